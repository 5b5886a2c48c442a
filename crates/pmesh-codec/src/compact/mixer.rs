//! Chances that several contexts give of a yes or no, mixed in the logistic domain (Mahoney's PAQ), in floating point.

use super::float::{squash, stretch};
use crate::range::Coder;

/// A probability of yes, and how often it was asked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Odds {
    yes: f32,
    seen: u32,
    /// The probability in the logistic domain.
    stretched: f32,
}

impl Default for Odds {
    fn default() -> Self {
        Self { yes: 0.5, seen: 0, stretched: 0.0 }
    }
}

/// Questions after which odds learn no slower.
pub(super) const MEMORY: u32 = 255;
/// How fast they learn after so many.
const RATES: [f32; MEMORY as usize + 1] = {
    let mut rates = [0.0; MEMORY as usize + 1];
    let mut i = 0;
    while i < rates.len() {
        rates[i] = 1.0 / (i as f32 + 1.5);
        i += 1;
    }
    rates
};

/// How fast a chance learns that was met `seen` times, [`MEMORY`] at most.
#[inline(always)]
pub(super) fn rate_after(seen: u32) -> f32 {
    RATES[(seen & 255) as usize]
}

impl Odds {
    /// Codes a yes or no by these odds alone.
    pub(super) fn code(&mut self, coder: &mut impl Coder, bit: bool) -> bool {
        let bit = coder.choose(chance_of_no(self.yes), bit);
        self.learn(bit);
        bit
    }
    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let target = if bit { 1.0 } else { 0.0 };
        self.yes += (target - self.yes) * rate_after(self.seen);
        self.stretched = stretch(self.yes.clamp(0.001, 0.999));
        self.seen = (self.seen + 1).min(MEMORY);
    }
}

/// Mixes `N` contexts and one opinion from elsewhere.
#[derive(Clone, Debug)]
pub(super) struct Mixer<const N: usize> {
    weights: Vec<[f32; N]>,
    opinions: Vec<f32>,
    odds: Vec<Vec<Odds>>,
}

/// How fast weights learn.
const RATE: f32 = 0.002;

/// A chance of yes in the coder's terms: a chance of no in 1/65536.
#[inline(always)]
pub(super) fn chance_of_no(yes: f32) -> u32 {
    (((1.0 - yes) * 65536.0) as i32).clamp(24, 65536 - 24) as u32
}

impl<const N: usize> Mixer<N> {
    /// `sizes`: values of each context; `sets`: sets of weights.
    pub(super) fn new(sizes: [usize; N], sets: usize, weight: f32, opinion: f32) -> Self {
        let odds = sizes.iter().map(|&n| vec![Odds::default(); n]).collect();
        Self { weights: vec![[weight; N]; sets], opinions: vec![opinion; sets], odds }
    }
    /// Bytes of the tables.
    pub(super) fn memory_bytes(&self) -> usize {
        let odds: usize = self.odds.iter().map(Vec::len).sum();
        size_of::<Odds>() * odds + 4 * (N + 1) * self.opinions.len()
    }
    /// Codes a yes or no. `opinion` is a probability of yes in the logistic domain.
    pub(super) fn code(&mut self, coder: &mut impl Coder, set: usize, at: [usize; N], opinion: f32, bit: bool) -> bool {
        let mut inputs = [0.0; N];
        let weights = &mut self.weights[set];
        let mut sum = self.opinions[set] * opinion;
        for i in 0..N {
            let o = self.odds[i][at[i]];
            // What has hardly been met says little.
            inputs[i] = o.stretched * o.seen.min(8) as f32 * 0.125;
            sum += weights[i] * inputs[i];
        }
        let yes = squash(sum.clamp(-9.0, 9.0));
        let bit = coder.choose(chance_of_no(yes), bit);
        let error = RATE * 4.0 * (if bit { 1.0 } else { 0.0 } - yes);
        for i in 0..N {
            weights[i] += error * inputs[i];
            self.odds[i][at[i]].learn(bit);
        }
        self.opinions[set] += error * opinion;
        bit
    }
}
