//! The queue: which collapse is cheapest now, and doing it.

use super::quadric::{Point, Quadric, cross, dot, sub};
use super::ring::{Connectivity, LARGE_VALENCE, Neighbour};
use super::{Collapses, Placement, SimplifyOptions, Step};
use crate::BuildError;
use pmesh_core::{IndexedMesh, Vertices};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Weight of the planes that hold boundaries and non-manifold edges, times the squared edge length.
const BOUNDARY_WEIGHT: f64 = 8.0;
/// Weight of the planes that hold seams, whose two sides refine together anyway.
const SEAM_WEIGHT: f64 = 0.5;
/// Weight of staying near, times the star's area: on flat ground short edges go first. Arbitrary, small.
const NEAR_WEIGHT: f64 = 1e-6;
/// Price of breaking topology: the star's area × the squared edge length × this.
const BREAK_WEIGHT: f64 = 4.0;
/// Attribute differences are priced as distances: a full range of a colour or texture coordinate as this part of the model.
const ATTRIBUTE_SCALE: f64 = 0.03;

/// A candidate: `vertex` may collapse for about `cost`.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    /// Bits of a non-negative f64: same order.
    cost: Reverse<u64>,
    vertex: Reverse<u32>,
}

/// What collapsing a vertex onto its best neighbour means.
#[derive(Clone, Copy)]
struct Choice {
    neighbour: usize,
    cost: f64,
    to: Point,
}

struct Collapser<'a> {
    mesh: &'a IndexedMesh,
    mesh_state: Connectivity,
    quadrics: Vec<Quadric>,
    placement: Placement,
    queue: BinaryHeap<Entry>,
    /// Cost bits under which a vertex stands in the queue; other entries of it are stale.
    queued: Vec<u64>,
    allow_turning: bool,
    /// Positions that a collapse has moved; the others stand bit for bit where the input has them.
    moved: Vec<bool>,
    center: Point,
    scale: f64,
}

const NOT_QUEUED: u64 = u64::MAX;

/// Collapses `mesh` until `options.target_triangles` are left or nothing can collapse. `progress` gets triangles left, every
/// few thousand collapses. O(n log n). Same input, same list, on every platform.
pub fn simplify(mesh: &IndexedMesh, options: SimplifyOptions, mut progress: impl FnMut(usize)) -> Result<Collapses, BuildError> {
    mesh.check()?;
    let (state, center, scale) = Connectivity::new(mesh);
    let quadrics = initial_quadrics(&state);
    let n = mesh.vertices.len();
    let mut collapser = Collapser {
        mesh,
        mesh_state: state,
        quadrics,
        placement: options.placement,
        queue: BinaryHeap::new(),
        queued: vec![NOT_QUEUED; n],
        allow_turning: false,
        moved: vec![false; n],
        center,
        scale,
    };
    let mut out = Collapses::default();
    collapser.run(options.target_triangles, &mut out, &mut progress);
    collapser.allow_turning = true;
    collapser.run(options.target_triangles, &mut out, &mut progress);
    out.positions = collapser.final_positions();
    Ok(out)
}

fn initial_quadrics(mesh: &Connectivity) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); mesh.positions.len()];
    for t in 0..mesh.triangles.len() as u32 {
        let corners = mesh.triangles[t as usize];
        let n = mesh.cross_of(t);
        let length = dot(n, n).sqrt();
        if !mesh.alive[t as usize] || length == 0.0 {
            continue;
        }
        let plane = Quadric::plane(mesh.positions[corners[0] as usize], n.map(|x| x / length), length / 6.0);
        corners.iter().for_each(|&v| quadrics[v as usize].add(&plane));
    }
    let mut ring = Vec::new();
    for v in 0..mesh.positions.len() as u32 {
        mesh.ring(v, &mut ring);
        for edge in ring.iter().filter(|e| e.is_special() && e.position > v) {
            hold_edge(mesh, v, edge, &mut quadrics);
        }
    }
    quadrics
}

/// Planes through a special edge, square to its triangles, so that it keeps its line.
fn hold_edge(mesh: &Connectivity, v: u32, edge: &Neighbour, quadrics: &mut [Quadric]) {
    let (a, b) = (mesh.positions[v as usize], mesh.positions[edge.position as usize]);
    let along = sub(b, a);
    let weight = if edge.triangles() == 2 { SEAM_WEIGHT } else { BOUNDARY_WEIGHT };
    for t in mesh.live(v).filter(|&t| mesh.triangles[t as usize].contains(&edge.position)) {
        let across = cross(along, mesh.cross_of(t));
        let length = dot(across, across).sqrt();
        if length > 0.0 {
            let mut plane =
                Quadric::plane(a, across.map(|x| x / length), weight * dot(along, along) / f64::from(edge.triangles()));
            // Held, but not area: the mean distance stays that of the surface.
            plane.weight = 0.0;
            quadrics[v as usize].add(&plane);
            quadrics[edge.position as usize].add(&plane);
        }
    }
}

