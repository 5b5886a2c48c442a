//! The canonical order of triangles (C.12).

use super::{NONE, Surface, next, previous};
use std::collections::VecDeque;

/// The canonical order: breadth first over vertices from vertex 0, about each of them the triangles that are not listed yet,
/// counter-clockwise; a boundary vertex begins at its clockwise-most triangle, another at the edge to the vertex that
/// discovered it; then the lowest vertex that was not met (C.12). Made in steps.
#[derive(Clone, Debug, Default)]
pub struct CanonicalOrder {
    /// Triangles in order, as far as it is known.
    pub order: Vec<u32>,
    listed: Vec<bool>,
    met: Vec<bool>,
    queue: VecDeque<u32>,
    seed: usize,
    sweep: usize,
}

impl CanonicalOrder {
    /// The whole order. O(triangles).
    pub fn of(surface: &Surface) -> Vec<u32> {
        let mut order = Self::default();
        while !order.step(surface, usize::MAX) {}
        order.order
    }
    /// Goes on by about `limit` triangles; true once all are listed.
    pub fn step(&mut self, surface: &Surface, limit: usize) -> bool {
        self.listed.resize(surface.triangles.len(), false);
        self.met.resize(surface.corner_of.len(), false);
        let stop = self.order.len().saturating_add(limit);
        let mut looked = 0;
        while self.order.len() < stop && looked < limit {
            looked += 1;
            if let Some(corner) = self.queue.pop_front() {
                self.about(surface, corner);
            } else if self.seed < self.met.len() {
                let v = self.seed;
                self.seed += 1;
                if !self.met[v] && surface.corner_of[v] != NONE {
                    self.met[v] = true;
                    self.queue.push_back(surface.corner_of[v]);
                }
            } else if self.sweep < self.listed.len() {
                // A triangle whose vertices were all met from other sides, as they can be where fans touch at a point.
                let gone = surface.triangles[self.sweep] == [NONE; 3];
                if !std::mem::replace(&mut self.listed[self.sweep], true) && !gone {
                    self.order.push(self.sweep as u32);
                }
                self.sweep += 1;
            } else {
                return true;
            }
        }
        false
    }
    /// Lists the fan about a corner's vertex.
    fn about(&mut self, surface: &Surface, corner: u32) {
        for c in surface.around(corner) {
            let t = c as usize / 3;
            if !std::mem::replace(&mut self.listed[t], true) {
                self.order.push(t as u32);
            }
            // Each neighbour begins at the edge back to this vertex.
            let back = match surface.across[c as usize] {
                NONE => next(c),
                other => other,
            };
            self.meet(surface, back);
            self.meet(surface, previous(c));
        }
    }
    fn meet(&mut self, surface: &Surface, corner: u32) {
        let v = surface.vertex(corner) as usize;
        if !std::mem::replace(&mut self.met[v], true) {
            self.queue.push_back(corner);
        }
    }
}
