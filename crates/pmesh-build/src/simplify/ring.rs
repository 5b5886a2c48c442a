//! The mesh while it collapses: triangles over positions and over wedges, and what stands around a position.

use super::quadric::{Point, cross, dot, sub};
use pmesh_core::IndexedMesh;
use std::collections::HashMap;

/// Triangles around a position above which its neighbours are hashed.
pub(super) const LARGE_VALENCE: usize = 64;

/// A neighbour of a position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    pub(super) position: u32,
    /// Triangles at the edge.
    triangles: u32,
    /// Wedges (here, there) of the first triangle at the edge.
    wedges: (u32, u32),
    /// True if another triangle at the edge has other wedges: a seam.
    seam: bool,
}

impl Neighbour {
    /// Boundary, non-manifold or seam: an edge that a shape is cut along.
    pub(super) fn is_special(&self) -> bool {
        self.triangles != 2 || self.seam
    }
    pub(super) fn triangles(&self) -> u32 {
        self.triangles
    }
}

/// Live connectivity. Positions are named by the first vertex that has them.
pub(super) struct Connectivity {
    pub(super) positions: Vec<Point>,
    /// Corners as positions.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Corners as wedges.
    pub(super) wedges: Vec<[u32; 3]>,
    pub(super) alive: Vec<bool>,
    /// Triangles of each position; dead ones are swept out on collapse.
    pub(super) incident: Vec<Vec<u32>>,
    pub(super) alive_count: usize,
    /// Wedges of each position that has more than one, itself included.
    pub(super) members: HashMap<u32, Vec<u32>>,
}

