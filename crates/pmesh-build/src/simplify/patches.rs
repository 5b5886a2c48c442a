//! Independent sets of vertices removed level by level, their holes filled with patches in three colours (C.3–C.5).
//!
//! A vertex inside a manifold piece of the surface can go if its star, refilled as a fan about one of its neighbours, turns no
//! triangle over and repeats no edge. The cheapest go first, by the quadric error of the fan; then none of their neighbours
//! does in this level, and a vertex for whose patch no colour is free stays. Boundaries, seams and what is not manifold
//! stay in the base mesh.

use super::quadric::{Point, Quadric, cross, dot, sub};
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
/// Largest star that is refilled.
const DEGREE_LIMIT: usize = 12;
/// Least cosine between a new triangle and the star it lies in.
const TURN_COSINE: f64 = 0.2;
/// Powers of two in cost that it is worth to have a whole rim in common with vertices that go: densely packed patches are
/// coded in fewer bits, and levels are fewer.
const PACKING: f64 = 16.0;
/// A level that removes a smaller part of the vertices is the last: what is left resists.
const LEAST_PART: f64 = 0.02;

/// Takes `mesh` apart into patches. `progress` gets the vertices left. O(n log n).
pub fn remove_patches(mesh: &IndexedMesh, options: PatchOptions, mut progress: impl FnMut(usize)) -> PatchStream {
    let mut surgery = Surgery::new(mesh);
    let mut levels = Vec::new();
    let mut errors = vec![0.0];
    let mut left = mesh.vertices.len();
    while left > options.base_vertices && levels.len() < LEVEL_LIMIT {
        let removed = surgery.level(left - options.base_vertices);
        if removed.is_empty() {
            break;
        }
        let last = (removed.len() as f64) < LEAST_PART * left as f64;
        left -= removed.len();
        progress(left);
        levels.push(PatchLevel { removed });
        errors.push(surgery.error.sqrt() as f32);
        if last {
            break;
        }
    }
    levels.reverse();
    errors.reverse();
    let base_triangles = surgery.alive_triangles();
    PatchStream { mesh: mesh.clone(), base_triangles, levels, errors, texture: None }
}

struct Candidate {
    cost: f64,
    vertex: u32,
    apex: u32,
    /// The rim counter-clockwise, the apex first.
    rim: Vec<u32>,
}

struct Surgery {
    positions: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Colour of each triangle made in this level.
    color: Vec<u8>,
    around: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    gone: Vec<bool>,
    /// Vertices that share a position: both sides of a seam stay.
    kept: Vec<bool>,
    /// Largest mean squared distance so far.
    error: f64,
}

fn normal(p: &[Point], [a, b, c]: [u32; 3]) -> Point {
    let [a, b, c] = [a, b, c].map(|v| p[v as usize]);
    cross(sub(b, a), sub(c, a))
}

impl Surgery {
    fn new(mesh: &IndexedMesh) -> Self {
        let positions: Vec<Point> = mesh.vertices.positions.iter().map(|p| p.map(f64::from)).collect();
        let mut around = vec![Vec::new(); positions.len()];
        let mut quadrics = vec![Quadric::default(); positions.len()];
        for (i, &t) in mesh.triangles.iter().enumerate() {
            t.iter().for_each(|&v| around[v as usize].push(i as u32));
            let n = normal(&positions, t);
            let length = dot(n, n).sqrt();
            if length > 0.0 {
                let plane = Quadric::plane(positions[t[0] as usize], n.map(|x| x / length), length);
                t.iter().for_each(|&v| quadrics[v as usize].add(&plane));
            }
        }
        let count = mesh.triangles.len();
        let mut kept = vec![false; positions.len()];
        mesh.position_of.iter().for_each(|&(v, p)| (kept[v as usize], kept[p as usize]) = (true, true));
        Self {
            kept,
            gone: vec![false; positions.len()],
            positions,
            triangles: mesh.triangles.clone(),
            alive: vec![true; count],
            color: vec![0; count],
            around,
            quadrics,
            error: 0.0,
        }
    }
    fn alive_triangles(&self) -> Vec<[u32; 3]> {
        self.triangles.iter().zip(&self.alive).filter(|t| *t.1).map(|t| *t.0).collect()
    }

