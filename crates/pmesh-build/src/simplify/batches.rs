//! Levels of half-edge collapses, each an independent set: what the compact stream undoes.
//!
//! A level takes about a quarter of the vertices, cheapest first, no two of them neighbours. A vertex of a manifold piece goes
//! onto a neighbour, one of the boundary along the boundary, if that repeats no edge. What it costs is the quadric error of
//! Garland & Heckbert (1997) × the mean of how far from regular the new triangles are: coarse triangles that are well shaped
//! predict better what lies between them. A collapse that turns a triangle over waits until little else is left. Where vertices
//! share a position all of them go together, along their seams, or none does. A mesh that is a grid is halved as one first
//! ([`super::lattice`]).

use super::lattice;
use super::quadric::{Point, Quadric, cross, dot, sub};
use pmesh_codec::compact::{CompactStream, Removed, Side};
use pmesh_codec::refine::surface::{NONE, Surface, next, previous};
use pmesh_core::IndexedMesh;

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
/// A level that removes a smaller part of the vertices is the last: what is left resists.
const LEAST_PART: f64 = 0.01;
/// Largest number of neighbours that the two vertices of a collapse may have together.
const VALENCE_LIMIT: usize = 18;
/// Least cosine between a triangle's normals before and after.
const TURN_COSINE: f64 = 0.2;
/// Least quality of a new triangle; 1 is equilateral.
const QUALITY_LIMIT: f64 = 0.05;
/// Factor in cost of what breaks one of the last two.
const TURN_PRICE: f64 = 65536.0;

/// Takes `mesh` apart. `progress` gets the vertices left. O(n log n).
pub fn collapse_batches(mesh: &IndexedMesh, options: BatchOptions, mut progress: impl FnMut(usize)) -> CompactStream {
    let mut work = Work::new(mesh);
    let mut out = CompactStream { mesh: mesh.clone(), errors: vec![0.0], ..Default::default() };
    let mut left = work.count.iter().filter(|&&c| c > 0).count();
    let total = left;
    let grid = lattice::coordinates(&work.surface, &work.count);
    while left > options.base_vertices && out.levels.len() < LEVEL_LIMIT {
        let step = grid.as_ref().filter(|_| out.levels.len() < 3 * GRID_HALVINGS).map(|g| (&g[..], out.levels.len()));
        let free = step.is_some() || options.profile == Profile::Size;
        let part = if free { 1.0 } else { LEVEL_PARTS[usize::from(left * COARSE < total)] };
        let most = ((left as f64 * part) as usize).clamp(1, left - options.base_vertices);
        let removed = work.level(most, step);
        if removed.is_empty() {
            break;
        }
        let last = (removed.len() as f64) < LEAST_PART * left as f64;
        left -= removed.len();
        progress(left);
        out.levels.push(removed);
        out.errors.push(work.error.sqrt() as f32);
        if last {
            break;
        }
    }
    out.levels.reverse();
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
    /// Scratch: when a vertex was last seen, and now.
    seen: Vec<u32>,
    now: u32,
}

/// The star of a vertex: its neighbours counter-clockwise, and whether they are a circle.
#[derive(Default)]
struct Ring {
    corners: Vec<u32>,
    vertices: Vec<u32>,
    closed: bool,
}

struct Candidate {
    cost: f64,
    /// The first at its position.
    vertex: u32,
    /// The neighbour onto which; of a seam, the first vertex at that position.
    onto: u32,
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
        for &(v, p) in &mesh.position_of {
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
        Self { surface, positions, quadrics, count, kept, beside, first, error: 0.0, seen: vec![0; n], now: 0 }
    }

    fn ring(&self, v: u32, ring: &mut Ring) {
        ring.corners.clear();
        ring.vertices.clear();
        ring.corners.extend(self.surface.around(self.surface.corner_of[v as usize]));
        ring.vertices.extend(ring.corners.iter().map(|&c| self.surface.vertex(next(c))));
        let last = ring.corners[ring.corners.len() - 1];
        ring.closed = self.surface.turn(last) != NONE;
        if !ring.closed {
            ring.vertices.push(self.surface.vertex(previous(last)));
        }
    }

