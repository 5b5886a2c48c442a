//! Levels by the exact rule, from an ordered list of directed collapses (A.7, A.8, D.10), with the partial order of
//! collapses (A.26, A.28, D.12) that comes out of the same replay.
//!
//! Source: GV99 and GV97. The star of an edge is both endpoints and every vertex adjacent to one of them. Non-manifold
//! meshes are replayed too: which triangles vanish follows from the indices alone.

use crate::BuildError;
use crate::arrange::Forest;
use pmesh_core::IndexedMesh;
use pmesh_core::forest::NO_REPRESENTATIVE;
use std::collections::{BTreeSet, HashMap};

/// One collapse after the replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Collapse {
    /// The vertex that goes.
    pub blue: u32,
    /// The vertex that stays.
    pub red: u32,
    /// Level of the blue vertex, from 1: final.
    pub level: u32,
    /// Triangles that vanish, indices into the mesh.
    pub blue_triangles: Vec<u32>,
    /// Earlier collapses (indices into the list) that must be done before this one.
    pub requires: Vec<u32>,
    /// The edge star at the moment of the collapse, ascending.
    pub star: Vec<u32>,
}

/// The outcome of a replay. Levels are the paper's: 1 finest, `top` coarsest; every LOD keeps what has its level or more.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// The collapses in order.
    pub collapses: Vec<Collapse>,
    /// Level of each vertex.
    pub vertex_levels: Vec<u32>,
    /// Level of each triangle.
    pub triangle_levels: Vec<u32>,
    /// Highest level + 1: that of everything that is left.
    pub top: u32,
}

/// Replays `pairs` of (blue, red) on `mesh`. O(sum of star sizes). Errors: a vertex that is gone or does not exist.
pub fn replay(mesh: &IndexedMesh, pairs: &[(u32, u32)]) -> Result<Replay, BuildError> {
    mesh.check()?;
    let n = mesh.vertices.len();
    let mut state = State {
        triangles: mesh.triangles.clone(),
        alive: mesh.triangles.iter().map(|[a, b, c]| a != b && b != c && c != a).collect(),
        incident: vec![Vec::new(); n],
        gone: vec![false; n],
        levels: vec![0; n],
        influences: HashMap::new(),
    };
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        triangle.iter().for_each(|&v| state.incident[v as usize].push(t as u32));
    }
    let mut triangle_levels = vec![0; mesh.triangles.len()];
    let mut collapses = Vec::with_capacity(pairs.len());
    for (i, &(blue, red)) in pairs.iter().enumerate() {
        let usable = |v: u32| (v as usize) < n && !state.gone[v as usize];
        if !usable(blue) || !usable(red) || blue == red {
            let message = format!("collapse {i} ({blue} -> {red}) names a vertex that is gone or does not exist");
            return Err(BuildError::Option(message));
        }
        let collapse = state.collapse(i as u32, blue, red);
        collapse.blue_triangles.iter().for_each(|&t| triangle_levels[t as usize] = collapse.level);
        collapses.push(collapse);
    }
    let top = 1 + collapses.iter().map(|c| c.level).max().unwrap_or(0);
    let mut vertex_levels = vec![top; n];
    collapses.iter().for_each(|c| vertex_levels[c.blue as usize] = c.level);
    for (t, level) in triangle_levels.iter_mut().enumerate().filter(|(_, l)| **l == 0) {
        let [a, b, c] = mesh.triangles[t];
        *level = if a == b || b == c || c == a { 1 } else { top };
    }
    Ok(Replay { collapses, vertex_levels, triangle_levels, top })
}

struct State {
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    incident: Vec<Vec<u32>>,
    gone: Vec<bool>,
    levels: Vec<u32>,
    /// Collapses that brought a vertex to its level: the influence table of D.12.
    influences: HashMap<u32, Vec<u32>>,
}

impl State {
    fn collapse(&mut self, index: u32, blue: u32, red: u32) -> Collapse {
        let star = self.edge_star(blue, red);
        let level = 1 + star.iter().map(|&v| self.levels[v as usize]).max().unwrap_or(0);
        let influenced = star.iter().filter(|&&v| self.levels[v as usize] > 0);
        let requires: BTreeSet<u32> = influenced.flat_map(|v| self.influences.get(v).into_iter().flatten().copied()).collect();
        self.levels[blue as usize] = level;
        self.levels[red as usize] = level;
        self.influences.entry(red).or_default().push(index);
        let blue_triangles = self.rewrite(blue, red);
        self.gone[blue as usize] = true;
        // A vertex that loses its last triangle with the red one has it in no star that comes: it must bear the mark itself.
        for v in blue_triangles.iter().flat_map(|&t| self.triangles[t as usize]).filter(|&v| v != blue && v != red) {
            let meets = |&t: &u32| self.alive[t as usize] && self.triangles[t as usize].contains(&red);
            if !self.incident[v as usize].iter().any(meets) {
                self.levels[v as usize] = level;
                self.influences.entry(v).or_default().push(index);
            }
        }
        let requires = requires.into_iter().collect();
        Collapse { blue, red, level, blue_triangles, requires, star: star.into_iter().collect() }
    }

    fn edge_star(&self, blue: u32, red: u32) -> BTreeSet<u32> {
        let around = [blue, red].into_iter().flat_map(|v| &self.incident[v as usize]);
        let corners = around.filter(|&&t| self.alive[t as usize]).flat_map(|&t| self.triangles[t as usize]);
        corners.chain([blue, red]).collect()
    }

    fn rewrite(&mut self, blue: u32, red: u32) -> Vec<u32> {
        let mut vanished = Vec::new();
        for t in std::mem::take(&mut self.incident[blue as usize]) {
            let triangle = &mut self.triangles[t as usize];
            if !self.alive[t as usize] {
                continue;
            }
            if triangle.contains(&red) {
                self.alive[t as usize] = false;
                vanished.push(t);
            } else {
                triangle.iter_mut().filter(|v| **v == blue).for_each(|v| *v = red);
                self.incident[red as usize].push(t);
            }
        }
        vanished.sort_unstable();
        vanished
    }
}

impl Replay {
    /// The forest of the paper's levels, each one kept.
    pub fn forest(&self) -> Forest {
        let mut parents = vec![NO_REPRESENTATIVE; self.vertex_levels.len()];
        self.collapses.iter().for_each(|c| parents[c.blue as usize] = c.red);
        let levels = self.vertex_levels.iter().map(|l| l - 1).collect();
        Forest { parents, levels, level_count: self.top }
    }

    /// As [`Self::forest`], consecutive levels merged: `last[k]` is the highest of the paper's levels (1 …) that merged level
    /// `k` holds; levels above the last entry become the coarsest. Any cut is consistent (A.8, D.5).
    pub fn merged(&self, last: &[u32]) -> Forest {
        let mut forest = self.forest();
        let merged = |level: u32| last.partition_point(|&l| l < level) as u32;
        forest.levels = self.vertex_levels.iter().map(|&l| merged(l)).collect();
        forest.level_count = merged(self.top) + 1;
        forest.lift_parents();
        forest
    }
}