    /// The rim of `v`, counter-clockwise, if its triangles are one closed fan.
    fn rim(&self, v: u32) -> Option<Vec<u32>> {
        let star = &self.around[v as usize];
        if !(3..=DEGREE_LIMIT).contains(&star.len()) {
            return None;
        }
        let edge = |&t: &u32| {
            let t = self.triangles[t as usize];
            let k = t.iter().position(|&x| x == v)?;
            Some((t[(k + 1) % 3], t[(k + 2) % 3]))
        };
        let edges = star.iter().map(edge).collect::<Option<Vec<_>>>()?;
        let mut rim = vec![edges[0].0];
        let mut at = edges[0].1;
        while at != rim[0] {
            if rim.len() == edges.len() || rim.contains(&at) || at == v {
                return None;
            }
            rim.push(at);
            at = edges.iter().find(|e| e.0 == at)?.1;
        }
        (rim.len() == edges.len()).then_some(rim)
    }
    fn joined(&self, a: u32, b: u32) -> bool {
        self.around[a as usize].iter().any(|&t| self.triangles[t as usize].contains(&b))
    }
    /// True if a fan about the first of `rim` would repeat an edge or a triangle.
    fn repeats(&self, rim: &[u32]) -> bool {
        let inner = &rim[2..rim.len() - 1];
        if inner.iter().any(|&b| self.joined(rim[0], b)) {
            return true;
        }
        let all = |&t: &u32| rim.iter().all(|v| self.triangles[t as usize].contains(v));
        rim.len() == 3 && self.around[rim[0] as usize].iter().any(all)
    }

    fn candidate(&self, v: u32) -> Option<Candidate> {
        let rim = self.rim(v)?;
        let star: Point = self.around[v as usize]
            .iter()
            .map(|&t| normal(&self.positions, self.triangles[t as usize]))
            .fold([0.0; 3], |s, n| [s[0] + n[0], s[1] + n[1], s[2] + n[2]]);
        let mut best: Option<Candidate> = None;
        for k in 0..rim.len() {
            let turned = [&rim[k..], &rim[..k]].concat();
            let apex = turned[0];
            let cost = self.quadrics[v as usize].at(self.positions[apex as usize]);
            if best.as_ref().is_some_and(|b| b.cost <= cost) {
                continue;
            }
            let fits = turned[1..].windows(2).all(|w| {
                let n = normal(&self.positions, [apex, w[0], w[1]]);
                let (size, turn) = ((dot(n, n) * dot(star, star)).sqrt(), dot(n, star));
                turn > TURN_COSINE * size && size > 0.0
            });
            if fits && !self.repeats(&turned) {
                best = Some(Candidate { cost, vertex: v, apex, rim: turned });
            }
        }
        best
    }

    /// A colour that no patch across the rim has.
    fn free_color(&self, c: &Candidate) -> Option<u8> {
        let mut taken = [false; 4];
        for k in 0..c.rim.len() {
            let (a, b) = (c.rim[k], c.rim[(k + 1) % c.rim.len()]);
            for &t in &self.around[a as usize] {
                if self.triangles[t as usize].contains(&b) {
                    taken[self.color[t as usize] as usize] = true;
                }
            }
        }
        (1..4).find(|&c| !taken[c as usize])
    }

    /// Removes an independent set of at most `most` vertices.
    fn level(&mut self, most: usize) -> Vec<Removed> {
        self.color.fill(0);
        let mut candidates: Vec<Option<Candidate>> = Vec::with_capacity(self.positions.len());
        for v in 0..self.positions.len() as u32 {
            candidates.push(if self.gone[v as usize] || self.kept[v as usize] { None } else { self.candidate(v) });
        }
        let mut blocked = vec![false; self.positions.len()];
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
            if blocked[v as usize] || self.repeats(&c.rim) {
                continue;
            }
            let Some(color) = self.free_color(&c) else { continue };
            let fresh: Vec<u32> = c.rim.iter().copied().filter(|&u| !blocked[u as usize]).collect();
            fresh.iter().for_each(|&u| blocked[u as usize] = true);
            removed.push(self.remove(c, color));
            for u in fresh {
                for &t in &self.around[u as usize] {
                    for w in self.triangles[t as usize] {
                        if let Some(c) = candidates[w as usize].as_ref().filter(|_| !blocked[w as usize]) {
                            queue.push(key(c, &blocked));
                        }
                    }
                }
            }
        }
        removed
    }

    fn remove(&mut self, c: Candidate, color: u8) -> Removed {
        self.gone[c.vertex as usize] = true;
        for t in std::mem::take(&mut self.around[c.vertex as usize]) {
            self.alive[t as usize] = false;
            for v in self.triangles[t as usize] {
                self.around[v as usize].retain(|&x| x != t);
            }
        }
        for w in c.rim[1..].windows(2) {
            self.add([c.apex, w[0], w[1]], color);
        }
        let own = self.quadrics[c.vertex as usize];
        if own.weight > 0.0 {
            self.error = self.error.max(c.cost / own.weight);
        }
        self.quadrics[c.apex as usize].add(&own);
        Removed { vertex: c.vertex, apex: c.apex, chain: c.rim[1..].to_vec(), color }
    }
    fn add(&mut self, triangle: [u32; 3], color: u8) {
        let t = self.triangles.len() as u32;
        self.triangles.push(triangle);
        self.alive.push(true);
        self.color.push(color);
        triangle.iter().for_each(|&v| self.around[v as usize].push(t));
    }
}