    /// True if the collapse onto the ring's vertex `onto` repeats no edge and leaves no vertex without triangles.
    fn fits(&mut self, ring: &Ring, onto: usize) -> bool {
        let n = ring.vertices.len();
        let p = ring.vertices[onto];
        if self.kept[p as usize] || n + self.count[p as usize] as usize > VALENCE_LIMIT {
            return false;
        }
        self.now += 1;
        for c in self.surface.around(self.surface.corner_of[p as usize]) {
            let (a, b) = (self.surface.vertex(next(c)), self.surface.vertex(previous(c)));
            (self.seen[a as usize], self.seen[b as usize]) = (self.now, self.now);
        }
        let beside = |i: usize| (i + 1) % n == onto || (onto + 1) % n == i;
        if ring.closed {
            // Two triangles back to back would be left.
            let opposite = |&c: &u32| self.surface.across[next(c) as usize];
            let folds = |e: u32| e != NONE && self.surface.vertex(previous(e)) == p;
            if n < 3 || (n == 3 && ring.corners.iter().map(opposite).any(folds)) {
                return false;
            }
        } else if n == 2 && self.surface.across[next(ring.corners[0]) as usize] == NONE {
            return false;
        }
        let met = |i: usize| i != onto && self.seen[ring.vertices[i] as usize] == self.now;
        (0..n).all(|i| !met(i) || (beside(i) && (ring.closed || i.abs_diff(onto) == 1)))
    }

    /// What the collapse onto ring vertex `onto` costs.
    fn cost(&self, v: u32, ring: &Ring, onto: usize) -> f64 {
        let p = self.positions[ring.vertices[onto] as usize];
        let own = self.positions[v as usize];
        let (mut shape, mut made, mut turned) = (0.0, 0, false);
        for &c in &ring.corners {
            let (a, b) = (self.surface.vertex(next(c)), self.surface.vertex(previous(c)));
            if a == ring.vertices[onto] || b == ring.vertices[onto] {
                continue;
            }
            let (a, b) = (self.positions[a as usize], self.positions[b as usize]);
            let before = cross(sub(a, own), sub(b, own));
            let after = cross(sub(a, p), sub(b, p));
            let area = dot(after, after).sqrt();
            let sides = dot(sub(a, p), sub(a, p)) + dot(sub(b, p), sub(b, p)) + dot(sub(a, b), sub(a, b));
            let quality = if sides > 0.0 { 2.0 * 3f64.sqrt() * area / sides } else { 0.0 };
            turned |= dot(before, after) < TURN_COSINE * area * dot(before, before).sqrt() || quality < QUALITY_LIMIT;
            shape += 1.0 / quality.max(1e-3);
            made += 1;
        }
        let edge = sub(own, p);
        let squared = dot(edge, edge);
        let cost = self.quadrics[v as usize].at(p) + 1e-3 * squared * squared;
        cost * (shape / f64::from(made.max(1))).max(1.0).sqrt() * if turned { TURN_PRICE } else { 1.0 }
    }

    /// All vertices at the position of `v`, itself first.
    fn wedges(&self, v: u32) -> Vec<u32> {
        let after = |&w: &u32| Some(self.beside[w as usize]).filter(|&x| x != v);
        std::iter::successors(Some(v), after).collect()
    }

    /// The collapses that take all of `wedges` to the position `goal` along their seams; `None` if one of them cannot go there, or
    /// they stand in each other's way. Both sides of a seam go together, or there would be cracks.
    fn seam(&mut self, wedges: &[u32], goal: u32) -> Option<Vec<(u32, Ring, usize)>> {
        let mut moves: Vec<(u32, Ring, usize)> = Vec::with_capacity(wedges.len());
        for &v in wedges {
            if self.kept[v as usize] || self.count[v as usize] == 0 {
                return None;
            }
            let mut ring = Ring::default();
            self.ring(v, &mut ring);
            let last = ring.vertices.len() - 1;
            let onto = [0, last].into_iter().find(|&i| self.first[ring.vertices[i] as usize] == goal)?;
            if ring.closed || !self.fits(&ring, onto) {
                return None;
            }
            let p = ring.vertices[onto];
            for (u, other, at) in &moves {
                let q = other.vertices[*at];
                let common = ring.vertices.iter().any(|x| *x != p && other.vertices.contains(x));
                let limit = other.vertices.len() + ring.vertices.len() + self.count[p as usize] as usize;
                if common || ring.vertices.contains(u) || other.vertices.contains(&v) || (p == q && limit > VALENCE_LIMIT) {
                    return None;
                }
                if p != q && other.vertices.contains(&p) {
                    return None;
                }
            }
            moves.push((v, ring, onto));
        }
        Some(moves)
    }

