//! Batches of half-edge collapses whose removed triangles form a forest: what a forest split undoes (A.31).
//!
//! In the coarser mesh the triangles that a batch removes are edges, and these must be trees; to each tree must belong one
//! polygon of removed triangles, edge to edge, without a vertex inside: then cutting the tree open and filling the gap
//! brings all of it back. Let the collapse of u onto v remove (u, v, x) and (v, u, z). It keeps the rule if the four vertices
//!
//! - touch no tree: they begin one, the path x v z;
//! - or two of them are the ends of one tree edge, one of ux, vx, uz, vz: the tree grows by an edge;
//! - or of two trees, ux and vz (or vx and uz): the trees become one;
//! - or the tree edge is uv itself: it gives way to vx and vz;
//!
//! and touch no tree otherwise. No edge of a tree joins two vertices of the boundary. The cheapest collapse goes first, by the quadric error; one that goes on with a tree costs a
//! little less than it does, for larger trees are fewer bits a vertex. Boundaries, seams and what is not manifold stay.

use super::surgery::Surgery;
use pmesh_codec::split::{SplitStream, TREE_LIMIT};
use pmesh_core::IndexedMesh;
use pmesh_core::forest::NO_REPRESENTATIVE;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForestOptions {
    /// Vertices of the base mesh, about.
    pub base_vertices: usize,
}

impl Default for ForestOptions {
    fn default() -> Self {
        Self { base_vertices: 300 }
    }
}

/// Most levels, the base not counted.
const LEVEL_LIMIT: usize = 61;
/// Powers of two in cost that it is worth to go on with a tree.
const GROWING: f64 = 8.0;
/// Part of the vertices, cheapest first, that sets what a level may cost.
const CAP_PART: f64 = 0.94;
/// No level removes a smaller part of the vertices: marking edges would cost more than the level brings.
const LEAST_PART: f64 = 0.08;

/// Takes `mesh` apart into forests. `progress` gets the vertices left. O(n log n).
pub fn collapse_forests(mesh: &IndexedMesh, options: ForestOptions, mut progress: impl FnMut(usize)) -> SplitStream {
    let n = mesh.vertices.len();
    let surgery = Surgery::new(mesh);
    let manifold = (0..n as u32).map(|v| surgery.is_manifold(v)).collect();
    let open = (0..n as u32).map(|v| surgery.is_open(v)).collect();
    let mut state = Forests { surgery, manifold, open, trees: Trees::new(n) };
    let (mut parents, mut batch_of) = (vec![NO_REPRESENTATIVE; n], vec![u32::MAX; n]);
    let mut errors = vec![0.0];
    let (mut left, mut batches) = (n, 0);
    while left > options.base_vertices && (batches as usize) < LEVEL_LIMIT {
        let collapses = state.batch(left - options.base_vertices);
        if (collapses.len() as f64) < LEAST_PART * left as f64 {
            break;
        }
        for &(u, v) in &collapses {
            (parents[u as usize], batch_of[u as usize]) = (v, batches);
        }
        // Who stands for a vertex may have gone later in the same batch.
        for &(u, v) in collapses.iter().rev() {
            if batch_of[v as usize] == batches {
                parents[u as usize] = parents[v as usize];
            }
        }
        batches += 1;
        left -= collapses.len();
        progress(left);
        errors.push(state.surgery.error.sqrt() as f32);
    }
    errors.reverse();
    let levels = batch_of.iter().map(|&b| if b == u32::MAX { 0 } else { batches - b }).collect();
    SplitStream { mesh: mesh.clone(), parents, levels, errors, texture: None }
}

/// Trees of edges of the mesh as it is now: the images of the triangles that the batch has removed.
struct Trees {
    /// Vertices at the other ends of tree edges.
    edges: Vec<Vec<u32>>,
    /// Union-find forest of vertices.
    parent: Vec<u32>,
    /// Edges of the tree, at its root.
    size: Vec<u32>,
}

impl Trees {
    fn new(n: usize) -> Self {
        Self { edges: vec![Vec::new(); n], parent: (0..n as u32).collect(), size: vec![0; n] }
    }
    fn has(&self, a: u32, b: u32) -> bool {
        self.edges[a as usize].contains(&b)
    }
    fn touches(&self, v: u32) -> bool {
        !self.edges[v as usize].is_empty()
    }
    fn root(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            let up = self.parent[v as usize];
            self.parent[v as usize] = self.parent[up as usize];
            v = up;
        }
        v
    }
    fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return a;
        }
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high as usize] = low;
        self.size[low as usize] += self.size[high as usize];
        low
    }
    fn link(&mut self, a: u32, b: u32) {
        if !self.has(a, b) {
            self.edges[a as usize].push(b);
            self.edges[b as usize].push(a);
        }
    }

    /// True if collapsing `u` onto `v`, which removes (u, v, x) and (v, u, z), keeps the rule; and whether it goes on with a tree.
    fn allow(&mut self, [u, v, x, z]: [u32; 4]) -> Option<bool> {
        let [tu, tv, tx, tz] = [u, v, x, z].map(|w| self.touches(w));
        let (ux, vx, uz, vz) = (self.has(u, x), self.has(v, x), self.has(u, z), self.has(v, z));
        match [tu, tv, tx, tz].iter().filter(|&&t| t).count() {
            0 => Some(false),
            2 if ux || vx || uz || vz || self.has(u, v) => {
                let root = self.root(if tu { u } else { v });
                (self.size[root as usize] < TREE_LIMIT).then_some(true)
            }
            4 => {
                let apart = (ux && vz && !vx && !uz) || (vx && uz && !ux && !vz);
                let (a, b) = (self.root(u), self.root(v));
                let fits = self.size[a as usize] + self.size[b as usize] <= TREE_LIMIT;
                (apart && a != b && fits && !self.has(u, v)).then_some(true)
            }
            _ => None,
        }
    }

    /// Collapses `u` onto `v`.
    fn collapse(&mut self, [u, v, x, z]: [u32; 4]) {
        let touched = [u, v, x, z].iter().filter(|&&w| self.touches(w)).count() as u32;
        for w in std::mem::take(&mut self.edges[u as usize]) {
            self.edges[w as usize].retain(|&e| e != u);
            if w != v {
                self.link(v, w);
            }
        }
        self.link(v, x);
        self.link(v, z);
        let root = [u, x, z].into_iter().fold(v, |root, w| self.join(root, w));
        // A new tree has two edges, one that grows gets one, two that become one had them all.
        self.size[root as usize] += 2 - touched / 2;
    }
}

