//! The header: what the stream is, its grids, and the table of what each byte will buy. Layout in docs/FORMAT.md.

use super::channels::Quantisation;
use super::varint::{ReadError, Reader, put};
use super::{BLOCK_LIMIT, SIGNATURE, VERSION};
use crate::{DecodeError, LevelEntry, Place, StreamInfo};
use pmesh_core::AttributeSet;

/// What a block of the file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// A level.
    Level,
    /// The base-colour image, a whole file.
    Texture,
    /// A part of the base-colour image, or several, as a wavelet picture.
    Picture,
}

/// An entry of the table. Blocks follow the header in this order without gaps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// What it holds.
    pub kind: BlockKind,
    /// Its length in the file.
    pub byte_count: u32,
    /// CRC-32 of these bytes.
    pub checksum: u32,
    /// Vertices that a level adds.
    pub new_vertices: u32,
    /// Triangles that a level adds.
    pub new_triangles: u32,
    /// Geometric error of a level, model units.
    pub error: f32,
}

/// Whose file it is: the header is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Container {
    /// `.pmesh`.
    #[default]
    Pmesh,
    /// `.pits`, patch-coloured.
    Patches,
    /// `.pfs`, forest splits.
    Forest,
}

impl Container {
    fn signature(self) -> [u8; 8] {
        match self {
            Container::Pmesh => SIGNATURE,
            Container::Patches => crate::patch::SIGNATURE,
            Container::Forest => crate::split::SIGNATURE,
        }
    }
    fn extension(self) -> &'static str {
        match self {
            Container::Pmesh => ".pmesh",
            Container::Patches => ".pits",
            Container::Forest => ".pfs",
        }
    }
    fn format(self) -> &'static str {
        match self {
            Container::Pmesh => "pmesh 0",
            Container::Patches => "patch-coloured (FC01), pits 0",
            Container::Forest => "forest splits (A.31), pfs 0",
        }
    }
}

/// The header of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Whose file it is.
    pub container: Container,
    /// Identifies the content.
    pub file_id: u64,
    /// Attributes of the vertices.
    pub attribute_set: AttributeSet,
    /// True if some vertices share positions across seams.
    pub has_seams: bool,
    /// The grids.
    pub grids: Quantisation,
    /// Bounding box of the finest level.
    pub bounds: ([f32; 3], [f32; 3]),
    /// The table.
    pub blocks: Vec<Block>,
}

/// Signature, version, and the length of the whole header.
pub(crate) const PREAMBLE_BYTES: usize = 11;
/// The largest header: fixed fields and 64 table entries, with room.
const HEADER_LIMIT: usize = 4096;

