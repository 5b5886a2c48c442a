//! From a forest to levels: orders vertices and triangles coarsest first (A.9a), which is all that a level is.

use crate::BuildError;
use pmesh_core::forest::NO_REPRESENTATIVE;
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh, split_levels, turned};

/// A parent and a level for each vertex of a mesh; 0 is the finest. A parent's level is higher than its child's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forest {
    /// Representative of each vertex, or [`NO_REPRESENTATIVE`].
    pub parents: Vec<u32>,
    /// Level of each vertex: it is there from this level down.
    pub levels: Vec<u32>,
    /// `L`.
    pub level_count: u32,
}

impl Forest {
    /// Every parent replaced by its first ancestor of a higher level: after merging levels a parent may have its child's.
    pub fn lift_parents(&mut self) {
        let order = self.top_down();
        for v in order {
            let mut p = self.parents[v];
            // Parents come before in `order`, so theirs is lifted already: one step is enough.
            if p != NO_REPRESENTATIVE && self.levels[p as usize] <= self.levels[v] {
                p = self.parents[p as usize];
                self.parents[v] = p;
            }
            debug_assert!(p == NO_REPRESENTATIVE || self.levels[p as usize] > self.levels[v]);
        }
    }

    /// Vertices so that each comes after its parent. O(n).
    fn top_down(&self) -> Vec<usize> {
        let n = self.parents.len();
        let mut order = Vec::with_capacity(n);
        let mut done = vec![false; n];
        let mut chain = Vec::new();
        for start in 0..n {
            let mut v = start;
            while !done[v] {
                done[v] = true;
                chain.push(v);
                match self.parents[v] {
                    NO_REPRESENTATIVE => break,
                    p => v = p as usize,
                }
            }
            order.extend(chain.drain(..).rev());
        }
        order
    }
}

/// A mesh in level order.
pub struct Arranged {
    /// The structure, without moved vertices.
    pub mesh: ProgressiveMultilevelMesh,
    /// New index of each vertex of the input.
    pub vertex_order: Vec<u32>,
    /// Its levels, coarsest first.
    pub levels: Vec<pmesh_core::Level>,
}

/// Orders `mesh` by `forest`. O(n log n + corners × chain).
///
/// A triangle belongs to the level at which its three corners become distinct (A.11); index-degenerate triangles and all
/// but the first of equal ones to level 0.
pub fn arrange(mesh: &IndexedMesh, forest: &Forest) -> Result<Arranged, BuildError> {
    mesh.check()?;
    let vertex_order = order_vertices(forest);
    let n = vertex_order.len();
    let mut old_of_new = vec![0u32; n];
    vertex_order.iter().enumerate().for_each(|(old, &new)| old_of_new[new as usize] = old as u32);
    let parents: Vec<u32> = old_of_new
        .iter()
        .map(|&old| match forest.parents[old as usize] {
            NO_REPRESENTATIVE => NO_REPRESENTATIVE,
            p => vertex_order[p as usize],
        })
        .collect();
    let mut triangles = level_triangles(mesh, forest, &vertex_order);
    let ends = ends(forest, &mut triangles);
    let triangles: Vec<_> = triangles.into_iter().map(|(_, t)| t).collect();
    let vertices = mesh.vertices.select(old_of_new.iter().copied());
    let seams = arrange_seams(mesh, &vertex_order);
    let levels = split_levels(&vertices, &parents, &triangles, &seams, &ends);
    let mut out = ProgressiveMultilevelMesh::new(vertices.set());
    out.declare_level_count(ends.len() as u32);
    for level in &levels {
        out.add_level(level)?;
    }
    out.shrink_to_fit();
    Ok(Arranged { mesh: out, vertex_order, levels })
}

