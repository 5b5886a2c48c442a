//! Hierarchical clustering of closest representatives (Schaufler & Stürzlinger 1995 as SS97 uses it; B.2–B.6).
//!
//! Step after step the two clusters whose representatives are closest are joined, and one of the two stays: that of more
//! vertices, at a tie that of the lower index (B.4). Among equal distances the lowest (lower index, higher index) pair goes
//! first. Positions are all that counts, so any soup of triangles clusters, down to one vertex.
//!
//! Exact and sub-quadratic: representatives only ever vanish, so a nearest neighbour that was found stays a lower bound. A
//! heap holds one for each cluster; the one that comes up is looked up again if its neighbour has gone, in a k-d tree that
//! counts the points that are left and is rebuilt when half have gone.

use super::{Collapses, Step};
use pmesh_core::IndexedMesh;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Points of a leaf.
const LEAF: usize = 8;

/// Clusters all vertices of `mesh` into one: the ordered list of joins, each a pair (vertex that goes, one that stays).
/// `progress` gets the vertices left. O(n log n) for points that are spread; errors are distances and never fall (B.5).
pub fn cluster_closest(mesh: &IndexedMesh, mut progress: impl FnMut(usize)) -> Collapses {
    let positions = &mesh.vertices.positions;
    let mut joins = Joins::new(mesh);
    for (blue, red) in coincident(positions) {
        joins.join(red, blue, 0.0);
    }
    let mut search = Search::new(positions, (0..positions.len() as u32).filter(|&v| joins.alive[v as usize]).collect());
    let mut heap = BinaryHeap::new();
    for v in (0..positions.len() as u32).filter(|&v| joins.alive[v as usize]) {
        heap.extend(search.nearest(v).map(|n| Reverse(candidate(v, n))));
    }
    while let Some(Reverse((distance, low, high, owner))) = heap.pop() {
        if !joins.alive[owner as usize] {
            continue;
        }
        let other = if owner == low { high } else { low };
        if joins.alive[other as usize] {
            let squared = f64::from_bits(distance);
            let (gone, stays) = joins.elect(low, high);
            joins.join(stays, gone, squared.sqrt() as f32);
            search.remove(gone);
            if joins.collapses.steps.len().is_multiple_of(4096) {
                progress(positions.len() - joins.collapses.steps.len());
            }
            if owner == gone {
                continue;
            }
        }
        heap.extend(search.nearest(owner).map(|n| Reverse(candidate(owner, n))));
    }
    joins.collapses
}

/// (squared distance as bits, lower index, higher index, whose neighbour it is); distances are positive, so bits compare.
fn candidate(owner: u32, (squared, other): (f64, u32)) -> (u64, u32, u32, u32) {
    (squared.to_bits(), owner.min(other), owner.max(other), owner)
}

/// Vertices at the same place as an earlier one: (vertex, the first there), by that first one.
fn coincident(positions: &[[f32; 3]]) -> Vec<(u32, u32)> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let mut pairs = Vec::new();
    for (v, p) in positions.iter().enumerate() {
        // Adding zero makes -0 and 0 one place.
        let leader = *first.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(v as u32);
        if leader != v as u32 {
            pairs.push((v as u32, leader));
        }
    }
    pairs.sort_unstable_by_key(|&(v, leader)| (leader, v));
    pairs
}

/// The joins so far, and the triangles that are left.
struct Joins<'a> {
    mesh: &'a IndexedMesh,
    alive: Vec<bool>,
    mass: Vec<u32>,
    /// Triangles with a corner in the cluster, some of them gone.
    around: Vec<Vec<u32>>,
    triangles: Vec<[u32; 3]>,
    collapsed: Vec<bool>,
    left: u32,
    collapses: Collapses,
}

