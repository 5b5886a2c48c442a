//! A mesh from which vertices are taken one by one, the hole of each filled by a fan about one of its neighbours: a half-edge
//! collapse. What patches and forests have in common.

use super::quadric::{Point, Quadric, cross, dot, sub};
use pmesh_core::IndexedMesh;

/// Largest star that is refilled.
const DEGREE_LIMIT: usize = 12;
/// Price of turning a triangle over: the star's area × the squared edge length × this.
const TURN_WEIGHT: f64 = 1.0;
/// Least cosine between a new triangle and the star it lies in.
const TURN_COSINE: f64 = 0.2;

pub(super) struct Surgery {
    pub(super) positions: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Triangles of each vertex.
    pub(super) around: Vec<Vec<u32>>,
    pub(super) quadrics: Vec<Quadric>,
    pub(super) gone: Vec<bool>,
    /// Vertices that share a position: both sides of a seam stay.
    pub(super) kept: Vec<bool>,
    /// Largest mean squared distance so far.
    pub(super) error: f64,
}

fn normal(p: &[Point], [a, b, c]: [u32; 3]) -> Point {
    let [a, b, c] = [a, b, c].map(|v| p[v as usize]);
    cross(sub(b, a), sub(c, a))
}

impl Surgery {
    pub(super) fn new(mesh: &IndexedMesh) -> Self {
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
        let mut kept = vec![false; positions.len()];
        mesh.position_of.iter().for_each(|&(v, p)| (kept[v as usize], kept[p as usize]) = (true, true));
        let (gone, alive) = (vec![false; positions.len()], vec![true; mesh.triangles.len()]);
        Self { kept, gone, positions, triangles: mesh.triangles.clone(), alive, around, quadrics, error: 0.0 }
    }
    pub(super) fn alive_triangles(&self) -> Vec<[u32; 3]> {
        self.triangles.iter().zip(&self.alive).filter(|t| *t.1).map(|t| *t.0).collect()
    }
    /// The edges across from `v`, as its triangles have them: (next vertex, the one after it).
    fn opposite_edges(&self, v: u32) -> Option<Vec<(u32, u32)>> {
        let edge = |&t: &u32| {
            let t = self.triangles[t as usize];
            let k = t.iter().position(|&x| x == v)?;
            Some((t[(k + 1) % 3], t[(k + 2) % 3]))
        };
        self.around[v as usize].iter().map(edge).collect()
    }
    /// The rim of `v`, counter-clockwise, if its triangles are one closed fan, not too large.
    pub(super) fn rim(&self, v: u32) -> Option<Vec<u32>> {
        if !(3..=DEGREE_LIMIT).contains(&self.around[v as usize].len()) {
            return None;
        }
        let edges = self.opposite_edges(v)?;
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
    /// True if the triangles of `v` are one fan, closed or open. O(valence²), or not looked at where that is large.
    pub(super) fn is_manifold(&self, v: u32) -> bool {
        if self.around[v as usize].len() > 4 * DEGREE_LIMIT {
            return false;
        }
        let Some(edges) = self.opposite_edges(v) else { return false };
        let twice = |f: fn(&(u32, u32)) -> u32| (1..edges.len()).any(|i| edges[..i].iter().any(|e| f(e) == f(&edges[i])));
        if edges.is_empty() || edges.iter().any(|e| e.0 == e.1 || e.0 == v || e.1 == v) || twice(|e| e.0) || twice(|e| e.1) {
            return false;
        }
        let start = edges.iter().find(|e| !edges.iter().any(|o| o.1 == e.0)).unwrap_or(&edges[0]);
        let (mut at, mut seen) = (start.1, 1);
        while let Some(e) = edges.iter().find(|e| e.0 == at).filter(|e| e.0 != start.0) {
            (at, seen) = (e.1, seen + 1);
        }
        seen == edges.len()
    }
    /// True if the mesh ends at `v`.
    pub(super) fn is_open(&self, v: u32) -> bool {
        let edges = self.opposite_edges(v).unwrap_or_default();
        edges.iter().any(|e| !edges.iter().any(|o| o.1 == e.0))
    }
    pub(super) fn joined(&self, a: u32, b: u32) -> bool {
        self.around[a as usize].iter().any(|&t| self.triangles[t as usize].contains(&b))
    }
    /// True if a fan about the first of `rim` would repeat an edge or a triangle.
    pub(super) fn repeats(&self, rim: &[u32]) -> bool {
        let inner = &rim[2..rim.len() - 1];
        if inner.iter().any(|&b| self.joined(rim[0], b)) {
            return true;
        }
        let all = |&t: &u32| rim.iter().all(|v| self.triangles[t as usize].contains(v));
        rim.len() == 3 && self.around[rim[0] as usize].iter().any(all)
    }
    /// Sum of the normals around `v`.
    pub(super) fn star_normal(&self, v: u32) -> Point {
        let normals = self.around[v as usize].iter().map(|&t| normal(&self.positions, self.triangles[t as usize]));
        normals.fold([0.0; 3], |s, n| [s[0] + n[0], s[1] + n[1], s[2] + n[2]])
    }
    /// True if the fan about the first of `rim` turns no triangle over.
    fn lies_flat(&self, rim: &[u32], star: Point) -> bool {
        rim[1..].windows(2).all(|w| {
            let n = normal(&self.positions, [rim[0], w[0], w[1]]);
            let (size, turn) = ((dot(n, n) * dot(star, star)).sqrt(), dot(n, star));
            turn > TURN_COSINE * size && size > 0.0
        })
    }
    /// What it costs at least to have `v` at the place of `apex`.
    pub(super) fn cost(&self, v: u32, apex: u32) -> f64 {
        self.quadrics[v as usize].at(self.positions[apex as usize])
    }
    /// What it costs to fill the hole of `v` with the fan about the first of `rim`; `None` if that would repeat an edge. A fan
    /// that turns a triangle over is not forbidden, for on rough ground no other may be left, but has its price.
    pub(super) fn price(&self, v: u32, rim: &[u32], star: Point) -> Option<f64> {
        if self.repeats(rim) {
            return None;
        }
        let cost = self.cost(v, rim[0]);
        if self.lies_flat(rim, star) {
            return Some(cost);
        }
        let edge = sub(self.positions[v as usize], self.positions[rim[0] as usize]);
        Some(cost + TURN_WEIGHT * self.quadrics[v as usize].weight * dot(edge, edge))
    }
    /// Takes `v` out; a fan about the first of `rim` fills the hole. Gives the fan's first triangle.
    pub(super) fn remove(&mut self, v: u32, rim: &[u32]) -> usize {
        self.gone[v as usize] = true;
        for t in std::mem::take(&mut self.around[v as usize]) {
            self.alive[t as usize] = false;
            for w in self.triangles[t as usize] {
                self.around[w as usize].retain(|&x| x != t);
            }
        }
        let first = self.triangles.len();
        for w in rim[1..].windows(2) {
            let triangle = [rim[0], w[0], w[1]];
            triangle.iter().for_each(|&x| self.around[x as usize].push(self.triangles.len() as u32));
            self.triangles.push(triangle);
            self.alive.push(true);
        }
        let own = self.quadrics[v as usize];
        if own.weight > 0.0 {
            // What it costs, not the price of a triangle turned over.
            self.error = self.error.max(self.cost(v, rim[0]) / own.weight);
        }
        self.quadrics[rim[0] as usize].add(&own);
        first
    }
}