impl Collapser<'_> {
    fn run(&mut self, target: usize, out: &mut Collapses, progress: &mut impl FnMut(usize)) {
        let mut ring = Vec::new();
        for v in 0..self.mesh_state.positions.len() as u32 {
            self.enqueue(v, 0.0, &mut ring);
        }
        let (mut ring_v, mut pairs) = (Vec::new(), Vec::new());
        while self.mesh_state.alive_count > target {
            let Some(Entry { cost: Reverse(bits), vertex: Reverse(u) }) = self.queue.pop() else { break };
            if self.queued[u as usize] != bits {
                continue;
            }
            self.queued[u as usize] = NOT_QUEUED;
            self.mesh_state.ring(u, &mut ring);
            let Some(choice) = self.best_allowed(u, &ring) else { continue };
            let next = self.queue.peek().map_or(f64::INFINITY, |e| f64::from_bits(e.cost.0));
            if choice.cost > next {
                self.put(u, choice.cost);
                continue;
            }
            let v = ring[choice.neighbour].position;
            self.perform(u, v, choice, &mut pairs, out);
            self.enqueue(v, 0.0, &mut ring_v);
            if out.steps.len().is_multiple_of(4096) {
                progress(self.mesh_state.alive_count);
            }
            // Vertices whose only candidates were refused get another chance as their surroundings change.
            for n in &ring {
                let refused = self.queued[n.position as usize] == NOT_QUEUED && n.position != v;
                // The hub of a large fan would be looked at anew for each of its spokes.
                if refused && self.mesh_state.incident[n.position as usize].len() <= LARGE_VALENCE {
                    self.enqueue(n.position, choice.cost, &mut ring_v);
                }
            }
        }
    }

    fn put(&mut self, v: u32, cost: f64) {
        let bits = cost.max(0.0).to_bits();
        self.queued[v as usize] = bits;
        self.queue.push(Entry { cost: Reverse(bits), vertex: Reverse(v) });
    }

    /// Queues `v` under its cheapest cost, refused or not, but not below `least`.
    fn enqueue(&mut self, v: u32, least: f64, ring: &mut Vec<Neighbour>) {
        self.mesh_state.ring(v, ring);
        let cheapest = ring.iter().map(|n| self.price(v, n).0).fold(f64::INFINITY, f64::min);
        if cheapest.is_finite() {
            self.put(v, cheapest.max(least));
        }
    }

    /// Cost of collapsing `u` onto `edge.position`, and where that then stands.
    fn price(&self, u: u32, edge: &Neighbour) -> (f64, Point) {
        let (pu, pv) = (self.mesh_state.positions[u as usize], self.mesh_state.positions[edge.position as usize]);
        let mut q = self.quadrics[u as usize];
        q.add(&self.quadrics[edge.position as usize]);
        let to = match self.placement {
            Placement::Kept => pv,
            Placement::Optimal => self.optimum(&q, pu, pv),
        };
        let moved = sub(pu, to);
        let near = NEAR_WEIGHT * self.quadrics[u as usize].weight * dot(moved, moved);
        (q.at(to) + near + self.attribute_cost(u, edge.position), to)
    }

    fn optimum(&self, q: &Quadric, pu: Point, pv: Point) -> Point {
        let middle: Point = std::array::from_fn(|k| (pu[k] + pv[k]) / 2.0);
        let edge = sub(pu, pv);
        // A little pull to the middle settles what planes leave open.
        let mut held = *q;
        held.add(&Quadric::point(middle, 1e-4 * q.weight));
        let reach = |p: &Point| dot(sub(*p, middle), sub(*p, middle)) <= 4.0 * dot(edge, edge);
        let candidates = [held.minimum().filter(reach), Some(pv), Some(pu), Some(middle)];
        let cost = |p: &Point| q.at(*p);
        candidates.into_iter().flatten().min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(pv)
    }

    /// Squared difference of colours and texture coordinates, priced as a distance over the star's area.
    fn attribute_cost(&self, u: u32, v: u32) -> f64 {
        let a = &self.mesh.vertices.attributes;
        fn difference<const N: usize>(values: &[[f32; N]], u: u32, v: u32) -> f64 {
            match (values.get(u as usize), values.get(v as usize)) {
                (Some(x), Some(y)) => (0..N).map(|k| f64::from(x[k] - y[k]).powi(2)).sum(),
                _ => 0.0,
            }
        }
        let sum = difference(&a.colors, u, v);
        sum * ATTRIBUTE_SCALE * ATTRIBUTE_SCALE * self.quadrics[u as usize].weight
    }

    fn best_allowed(&self, u: u32, ring: &[Neighbour]) -> Option<Choice> {
        let mut priced: Vec<(f64, usize, Point)> = ring
            .iter()
            .enumerate()
            .map(|(i, n)| {
                let (cost, to) = self.price(u, n);
                (cost, i, to)
            })
            .collect();
        priced.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<Choice> = None;
        for (mut cost, neighbour, to) in priced {
            if best.is_some_and(|b| b.cost <= cost) {
                break;
            }
            let v = ring[neighbour].position;
            if !self.allow_turning && !self.keeps_orientation(u, v, to) {
                continue;
            }
            if !self.mesh_state.keeps_topology(&ring[neighbour], ring) {
                let edge = sub(self.mesh_state.positions[u as usize], self.mesh_state.positions[v as usize]);
                cost += BREAK_WEIGHT * (self.quadrics[u as usize].weight + 1e-12) * dot(edge, edge);
            }
            if best.is_none_or(|b| cost < b.cost) {
                best = Some(Choice { neighbour, cost, to });
            }
        }
        best
    }

    fn keeps_orientation(&self, u: u32, v: u32, to: Point) -> bool {
        let moves = self.placement == Placement::Optimal;
        self.mesh_state.keeps_orientation(u, v, to) && (!moves || self.mesh_state.keeps_orientation(v, u, to))
    }

    fn perform(&mut self, u: u32, v: u32, choice: Choice, pairs: &mut Vec<(u32, u32)>, out: &mut Collapses) {
        pairs.clear();
        let vertices = &self.mesh.vertices;
        self.mesh_state.wedge_pairs(u, v, |w, among| closest_wedge(vertices, w, among), pairs);
        let red_before = self.model_position(v);
        self.mesh_state.collapse(u, v, pairs);
        self.moved[v as usize] |= self.placement == Placement::Optimal && self.mesh_state.positions[v as usize] != choice.to;
        self.mesh_state.positions[v as usize] = choice.to;
        let q = self.quadrics[u as usize];
        self.quadrics[v as usize].add(&q);
        let weight = self.quadrics[v as usize].weight;
        let error = if weight > 0.0 { (choice.cost / weight).sqrt() * self.scale } else { 0.0 } as f32;
        let error = out.steps.last().map_or(error, |s| s.error.max(error));
        out.pairs.extend_from_slice(pairs);
        let (pairs_end, triangle_count) = (out.pairs.len() as u32, self.mesh_state.alive_count as u32);
        out.steps.push(Step { pairs_end, error, triangle_count, red: v, red_before });
    }

    fn model_position(&self, v: u32) -> [f32; 3] {
        let p = self.mesh_state.positions[v as usize];
        if !self.moved[v as usize] {
            return self.mesh.vertices.positions[v as usize];
        }
        std::array::from_fn(|k| (p[k] * self.scale + self.center[k]) as f32)
    }

    fn final_positions(&self) -> Vec<[f32; 3]> {
        let mut positions = self.mesh.vertices.positions.clone();
        if self.placement == Placement::Optimal {
            for v in 0..positions.len() as u32 {
                positions[v as usize] = self.model_position(v);
            }
            for &(v, p) in &self.mesh.position_of {
                positions[v as usize] = positions[p as usize];
            }
        }
        positions
    }
}

/// The wedge among `among` whose attributes are closest to those of `w`.
fn closest_wedge(vertices: &Vertices, w: u32, among: &[u32]) -> u32 {
    let a = &vertices.attributes;
    fn difference<const N: usize>(values: &[[f32; N]], u: u32, v: u32) -> f32 {
        match (values.get(u as usize), values.get(v as usize)) {
            (Some(x), Some(y)) => (0..N).map(|k| (x[k] - y[k]).powi(2)).sum(),
            _ => 0.0,
        }
    }
    let distance = |v: u32| difference(&a.normals, w, v) + difference(&a.colors, w, v) + 4.0 * difference(&a.texcoords, w, v);
    among.iter().copied().min_by(|&x, &y| distance(x).total_cmp(&distance(y)).then(x.cmp(&y))).unwrap_or(w)
}
