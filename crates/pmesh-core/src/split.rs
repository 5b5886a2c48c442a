//! From the structure back to levels: the same refinements as batches, whatever style they arrived in.

use crate::forest::{NO_REPRESENTATIVE, ancestor_below};
use crate::{AttributeSet, CornerMove, Level, MeshError, ProgressiveMultilevelMesh, Vertices};

impl ProgressiveMultilevelMesh {
    /// A mesh from arrays in level order: `parents` lower and of earlier levels, `triangles` with their finest indices,
    /// `ends` the (vertices, triangles) of each level, coarsest first. O(n). Errors as `add_level`.
    pub fn from_arrays(
        vertices: &Vertices,
        parents: &[u32],
        triangles: &[[u32; 3]],
        position_of: &[(u32, u32)],
        ends: &[(u32, u32)],
    ) -> Result<Self, MeshError> {
        let set: AttributeSet = vertices.set();
        let mut mesh = Self::new(set);
        for level in split_levels(vertices, parents, triangles, position_of, ends) {
            mesh.add_level(&level)?;
        }
        mesh.declare_level_count(ends.len() as u32);
        mesh.shrink_to_fit();
        Ok(mesh)
    }

    /// The levels that make this mesh, coarsest first, split-coded: triangles at the vertices present, corners moved
    /// later. `None` if vertices move between levels (their versions are not a plain forest) or triangles are replaced. O(corners × levels they pass).
    pub fn to_levels(&self) -> Option<Vec<Level>> {
        if self.versions.is_some() { None } else { self.settled_levels() }
    }

    /// As [`Self::to_levels`], but vertices that move stand at every level where the newest has them. `None` if triangles are replaced.
    pub fn settled_levels(&self) -> Option<Vec<Level>> {
        if self.has_retired() {
            return None;
        }
        let ends: Vec<_> = self.ends.iter().map(|e| (e.vertices - e.superseded, e.triangles)).collect();
        let Some(map) = &self.versions else {
            return Some(split_levels(&self.vertices, &self.parents, &self.triangles, &self.seams, &ends));
        };
        let whole = self.finest_mesh();
        let root = |v: u32| if v == NO_REPRESENTATIVE { v } else { map.logical(v) };
        // A vertex stands for others from its first version on; of a later one the representative is itself.
        let (mut parents, count) = (Vec::with_capacity(whole.vertices.len()), self.level_start());
        for (entry, &parent) in self.parents.iter().enumerate().take(count as usize) {
            if map.logical(entry as u32) as usize == parents.len() {
                parents.push(root(parent));
            }
        }
        Some(split_levels(&whole.vertices, &parents, &whole.triangles, &whole.position_of, &ends))
    }
}

/// Cuts arrays in level order into levels: see [`ProgressiveMultilevelMesh::from_arrays`].
pub fn split_levels(
    vertices: &Vertices,
    parents: &[u32],
    triangles: &[[u32; 3]],
    position_of: &[(u32, u32)],
    ends: &[(u32, u32)],
) -> Vec<Level> {
    let step_of = |v: u32| ends.partition_point(|e| e.0 <= v);
    let mut levels = vec![Level::default(); ends.len()];
    let mut seams = position_of.iter().copied().peekable();
    let (mut first_vertex, mut first_triangle) = (0, 0);
    for (step, &(vertex_end, triangle_end)) in ends.iter().enumerate() {
        levels[step].vertices = vertices.select(first_vertex..vertex_end);
        let named = (first_vertex..vertex_end).map(|v| (v, parents[v as usize]));
        levels[step].representatives = named.filter(|p| p.1 != NO_REPRESENTATIVE).collect();
        while let Some(seam) = seams.next_if(|s| s.0 < vertex_end) {
            levels[step].position_of.push(seam);
        }
        for t in first_triangle..triangle_end {
            let finest = triangles[t as usize];
            levels[step].triangles.push(finest.map(|v| ancestor_below(parents, v, vertex_end)));
            for (corner, mut v) in finest.into_iter().enumerate() {
                while v >= vertex_end {
                    let corner_move = CornerMove { triangle: t, corner: corner as u8, vertex: v };
                    levels[step_of(v)].corner_moves.push(corner_move);
                    v = parents[v as usize];
                    if v == NO_REPRESENTATIVE {
                        break;
                    }
                }
            }
        }
        (first_vertex, first_triangle) = (vertex_end, triangle_end);
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MovedVertices;

    fn at(positions: &[[f32; 3]]) -> Vertices {
        Vertices { positions: positions.to_vec(), ..Default::default() }
    }

    #[test]
    fn levels_whose_vertices_move_can_be_had_with_vertices_that_stay() {
        let base = Level {
            vertices: at(&[[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0; 3], [9.0, 9.0, 9.0]]),
            triangles: vec![[0, 1, 2], [3, 2, 4]],
            position_of: vec![(3, 0)],
            ..Default::default()
        };
        let corner = |triangle, corner, vertex| CornerMove { triangle, corner, vertex };
        let second = Level {
            vertices: at(&[[5.0, 5.0, 0.0]]),
            triangles: vec![[5, 1, 0]],
            representatives: vec![(5, 1)],
            corner_moves: vec![corner(0, 1, 5)],
            moved: MovedVertices { ids: vec![3, 1, 0], values: at(&[[1.0; 3], [8.0, 0.0, 0.0], [1.0; 3]]) },
            ..Default::default()
        };
        let third = Level {
            vertices: at(&[[6.0, 6.0, 1.0]]),
            triangles: vec![[6, 5, 1]],
            representatives: vec![(6, 5)],
            corner_moves: vec![corner(2, 0, 6)],
            moved: MovedVertices { ids: vec![1], values: at(&[[7.0, 0.0, 0.0]]) },
            ..Default::default()
        };
        let mut mesh = ProgressiveMultilevelMesh::new(AttributeSet::default());
        for level in [base, second, third] {
            mesh.add_level(&level).expect("it is good");
        }
        assert_eq!(mesh.to_levels(), None);
        let levels = mesh.settled_levels().expect("nothing is replaced");
        let mut settled = ProgressiveMultilevelMesh::new(AttributeSet::default());
        for level in &levels {
            assert!(level.moved.ids.is_empty());
            settled.add_level(level).expect("it is good");
        }
        assert_eq!(settled.finest_mesh(), mesh.finest_mesh());
        assert_eq!(settled.finest_mesh().position_of, vec![(3, 0)]);
        for level in 0..3 {
            assert_eq!(settled.vertex_count(level), mesh.vertex_count(level));
            let corners = |m: &ProgressiveMultilevelMesh| m.mesh_at(level.into()).map(|m| m.triangles);
            assert_eq!(corners(&settled), corners(&mesh), "level {level}");
        }
        assert_eq!(settled.to_levels(), Some(levels));
    }
}
