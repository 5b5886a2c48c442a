//! What each vertex would cost, and which neighbour it would go onto.

use super::{Point, Work, cross, dot, sub};
use pmesh_core::surface::{NONE, next, previous};
use std::thread;

/// Vertices below which a second thread is not worth starting.
const LEAST_SHARE: usize = 4096;

/// Largest number of neighbours that the two vertices of a collapse may have together.
const VALENCE_LIMIT: usize = 18;
/// Least cosine between a triangle's normals before and after.
const TURN_COSINE: f64 = 0.2;
/// Least quality of a new triangle; 1 is equilateral.
const QUALITY_LIMIT: f64 = 0.05;
/// Factor in cost of what breaks one of the last two.
const TURN_PRICE: f64 = 65536.0;

/// Where bytes count most: part that is added to a cost for each vertex that is left with five triangles; four times that for four, and so on.
const LOW_VALENCE: f64 = 0.3;

/// Places of a grid's vertices, and the step of its halving.
pub(super) type Grid<'a> = (&'a [Option<[i32; 2]>], usize);

/// The star of a vertex: its neighbours counter-clockwise, and whether they are a circle.
#[derive(Default)]
pub(super) struct Ring {
    pub(super) corners: Vec<u32>,
    pub(super) vertices: Vec<u32>,
    pub(super) closed: bool,
    /// Of each triangle: twice its normal × area.
    areas: Vec<Point>,
    /// Scratch: neighbours of the vertex to go onto.
    goal: Vec<u32>,
    /// Scratch: the least that going onto each neighbour costs.
    floors: Vec<(f64, usize)>,
}

pub(super) struct Candidate {
    pub(super) cost: f64,
    /// The first at its position.
    pub(super) vertex: u32,
    /// The neighbour onto which; of a seam, the first vertex at that position.
    pub(super) onto: u32,
}

