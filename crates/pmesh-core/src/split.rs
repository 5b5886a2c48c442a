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
        if self.versions.is_some() || self.has_retired() {
            return None;
        }
        let ends: Vec<_> = self.ends.iter().map(|e| (e.vertices, e.triangles)).collect();
        Some(split_levels(&self.vertices, &self.parents, &self.triangles, &self.seams, &ends))
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