    /// The best collapse of the wedges at a position.
    fn seam_candidate(&mut self, wedges: &[u32]) -> Option<Candidate> {
        let mut ring = Ring::default();
        if self.kept[wedges[0] as usize] || self.count[wedges[0] as usize] == 0 {
            return None;
        }
        self.ring(wedges[0], &mut ring);
        let last = ring.vertices.len() - 1;
        let mut best: Option<Candidate> = None;
        for end in [0, last] {
            let goal = self.first[ring.vertices[end] as usize];
            let Some(moves) = self.seam(wedges, goal) else { continue };
            let cost = moves.iter().map(|(v, ring, onto)| self.cost(*v, ring, *onto)).sum();
            if best.as_ref().is_none_or(|b| cost < b.cost) {
                best = Some(Candidate { cost, vertex: wedges[0], onto: goal });
            }
        }
        best
    }

    fn candidate(&mut self, v: u32, ring: &mut Ring) -> Option<Candidate> {
        self.ring(v, ring);
        let ring = &*ring;
        let n = ring.vertices.len();
        let mut best: Option<Candidate> = None;
        for onto in 0..n {
            if !ring.closed && onto != 0 && onto != n - 1 {
                continue;
            }
            let floor = self.quadrics[v as usize].at(self.positions[ring.vertices[onto] as usize]);
            let least = best.as_ref().map_or(f64::INFINITY, |b| b.cost);
            if floor >= least {
                continue;
            }
            let cost = self.cost(v, ring, onto);
            if cost < least && self.fits(ring, onto) {
                best = Some(Candidate { cost, vertex: v, onto: ring.vertices[onto] });
            }
        }
        best
    }

    /// The collapse that halves a grid in three steps, if `v` is one that goes in this one: of each four vertices the one at odd
    /// rows and columns, then the two at odd rows or columns, each onto the one that stays. What is left is a grid again.
    fn grid_candidate(&mut self, v: u32, ring: &mut Ring, places: &[Option<[i32; 2]>], step: usize) -> Option<Candidate> {
        let [i, j] = places[v as usize]?;
        let (halvings, [x, y]) = (step / 3, [[1, 1], [1, 0], [0, 1]][step % 3]);
        let odd = |i: i32| i >> halvings & 1;
        if [odd(i), odd(j)] != [x, y] {
            return None;
        }
        self.ring(v, ring);
        let goal = |sign: i32| Some([i + sign * (x << halvings), j + sign * (y << halvings)]);
        let at = |goal| ring.vertices.iter().position(|&w| places[w as usize] == goal);
        for onto in [at(goal(-1)), at(goal(1))].into_iter().flatten() {
            let along = ring.closed || onto == 0 || onto == ring.vertices.len() - 1;
            if along && self.fits(ring, onto) {
                return Some(Candidate { cost: 0.0, vertex: v, onto: ring.vertices[onto] });
            }
        }
        self.candidate(v, ring)
    }

    /// Removes an independent set of at most `most` vertices.
    fn level(&mut self, most: usize, grid: Option<(&[Option<[i32; 2]>], usize)>) -> Vec<Removed> {
        let mut ring = Ring::default();
        let mut candidates: Vec<Candidate> = Vec::new();
        for v in 0..self.positions.len() as u32 {
            if self.first[v as usize] != v || self.kept[v as usize] || self.count[v as usize] == 0 {
                continue;
            }
            if self.beside[v as usize] != v {
                let wedges = self.wedges(v);
                candidates.extend(self.seam_candidate(&wedges));
            } else {
                match grid {
                    Some((places, step)) => candidates.extend(self.grid_candidate(v, &mut ring, places, step)),
                    None => candidates.extend(self.candidate(v, &mut ring)),
                }
            }
        }
        candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.vertex.cmp(&b.vertex)));
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
            if !self.fits(&ring, onto) {
                continue;
            }
            ring.vertices.iter().for_each(|&x| locked[x as usize] = true);
            out.push(self.remove(c.vertex, &ring, onto));
        }
        out
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
