//! Independent sets of vertices removed level by level, their holes filled with patches in three colours (C.3–C.5).
//!
//! A vertex inside a manifold piece of the surface can go if its star, refilled as a fan about one of its neighbours, turns no
//! triangle over and repeats no edge. The cheapest go first, by the quadric error of the fan; then none of their neighbours
//! does in this level, and a vertex for whose patch no colour is free stays. Boundaries, seams and what is not manifold
//! stay in the base mesh.

use super::surgery::Surgery;
use pmesh_codec::patch::{PatchLevel, PatchStream, Removed};
use pmesh_core::IndexedMesh;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchOptions {
    /// Vertices of the base mesh, about.
    pub base_vertices: usize,
}

impl Default for PatchOptions {
    fn default() -> Self {
        Self { base_vertices: 600 }
    }
}

/// Most levels, the base not counted.
const LEVEL_LIMIT: usize = 61;
/// Powers of two in cost that it is worth to have a whole rim in common with vertices that go: densely packed patches are
/// coded in fewer bits, and levels are fewer.
const PACKING: f64 = 16.0;
/// A level that removes a smaller part of the vertices is the last: what is left resists.
const LEAST_PART: f64 = 0.02;

/// Takes `mesh` apart into patches. `progress` gets the vertices left. O(n log n).
pub fn remove_patches(mesh: &IndexedMesh, options: PatchOptions, mut progress: impl FnMut(usize)) -> PatchStream {
    let mut patches = Patches { surgery: Surgery::new(mesh), color: vec![0; mesh.triangles.len()] };
    let mut levels = Vec::new();
    let mut errors = vec![0.0];
    let mut left = mesh.vertices.len();
    while left > options.base_vertices && levels.len() < LEVEL_LIMIT {
        let removed = patches.level(left - options.base_vertices);
        if removed.is_empty() {
            break;
        }
        let last = (removed.len() as f64) < LEAST_PART * left as f64;
        left -= removed.len();
        progress(left);
        levels.push(PatchLevel { removed });
        errors.push(patches.surgery.error.sqrt() as f32);
        if last {
            break;
        }
    }
    levels.reverse();
    errors.reverse();
    let base_triangles = patches.surgery.alive_triangles();
    PatchStream { mesh: mesh.clone(), base_triangles, levels, errors, texture: None }
}

struct Candidate {
    cost: f64,
    vertex: u32,
    apex: u32,
    /// The rim counter-clockwise, the apex first.
    rim: Vec<u32>,
}

struct Patches {
    surgery: Surgery,
    /// Colour of each triangle made in this level.
    color: Vec<u8>,
}

impl Patches {
    fn candidate(&self, v: u32) -> Option<Candidate> {
        let rim = self.surgery.rim(v)?;
        let star = self.surgery.star_normal(v);
        let mut best: Option<Candidate> = None;
        for k in 0..rim.len() {
            let cheapest = best.as_ref().map_or(f64::INFINITY, |b| b.cost);
            if cheapest <= self.surgery.cost(v, rim[k]) {
                continue;
            }
            let turned = [&rim[k..], &rim[..k]].concat();
            if let Some(cost) = self.surgery.price(v, &turned, star).filter(|&cost| cost < cheapest) {
                best = Some(Candidate { cost, vertex: v, apex: rim[k], rim: turned });
            }
        }
        best
    }

    /// A colour that no patch across the rim has.
    fn free_color(&self, c: &Candidate) -> Option<u8> {
        let mut taken = [false; 4];
        for k in 0..c.rim.len() {
            let (a, b) = (c.rim[k], c.rim[(k + 1) % c.rim.len()]);
            for &t in &self.surgery.around[a as usize] {
                if self.surgery.triangles[t as usize].contains(&b) {
                    taken[self.color[t as usize] as usize] = true;
                }
            }
        }
        (1..4).find(|&c| !taken[c as usize])
    }

    /// Removes an independent set of at most `most` vertices.
    fn level(&mut self, most: usize) -> Vec<Removed> {
        self.color.fill(0);
        let mut candidates: Vec<Option<Candidate>> = Vec::with_capacity(self.surgery.positions.len());
        for v in 0..self.surgery.positions.len() as u32 {
            candidates.push(if self.surgery.gone[v as usize] || self.surgery.kept[v as usize] {
                None
            } else {
                self.candidate(v)
            });
        }
        let mut blocked = vec![false; self.surgery.positions.len()];
        let mut queue = BinaryHeap::new();
        let key = |c: &Candidate, blocked: &[bool]| {
            let beside = c.rim.iter().filter(|&&v| blocked[v as usize]).count() as f64 / c.rim.len() as f64;
            // In sixteenths of a power of two; whole numbers order on every machine.
            let cost = (c.cost + 1e-30).log2() - PACKING * beside;
            (Reverse((cost * 16.0) as i64), Reverse(c.vertex))
        };
        queue.extend(candidates.iter().flatten().map(|c| key(c, &blocked)));
        let mut removed = Vec::new();
        while let Some((at, Reverse(v))) = queue.pop() {
            if removed.len() == most {
                break;
            }
            let current = candidates[v as usize].as_ref().is_some_and(|c| key(c, &blocked).0 == at);
            let Some(c) = candidates[v as usize].take_if(|_| current) else { continue };
            // What was removed since may have made an edge that this fan would repeat.
            if blocked[v as usize] || self.surgery.repeats(&c.rim) {
                continue;
            }
            let Some(color) = self.free_color(&c) else { continue };
            let fresh: Vec<u32> = c.rim.iter().copied().filter(|&u| !blocked[u as usize]).collect();
            fresh.iter().for_each(|&u| blocked[u as usize] = true);
            let made = self.surgery.remove(c.vertex, &c.rim);
            self.color.resize(made, 0);
            self.color.resize(self.surgery.triangles.len(), color);
            removed.push(Removed { vertex: c.vertex, apex: c.apex, chain: c.rim[1..].to_vec(), color });
            for u in fresh {
                for &t in &self.surgery.around[u as usize] {
                    for w in self.surgery.triangles[t as usize] {
                        if let Some(c) = candidates[w as usize].as_ref().filter(|_| !blocked[w as usize]) {
                            queue.push(key(c, &blocked));
                        }
                    }
                }
            }
        }
        removed
    }
}
