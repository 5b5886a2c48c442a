//! A limit on triangles, kept by a coarser tolerance.

use super::bounds::ROOTS;
use super::{Progress, View};

/// Coarsest step: 2^10 times the tolerance.
const COARSEST: u32 = 40;
/// Part of the limit below which a finer tolerance is tried.
const ROOM: f64 = 0.7;

/// Finds a tolerance, in steps of a quarter octave, whose front has no more triangles than allowed, and mostly over two thirds of that. Comes to rest with the camera: a step that was
/// too fine for a view is not tried again until the view is another, or the limit.
#[derive(Clone, Debug, Default)]
pub struct Allowance {
    step: u32,
    /// Finer steps are too fine for this view.
    finest: u32,
    limit: usize,
    asked: Option<View>,
    /// Of the pass through the front that is under way.
    looked: u32,
    denied: bool,
    changed: bool,
}

impl Allowance {
    /// The view with the tolerance that is allowed now. O(1).
    pub fn view(&mut self, asked: &View) -> View {
        if self.asked.as_ref() != Some(asked) {
            self.asked = Some(*asked);
            self.finest = 0;
            (self.looked, self.denied, self.changed) = (0, false, false);
        }
        let factor = ROOTS[(self.step % 4) as usize] * f64::from(1u32 << (self.step / 4));
        if self.step == 0 { *asked } else { asked.coarser(factor) }
    }
    /// Takes what a look through the front has shown: its length, how many vertices leave it, its triangles, and how many are allowed. O(1).
    pub fn learn(&mut self, progress: &Progress, (front, leaving): (usize, u32), triangles: usize, limit: usize) {
        if limit != self.limit {
            (self.limit, self.finest) = (limit, 0);
        }
        self.looked = self.looked.saturating_add(progress.looked);
        self.denied |= progress.denied;
        self.changed |= progress.splits + progress.collapses > 0;
        if (self.looked as usize) < front {
            return;
        }
        let too_many = self.denied || triangles > limit;
        if too_many && leaving == 0 && !(self.changed && triangles < limit) {
            self.step = (self.step + 1).min(COARSEST);
            self.finest = self.step;
        } else if !too_many
            && !self.changed
            && leaving == 0
            && (triangles as f64) < ROOM * limit as f64
            && self.step > self.finest
        {
            self.step -= 1;
        }
        (self.looked, self.denied, self.changed) = (0, false, false);
    }
    /// By how much the tolerance is coarser than asked for, in quarters of an octave.
    pub fn step(&self) -> u32 {
        self.step
    }
}
