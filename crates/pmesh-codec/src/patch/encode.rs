//! Patches to bytes. The encoder refines as the decoder will, so that both number everything alike.

use super::level::{LevelCoder, LevelModel, LevelTruth, predict};
use crate::pmesh::header::Container;
use crate::range::Encoder;
use crate::refine::encode::{Writer, misfit};
use crate::refine::rows::Rows;
use crate::{EncodeError, Texture};
use pmesh_core::surface::{CanonicalOrder, Fan, NONE, Surface};
use pmesh_core::{IndexedMesh, turned};
use std::collections::{HashMap, HashSet};
use std::io::Write;

/// A vertex that a coarser level lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// The vertex.
    pub vertex: u32,
    /// Where all triangles of its patch meet.
    pub apex: u32,
    /// The rest of the rim, counter-clockwise: the patch is (apex, chain\[i\], chain\[i + 1\]).
    pub chain: Vec<u32>,
    /// Colour of the patch, 1 to 3; unlike that of any patch across an edge.
    pub color: u8,
}

impl Removed {
    /// The triangles of the patch; `coded` gives the surface's number of each vertex, `places` is [`Surface::places`].
    pub(crate) fn patch(&self, coded: &[u32], places: &HashMap<[u32; 3], u32>) -> Option<Vec<u32>> {
        let triangle = |w: &[u32]| places.get(&turned([self.apex, w[0], w[1]].map(|v| coded[v as usize]))).copied();
        self.chain.windows(2).map(triangle).collect()
    }
}

/// The vertices that a level adds to the one before; no two of them neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchLevel {
    /// The vertices.
    pub removed: Vec<Removed>,
}

/// A mesh and how it is taken apart.
#[derive(Clone, Debug, Default)]
pub struct PatchStream {
    /// The finest mesh.
    pub mesh: IndexedMesh,
    /// Triangles of the base mesh, in the finest mesh's vertices.
    pub base_triangles: Vec<[u32; 3]>,
    /// Levels after the base, coarsest first.
    pub levels: Vec<PatchLevel>,
    /// Geometric error of each level, the base first; model units.
    pub errors: Vec<f32>,
    /// The base-colour image.
    pub texture: Option<Texture>,
}

/// What was written, in the terms of FC01's tables.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PatchReport {
    /// Vertices and triangles of the base mesh, and its bytes.
    pub base: (u32, u32, usize),
    /// Vertices of no triangle, and their bytes.
    pub loose: (u32, usize),
    /// Vertices of the levels, and their bytes.
    pub removed: (u32, usize),
    /// Bytes of the levels that say which triangles make patches; the rest are displacements.
    pub connectivity: usize,
    /// Bits of the colours as they are, two a triangle (C.5).
    pub color_bits: u64,
    /// Of them those of triangles in patches: 2 (d - 2) a vertex of degree d.
    pub patch_bits: u64,
}

/// Writes a stream. `position_bits` as in `.pmesh`. O(n), four passes. Errors: more levels than a table holds, patches that do
/// not fit the mesh, or a failing writer.
pub fn encode(stream: &PatchStream, position_bits: Option<u8>, out: &mut impl Write) -> Result<PatchReport, EncodeError> {
    let in_levels: HashSet<u32> = stream.levels.iter().flat_map(|l| &l.removed).map(|r| r.vertex).collect();
    let later = |v| in_levels.contains(&v);
    let base = &stream.base_triangles;
    let mut writer = Writer::new(
        Container::Patches,
        (&stream.mesh, &stream.mesh.position_of),
        position_bits,
        base,
        later,
        stream.errors.first(),
        |_| 0,
    )?;
    let mut report = PatchReport { base: writer.base, ..Default::default() };
    let mut coded = writer.coded();
    let mut model = LevelModel::new(writer.rows.width);
    for (i, level) in stream.levels.iter().enumerate() {
        let vertex = patches(&writer.surface, level, &coded).ok_or("no triangle").map_err(misfit)?;
        report.color_bits += 2 * vertex.len() as u64;
        report.patch_bits += 2 * vertex.iter().filter(|&&v| v != NONE).count() as u64;
        let outer = best_outer(&writer.surface, &writer.rows, &writer.source, &vertex);
        let count = level.removed.len() as u32;
        let mut truth = LevelTruth { vertex: &vertex, rows: &writer.source, vertex_order: &mut writer.vertex_order };
        let (mut coder, mut patch_bytes) = (Encoder::new(), 0);
        let mut levels = LevelCoder::new(count, outer);
        let mut inserted = Vec::new();
        let (surface, rows) = (&mut writer.surface, &mut writer.rows);
        while !levels
            .step(&mut coder, &mut model, (&mut *surface, &mut *rows), Some(&mut truth), usize::MAX, &mut inserted)
            .map_err(misfit)?
        {
            if patch_bytes == 0 && levels.patches_are_coded() {
                patch_bytes = coder.byte_count();
            }
        }
        report.connectivity += patch_bytes;
        inserted.iter().for_each(|v| coded[writer.vertex_order[v.vertex as usize] as usize] = v.vertex);
        let payload = [vec![outer as u8], coder.finish()].concat();
        report.removed.0 += count;
        report.removed.1 += payload.len();
        writer.level(count, payload, stream.errors.get(i + 1));
    }
    report.loose = writer.finish(stream.texture.as_ref(), out)?;
    Ok(report)
}

/// For each triangle of the coarser mesh the vertex that its patch gets, or [`NONE`].
fn patches(surface: &Surface, level: &PatchLevel, coded: &[u32]) -> Option<Vec<u32>> {
    let mut vertex = vec![NONE; surface.triangles.len()];
    let places = surface.places();
    for r in &level.removed {
        for t in r.patch(coded, &places)? {
            vertex[t as usize] = r.vertex;
        }
    }
    Some(vertex)
}

/// The predictor's parameter that makes the displacements shortest, judged before any vertex is put in.
fn best_outer(surface: &Surface, rows: &Rows, source: &Rows, vertex: &[u32]) -> i64 {
    let mut patches: HashMap<u32, Vec<u32>> = HashMap::new();
    for t in CanonicalOrder::of(surface).into_iter().filter(|&t| vertex[t as usize] != NONE) {
        patches.entry(vertex[t as usize]).or_default().push(t);
    }
    let fans: Vec<_> = patches.iter().filter_map(|(&v, region)| Some((v, surface.fan(region)?))).collect();
    let cost = |outer: i64| -> u64 {
        let residual = |&(v, ref fan): &(u32, Fan)| {
            let (predicted, _) = predict(surface, rows, fan, outer);
            (0..3)
                .map(|k| (source.value(v, k) - predicted[k]).unsigned_abs())
                .map(|r| u64::from(64 - r.leading_zeros()))
                .sum::<u64>()
        };
        fans.iter().map(residual).sum()
    };
    (0..9).min_by_key(|&outer| cost(outer)).unwrap_or(0)
}