/// By level, coarsest first; within a level by parent, so that neighbours in space are neighbours in the file.
fn order_vertices(forest: &Forest) -> Vec<u32> {
    let n = forest.parents.len();
    let mut by_level: Vec<Vec<u32>> = vec![Vec::new(); forest.level_count.max(1) as usize];
    for v in 0..n as u32 {
        by_level[forest.levels[v as usize] as usize].push(v);
    }
    let mut new = vec![NO_REPRESENTATIVE; n];
    let mut next = 0;
    for level in by_level.iter_mut().rev() {
        // Parents are of earlier levels: they have their numbers. None sorts last.
        level.sort_by_key(|&v| match forest.parents[v as usize] {
            NO_REPRESENTATIVE => (NO_REPRESENTATIVE, v),
            p => (new[p as usize], v),
        });
        for &v in level.iter() {
            new[v as usize] = next;
            next += 1;
        }
    }
    new
}

/// (level, triangle in new indices) of each triangle.
fn level_triangles(mesh: &IndexedMesh, forest: &Forest, new: &[u32]) -> Vec<(u32, [u32; 3])> {
    let duplicate = find_duplicates(&mesh.triangles);
    let level = |i: usize, t: &[u32; 3]| if duplicate[i] { 0 } else { triangle_level(forest, *t).0 };
    mesh.triangles.iter().enumerate().map(|(i, t)| (level(i, t), t.map(|v| new[v as usize]))).collect()
}

/// True for every triangle that equals an earlier one, corners turned.
fn find_duplicates(triangles: &[[u32; 3]]) -> Vec<bool> {
    let mut order: Vec<([u32; 3], u32)> = triangles.iter().enumerate().map(|(i, &t)| (turned(t), i as u32)).collect();
    order.sort_unstable();
    let mut duplicate = vec![false; triangles.len()];
    for pair in order.windows(2).filter(|w| w[0].0 == w[1].0) {
        duplicate[pair[1].1 as usize] = true;
    }
    duplicate
}

/// The coarsest level at which the three corners, each at its representative, are distinct, and those representatives;
/// 0 and the corners themselves for an index-degenerate triangle.
pub(crate) fn triangle_level(forest: &Forest, mut t: [u32; 3]) -> (u32, [u32; 3]) {
    let distinct = |[a, b, c]: [u32; 3]| a != b && b != c && c != a;
    if !distinct(t) {
        return (0, t);
    }
    loop {
        let levels = t.map(|v| forest.levels[v as usize]);
        let lowest = levels[0].min(levels[1]).min(levels[2]);
        let mut coarser = t;
        for k in 0..3 {
            if levels[k] == lowest {
                coarser[k] = forest.parents[t[k] as usize];
            }
        }
        if coarser.contains(&NO_REPRESENTATIVE) || !distinct(coarser) {
            return (lowest, t);
        }
        t = coarser;
    }
}

/// Sorts the triangles into level order and says where each level ends.
fn ends(forest: &Forest, triangles: &mut [(u32, [u32; 3])]) -> Vec<(u32, u32)> {
    triangles.sort_by_key(|&(level, t)| (u32::MAX - level, t.into_iter().max()));
    let count = forest.level_count.max(1) as usize;
    let mut per_level = vec![(0u32, 0u32); count];
    forest.levels.iter().for_each(|&l| per_level[count - 1 - l as usize].0 += 1);
    triangles.iter().for_each(|&(l, _)| per_level[count - 1 - l as usize].1 += 1);
    let mut end = (0, 0);
    for slot in &mut per_level {
        end = (end.0 + slot.0, end.1 + slot.1);
        *slot = end;
    }
    per_level
}

/// Seams in new indices: the lowest new index of each position leads.
fn arrange_seams(mesh: &IndexedMesh, new: &[u32]) -> Vec<(u32, u32)> {
    let mut leader: std::collections::HashMap<u32, u32> = std::collections::HashMap::new();
    for &(v, p) in &mesh.position_of {
        let lowest = leader.entry(p).or_insert(new[p as usize]);
        *lowest = (*lowest).min(new[v as usize]);
    }
    let members = mesh.position_of.iter().flat_map(|&(v, p)| [(new[v as usize], p), (new[p as usize], p)]);
    let mut seams: Vec<_> = members.map(|(v, p)| (v, leader[&p])).filter(|(v, l)| v != l).collect();
    seams.sort_unstable();
    seams.dedup();
    seams
}
