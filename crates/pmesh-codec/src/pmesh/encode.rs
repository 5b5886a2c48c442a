//! Levels to a `.pmesh` file. Deterministic; memory: the file and one level beside the levels given.

use super::channels::{Channels, Quantisation};
use super::header::{Block, BlockKind, Header};
use super::records::{Model, Refinement};
use super::{BLOCK_LIMIT, inflate_limit, varint};
use crate::{EncodeError, Texture};
use flate2::{Compression, write::DeflateEncoder};
use pmesh_core::{AttributeSet, CornerMove, Level};
use std::io::Write;

/// Levels on their way to a file, coarsest first, split-coded as `ProgressiveMultilevelMesh::to_levels` gives them.
#[derive(Clone, Debug, Default)]
pub struct LevelStream {
    /// Attributes of the vertices.
    pub attribute_set: AttributeSet,
    /// The levels.
    pub levels: Vec<Level>,
    /// Geometric error of each level, model units; as long as `levels`.
    pub errors: Vec<f32>,
    /// The base-colour image.
    pub texture: Option<Texture>,
}

/// How to encode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EncodeOptions {
    /// Bits a coordinate, 8 to 16; `None` keeps every float bit for bit.
    pub position_bits: Option<u8>,
}

/// Writes a `.pmesh` file of version 0. O(n).
pub fn encode(stream: &LevelStream, options: EncodeOptions, out: &mut impl Write) -> Result<(), EncodeError> {
    check(stream, options)?;
    let mut all = pmesh_core::Vertices::default();
    stream.levels.iter().for_each(|l| all.extend_from(&l.vertices));
    let finest = finest_positions(stream, &all);
    let grids = Quantisation::fit(&finest, options.position_bits);
    let has_seams = stream.levels.iter().any(|l| !l.position_of.is_empty());
    let channels = Channels::new(stream.attribute_set, grids);
    let mut model = Model::new(channels.count(), has_seams);
    let mut places = Vec::new();
    let mut payloads = Vec::new();
    let mut blocks = Vec::new();
    for (level, &error) in stream.levels.iter().zip(&stream.errors) {
        let payload = deflate(&pack(level, &channels, &mut model, &mut places))?;
        let (v, t) = (level.vertices.len() as u32, level.triangles.len() as u32);
        let (byte_count, checksum) = (payload.len() as u32, crc32fast::hash(&payload));
        blocks.push(Block { kind: BlockKind::Level, byte_count, checksum, new_vertices: v, new_triangles: t, error });
        payloads.push(payload);
    }
    if let Some(texture) = &stream.texture {
        super::texture::insert(texture, &mut blocks, &mut payloads)?;
    }
    let bounds = pmesh_core::IndexedMesh { vertices: finest, ..Default::default() }.bounds();
    let mut header = Header {
        container: Default::default(),
        file_id: 0,
        attribute_set: stream.attribute_set,
        has_seams,
        grids,
        base_shift: 0,
        bounds,
        blocks,
    };
    let content = crc32fast::hash(&header.to_bytes());
    let total: u64 = payloads.iter().map(|p| p.len() as u64).sum();
    header.file_id = u64::from(content) << 32 | (total & 0xffff_ffff);
    out.write_all(&header.to_bytes())?;
    payloads.iter().try_for_each(|p| out.write_all(p))?;
    Ok(())
}

fn check(stream: &LevelStream, options: EncodeOptions) -> Result<(), EncodeError> {
    let blocks = stream.levels.len() + usize::from(stream.texture.is_some());
    if blocks > BLOCK_LIMIT || stream.levels.is_empty() || stream.errors.len() != stream.levels.len() {
        let got = format!("{blocks} with {} errors", stream.errors.len());
        let expected = "1 to 64 levels (63 with a texture), an error each: merge levels first";
        return Err(EncodeError::BadOption { what: "the number of levels", got, expected });
    }
    check_precision(options.position_bits)
}

