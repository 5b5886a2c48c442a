//! Levels of collapses to bytes. The encoder refines as the decoder will, so that both number everything alike.

use super::center::Side;
use super::level::{LevelCoder, LevelModel, Spent};
use super::site::Memory;
use super::truth::{LevelTruth, Splits};
use crate::pmesh::channels::Quantisation;
use crate::pmesh::header::{Container, SHIFT_LIMIT};
use crate::pmesh::varint::put;
use crate::range::Encoder;
use crate::refine::encode::{Writer, misfit};
use crate::{EncodeError, Texture};
use pmesh_core::IndexedMesh;
use pmesh_core::surface::{NONE, Surface};
use std::io::Write;

/// A vertex that a coarser level lacks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Removed {
    /// The vertex.
    pub vertex: u32,
    /// The neighbour that stands for it.
    pub apex: u32,
    /// Where its triangles lie among those of the apex.
    pub side: Side,
    /// Its other neighbours, counter-clockwise.
    pub chain: Vec<u32>,
}

/// A mesh and how it is taken apart.
#[derive(Clone, Debug, Default)]
pub struct CompactStream {
    /// The finest mesh.
    pub mesh: IndexedMesh,
    /// Triangles of the base mesh, in the finest mesh's vertices.
    pub base_triangles: Vec<[u32; 3]>,
    /// Levels after the base, coarsest first; in each no two vertices are neighbours.
    pub levels: Vec<Vec<Removed>>,
    /// Geometric error of each level, the base first; model units.
    pub errors: Vec<f32>,
    /// Grid steps that do for the coordinates of each level, the base first; model units. They sharpen with later levels. A level without one has all
    /// bits of its coordinates.
    pub steps: Vec<f32>,
    /// The base-colour image.
    pub texture: Option<Texture>,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompactReport {
    /// Vertices and triangles of the base mesh, and its bytes.
    pub base: (u32, u32, usize),
    /// Vertices of no triangle, and their bytes.
    pub loose: (u32, usize),
    /// Vertices of the levels, and their bytes.
    pub removed: (u32, usize),
    /// What these bytes say, in bits.
    pub spent: Spent,
}

/// The pairs of `mesh.position_of` that are seams: between vertices that triangles do not surround. Two surfaces that only touch share
/// positions, too, but each refines by itself. (vertex, earlier vertex), ascending. O(triangles).
pub fn seams(mesh: &IndexedMesh) -> Vec<(u32, u32)> {
    if mesh.position_of.is_empty() {
        return Vec::new();
    }
    let n = mesh.vertices.len();
    let surface = Surface::new(mesh.triangles.clone(), n as u32);
    let (mut count, mut degenerate) = (vec![0; n], vec![false; n]);
    for t in &mesh.triangles {
        let repeats = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        t.iter().for_each(|&v| {
            (count[v as usize], degenerate[v as usize]) = (count[v as usize] + 1, degenerate[v as usize] | repeats)
        });
    }
    let surrounded = |v: u32| {
        let start = surface.corner_of[v as usize];
        if start == NONE || degenerate[v as usize] {
            return false;
        }
        let (fan, last) = surface.around(start).fold((0, start), |(n, _), c| (n + 1, c));
        fan == count[v as usize] && surface.turn(last) != NONE
    };
    // The first vertex at each position, and of these the first that is on a seam.
    let (mut first, mut on_seam): (Vec<u32>, Vec<u32>) = ((0..n as u32).collect(), vec![NONE; n]);
    let mut out = Vec::with_capacity(mesh.position_of.len());
    for &(v, p) in &mesh.position_of {
        let root = first[p as usize];
        first[v as usize] = root;
        if on_seam[root as usize] == NONE && !surrounded(root) {
            on_seam[root as usize] = root;
        }
        if surrounded(v) {
            continue;
        }
        match on_seam[root as usize] {
            NONE => on_seam[root as usize] = v,
            p => out.push((v, p)),
        }
    }
    out
}

/// Low bits of a coordinate that a level does without, of a grid with `step`; 0 for exact floats, which have none.
fn shift(stream: &CompactStream, step: f64, level: usize) -> u32 {
    let enough = f64::from(stream.steps.get(level).copied().unwrap_or(0.0));
    (1..=u32::from(SHIFT_LIMIT)).take_while(|&s| step > 0.0 && step * f64::from(1u32 << s) <= enough).count() as u32
}

/// Writes a stream. `position_bits` as in `.pmesh`. O(n). Errors: more levels than a table holds, collapses that do not fit the
/// mesh, or a failing writer.
pub fn encode(stream: &CompactStream, position_bits: Option<u8>, out: &mut impl Write) -> Result<CompactReport, EncodeError> {
    let mut in_levels = vec![false; stream.mesh.vertices.len()];
    stream.levels.iter().flatten().for_each(|r| in_levels[r.vertex as usize] = true);
    let later = |v: u32| in_levels[v as usize];
    let base = &stream.base_triangles;
    let seams = seams(&stream.mesh);
    let step = |g: &Quantisation| g.position_bits.map_or(0.0, |_| g.position_step);
    let first = |g: &Quantisation| if stream.levels.is_empty() { 0 } else { shift(stream, step(g), 0) };
    let mut writer =
        Writer::new(Container::Compact, (&stream.mesh, &seams), position_bits, base, later, stream.errors.first(), first)?;
    let step = step(&writer.header.grids);
    let mut report = CompactReport { base: writer.base, ..Default::default() };
    let mut coded = writer.coded();
    let (mut model, mut memory) = (LevelModel::new(writer.rows.width), Memory::default());
    for (i, level) in stream.levels.iter().enumerate() {
        let mut splits = Splits::new(writer.rows.count(), level.len());
        for r in level {
            let chain = (r.chain.first().map_or(NONE, |&v| coded[v as usize]), r.chain.len() as u32);
            splits.add(coded[r.apex as usize], (r.vertex, r.side), chain).map_err(misfit)?;
        }
        let count = level.len() as u32;
        let before = writer.rows.count();
        let triangles = writer.surface.triangles.len();
        let mut truth = LevelTruth {
            splits: &mut splits,
            rows: &writer.source,
            shift: if i + 1 < stream.levels.len() { shift(stream, step, i + 1) } else { 0 },
            vertex_order: &mut writer.vertex_order,
            position_of: &writer.position_of,
        };
        let (mut coder, mut levels, mut part) = (Encoder::new(), LevelCoder::new(count, count.into(), 0), Default::default());
        let (surface, rows) = (&mut writer.surface, &mut writer.rows);
        while !levels
            .step(&mut coder, (&mut model, &mut memory), (&mut *surface, &mut *rows), Some(&mut truth), usize::MAX, &mut part)
            .map_err(misfit)?
        {}
        for v in before..writer.rows.count() {
            coded[writer.vertex_order[v as usize] as usize] = v;
        }
        let mut payload = Vec::new();
        put(&mut payload, levels.reach as u32);
        payload.extend(coder.finish());
        report.spent = report.spent.plus(levels.spent);
        report.removed.0 += count;
        report.removed.1 += payload.len();
        let triangles = (writer.surface.triangles.len() - triangles) as u32;
        writer.level_of(count, triangles, payload, stream.errors.get(i + 1));
    }
    report.loose = writer.finish(stream.texture.as_ref(), out)?;
    Ok(report)
}
