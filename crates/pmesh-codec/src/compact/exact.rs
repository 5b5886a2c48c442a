//! Vertices that stand where a regular neighbourhood would have them, to the grid step: in the middle of two neighbours, or at
//! the fourth corner of a parallelogram. Scans of lattices and machined parts are full of them, and no smooth distribution says so.

use super::mixer::{Mixer, Odds};
use super::place::{P, Star};
use super::vector::{add, scale, sub};
use crate::range::{Chance, Coder};

/// Larger rings have too many candidates.
const RING_LIMIT: usize = 9;
/// Predictions surer than this many grid steps, all axes together, need no candidates.
const LEAST_VOLUME: f64 = 1.0;
/// In a level that has guesses switched off, one vertex of so many is asked for: the encoder learns when to switch them on.
const SPARSE: u32 = 16;

/// What is learnt about candidates.
#[derive(Clone, Debug)]
pub(super) struct ExactModel {
    hit: Mixer<4>,
    /// By class of votes and axis: is it off, and to which side.
    off: Vec<[Odds; 2]>,
    candidates: Vec<P>,
    votes: Vec<u8>,
    /// Whether guesses are switched on.
    is_on: bool,
    passed: u32,
    /// Bits that guesses have saved in the level. Of an encoder.
    pub(super) saved: f64,
}

/// The most-voted candidate near the prediction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    pub(super) place: [i64; 3],
    votes: usize,
    candidates: usize,
}

impl ExactModel {
    pub(super) fn new() -> Self {
        let hit = Mixer::new([16 * 10, 16 * 12, 10 * 12, 16 * 16], 1, 0.35, 0.3);
        Self {
            hit,
            off: vec![[Odds::default(); 2]; 8 * 3],
            candidates: Vec::new(),
            votes: Vec::new(),
            is_on: true,
            passed: 0,
            saved: 0.0,
        }
    }

    /// Bytes of the tables.
    pub(super) fn memory_bytes(&self) -> usize {
        self.hit.memory_bytes() + size_of::<[Odds; 2]>() * self.off.len()
    }
    /// The candidate that most others agree with, among those within `reach` of the prediction.
    pub(super) fn guess(&mut self, star: &Star, predicted: P, reach: P) -> Option<Guess> {
        let k = star.ring.len();
        if !(3..=RING_LIMIT).contains(&k) {
            return None;
        }
        let list = &mut self.candidates;
        list.clear();
        let r = &star.ring;
        let mut push = |c: P| {
            if (0..3).all(|a| (c[a] - predicted[a]).abs() <= reach[a]) {
                list.push(c);
            }
        };
        for i in 0..k {
            let (after, second) = (r[(i + 1) % k], r[(i + 2) % k]);
            r[i + 1..].iter().for_each(|&other| push(scale(add(r[i], other), 0.5)));
            push(sub(add(r[i], second), after));
            if let Some(Some(o)) = star.beyond.get(i) {
                push(sub(add(r[i], after), *o));
            }
        }
        let n = list.len();
        let votes = &mut self.votes;
        votes.clear();
        votes.resize(n, 1u8);
        for i in 0..n {
            let a = list[i];
            for j in i + 1..n {
                let b = list[j];
                let agree = ((a[0] - b[0]).abs() <= 1.0) & ((a[1] - b[1]).abs() <= 1.0) & ((a[2] - b[2]).abs() <= 1.0);
                votes[i] += u8::from(agree);
                votes[j] += u8::from(agree);
            }
        }
        let most = votes.iter().copied().max()?;
        let far = |c: &P| (0..3).map(|a| (c[a] - predicted[a]).abs() / reach[a]).sum::<f64>();
        let chosen = list.iter().zip(votes).filter(|v| *v.1 == most).map(|v| v.0);
        let place = chosen.min_by(|a, b| far(a).total_cmp(&far(b)))?;
        Some(Guess { place: place.map(|x| (x + 0.5).floor() as i64), votes: usize::from(most), candidates: list.len() })
    }

    /// Codes whether the vertex is within a step of the guess, and if so where; `None` if not.
    pub(super) fn code(
        &mut self,
        coder: &mut impl Coder,
        guess: &Guess,
        (near, volume, distance): (usize, f64, f64),
        opinion: f32,
        truth: Option<[i32; 3]>,
    ) -> Option<[i64; 3]> {
        let off = |a: usize| truth.map_or(0, |t| i64::from(t[a]).wrapping_sub(guess.place[a]));
        let votes = guess.votes.min(15);
        let share = (12 * guess.votes / guess.candidates.max(1)).min(11);
        let size = (2.0 * f64::from(super::float::ln(volume.clamp(1e-3, 1e9) as f32)) + 2.0).clamp(0.0, 15.0) as usize;
        let far = (4.0 * distance).min(11.0) as usize;
        let at = [votes * 10 + near.min(9), votes * 12 + share, near.min(9) * 12 + far, size * 16 + votes];
        let hits = (0..3).all(|a| off(a).abs() <= 1);
        if !self.hit.code(coder, 0, at, opinion, hits) {
            return None;
        }
        let class = (votes / 2).min(7);
        Some([0, 1, 2].map(|a| {
            let odds = &mut self.off[class * 3 + a];
            if !odds[0].code(coder, off(a) != 0) {
                return guess.place[a];
            }
            if odds[1].code(coder, off(a) > 0) { guess.place[a] + 1 } else { guess.place[a] - 1 }
        }))
    }

    /// Another level: says whether guesses are on, which the encoder decides by the level before.
    pub(super) fn begin_level(&mut self, coder: &mut impl Coder) {
        self.is_on = coder.bit(&mut Chance::default(), self.saved >= 0.0);
        self.saved = 0.0;
    }

    /// Whether a guess is worth asking for.
    pub(super) fn is_worth(&mut self, volume: f64) -> bool {
        if volume <= LEAST_VOLUME {
            return false;
        }
        self.passed = (self.passed + 1) % SPARSE;
        self.is_on || self.passed == 0
    }
}