impl<'a> Joins<'a> {
    fn new(mesh: &'a IndexedMesh) -> Self {
        let n = mesh.vertices.len();
        let mut around = vec![Vec::new(); n];
        for (i, t) in mesh.triangles.iter().enumerate() {
            t.iter().for_each(|&v| around[v as usize].push(i as u32));
        }
        let collapses = Collapses { positions: mesh.vertices.positions.clone(), ..Default::default() };
        Self {
            mesh,
            alive: vec![true; n],
            mass: vec![1; n],
            around,
            triangles: mesh.triangles.clone(),
            collapsed: vec![false; mesh.triangles.len()],
            left: mesh.triangles.len() as u32,
            collapses,
        }
    }
    /// (the representative that goes, the one that stays).
    fn elect(&self, low: u32, high: u32) -> (u32, u32) {
        if self.mass[high as usize] > self.mass[low as usize] { (low, high) } else { (high, low) }
    }
    fn join(&mut self, stays: u32, gone: u32, distance: f32) {
        self.alive[gone as usize] = false;
        self.mass[stays as usize] += self.mass[gone as usize];
        for t in std::mem::take(&mut self.around[gone as usize]) {
            if self.collapsed[t as usize] {
                continue;
            }
            let corners = &mut self.triangles[t as usize];
            let collapses = corners.contains(&stays);
            corners.iter_mut().filter(|v| **v == gone).for_each(|v| *v = stays);
            if collapses {
                self.collapsed[t as usize] = true;
                self.left -= 1;
            } else {
                self.around[stays as usize].push(t);
            }
        }
        let list = &mut self.collapses;
        list.pairs.push((gone, stays));
        let error = list.steps.last().map_or(distance, |s| s.error.max(distance));
        list.steps.push(Step {
            pairs_end: list.pairs.len() as u32,
            error,
            triangle_count: self.left,
            red: stays,
            red_before: self.mesh.vertices.positions[stays as usize],
        });
    }
}

#[derive(Clone, Debug)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// Points of the range that are left.
    live: u32,
    parent: u32,
    /// First of two children, or 0 at a leaf.
    children: u32,
    range: (u32, u32),
}

/// Nearest neighbours among points that vanish.
struct Search<'a> {
    positions: &'a [[f32; 3]],
    nodes: Vec<Node>,
    points: Vec<u32>,
    leaf_of: Vec<u32>,
    gone: Vec<bool>,
}

