//! Patches to bytes. The encoder refines as the decoder will, so that both number everything alike.

use super::base::{BaseCoder, BaseTruth};
use super::item_limit;
use super::level::{LevelCoder, LevelModel, LevelTruth, predict};
use super::rows::Rows;
use super::surface::{CanonicalOrder, NONE, Surface};
use crate::pmesh::channels::{Channels, Quantisation};
use crate::pmesh::header::{Block, BlockKind, Container, Header};
use crate::pmesh::{mime_code, texture_place};
use crate::range::Encoder;
use crate::{EncodeError, Texture};
use pmesh_core::{IndexedMesh, Vertices, turned};
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
    let misfit = |found: &'static str| {
        let expected = "patches that fit the mesh: build the levels anew";
        EncodeError::BadOption { what: "a level", got: found.into(), expected }
    };
    let mesh = &stream.mesh;
    let set = mesh.vertices.set();
    let grids = Quantisation::fit(&mesh.vertices, position_bits);
    let channels = Channels::new(set, grids);
    let mut source = Rows { width: channels.count(), values: Vec::new() };
    (0..mesh.vertices.len()).for_each(|i| channels.row(&mesh.vertices, i, &mut source.values));
    let mut blocks = Vec::new();
    let mut payloads = Vec::new();
    let mut report = PatchReport::default();
    // The base.
    let removed: u32 = stream.levels.iter().map(|l| l.removed.len() as u32).sum();
    let mut used = vec![false; mesh.vertices.len()];
    stream.base_triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let loose: Vec<u32> = (0..used.len() as u32).filter(|&v| !used[v as usize]).collect();
    let loose_count = loose.len() as u32 - removed;
    let (base_vertices, base_triangles) = (used.len() as u32 - loose.len() as u32, stream.base_triangles.len() as u32);
    let mut position_of = vec![NONE; mesh.vertices.len()];
    mesh.position_of.iter().for_each(|&(v, p)| position_of[v as usize] = p);
    let has_seams = !mesh.position_of.is_empty();
    let mut truth = BaseTruth::new(&source, &stream.base_triangles, &position_of);
    // Vertices of levels are not the base's, and those of no triangle come last.
    loose.iter().for_each(|&v| truth.coded[v as usize] = NONE - 1);
    let mut base = BaseCoder::new(base_vertices, base_triangles, source.width, has_seams);
    let mut rows = Rows { width: source.width, values: Vec::new() };
    let mut coder = Encoder::new();
    while !base.step(&mut coder, &mut rows, Some(&mut truth), usize::MAX).map_err(misfit)? {}
    let payload = coder.finish();
    report.base = (base_vertices, base_triangles, payload.len());
    push_block(&mut blocks, &mut payloads, payload, (base_vertices, base_triangles), stream.errors.first());
    let mut vertex_order = std::mem::take(&mut truth.vertex_order);
    let mut coded = vec![NONE; mesh.vertices.len()];
    vertex_order.iter().enumerate().for_each(|(new, &old)| coded[old as usize] = new as u32);
    let mut surface = Surface::new(base.triangles, base_vertices);
    let mut model = LevelModel::new(source.width);
    for (i, level) in stream.levels.iter().enumerate() {
        let vertex = patches(&surface, level, &coded).ok_or("no triangle").map_err(misfit)?;
        report.color_bits += 2 * vertex.len() as u64;
        report.patch_bits += 2 * vertex.iter().filter(|&&v| v != NONE).count() as u64;
        let outer = best_outer(&surface, &rows, &source, &vertex);
        let count = level.removed.len() as u32;
        let mut truth = LevelTruth { vertex: &vertex, rows: &source, vertex_order: &mut vertex_order };
        let (mut coder, mut patch_bytes) = (Encoder::new(), 0);
        let mut levels = LevelCoder::new(count, outer);
        let mut inserted = Vec::new();
        let both = &mut (&mut surface, &mut rows);
        while !levels
            .step(&mut coder, &mut model, (both.0, both.1), Some(&mut truth), usize::MAX, &mut inserted)
            .map_err(misfit)?
        {
            if patch_bytes == 0 && levels.patches_are_coded() {
                patch_bytes = coder.byte_count();
            }
        }
        report.connectivity += patch_bytes;
        inserted.iter().for_each(|v| coded[vertex_order[v.vertex as usize] as usize] = v.vertex);
        let payload = [vec![outer as u8], coder.finish()].concat();
        report.removed.0 += count;
        report.removed.1 += payload.len();
        push_block(&mut blocks, &mut payloads, payload, (count, 2 * count), stream.errors.get(i + 1));
    }
    if loose_count > 0 {
        let in_levels: HashSet<u32> = stream.levels.iter().flat_map(|l| &l.removed).map(|r| r.vertex).collect();
        loose.iter().filter(|v| !in_levels.contains(v)).for_each(|&v| truth.coded[v as usize] = NONE);
        let mut coder = Encoder::new();
        let mut rest = BaseCoder::new(rows.count() + loose_count, 0, rows.width, has_seams);
        while !rest.step(&mut coder, &mut rows, Some(&mut truth), usize::MAX).map_err(misfit)? {}
        let payload = coder.finish();
        report.loose = (loose_count, payload.len());
        push_block(&mut blocks, &mut payloads, payload, (loose_count, 0), Some(&0.0));
    }
    if let Some(texture) = &stream.texture {
        let at = texture_place(&payloads, texture.bytes.len());
        let payload = [&[mime_code(&texture.mime)?], &texture.bytes[..]].concat();
        let block = Block {
            kind: BlockKind::Texture,
            byte_count: payload.len() as u32,
            checksum: crc32fast::hash(&payload),
            new_vertices: 0,
            new_triangles: 0,
            error: 0.0,
        };
        blocks.insert(at, block);
        payloads.insert(at, payload);
    }
    if blocks.len() > crate::pmesh::BLOCK_LIMIT {
        let expected = "at most 64 levels, the texture counted";
        return Err(EncodeError::BadOption { what: "the number of levels", got: blocks.len().to_string(), expected });
    }
    let bounds = bounds(&rows, &channels);
    let mut header = Header { container: Container::Patches, file_id: 0, attribute_set: set, has_seams, grids, bounds, blocks };
    let total: u64 = payloads.iter().map(|p| p.len() as u64).sum();
    header.file_id = u64::from(crc32fast::hash(&header.to_bytes())) << 32 | (total & 0xffff_ffff);
    out.write_all(&header.to_bytes())?;
    payloads.iter().try_for_each(|p| out.write_all(p))?;
    Ok(report)
}

fn bounds(rows: &Rows, channels: &Channels) -> ([f32; 3], [f32; 3]) {
    let mut vertices = Vertices::default();
    (0..rows.count()).for_each(|v| channels.push(rows.row(v), &mut vertices));
    IndexedMesh { vertices, ..Default::default() }.bounds()
}

fn push_block(blocks: &mut Vec<Block>, payloads: &mut Vec<Vec<u8>>, mut payload: Vec<u8>, new: (u32, u32), error: Option<&f32>) {
    // What packs better than a decoder believes is filled up.
    while item_limit(payload.len() as u32) < u64::from(new.0.max(new.1)) {
        payload.resize(payload.len() + (payload.len() / 2).max(64), 0);
    }
    blocks.push(Block {
        kind: BlockKind::Level,
        byte_count: payload.len() as u32,
        checksum: crc32fast::hash(&payload),
        new_vertices: new.0,
        new_triangles: new.1,
        error: error.copied().unwrap_or(0.0),
    });
    payloads.push(payload);
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
        let residual = |&(v, ref fan): &(u32, super::surface::Fan)| {
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
