//! Levels of half-edge collapses, each an independent set: what the compact stream undoes.
//!
//! A level takes about a quarter of the vertices, cheapest first, no two of them neighbours. A vertex of a manifold piece goes
//! onto a neighbour, one of the boundary along the boundary, if that repeats no edge. What it costs is the quadric error of
//! Garland & Heckbert (1997) × the mean of how far from regular the new triangles are: coarse triangles that are well shaped
//! predict better what lies between them. Where bytes count most, in the finest level and in all of `size`, that weighs more, and
//! so does leaving neighbours with few triangles. A collapse that turns a triangle over waits until little else is left. Where
//! vertices share a position all of them go together, along their seams, or none does. A mesh that is a grid is halved as one
//! first ([`super::lattice`]). Coarse levels of `prefix` say how fine a grid does for their coordinates.

mod candidates;

use super::lattice;
use super::quadric::{Point, Quadric, cross, dot, sub};
use candidates::{Grid, Ring};
use pmesh_codec::compact::{CompactStream, Removed, Side, seams};
use pmesh_core::IndexedMesh;
use pmesh_core::surface::{NONE, Surface, next, previous};

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchOptions {
    /// Vertices of the base mesh, about.
    pub base_vertices: usize,
    /// What the levels are to serve.
    pub profile: Profile,
}

impl Default for BatchOptions {
    fn default() -> Self {
        Self { base_vertices: 60, profile: Profile::default() }
    }
}

/// What pulls apart: good levels, and few bytes in all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// A good mesh after any part of the bytes: a level leaves its dearest vertices to later ones.
    #[default]
    Prefix,
    /// Few bytes: each level takes all that it can.
    Size,
}

/// Most levels, the base not counted.
const LEVEL_LIMIT: usize = 61;
/// How often the side of a grid is halved before its vertices go by what they cost.
const GRID_HALVINGS: usize = 3;
/// Part of the vertices that goes in a level, of a fine one and of a coarse one: the less, the better each level; the more, the
/// fewer bytes in all.
const LEVEL_PARTS: [f64; 2] = [0.26, 0.23];
/// How much coarser than the finest a coarse level is.
const COARSE: usize = 4;
/// How much coarser than the finest a level is whose coordinates lack their low bits.
const ROUGH: usize = 4;
/// Step of such a level's grid, in parts of how far its vertices are from what they stand for. A uniform error of a step along one axis
/// is 0.29 steps in the mean: rounding adds a tenth to what a level is off anyway, and buys a third more vertices.
const STEP_A_DISTANCE: f64 = 1.5;
/// A level that removes a smaller part of the vertices is the last: what is left resists.
const LEAST_PART: f64 = 0.01;
/// Takes `mesh` apart. `progress` gets the vertices left. O(n log n).
pub fn collapse_batches(mesh: &IndexedMesh, options: BatchOptions, mut progress: impl FnMut(usize)) -> CompactStream {
    let mut work = Work::new(mesh);
    let mut out = CompactStream { mesh: mesh.clone(), errors: vec![0.0], steps: vec![0.0], ..Default::default() };
    let mut left = work.count.iter().filter(|&&c| c > 0).count();
    let total = left;
    let grid = lattice::coordinates(&work.surface, &work.count);
    while left > options.base_vertices && out.levels.len() < LEVEL_LIMIT {
        let step = grid.as_ref().filter(|_| out.levels.len() < 3 * GRID_HALVINGS).map(|g| (&g[..], out.levels.len()));
        let free = step.is_some() || options.profile == Profile::Size;
        let part = if free { 1.0 } else { LEVEL_PARTS[usize::from(left * COARSE < total)] };
        let most = ((left as f64 * part) as usize).clamp(1, left - options.base_vertices);
        // The finest level is seen last, and is the largest.
        work.for_bytes = options.profile == Profile::Size || left == total;
        let removed = work.level(most, step);
        if removed.is_empty() {
            break;
        }
        let last = (removed.len() as f64) < LEAST_PART * left as f64;
        left -= removed.len();
        progress(left);
        out.levels.push(removed);
        out.errors.push(work.error.sqrt() as f32);
        let is_rough = !free && left * ROUGH < total;
        out.steps.push(if is_rough { (STEP_A_DISTANCE * work.distance()) as f32 } else { 0.0 });
        if last {
            break;
        }
    }
    out.levels.reverse();
    out.steps.reverse();
    out.errors.reverse();
    out.base_triangles = work.surface.triangles.iter().copied().filter(|t| t[0] != NONE).collect();
    out
}

