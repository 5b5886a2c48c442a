//! Levels as plain arrays: what JavaScript, files and tests get. Vertices that moved appear once, at their last place.

use crate::forest::{ancestor_below, compress};
use crate::{IndexedMesh, MeshError, ProgressiveMultilevelMesh, Vertices};

impl ProgressiveMultilevelMesh {
    /// The mesh of level `x` as arrays, fractional levels morphed as the shader does. Degenerate triangles are left out.
    /// O(vertices that have arrived + triangles of the level).
    pub fn mesh_at(&self, x: f64) -> Result<IndexedMesh, MeshError> {
        let prefix = self.prefix_of(x)?;
        let triangles = self.triangles_at(x.floor() as u32)?;
        let mut vertices = self.vertices.select(0..prefix.vertex_count);
        if prefix.fraction > 0.0 {
            let (first, t) = (prefix.coarse_vertex_count, prefix.fraction);
            let coarse = compress(&self.parents[..prefix.vertex_count as usize], first);
            mix_all(&mut vertices, &coarse, first as usize, t);
        }
        Ok(self.without_superseded(vertices, triangles))
    }

    /// The mesh as far as its levels have arrived, with every vertex (isolated ones too) and every triangle (degenerate
    /// ones too): at the end of a lossless stream, the input. O(n).
    pub fn finest_mesh(&self) -> IndexedMesh {
        let Some(end) = self.ends.last() else { return Default::default() };
        let resolve = |v: u32| ancestor_below(&self.parents, v, end.vertices);
        let finest = self.finest_level();
        let there = (0..end.triangles).filter(|&t| !self.is_retired_at(t, finest));
        let triangles = there.map(|t| self.triangles[t as usize].map(resolve)).collect();
        self.without_superseded(self.vertices.select(0..end.vertices), triangles)
    }

    /// As [`Self::finest_mesh`], with what has arrived of the next level: the mesh as if that ended here. Whether this is a whole
    /// surface depends on how parts are cut. Not for levels that replace what was there: then the finest whole level. O(n).
    pub fn newest_mesh(&self) -> IndexedMesh {
        if self.has_retired() || self.has_pending_vertices() {
            return self.finest_mesh();
        }
        self.without_superseded(self.vertices.clone(), self.triangles.clone())
    }
    /// True if a part of the next level has arrived.
    pub fn has_open_level(&self) -> bool {
        self.vertices.len() as u32 > self.level_start()
    }

    /// Numbers the vertices as the outside does, each version of one vertex by the newest that is here.
    fn without_superseded(&self, vertices: Vertices, triangles: Vec<[u32; 3]>) -> IndexedMesh {
        let count = vertices.len() as u32;
        let seams = self.seams.iter().copied().filter(|s| s.0 < count);
        let (vertices, triangles, mut position_of) = match &self.versions {
            None => (vertices, triangles, seams.collect::<Vec<_>>()),
            Some(map) => (
                vertices.select(map.newest_below(count)),
                triangles.iter().map(|t| t.map(|v| map.logical(v))).collect(),
                seams.map(|(v, p)| (map.logical(v), map.logical(p))).collect(),
            ),
        };
        // A stream may move one side of a seam alone, or morph the two from different places: then the seam is open at this level.
        position_of.retain(|&(v, p)| vertices.positions[v as usize] == vertices.positions[p as usize]);
        IndexedMesh { vertices, triangles, position_of }
    }
}

fn mix_all(vertices: &mut Vertices, coarse: &[u32], first: usize, t: f32) {
    mix(&mut vertices.positions, coarse, first, t);
    mix(&mut vertices.attributes.normals, coarse, first, t);
    mix(&mut vertices.attributes.colors, coarse, first, t);
    mix(&mut vertices.attributes.texcoords, coarse, first, t);
}

/// Moves entry `first + i` towards entry `coarse[i]` by `t`. Representatives are not moved themselves: they lie below `first`.
fn mix<const N: usize>(values: &mut [[f32; N]], coarse: &[u32], first: usize, t: f32) {
    if values.is_empty() {
        return;
    }
    for (i, &r) in coarse.iter().enumerate() {
        let (own, other) = (values[first + i], values[r as usize]);
        values[first + i] = std::array::from_fn(|k| own[k] + (other[k] - own[k]) * t);
    }
}

#[cfg(test)]
mod tests {
    use crate::{IndexedMesh, Level, MovedVertices, ProgressiveMultilevelMesh, Vertices};

    fn at(positions: &[[f32; 3]]) -> Vertices {
        Vertices { positions: positions.to_vec(), ..Default::default() }
    }

    #[test]
    fn a_seam_that_is_pulled_apart_is_no_seam() {
        let base = Level {
            vertices: at(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]]),
            triangles: vec![[0, 1, 2], [3, 2, 1]],
            position_of: vec![(3, 0)],
            ..Default::default()
        };
        let one_side = MovedVertices { ids: vec![0], values: at(&[[0.0, 0.0, 1.0]]) };
        let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
        mesh.add_level(&base).expect("a base");
        mesh.add_level(&Level { moved: one_side, ..Default::default() }).expect("a move");
        let seams = |m: &IndexedMesh| m.check().map(|()| m.position_of.clone());
        assert_eq!(seams(&mesh.mesh_at(1.0).expect("the coarsest")), Ok(vec![(3, 0)]));
        assert_eq!(seams(&mesh.mesh_at(0.5).expect("between")), Ok(vec![]));
        assert_eq!(seams(&mesh.finest_mesh()), Ok(vec![]));
    }
}
