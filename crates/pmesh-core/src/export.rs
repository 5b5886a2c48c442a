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
    /// surface depends on how parts are cut. Not for levels that move or replace what was there: then the finest whole level.
    pub fn newest_mesh(&self) -> IndexedMesh {
        if self.has_moves() || self.has_retired() || self.has_pending_vertices() {
            return self.finest_mesh();
        }
        let position_of = self.seams.clone();
        IndexedMesh { vertices: self.vertices.clone(), triangles: self.triangles.clone(), position_of }
    }
    /// True if a part of the next level has arrived.
    pub fn has_open_level(&self) -> bool {
        self.vertices.len() as u32 > self.level_start()
    }

    /// Numbers the vertices as the outside does, each version of one vertex by the newest that is here.
    fn without_superseded(&self, vertices: Vertices, triangles: Vec<[u32; 3]>) -> IndexedMesh {
        let count = vertices.len() as u32;
        let seams = self.seams.iter().copied().filter(|s| s.0 < count);
        let Some(map) = &self.versions else {
            return IndexedMesh { vertices, triangles, position_of: seams.collect() };
        };
        let newest = map.newest_below(count);
        IndexedMesh {
            vertices: vertices.select(newest.iter().copied()),
            triangles: triangles.iter().map(|t| t.map(|v| map.logical(v))).collect(),
            position_of: seams.map(|(v, p)| (map.logical(v), map.logical(p))).collect(),
        }
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
