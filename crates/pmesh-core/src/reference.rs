//! The slow, obviously right way to select a level, which tests hold the fast ones against. Not for use elsewhere.

use crate::forest::ancestor_below;
use crate::{MeshError, ProgressiveMultilevelMesh};

/// Triangles of level `level` by walking every corner up the forest (A.9d), degenerate ones left out. O(corners × depth).
pub fn triangles_at(mesh: &ProgressiveMultilevelMesh, level: u32) -> Result<Vec<[u32; 3]>, MeshError> {
    let (vertices, triangles) = (mesh.vertex_end(level)?, mesh.triangle_end(level)?);
    let parents = mesh.representatives();
    let resolve = |t: &[u32; 3]| t.map(|v| ancestor_below(parents, v, vertices));
    let there = (0..triangles).filter(|&t| !mesh.is_retired_at(t, level)).map(|t| &mesh.triangles()[t as usize]);
    Ok(there.map(resolve).filter(|[a, b, c]| a != b && b != c && c != a).collect())
}

/// Position of one corner at level `x`, by the definition of a geomorph (DESIGN: `mix(own, representative, fract)`).
pub fn corner_position(mesh: &ProgressiveMultilevelMesh, vertex: u32, x: f64) -> Result<[f32; 3], MeshError> {
    let prefix = mesh.prefix_of(x)?;
    let parents = mesh.representatives();
    let fine = ancestor_below(parents, vertex, prefix.vertex_count);
    let coarse = ancestor_below(parents, fine, prefix.coarse_vertex_count);
    let (p, q) = (mesh.vertices().positions[fine as usize], mesh.vertices().positions[coarse as usize]);
    Ok(std::array::from_fn(|k| p[k] + (q[k] - p[k]) * prefix.fraction))
}
