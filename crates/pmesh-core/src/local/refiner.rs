//! What to split and what to collapse for a view: the two queues of D.13.

use super::graph::Refusal;
use super::mesh::LocalMesh;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// A collapse by the error that it makes where it is seen.
#[derive(Clone, Copy, Debug)]
struct Entry {
    error: f32,
    collapse: u32,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Entry {}
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(other.collapse.cmp(&self.collapse))
    }
}

/// What a call of [`Refiner::refine`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Collapses undone.
    pub splits: u32,
    /// Collapses done.
    pub collapses: u32,
    /// Nothing is left to do for this view.
    pub is_done: bool,
}

/// Follows a view: splits what is too coarse, the worst first, then collapses what is finer than asked for, the best first.
///
/// A collapse is not undone before those that require it: an error must be no less than those of what its collapse requires (a bound on all of them does), or
/// what is coarse stays so behind what is fine enough.
///
/// A queue holds what can be split, another what can be collapsed, by the errors of the view when they came in; [`Self::refresh`] weighs
/// them anew after the view has changed (D.13 does so every few views).
#[derive(Clone, Debug, Default)]
pub struct Refiner {
    splits: BinaryHeap<Entry>,
    collapses: BinaryHeap<Reverse<Entry>>,
}

impl Refiner {
    /// For `mesh` as it is, at the errors of a view: what a viewer sees of collapse `i` while it is done, such as pixels; NaN is 0. O(collapses).
    pub fn new(mesh: &LocalMesh, error: impl Fn(u32) -> f32) -> Self {
        let mut refiner = Self::default();
        (0..mesh.graph().len()).for_each(|i| refiner.offer(mesh, i, &error));
        refiner
    }

    /// Weighs anew what waits. O(what waits).
    pub fn refresh(&mut self, mesh: &LocalMesh, error: impl Fn(u32) -> f32) {
        let splits = std::mem::take(&mut self.splits).into_iter().map(|e| e.collapse);
        let collapses = std::mem::take(&mut self.collapses).into_iter().map(|e| e.0.collapse);
        let mut all: Vec<u32> = splits.chain(collapses).collect();
        all.sort_unstable();
        all.dedup();
        all.into_iter().for_each(|i| self.offer(mesh, i, &error));
    }

    /// Splits while a collapse that can be undone has more than `most`, then collapses while one that can be done has less; at most `budget` of
    /// both. O(changes · log n). Nothing is more or less than a `most` that is not a number.
    pub fn refine(&mut self, mesh: &mut LocalMesh, error: impl Fn(u32) -> f32, most: f32, budget: u32) -> Result<Work, Refusal> {
        let mut work = Work::default();
        while work.splits < budget && !most.is_nan() {
            let Some(top) = self.splits.peek().copied() else { break };
            if !mesh.graph().can_split(top.collapse) {
                self.splits.pop();
                continue;
            }
            if top.error <= most {
                break;
            }
            self.splits.pop();
            mesh.split(top.collapse)?;
            work.splits += 1;
            self.offer(mesh, top.collapse, &error);
            mesh.graph().requires(top.collapse).iter().for_each(|&r| self.offer(mesh, r, &error));
        }
        while work.splits + work.collapses < budget && !most.is_nan() {
            let Some(Reverse(top)) = self.collapses.peek().copied() else { break };
            if !mesh.graph().can_collapse(top.collapse) {
                self.collapses.pop();
                continue;
            }
            if top.error >= most {
                break;
            }
            self.collapses.pop();
            mesh.collapse(top.collapse)?;
            work.collapses += 1;
            self.offer(mesh, top.collapse, &error);
            mesh.graph().required_by(top.collapse).iter().for_each(|&r| self.offer(mesh, r, &error));
        }
        work.is_done = work.splits + work.collapses < budget;
        Ok(work)
    }

    /// Puts collapse `i` into the queue of what can be done with it, if anything can.
    fn offer(&mut self, mesh: &LocalMesh, i: u32, error: &impl Fn(u32) -> f32) {
        // What is not a number is no error: it would stand before all that are.
        let entry = Entry { error: Some(error(i)).filter(|e| !e.is_nan()).unwrap_or(0.0), collapse: i };
        if mesh.graph().can_split(i) {
            self.splits.push(entry);
        } else if mesh.graph().can_collapse(i) {
            self.collapses.push(Reverse(entry));
        }
    }
}