struct Forests {
    surgery: Surgery,
    /// Vertices whose triangles are one fan; a collapse keeps it so.
    manifold: Vec<bool>,
    /// Vertices of the boundary.
    open: Vec<bool>,
    trees: Trees,
}

/// A collapse that may be done.
struct Candidate {
    /// In sixteenths of a power of two; whole numbers order on every machine.
    key: i64,
    /// The vertex onto which, then the rest of the rim, counter-clockwise.
    rim: Vec<u32>,
}

fn key(cost: f64, grows: bool) -> i64 {
    (((cost + 1e-30).log2() - if grows { GROWING } else { 0.0 }) * 16.0) as i64
}

impl Forests {
    /// The best collapse of `u` that is allowed now.
    fn candidate(&mut self, u: u32) -> Option<Candidate> {
        let rim = self.surgery.rim(u)?;
        let star = self.surgery.star_normal(u);
        let mut best: Option<Candidate> = None;
        for k in 0..rim.len() {
            let (v, x, z) = (rim[k], rim[(k + 1) % rim.len()], rim[(k + rim.len() - 1) % rim.len()]);
            if ![v, x, z].iter().all(|&w| self.manifold[w as usize]) {
                continue;
            }
            let bound = self.open[v as usize];
            if bound && [x, z].iter().chain(&self.trees.edges[u as usize]).any(|&w| w != v && self.open[w as usize]) {
                continue;
            }
            let Some(grows) = self.trees.allow([u, v, x, z]) else { continue };
            let least = best.as_ref().map_or(i64::MAX, |b| b.key);
            if least <= key(self.surgery.cost(u, v), grows) {
                continue;
            }
            let turned = [&rim[k..], &rim[..k]].concat();
            let inner = |w: u32| {
                let both = |t: &&u32| self.surgery.triangles[**t as usize].contains(&w);
                self.surgery.around[v as usize].iter().filter(both).count() == 2
            };
            let Some(cost) = self.surgery.price(u, &turned, star).filter(|_| inner(x) && inner(z)) else { continue };
            let key = key(cost, grows);
            if key < least {
                best = Some(Candidate { key, rim: turned });
            }
        }
        best
    }

    /// Collapses (gone, onto) of one forest, at most `most`.
    fn batch(&mut self, most: usize) -> Vec<(u32, u32)> {
        let n = self.surgery.positions.len();
        self.trees = Trees::new(n);
        let mut queued = vec![i64::MAX; n];
        // Least key that a vertex can have while no tree grows.
        let mut least = vec![i64::MAX; n];
        let mut queue = BinaryHeap::new();
        for u in 0..n as u32 {
            if self.surgery.gone[u as usize] || self.surgery.kept[u as usize] {
                continue;
            }
            if let Some(c) = self.candidate(u) {
                least[u as usize] = c.key;
                queued[u as usize] = c.key;
                queue.push((Reverse(c.key), Reverse(u)));
            }
        }
        // What is dearer than most waits for a later batch, where it may be cheap beside the rest.
        let mut costs: Vec<i64> = least.iter().copied().filter(|&k| k != i64::MAX).collect();
        let at = (costs.len() as f64 * CAP_PART) as usize;
        let cap = if at < costs.len() { *costs.select_nth_unstable(at).1 } else { i64::MAX };
        let grown = (GROWING * 16.0) as i64;
        let mut out = Vec::new();
        while let Some((Reverse(at), Reverse(u))) = queue.pop() {
            if out.len() == most || at > cap {
                break;
            }
            if queued[u as usize] != at {
                continue;
            }
            queued[u as usize] = i64::MAX;
            let Some(c) = self.candidate(u) else { continue };
            if c.key > at {
                queued[u as usize] = c.key;
                queue.push((Reverse(c.key), Reverse(u)));
                continue;
            }
            let (v, x, z) = (c.rim[0], c.rim[1], c.rim[c.rim.len() - 1]);
            self.trees.collapse([u, v, x, z]);
            self.surgery.remove(u, &c.rim);
            least[u as usize] = i64::MAX;
            out.push((u, v));
            // Beside these a tree may grow now; what is queued says at least what it costs.
            for w in [v, x, z] {
                for &t in &self.surgery.around[w as usize] {
                    for y in self.surgery.triangles[t as usize] {
                        let hope = least[y as usize].saturating_sub(grown);
                        if least[y as usize] != i64::MAX && hope < queued[y as usize] {
                            queued[y as usize] = hope;
                            queue.push((Reverse(hope), Reverse(y)));
                        }
                    }
                }
            }
        }
        out
    }
}
