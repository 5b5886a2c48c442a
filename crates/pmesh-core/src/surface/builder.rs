//! Making a surface of triangles, in steps.

use super::{NONE, Surface, next};

/// Finds what lies across each edge, in steps.
#[derive(Clone, Debug, Default)]
pub struct SurfaceBuilder {
    /// The surface, once it is whole.
    pub surface: Surface,
    /// By vertex: where the edges that leave it end in `edges`, and one entry more.
    ends: Vec<u32>,
    /// (where to, corner) of the edges, by the vertex that they leave.
    edges: Vec<(u32, u32)>,
    at: u32,
    stage: Stage,
}

/// What is done with each corner, or each vertex, in turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Stage {
    /// Edges are counted.
    #[default]
    Count,
    /// They are filed by the vertex that they leave.
    File,
    /// Those of each vertex are sorted by where they lead.
    Sort,
    /// Each is paired with the one that leads back.
    Pair,
}

impl SurfaceBuilder {
    /// Begins.
    pub fn new(triangles: Vec<[u32; 3]>, vertex_count: u32) -> Self {
        let (across, corner_of) = (vec![NONE; triangles.len() * 3], vec![NONE; vertex_count as usize]);
        let edges = vec![(NONE, NONE); across.len()];
        let ends = vec![0; vertex_count as usize + 1];
        Self { surface: Surface { triangles, across, corner_of }, ends, edges, ..Default::default() }
    }
    /// Goes on by about `limit` corners; true once the surface is whole. O(triangles), and a logarithm of the valence.
    pub fn step(&mut self, limit: usize) -> bool {
        let count = if self.stage == Stage::Sort { self.ends.len() - 1 } else { self.edges.len() } as u32;
        let end = (u64::from(self.at) + limit as u64).min(u64::from(count)) as u32;
        for i in self.at..end {
            self.one(i);
        }
        self.at = end;
        if end < count {
            return false;
        }
        self.at = 0;
        self.stage = match self.stage {
            Stage::Count => {
                // From counts to where each vertex's edges begin: filing them moves that to where they end.
                let mut sum = 0;
                for e in &mut self.ends {
                    sum += std::mem::replace(e, sum);
                }
                Stage::File
            }
            Stage::File => Stage::Sort,
            Stage::Sort => Stage::Pair,
            Stage::Pair => {
                (self.ends, self.edges) = Default::default();
                return true;
            }
        };
        false
    }
    fn one(&mut self, i: u32) {
        let surface = &mut self.surface;
        if self.stage == Stage::Sort {
            let edges = self.leaving(i);
            self.edges[edges].sort_unstable();
            return;
        }
        let (a, b) = (surface.vertex(i), surface.vertex(next(i)));
        match self.stage {
            Stage::Count => {
                self.ends[a as usize] += 1;
                let first = &mut surface.corner_of[a as usize];
                *first = (*first).min(i);
            }
            Stage::File => {
                let place = &mut self.ends[a as usize];
                self.edges[*place as usize] = (b, i);
                *place += 1;
            }
            _ => {
                // One edge each way, and no more: where others lie beside it nothing is across. A triangle that has a vertex twice is not across from
                // itself: its fan would never end.
                let back = self.only(a, b).and_then(|_| self.only(b, a));
                if let Some(other) = back.filter(|other| other / 3 != i / 3) {
                    self.surface.across[i as usize] = other;
                }
            }
        }
    }
    /// Where the edges are that leave a vertex.
    fn leaving(&self, v: u32) -> std::ops::Range<usize> {
        let start = if v == 0 { 0 } else { self.ends[v as usize - 1] };
        start as usize..self.ends[v as usize] as usize
    }
    /// The corner of the edge from `a` to `b`, if there is one and no other.
    fn only(&self, a: u32, b: u32) -> Option<u32> {
        let edges = &self.edges[self.leaving(a)];
        let first = edges.partition_point(|e| e.0 < b);
        let (found, other) = (edges.get(first)?, edges.get(first + 1));
        (found.0 == b && other.is_none_or(|o| o.0 != b)).then_some(found.1)
    }
}