impl Header {
    /// The header's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = self.container.signature().to_vec();
        out.extend([VERSION, 0, 0]);
        let (a, g) = (self.attribute_set, &self.grids);
        out.push(u8::from(a.normals) | u8::from(a.colors) << 1 | u8::from(a.texcoords) << 2 | u8::from(self.has_seams) << 3);
        out.extend([g.position_bits, g.normal_bits, g.color_bits, g.texcoord_bits].map(|b| b.unwrap_or(0)));
        out.extend(self.file_id.to_le_bytes());
        let floats = |out: &mut Vec<u8>, f: &[f32]| f.iter().for_each(|x| out.extend(x.to_le_bytes()));
        floats(&mut out, &self.bounds.0);
        floats(&mut out, &self.bounds.1);
        if g.position_bits.is_some() {
            floats(&mut out, &g.position_origin);
            out.extend(g.position_step.to_le_bytes());
        }
        if a.texcoords && g.texcoord_bits.is_some() {
            floats(&mut out, &g.texcoord_origin);
            out.extend(g.texcoord_step.to_le_bytes());
        }
        out.push(self.blocks.len() as u8);
        for b in &self.blocks {
            out.push(b.kind as u8);
            put(&mut out, b.byte_count);
            out.extend(b.checksum.to_le_bytes());
            if b.kind == BlockKind::Level {
                put(&mut out, b.new_vertices);
                put(&mut out, b.new_triangles);
                floats(&mut out, &[b.error]);
            }
        }
        let length = (out.len() + 4) as u16;
        out[9..11].copy_from_slice(&length.to_le_bytes());
        let checksum = crc32fast::hash(&out);
        out.extend(checksum.to_le_bytes());
        out
    }

    /// The length of the header, from its first [`PREAMBLE_BYTES`].
    pub(crate) fn byte_count(preamble: &[u8; PREAMBLE_BYTES], container: Container) -> Result<usize, DecodeError> {
        if preamble[8] > VERSION {
            return Err(DecodeError::NewerVersion { format: container.extension(), found: preamble[8], known: VERSION });
        }
        let length = usize::from(u16::from_le_bytes([preamble[9], preamble[10]]));
        if !(PREAMBLE_BYTES + 4..=HEADER_LIMIT).contains(&length) {
            let got = length as u64;
            return Err(DecodeError::Limit { place: Place::Byte(9), what: "the header length", got, limit: HEADER_LIMIT as u64 });
        }
        Ok(length)
    }

    /// Reads a whole header, whose length [`Self::byte_count`] gave.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (body, checksum) = bytes.split_at(bytes.len() - 4);
        if crc32fast::hash(body).to_le_bytes() != checksum {
            return Err(DecodeError::Checksum { place: Place::Byte(0), what: "the header".into() });
        }
        let mut reader = Reader { rest: &body[PREAMBLE_BYTES..] };
        let kinds = [Container::Patches, Container::Forest];
        let container = kinds.into_iter().find(|c| body.starts_with(&c.signature())).unwrap_or_default();
        let parsed = Self::parse(&mut reader, container).and_then(|h| match reader.rest {
            [] => Ok(h),
            _ => Err(ReadError::Bad("the header is longer than its fields")),
        });
        parsed.map_err(|e| {
            let place = Place::Byte((body.len() - reader.rest.len()) as u64);
            let message = match e {
                ReadError::End => "the header is shorter than its fields",
                ReadError::Bad(what) => what,
            };
            DecodeError::syntax(place, message)
        })
    }

    fn parse(r: &mut Reader, container: Container) -> Result<Self, ReadError> {
        let flags = r.u8()?;
        if flags > 15 {
            return Err(ReadError::Bad("unknown attribute flags"));
        }
        let attribute_set = AttributeSet { normals: flags & 1 != 0, colors: flags & 2 != 0, texcoords: flags & 4 != 0 };
        let mut bits = |low: u8, high: u8| match r.u8()? {
            0 => Ok(None),
            b if (low..=high).contains(&b) => Ok(Some(b)),
            _ => Err(ReadError::Bad("a precision is out of range")),
        };
        let mut grids = Quantisation {
            position_bits: bits(8, 16)?,
            normal_bits: bits(4, 16)?,
            color_bits: bits(1, 16)?,
            texcoord_bits: bits(4, 20)?,
            ..Default::default()
        };
        let file_id = u64::from_le_bytes(r.array()?);
        let bounds = (floats(r)?, floats(r)?);
        if grids.position_bits.is_some() {
            grids.position_origin = floats(r)?;
            grids.position_step = step(r)?;
        }
        if attribute_set.texcoords && grids.texcoord_bits.is_some() {
            grids.texcoord_origin = floats(r)?;
            grids.texcoord_step = step(r)?;
        }
        let count = usize::from(r.u8()?);
        if count > BLOCK_LIMIT {
            return Err(ReadError::Bad("the table has more than 64 entries"));
        }
        let blocks = (0..count).map(|_| Block::parse(r)).collect::<Result<Vec<_>, _>>()?;
        if !blocks.iter().any(|b| b.kind == BlockKind::Level) {
            return Err(ReadError::Bad("the table has no level"));
        }
        let total = |f: fn(&Block) -> u32| blocks.iter().map(|b| u64::from(f(b))).sum::<u64>();
        if total(|b| b.new_vertices) >= 1 << 30 || total(|b| b.new_triangles) >= 1 << 30 {
            return Err(ReadError::Bad("more than 2^30 vertices or triangles"));
        }
        Ok(Self { container, file_id, attribute_set, has_seams: flags & 8 != 0, grids, bounds, blocks })
    }

    /// What a user of the stream wants to know; `header_bytes` is where the first block begins.
    pub fn info(&self, header_bytes: u64) -> StreamInfo {
        let mut entry = LevelEntry { end_byte: header_bytes, ..Default::default() };
        let mut levels = Vec::new();
        let mut texture_end_byte = None;
        for b in &self.blocks {
            entry.end_byte += u64::from(b.byte_count);
            if b.kind == BlockKind::Texture {
                texture_end_byte = Some(entry.end_byte);
            }
            if b.kind == BlockKind::Level {
                entry.vertex_count += b.new_vertices;
                entry.triangle_count += b.new_triangles;
                entry.error = b.error;
                levels.push(entry.clone());
            }
        }
        StreamInfo {
            format: self.container.format(),
            attribute_set: self.attribute_set,
            levels: Some(levels),
            level_count: None,
            bounds: Some(self.bounds),
            file_id: Some(self.file_id),
            total_bytes: Some(entry.end_byte),
            texture_end_byte,
            position_bits: self.grids.position_bits,
        }
    }
}

impl Block {
    fn parse(r: &mut Reader) -> Result<Self, ReadError> {
        let kind = match r.u8()? {
            0 => BlockKind::Level,
            1 => BlockKind::Texture,
            2 => BlockKind::Picture,
            _ => return Err(ReadError::Bad("unknown kind of block")),
        };
        let byte_count = r.varint()?;
        let checksum = u32::from_le_bytes(r.array()?);
        let mut block = Block { kind, byte_count, checksum, new_vertices: 0, new_triangles: 0, error: 0.0 };
        if kind == BlockKind::Level {
            block.new_vertices = r.varint()?;
            block.new_triangles = r.varint()?;
            let [error] = floats(r)?;
            block.error = error;
        }
        Ok(block)
    }
}

fn floats<const N: usize>(r: &mut Reader) -> Result<[f32; N], ReadError> {
    let mut out = [0.0; N];
    for x in &mut out {
        *x = f32::from_le_bytes(r.array()?);
    }
    if out.iter().all(|x| x.is_finite()) { Ok(out) } else { Err(ReadError::Bad("a number is not finite")) }
}

fn step(r: &mut Reader) -> Result<f64, ReadError> {
    let step = f64::from_le_bytes(r.array()?);
    if step.is_finite() && step > 0.0 { Ok(step) } else { Err(ReadError::Bad("a grid step is not positive")) }
}