struct Work {
    surface: Surface,
    positions: Vec<Point>,
    quadrics: Vec<Quadric>,
    /// Triangles of each vertex.
    count: Vec<u32>,
    /// Vertices that stay for ever: not manifold, or sharing a position with one that is not.
    kept: Vec<bool>,
    /// The next vertex at the same position, in a circle.
    beside: Vec<u32>,
    /// The first vertex at the position.
    first: Vec<u32>,
    error: f64,
    /// What goes is chosen for the bytes it takes, too.
    for_bytes: bool,
}

impl Work {
    fn new(mesh: &IndexedMesh) -> Self {
        let n = mesh.vertices.len();
        let surface = Surface::new(mesh.triangles.clone(), n as u32);
        let positions: Vec<Point> = mesh.vertices.positions.iter().map(|p| p.map(f64::from)).collect();
        let (mut quadrics, mut count) = (vec![Quadric::default(); n], vec![0u32; n]);
        let normal = |t: [u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            cross(sub(b, a), sub(c, a))
        };
        for (i, &t) in mesh.triangles.iter().enumerate() {
            t.iter().for_each(|&v| count[v as usize] += 1);
            let n = normal(t);
            let length = dot(n, n).sqrt();
            if length == 0.0 {
                continue;
            }
            let unit = n.map(|x| x / length);
            let plane = Quadric::plane(positions[t[0] as usize], unit, length / 6.0);
            t.iter().for_each(|&v| quadrics[v as usize].add(&plane));
            for k in 0..3 {
                if surface.across[3 * i + k] != NONE {
                    continue;
                }
                // A plane along the boundary, square to the triangle.
                let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
                let edge = sub(positions[b], positions[a]);
                let side = cross(edge, unit);
                let squared = dot(edge, edge);
                if squared > 0.0 {
                    let side = Quadric::plane(positions[a], side.map(|x| x / squared.sqrt()), 3.0 * squared);
                    [a, b].iter().for_each(|&v| quadrics[v].add(&side));
                }
            }
        }
        let mut kept = vec![false; n];
        let (mut beside, mut first): (Vec<u32>, Vec<u32>) = ((0..n as u32).collect(), (0..n as u32).collect());
        for (v, p) in seams(mesh) {
            beside.swap(v as usize, p as usize);
            first[v as usize] = p;
        }
        for v in 0..n {
            let start = surface.corner_of[v];
            kept[v] |= start == NONE || surface.around(start).count() as u32 != count[v];
        }
        for t in &mesh.triangles {
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                t.iter().for_each(|&v| kept[v as usize] = true);
            }
        }
        for v in 0..n as u32 {
            let mut w = beside[v as usize];
            while kept[v as usize] && w != v {
                kept[w as usize] = true;
                w = beside[w as usize];
            }
        }
        Self { surface, positions, quadrics, count, kept, beside, first, error: 0.0, for_bytes: false }
    }

    /// All vertices at the position of `v`, itself first.
    fn wedges(&self, v: u32) -> Vec<u32> {
        let after = |&w: &u32| Some(self.beside[w as usize]).filter(|&x| x != v);
        std::iter::successors(Some(v), after).collect()
    }

    /// Removes an independent set of at most `most` vertices.
    fn level(&mut self, most: usize, grid: Option<Grid>) -> Vec<Removed> {
        let mut ring = Ring::default();
        let mut candidates = self.candidates(grid);
        candidates.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost).then(a.vertex.cmp(&b.vertex)));
        let mut locked = vec![false; self.positions.len()];
        let mut out = Vec::with_capacity(most);
        for c in candidates {
            if out.len() >= most {
                break;
            }
            if locked[c.vertex as usize] {
                continue;
            }
            if self.beside[c.vertex as usize] != c.vertex {
                let wedges = self.wedges(c.vertex);
                if wedges.iter().any(|&w| locked[w as usize]) {
                    continue;
                }
                for (v, ring, onto) in self.seam(&wedges, c.onto).into_iter().flatten() {
                    ring.vertices.iter().for_each(|&x| locked[x as usize] = true);
                    out.push(self.remove(v, &ring, onto));
                }
                continue;
            }
            self.ring(c.vertex, &mut ring);
            let Some(onto) = ring.vertices.iter().position(|&x| x == c.onto) else { continue };
            // Where no neighbour of the goal has gone it fits as it did.
            if locked[c.onto as usize] && !self.fits(&mut ring, onto) {
                continue;
            }
            ring.vertices.iter().for_each(|&x| locked[x as usize] = true);
            out.push(self.remove(c.vertex, &ring, onto));
        }
        out
    }

    /// How far the vertices are from what they stand for: the root mean square, by area.
    fn distance(&self) -> f64 {
        let there = (0..self.count.len()).filter(|&v| self.count[v] > 0);
        let (sum, weight) = there.fold((0.0, 0.0), |(sum, weight), v| {
            let q = &self.quadrics[v];
            (sum + q.at(self.positions[v]), weight + q.weight)
        });
        if weight > 0.0 { (sum / weight).max(0.0).sqrt() } else { 0.0 }
    }

    fn remove(&mut self, v: u32, ring: &Ring, onto: usize) -> Removed {
        let n = ring.vertices.len();
        let p = ring.vertices[onto];
        let (side, chain): (Side, Vec<u32>) = if ring.closed {
            (Side::Inside, (1..n).map(|i| ring.vertices[(onto + i) % n]).collect())
        } else if onto == 0 {
            (Side::Tail, ring.vertices[1..].to_vec())
        } else {
            (Side::Head, ring.vertices[..n - 1].to_vec())
        };
        let surface = &mut self.surface;
        let goes = |surface: &Surface, c: u32| surface.vertex(next(c)) == p || surface.vertex(previous(c)) == p;
        for &c in &ring.corners {
            if !goes(surface, c) {
                surface.triangles[c as usize / 3][c as usize % 3] = p;
                surface.corner_of[p as usize] = c;
            }
        }
        for &c in &ring.corners {
            let (a, b, t) = (next(c), previous(c), c as usize / 3);
            if !goes(surface, c) {
                continue;
            }
            // What lay across the triangle's two other edges meets.
            let (third, inner) = if surface.vertex(a) == p { (surface.vertex(b), b) } else { (surface.vertex(a), c) };
            let (outer, inner) = (surface.across[a as usize], surface.across[inner as usize]);
            surface.triangles[t] = [NONE; 3];
            surface.across[3 * t..3 * t + 3].fill(NONE);
            for (e, f) in [(outer, inner), (inner, outer)] {
                if e != NONE {
                    surface.across[e as usize] = f;
                    for end in [e, next(e)] {
                        let w = surface.vertex(end);
                        surface.corner_of[w as usize] = end;
                    }
                }
            }
            self.count[third as usize] -= 1;
            self.count[p as usize] -= 1;
        }
        self.count[p as usize] += ring.corners.len() as u32 - if ring.closed { 2 } else { 1 };
        self.count[v as usize] = 0;
        let own = self.quadrics[v as usize];
        if own.weight > 0.0 {
            self.error = self.error.max(own.at(self.positions[p as usize]) / own.weight);
        }
        self.quadrics[p as usize].add(&own);
        Removed { vertex: v, apex: p, side, chain }
    }
}