impl Work {
    pub(super) fn ring(&self, v: u32, ring: &mut Ring) {
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

    /// Finds the areas of the ring's triangles.
    fn measure(&self, v: u32, ring: &mut Ring) {
        let own = self.positions[v as usize];
        let arm = |c: u32| sub(self.positions[self.surface.vertex(c) as usize], own);
        ring.areas.clear();
        ring.areas.extend(ring.corners.iter().map(|&c| cross(arm(next(c)), arm(previous(c)))));
    }

    /// True if the collapse onto the ring's vertex `onto` repeats no edge and leaves no vertex without triangles.
    pub(super) fn fits(&self, ring: &mut Ring, onto: usize) -> bool {
        let n = ring.vertices.len();
        let p = ring.vertices[onto];
        if self.kept[p as usize] || n + self.count[p as usize] as usize > VALENCE_LIMIT {
            return false;
        }
        ring.goal.clear();
        let mut last = NONE;
        for c in self.surface.around(self.surface.corner_of[p as usize]) {
            ring.goal.push(self.surface.vertex(next(c)));
            last = c;
        }
        ring.goal.push(self.surface.vertex(previous(last)));
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
        let met = |i: usize| i != onto && ring.goal.contains(&ring.vertices[i]);
        (0..n).all(|i| !met(i) || (beside(i) && (ring.closed || i.abs_diff(onto) == 1)))
    }

    /// What the collapse onto ring vertex `onto` costs; the ring's areas are known.
    fn cost(&self, v: u32, ring: &Ring, onto: usize) -> f64 {
        let p = self.positions[ring.vertices[onto] as usize];
        let own = self.positions[v as usize];
        let (mut shape, mut made, mut turned) = (0.0, 0, false);
        for (&c, &before) in ring.corners.iter().zip(&ring.areas) {
            let (a, b) = (self.surface.vertex(next(c)), self.surface.vertex(previous(c)));
            if a == ring.vertices[onto] || b == ring.vertices[onto] {
                continue;
            }
            let (a, b) = (self.positions[a as usize], self.positions[b as usize]);
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
        let irregular = (shape / f64::from(made.max(1))).max(1.0);
        let cost = cost * irregular.sqrt() * if turned { TURN_PRICE } else { 1.0 };
        if !self.for_bytes {
            return cost;
        }
        // Of a mesh that stays regular it is easier to say what splits, and how.
        let n = ring.vertices.len();
        let low = |i: usize| {
            let missing = 7 - self.count[ring.vertices[i % n] as usize].min(7);
            f64::from(missing * missing)
        };
        let sides = if ring.closed { low(onto + 1) + low(onto + n - 1) } else { 0.0 };
        cost * irregular.sqrt() * irregular.sqrt().sqrt() * (1.0 + LOW_VALENCE * sides)
    }

    /// The best collapse of each vertex that may go, on all processors: each is found by itself.
    pub(super) fn candidates(&self, grid: Option<Grid>) -> Vec<Candidate> {
        let n = self.positions.len();
        let threads = thread::available_parallelism().map_or(1, |t| t.get()).min(n / LEAST_SHARE).max(1);
        let share = n.div_ceil(threads);
        let part = |t: usize| {
            let (mut ring, mut out) = (Ring::default(), Vec::new());
            out.extend((t * share..n.min((t + 1) * share)).filter_map(|v| self.best(v as u32, &mut ring, grid)));
            out
        };
        if threads == 1 {
            return part(0);
        }
        thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|t| scope.spawn(move || part(t))).collect();
            let mut all = part(0);
            // A thread that panicked takes this one along.
            others.into_iter().for_each(|o| all.extend(o.join().unwrap_or_else(|p| std::panic::resume_unwind(p))));
            all
        })
    }

    fn best(&self, v: u32, ring: &mut Ring, grid: Option<Grid>) -> Option<Candidate> {
        if self.first[v as usize] != v || self.kept[v as usize] || self.count[v as usize] == 0 {
            return None;
        }
        if self.beside[v as usize] != v {
            return self.seam_candidate(&self.wedges(v));
        }
        match grid {
            Some((places, step)) => self.grid_candidate(v, ring, places, step),
            None => self.candidate(v, ring),
        }
    }

    /// The collapses that take all of `wedges` to the position `goal` along their seams; `None` if one of them cannot go there, or
    /// they stand in each other's way. Both sides of a seam go together, or there would be cracks.
    pub(super) fn seam(&self, wedges: &[u32], goal: u32) -> Option<Vec<(u32, Ring, usize)>> {
        let mut moves: Vec<(u32, Ring, usize)> = Vec::with_capacity(wedges.len());
        for &v in wedges {
            if self.kept[v as usize] || self.count[v as usize] == 0 {
                return None;
            }
            let mut ring = Ring::default();
            self.ring(v, &mut ring);
            let last = ring.vertices.len() - 1;
            let onto = [0, last].into_iter().find(|&i| self.first[ring.vertices[i] as usize] == goal)?;
            if ring.closed || !self.fits(&mut ring, onto) {
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
    fn seam_candidate(&self, wedges: &[u32]) -> Option<Candidate> {
        let mut ring = Ring::default();
        if self.kept[wedges[0] as usize] || self.count[wedges[0] as usize] == 0 {
            return None;
        }
        self.ring(wedges[0], &mut ring);
        let last = ring.vertices.len() - 1;
        let mut best: Option<Candidate> = None;
        for end in [0, last] {
            let goal = self.first[ring.vertices[end] as usize];
            let Some(mut moves) = self.seam(wedges, goal) else { continue };
            moves.iter_mut().for_each(|(v, ring, _)| self.measure(*v, ring));
            let cost = moves.iter().map(|(v, ring, onto)| self.cost(*v, ring, *onto)).sum();
            if best.as_ref().is_none_or(|b| cost < b.cost) {
                best = Some(Candidate { cost, vertex: wedges[0], onto: goal });
            }
        }
        best
    }

    fn candidate(&self, v: u32, ring: &mut Ring) -> Option<Candidate> {
        self.ring(v, ring);
        self.measure(v, ring);
        let n = ring.vertices.len();
        let along = |onto: &usize| ring.closed || *onto == 0 || onto + 1 == n;
        let floor = |onto: usize| self.quadrics[v as usize].at(self.positions[ring.vertices[onto] as usize]);
        let mut floors = std::mem::take(&mut ring.floors);
        floors.clear();
        floors.extend((0..n).filter(along).map(|onto| (floor(onto), onto)));
        floors.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<(f64, usize)> = None;
        for &(floor, onto) in &floors {
            if best.is_some_and(|(least, _)| floor > least) {
                break;
            }
            let cost = self.cost(v, ring, onto);
            if best.is_none_or(|b| (cost, onto) < b) && self.fits(ring, onto) {
                best = Some((cost, onto));
            }
        }
        ring.floors = floors;
        best.map(|(cost, onto)| Candidate { cost, vertex: v, onto: ring.vertices[onto] })
    }

    /// The collapse that halves a grid in three steps, if `v` is one that goes in this one: of each four vertices the one at odd
    /// rows and columns, then the two at odd rows or columns, each onto the one that stays. What is left is a grid again.
    fn grid_candidate(&self, v: u32, ring: &mut Ring, places: &[Option<[i32; 2]>], step: usize) -> Option<Candidate> {
        let [i, j] = places[v as usize]?;
        let (halvings, [x, y]) = (step / 3, [[1, 1], [1, 0], [0, 1]][step % 3]);
        let odd = |i: i32| i >> halvings & 1;
        if [odd(i), odd(j)] != [x, y] {
            return None;
        }
        self.ring(v, ring);
        let goal = |sign: i32| Some([i + sign * (x << halvings), j + sign * (y << halvings)]);
        let at = |goal| ring.vertices.iter().position(|&w| places[w as usize] == goal);
        // The first of the two steps that follow goes the other way: else three vertices in a row would be a triangle until the second.
        let first = if step % 3 == 1 { 1 } else { -1 };
        for onto in [at(goal(first)), at(goal(-first))].into_iter().flatten() {
            let along = ring.closed || onto == 0 || onto == ring.vertices.len() - 1;
            if along && self.fits(ring, onto) {
                return Some(Candidate { cost: 0.0, vertex: v, onto: ring.vertices[onto] });
            }
        }
        self.candidate(v, ring)
    }
}
