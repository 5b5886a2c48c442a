//! What outlives levels besides the models: of each vertex what its neighbours are asked for.

use super::vector::{Vector, add, cross, length, scale, sub};
use crate::refine::rows::Rows;
use pmesh_core::surface::{NONE, Surface, next, previous};

/// What is known of a vertex beside its row. In 32 bytes, aligned: neighbours lie anywhere, and a look at one is one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Site {
    /// Mean length of its edges when it was last asked; of a new vertex that of the one it split from.
    pub(super) edge: f32,
    /// Its normal when it was last asked; of a new vertex that of its ring.
    pub(super) normal: Vector<f32>,
    /// How far off its prediction was, and those of its neighbours since.
    pub(super) misses: [f32; 2],
    /// The vertex that is asked after it: one that it split into, or the next of before. So what lies together on the surface is asked
    /// together at every level, and numbered together.
    pub(super) next: u32,
    /// Triangles there, at most 65,535.
    pub(super) valence: u16,
    /// Its level, at most 255.
    pub(super) birth: u8,
    /// Twice the level that asked it last; one more if it stands where a regular neighbourhood has it.
    pub(super) marks: u8,
}

impl Site {
    /// It stands where a regular neighbourhood has it.
    pub(super) fn is_exact(&self) -> bool {
        self.marks & 1 != 0
    }
    /// Level `level` has asked it. (A file has 64 levels at most.)
    pub(super) fn was_asked(&self, level: usize) -> bool {
        usize::from(self.marks >> 1) == level & 127
    }
    pub(super) fn mark_asked(&mut self, level: usize) {
        self.marks = self.marks & 1 | (level << 1) as u8;
    }
}

/// All vertices.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) sites: Vec<Site>,
    /// Mean edge length of the vertices that the level before asked.
    pub(super) mean_edge: f64,
    /// First vertex at the position of each; empty where none share one.
    first: Vec<u32>,
    /// How many of the seams are in `first`.
    linked: usize,
}

impl Memory {
    pub(super) fn count(&self) -> usize {
        self.sites.len()
    }
    /// Room for so many vertices more.
    pub(super) fn reserve(&mut self, more: usize) {
        self.sites.reserve_exact(more);
    }
    /// First vertex at the position of `v`.
    pub(super) fn first(&self, v: u32) -> u32 {
        self.first.get(v as usize).copied().unwrap_or(v)
    }
    /// Takes up what the rows say of shared positions.
    pub(super) fn know(&mut self, rows: &Rows) {
        if !rows.has_seams {
            return;
        }
        self.first.extend(self.first.len() as u32..rows.count());
        for &(v, p) in &rows.seams[self.linked..] {
            self.first[v as usize] = self.first[p as usize];
        }
        self.linked = rows.seams.len();
    }
    /// A vertex more or less at the corners of a triangle.
    pub(super) fn touch(&mut self, v: u32) {
        let valence = &mut self.sites[v as usize].valence;
        *valence = valence.saturating_add(1);
    }
    /// Finds normal and mean edge length of a vertex of the base.
    pub(super) fn look(&mut self, surface: &Surface, rows: &Rows, v: u32) {
        let (mut normal, mut sum, mut count) = ([0.0f32; 3], 0.0f32, 0.0f32);
        let own = position(rows, v);
        if surface.corner_of[v as usize] != NONE {
            for c in surface.around(surface.corner_of[v as usize]) {
                let a = sub(position(rows, surface.vertex(next(c))), own);
                let b = sub(position(rows, surface.vertex(previous(c))), own);
                normal = add(normal, cross(a, b));
                sum += length(a);
                count += 1.0;
            }
        }
        let site = &mut self.sites[v as usize];
        site.normal = unit(normal);
        site.edge = if count > 0.0 { sum / count } else { 0.0 };
        self.mean_edge += f64::from(site.edge);
    }
}

/// `a` to length 1; nothing stays nothing.
pub(super) fn unit(a: Vector<f32>) -> Vector<f32> {
    let l = length(a);
    scale(a, if l > 1e-12 { 1.0 / l } else { 0.0 })
}

pub(super) fn position(rows: &Rows, v: u32) -> Vector<f32> {
    [0, 1, 2].map(|k| rows.value(v, k) as f32)
}
