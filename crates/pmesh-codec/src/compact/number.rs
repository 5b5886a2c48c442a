//! A place coded by a normal distribution, axis by axis; integers by a logistic one.

use super::float::{exp, ln, squash, stretch};
use super::mixer::{MEMORY, chance_of_no, rate_after};
use crate::range::Coder;

/// Widths, kinds of questions about an integer, and axes, that are calibrated apart.
const WIDTHS: usize = 4;
const KINDS: usize = 3;
const AXES: usize = 3;
/// Points at which chances are looked up: from -8 to 8 in the logistic domain.
const POINTS: usize = 33;

/// What became of chances: how often yes came where a distribution said how likely that was. No distribution is quite right,
/// least of all where coordinates are on a lattice.
#[derive(Clone, Debug)]
pub(super) struct Calibration {
    /// Chances of yes, and how often they were met.
    points: Vec<(f32, u32)>,
}

impl Calibration {
    pub(super) fn new() -> Self {
        let said = |i: usize| squash(0.5 * i as f32 - 8.0);
        Self { points: (0..AXES * WIDTHS * KINDS * POINTS).map(|i| (said(i % POINTS), 20)).collect() }
    }
    pub(super) fn memory_bytes(&self) -> usize {
        size_of::<(f32, u32)>() * self.points.len()
    }
    /// Codes a yes or no that is said to be as likely as `yes`.
    #[inline(always)]
    fn code<C: Coder>(&mut self, coder: &mut C, set: usize, yes: f32, bit: bool) -> bool {
        let x = 2.0 * stretch(yes.clamp(0.0005, 0.9995)) + 16.0;
        let low = (x as usize).min(POINTS - 2);
        let part = x - low as f32;
        let points = &mut self.points[set * POINTS + low..][..2];
        let chance = points[0].0 + part * (points[1].0 - points[0].0);
        let bit = coder.choose(chance_of_no(chance), bit);
        if !C::COUNTS {
            // The nearer one learns.
            let (yes, seen) = &mut points[usize::from(part >= 0.5)];
            *yes += (if bit { 1.0 } else { 0.0 } - *yes) * rate_after(*seen);
            *seen = (*seen + 1).min(MEMORY);
        }
        bit
    }
}

/// A normal distribution of a place, axis by axis: what is known of the first two says more of the next.
pub(super) struct Smooth {
    pub(super) order: [usize; 3],
    pub(super) means: [f64; 3],
    /// How the second follows the first, the third the first, the third the second.
    pub(super) slopes: [f64; 3],
    pub(super) variances: [f64; 3],
}

impl Smooth {
    pub(super) fn code(&self, coder: &mut impl Coder, calibration: &mut Calibration, truth: Option<[i32; 3]>) -> [i32; 3] {
        let mut out = [0; 3];
        let mut off = [0.0; 2];
        for (k, &axis) in self.order.iter().enumerate() {
            let mean = self.means[k]
                + match k {
                    0 => 0.0,
                    1 => self.slopes[0] * off[0],
                    _ => self.slopes[1] * off[0] + self.slopes[2] * off[1],
                };
            let value = integer(coder, (calibration, k), mean, self.variances[k], truth.map_or(0, |t| i64::from(t[axis])));
            if k < 2 {
                off[k] = value as f64 - mean;
            }
            out[axis] = value as i32;
        }
        out
    }
}

/// Counts what choices would cost.
#[derive(Default)]
pub(super) struct Counter {
    pub(super) bits: f64,
}

impl Coder for Counter {
    const ENCODES: bool = true;
    const COUNTS: bool = true;

    fn position(&self) -> f64 {
        self.bits
    }

    fn byte_position(&self) -> usize {
        (self.bits / 8.0) as usize
    }

    fn choose(&mut self, zero: u32, bit: bool) -> bool {
        let part = if bit { 65536 - zero } else { zero };
        self.bits += 16.0 - f64::from(ln(part as f32)) * std::f64::consts::LOG2_E;
        bit
    }
}

/// Bound of predictions; rows are 32-bit numbers.
const FARTHEST: f64 = (1u64 << 34) as f64;
/// A grid step's own.
pub(super) const LEAST_VARIANCE: f64 = 1.0 / 12.0;

/// Codes an integer whose distribution is logistic about `mean`, the `k`th of a place.
fn integer<C: Coder>(coder: &mut C, (calibration, k): (&mut Calibration, usize), mean: f64, variance: f64, truth: i64) -> i64 {
    let mean = if mean.is_finite() { mean.clamp(-FARTHEST, FARTHEST) } else { 0.0 };
    let s = 0.509 * variance.sqrt();
    let middle = (mean + 0.5).floor();
    let inverse = (1.0 / s) as f32;
    let d = (middle - mean) as f32;
    let m = middle as i64;
    let above = squash(-(0.5 + d) * inverse);
    let below = squash((d - 0.5) * inverse);
    let off = truth.wrapping_sub(m);
    let width = [0.3, 1.0, 4.0].iter().filter(|w| s >= **w).count();
    let set = (k * WIDTHS + width) * KINDS;
    if !calibration.code(coder, set, above + below, off != 0) {
        return m;
    }
    let up = coder.choose(chance_of_no(above / (above + below)), off > 0);
    let d = if up { d } else { -d };
    let magnitude = off.unsigned_abs();
    // Buckets, each twice as wide as the one before, then halves.
    let mut width = (s.min(1e9) as u64).max(1);
    let mut from = 1u64;
    // Chance to be beyond `w` more of those that are `k` off at least; exp bounds what is huge.
    let passes = |k: u64, w: u64| {
        let z = (k as f32 - 0.5 + d) * inverse;
        let z = if z < 40.0 { z } else { 40.0 };
        (1.0 + exp(z)) / (1.0 + exp(z + w as f32 * inverse))
    };
    while width < 2 * FARTHEST as u64 {
        if !calibration.code(coder, set + if from == 1 { 1 } else { 2 }, passes(from, width), magnitude >= from + width) {
            break;
        }
        from += width;
        width *= 2;
    }
    while width > 1 {
        let half = width / 2;
        let (all, first) = (1.0 - passes(from, width), 1.0 - passes(from, half));
        let upper = if all > 1e-6 { 1.0 - first / all } else { 0.5 };
        if coder.choose(chance_of_no(upper), magnitude >= from + half) {
            from += half;
            width -= half;
        } else {
            width = half;
        }
    }
    if up { m.wrapping_add(from as i64) } else { m.wrapping_sub(from as i64) }
}