impl<'a> Search<'a> {
    fn new(positions: &'a [[f32; 3]], points: Vec<u32>) -> Self {
        let mut search =
            Self { positions, nodes: Vec::new(), points, leaf_of: vec![0; positions.len()], gone: vec![false; positions.len()] };
        search.build();
        search
    }
    fn build(&mut self) {
        self.nodes.clear();
        let count = self.points.len() as u32;
        self.push_node(0, (0, count));
        let mut next = 0;
        while next < self.nodes.len() {
            let node = self.nodes[next].clone();
            let (start, end) = (node.range.0 as usize, node.range.1 as usize);
            if end - start <= LEAF {
                self.points[start..end].iter().for_each(|&p| self.leaf_of[p as usize] = next as u32);
            } else {
                let widest = (0..3).max_by(|&a, &b| (node.high[a] - node.low[a]).total_cmp(&(node.high[b] - node.low[b])));
                let axis = widest.unwrap_or(0);
                let positions = self.positions;
                let middle = (end - start) / 2;
                self.points[start..end].select_nth_unstable_by(middle, |&a, &b| {
                    positions[a as usize][axis].total_cmp(&positions[b as usize][axis]).then(a.cmp(&b))
                });
                self.nodes[next].children = self.nodes.len() as u32;
                let middle = (start + middle) as u32;
                self.push_node(next as u32, (node.range.0, middle));
                self.push_node(next as u32, (middle, node.range.1));
            }
            next += 1;
        }
    }
    fn push_node(&mut self, parent: u32, range: (u32, u32)) {
        let points = &self.points[range.0 as usize..range.1 as usize];
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for &p in points {
            let p = self.positions[p as usize];
            (0..3).for_each(|k| (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k])));
        }
        self.nodes.push(Node { low, high, live: range.1 - range.0, parent, children: 0, range });
    }

    fn remove(&mut self, point: u32) {
        self.gone[point as usize] = true;
        let mut node = self.leaf_of[point as usize] as usize;
        loop {
            self.nodes[node].live -= 1;
            if node == 0 {
                break;
            }
            node = self.nodes[node].parent as usize;
        }
        if (self.nodes[0].live as usize) < self.points.len() / 2 && self.points.len() > 4 * LEAF {
            let gone = &self.gone;
            self.points.retain(|&p| !gone[p as usize]);
            self.build();
        }
    }

    fn squared(&self, a: u32, b: u32) -> f64 {
        let (a, b) = (self.positions[a as usize], self.positions[b as usize]);
        (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|d| d * d).sum()
    }
    fn squared_to_box(&self, node: usize, p: [f32; 3]) -> f64 {
        let n = &self.nodes[node];
        let outside = |k: usize| (f64::from(n.low[k]) - f64::from(p[k])).max(f64::from(p[k]) - f64::from(n.high[k])).max(0.0);
        (0..3).map(outside).map(|d| d * d).sum()
    }

    /// (squared distance, index) of the nearest other point that is left; the lowest index at a tie.
    fn nearest(&self, of: u32) -> Option<(f64, u32)> {
        let position = self.positions[of as usize];
        let mut best: Option<(f64, u32)> = None;
        let mut stack = vec![(0.0, 0usize)];
        while let Some((distance, node)) = stack.pop() {
            let n = &self.nodes[node];
            if n.live == 0 || best.is_some_and(|b| distance > b.0) {
                continue;
            }
            if n.children == 0 {
                for &p in &self.points[n.range.0 as usize..n.range.1 as usize] {
                    if p != of && !self.gone[p as usize] {
                        let found = (self.squared(of, p), p);
                        best = Some(best.map_or(found, |b| if found < b { found } else { b }));
                    }
                }
                continue;
            }
            let children = [n.children as usize, n.children as usize + 1].map(|c| (self.squared_to_box(c, position), c));
            let (near, far) = if children[0].0 <= children[1].0 { (0, 1) } else { (1, 0) };
            stack.push(children[far]);
            stack.push(children[near]);
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pmesh_core::Vertices;
    use proptest::prelude::*;

    /// The definition (B.2), quadratic: pairs in order.
    fn by_definition(positions: &[[f32; 3]]) -> Vec<(u32, u32)> {
        let mut alive: Vec<u32> = (0..positions.len() as u32).collect();
        let mut mass = vec![1; positions.len()];
        let mut pairs = Vec::new();
        while alive.len() > 1 {
            let squared = |a: u32, b: u32| -> f64 {
                let (a, b) = (positions[a as usize], positions[b as usize]);
                (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|d| d * d).sum()
            };
            let all = alive.iter().flat_map(|&a| alive.iter().filter(move |&&b| a < b).map(move |&b| (a, b)));
            let (a, b) = all.min_by(|x, y| squared(x.0, x.1).total_cmp(&squared(y.0, y.1)).then(x.cmp(y))).expect("two");
            let (gone, stays) = if mass[b as usize] > mass[a as usize] { (a, b) } else { (b, a) };
            mass[stays as usize] += mass[gone as usize];
            alive.retain(|&v| v != gone);
            pairs.push((gone, stays));
        }
        pairs
    }

    proptest! {
        /// Small whole numbers: ties and coincident points abound.
        #[test]
        fn the_joins_are_those_of_the_definition(raw in prop::collection::vec((0i8..7, 0i8..7, 0i8..4), 1..60)) {
            let positions: Vec<_> = raw.into_iter().map(|(x, y, z)| [f32::from(x), f32::from(y), f32::from(z)]).collect();
            let mesh = IndexedMesh { vertices: Vertices { positions, ..Default::default() }, ..Default::default() };
            prop_assert_eq!(cluster_closest(&mesh, |_| {}).pairs, by_definition(&mesh.vertices.positions));
        }
    }

    #[test]
    fn triangles_that_collapse_are_counted_once() {
        let mesh = crate::sample::sample("knot").expect("it is built in").mesh;
        let list = cluster_closest(&mesh, |_| {});
        assert_eq!(list.steps.len(), mesh.vertices.len() - 1);
        assert_eq!(list.steps.last().map(|s| s.triangle_count), Some(0));
        assert!(list.steps.windows(2).all(|w| w[0].error <= w[1].error && w[0].triangle_count >= w[1].triangle_count));
    }
}