impl Connectivity {
    /// Positions moved to the origin and scaled to a unit box, so that thresholds have no units. Gives the scale too.
    pub(super) fn new(mesh: &IndexedMesh) -> (Self, Point, f64) {
        let n = mesh.vertices.len();
        let mut position_of: Vec<u32> = (0..n as u32).collect();
        let mut members: HashMap<u32, Vec<u32>> = Default::default();
        for &(v, p) in &mesh.position_of {
            let root = position_of[p as usize];
            position_of[v as usize] = root;
            members.entry(root).or_insert_with(|| vec![root]).push(v);
        }
        let (low, high) = mesh.bounds();
        let center: Point = std::array::from_fn(|k| (f64::from(low[k]) + f64::from(high[k])) / 2.0);
        let extent = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(0.0, f64::max);
        let scale = if extent > 0.0 { extent } else { 1.0 };
        let unit = |p: &[f32; 3]| std::array::from_fn(|k| (f64::from(p[k]) - center[k]) / scale);
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| position_of[v as usize])).collect();
        let alive: Vec<bool> = triangles.iter().map(|[a, b, c]| a != b && b != c && c != a).collect();
        let mut degree = vec![0u32; n];
        let live = || triangles.iter().enumerate().filter(|(t, _)| alive[*t]);
        live().for_each(|(_, t)| t.iter().for_each(|&v| degree[v as usize] += 1));
        let mut incident: Vec<Vec<u32>> = degree.iter().map(|&d| Vec::with_capacity(d as usize)).collect();
        live().for_each(|(i, t)| t.iter().for_each(|&v| incident[v as usize].push(i as u32)));
        let alive_count = live().count();
        let positions = mesh.vertices.positions.iter().map(unit).collect();
        let wedges = mesh.triangles.clone();
        (Self { positions, triangles, wedges, alive, incident, alive_count, members }, center, scale)
    }

    pub(super) fn live(&self, v: u32) -> impl Iterator<Item = u32> {
        self.incident[v as usize].iter().copied().filter(|&t| self.alive[t as usize])
    }

    pub(super) fn cross_of(&self, t: u32) -> Point {
        let [a, b, c] = self.triangles[t as usize].map(|v| self.positions[v as usize]);
        cross(sub(b, a), sub(c, a))
    }

    /// The neighbours of `v`. O(valence), but for small rings, where looking through them is quicker than hashing.
    pub(super) fn ring(&self, v: u32, out: &mut Vec<Neighbour>) {
        out.clear();
        let mut index = (self.incident[v as usize].len() > LARGE_VALENCE).then(HashMap::new);
        for t in self.live(v) {
            let (corners, wedges) = (self.triangles[t as usize], self.wedges[t as usize]);
            let here = corners.iter().position(|&x| x == v).unwrap_or(0);
            for k in [(here + 1) % 3, (here + 2) % 3] {
                let pair = (wedges[here], wedges[k]);
                let known = match &mut index {
                    None => out.iter().position(|n| n.position == corners[k]),
                    Some(index) => {
                        let at = *index.entry(corners[k]).or_insert(out.len());
                        (at < out.len()).then_some(at)
                    }
                };
                match known {
                    Some(at) => {
                        let n = &mut out[at];
                        n.triangles += 1;
                        n.seam |= n.wedges != pair;
                    }
                    None => out.push(Neighbour { position: corners[k], triangles: 1, wedges: pair, seam: false }),
                }
            }
        }
    }

    /// True if collapsing `u` onto its neighbour `v` keeps the surface's topology, its boundaries and its seams: the link
    /// condition, and special edges collapse along themselves only.
    pub(super) fn keeps_topology(&self, edge: &Neighbour, ring_u: &[Neighbour]) -> bool {
        let special = ring_u.iter().filter(|n| n.is_special()).count();
        if special != 0 && !(special == 2 && edge.is_special()) {
            return false;
        }
        let v = edge.position;
        let at_v = |n: &&Neighbour| n.position != v && self.has_edge(n.position, v);
        if ring_u.iter().filter(at_v).count() as u32 != edge.triangles {
            return false;
        }
        // A tetrahedron's link passes the count, yet it would fold onto itself.
        !(special == 0 && ring_u.len() == 3 && self.live(v).take(4).count() == 3)
    }

    /// True if some triangle holds both, looked for around the one with fewer.
    fn has_edge(&self, a: u32, b: u32) -> bool {
        let fewer = self.incident[a as usize].len() <= self.incident[b as usize].len();
        let (a, b) = if fewer { (a, b) } else { (b, a) };
        self.live(a).any(|t| self.triangles[t as usize].contains(&b))
    }

    /// True if no triangle around `u`, moved to `to`, turns over; those that also hold `v` vanish.
    pub(super) fn keeps_orientation(&self, u: u32, v: u32, to: Point) -> bool {
        self.live(u).all(|t| {
            let corners = self.triangles[t as usize];
            if corners.contains(&v) {
                return true;
            }
            let before = self.cross_of(t);
            let [a, b, c] = corners.map(|x| if x == u { to } else { self.positions[x as usize] });
            let after = cross(sub(b, a), sub(c, a));
            let (l0, l1) = (dot(before, before), dot(after, after));
            // 0.2: a triangle may turn by less than 78°. One without area may become anything.
            l0 == 0.0 || dot(before, after) > 0.2 * (l0 * l1).sqrt()
        })
    }

    /// The wedges of `u`, each with the wedge of `v` that it becomes: that of a common triangle, else the one `closest` says.
    pub(super) fn wedge_pairs(&self, u: u32, v: u32, closest: impl Fn(u32, &[u32]) -> u32, out: &mut Vec<(u32, u32)>) {
        let own = [u];
        let to = [v];
        let wedges_u = self.members.get(&u).map_or(&own[..], |m| &m[..]);
        let wedges_v = self.members.get(&v).map_or(&to[..], |m| &m[..]);
        for &w in wedges_u {
            let across = self.live(u).find_map(|t| {
                let (corners, wedges) = (self.triangles[t as usize], self.wedges[t as usize]);
                let k = corners.iter().position(|&x| x == v)?;
                wedges.contains(&w).then_some(wedges[k])
            });
            out.push((w, across.unwrap_or_else(|| closest(w, wedges_v))));
        }
    }

    /// Collapses `u` onto `v`; `pairs` are the wedges. The neighbours of `v` are told to `touched`.
    pub(super) fn collapse(&mut self, u: u32, v: u32, pairs: &[(u32, u32)]) {
        let becomes = |w: u32| pairs.iter().find(|p| p.0 == w).map_or(w, |p| p.1);
        let mut kept = std::mem::take(&mut self.incident[v as usize]);
        for t in std::mem::take(&mut self.incident[u as usize]) {
            let i = t as usize;
            if !self.alive[i] {
                continue;
            }
            if self.triangles[i].contains(&v) {
                self.alive[i] = false;
                self.alive_count -= 1;
            } else {
                for k in 0..3 {
                    if self.triangles[i][k] == u {
                        self.triangles[i][k] = v;
                        self.wedges[i][k] = becomes(self.wedges[i][k]);
                    }
                }
                kept.push(t);
            }
        }
        kept.retain(|&t| self.alive[t as usize]);
        self.incident[v as usize] = kept;
    }
}