/// What a header can say, and every decoder takes.
pub(crate) fn check_precision(position_bits: Option<u8>) -> Result<(), EncodeError> {
    match position_bits {
        Some(b) if !(8..=16).contains(&b) => Err(EncodeError::BadOption {
            what: "bits a coordinate",
            got: b.to_string(),
            expected: "8 to 16, or none for exact floats",
        }),
        _ => Ok(()),
    }
}

/// Vertices with those that move at their last place: what the grid and the bounding box are made for.
fn finest_positions(stream: &LevelStream, all: &pmesh_core::Vertices) -> pmesh_core::Vertices {
    let mut finest = all.clone();
    for level in &stream.levels {
        for (&v, p) in level.moved.ids.iter().zip(&level.moved.values.positions) {
            finest.positions[v as usize] = *p;
        }
    }
    finest
}

fn deflate(bytes: &[u8]) -> Result<Vec<u8>, EncodeError> {
    let with = |level| {
        let mut encoder = DeflateEncoder::new(Vec::new(), level);
        encoder.write_all(bytes).and_then(|()| encoder.finish())
    };
    let small = with(Compression::best())?;
    // What shrinks further than a decoder lets it grow (a triangle repeated a hundred thousand times) is stored as it is.
    if bytes.len() as u64 > inflate_limit(small.len() as u64) { Ok(with(Compression::none())?) } else { Ok(small) }
}

/// Where a triangle of the stream lies in the file: its index there, and how far its corners are turned.
struct Place {
    index: u32,
    turn: u8,
}

/// Packs a level. Triangles follow the vertex that completes them, turned so that it leads; `places` remembers that for
/// the corner moves of later levels.
fn pack(level: &Level, channels: &Channels, model: &mut Model, places: &mut Vec<Place>) -> Vec<u8> {
    model.begin_level();
    let start = model.vertex_count();
    let mut refinements = vec![Refinement::default(); level.vertices.len()];
    for (i, r) in refinements.iter_mut().enumerate() {
        channels.row(&level.vertices, i, &mut r.row);
    }
    let at = |v: u32| (v - start) as usize;
    for &(v, p) in &level.representatives {
        refinements[at(v)].representative = Some(p);
    }
    for &(v, p) in &level.position_of {
        refinements[at(v)].position_of = Some(p);
    }
    for m in &level.corner_moves {
        let place = &places[m.triangle as usize];
        let corner = (m.corner + 3 - place.turn) % 3;
        refinements[at(m.vertex)].corner_moves.push(CornerMove { triangle: place.index, corner, vertex: m.vertex });
    }
    // Sorted by the vertex that completes them; those that no new vertex completes come last.
    let leader = |t: &[u32; 3]| t.iter().copied().max().filter(|&v| v >= start).unwrap_or(u32::MAX);
    let first = places.len();
    let mut order: Vec<usize> = (0..level.triangles.len()).collect();
    order.sort_by_key(|&i| leader(&level.triangles[i]));
    places.extend(level.triangles.iter().map(|_| Place { index: 0, turn: 0 }));
    let mut rest = Vec::new();
    for (k, &i) in order.iter().enumerate() {
        let t = level.triangles[i];
        let lead = leader(&t);
        let turn = t.iter().position(|&v| v == lead).unwrap_or(0);
        let turned = [t[turn], t[(turn + 1) % 3], t[(turn + 2) % 3]];
        places[first + i] = Place { index: (first + k) as u32, turn: turn as u8 };
        if lead == u32::MAX { rest.push(turned) } else { refinements[at(lead)].triangles.push(turned) }
    }
    let mut out = Vec::new();
    for r in &refinements {
        model.write(r, &mut out);
    }
    let mut row = Vec::new();
    let rows = level.moved.ids.iter().enumerate().map(|(i, &v)| {
        row.clear();
        channels.row(&level.moved.values, i, &mut row);
        (v, row.clone())
    });
    // A move below the grid's step is none.
    let mut moved: Vec<_> = rows.filter(|(v, row)| model.row(*v) != &row[..]).collect();
    moved.sort_unstable();
    model.write_tail(&rest, &moved, &mut out);
    // A last zero byte, so that a decoder knows the end of the level before the inflater says so.
    varint::put(&mut out, 0);
    out
}
