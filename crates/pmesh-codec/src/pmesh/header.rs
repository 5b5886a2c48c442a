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

impl BlockKind {
    fn parse(byte: u8) -> Result<Self, ReadError> {
        match byte {
            0 => Ok(BlockKind::Level),
            1 => Ok(BlockKind::Texture),
            2 => Ok(BlockKind::Picture),
            _ => Err(ReadError::Bad("unknown kind of block")),
        }
    }
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
    /// `.pmesh`, version 1.
    Compact,
    /// `.pits`, patch-coloured.
    Patches,
    /// `.pfs`, forest splits.
    Forest,
}

impl Container {
    fn signature(self) -> [u8; 8] {
        match self {
            Container::Pmesh | Container::Compact => SIGNATURE,
            Container::Patches => crate::patch::SIGNATURE,
            Container::Forest => crate::split::SIGNATURE,
        }
    }
    /// The newest version that is known.
    fn version(self) -> u8 {
        if self == Container::Compact { crate::compact::VERSION } else { VERSION }
    }
    /// True if what a part of a level brings can be shown before the rest is there.
    pub(crate) fn shows_parts(self) -> bool {
        self == Container::Compact
    }
    /// What the table says of a block's bytes.
    pub(crate) fn checksum(self, block: &[u8]) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(block);
        self.checksum_of(hasher)
    }
    /// The same of bytes that went through `hasher`.
    pub(crate) fn checksum_of(self, hasher: crc32fast::Hasher) -> u32 {
        let whole = hasher.finalize();
        if self.version() == 1 { whole & 0xffff } else { whole }
    }
    fn extension(self) -> &'static str {
        match self {
            Container::Pmesh | Container::Compact => ".pmesh",
            Container::Patches => ".pits",
            Container::Forest => ".pfs",
        }
    }
    fn format(self) -> &'static str {
        match self {
            Container::Pmesh => "pmesh 0",
            Container::Compact => "compact, pmesh 1",
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
    /// Low bits of a coordinate that the base lacks; levels bring them. Version 1 alone has them.
    pub base_shift: u8,
    /// Bounding box of the finest level.
    pub bounds: ([f32; 3], [f32; 3]),
    /// The table.
    pub blocks: Vec<Block>,
}

/// Signature, version, and the length of the whole header.
pub(crate) const PREAMBLE_BYTES: usize = 11;
/// Most bits that a base may lack: each that comes moves all vertices that are there.
pub(crate) const SHIFT_LIMIT: u8 = 8;
/// The largest header: fixed fields and 64 table entries, with room.
const HEADER_LIMIT: usize = 4096;

impl Header {
    /// The header's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = self.container.signature().to_vec();
        out.extend([self.container.version(), 0, 0]);
        if self.container.version() == 1 {
            self.short(&mut out);
        } else {
            self.long(&mut out);
        }
        let length = (out.len() + 4) as u16;
        out[9..11].copy_from_slice(&length.to_le_bytes());
        let checksum = crc32fast::hash(&out);
        out.extend(checksum.to_le_bytes());
        out
    }

    /// The fields of version 1: what follows from another field is left out.
    fn short(&self, out: &mut Vec<u8>) {
        let (a, g) = (self.attribute_set, &self.grids);
        out.push(self.flags());
        let bits =
            [(true, g.position_bits), (a.normals, g.normal_bits), (a.colors, g.color_bits), (a.texcoords, g.texcoord_bits)];
        out.extend(bits.iter().filter(|b| b.0).map(|b| b.1.unwrap_or(0)));
        out.extend((self.file_id as u32).to_le_bytes());
        if g.position_bits.is_some() {
            out.push(self.base_shift);
            put_floats(out, &g.position_origin);
            out.extend(g.position_step.to_le_bytes());
            let steps = |k: usize| (f64::from(self.bounds.1[k]) - f64::from(self.bounds.0[k])) / g.position_step;
            (0..3).for_each(|k| put(out, steps(k).round() as u32));
        } else {
            put_floats(out, &self.bounds.0);
            put_floats(out, &self.bounds.1);
        }
        if a.texcoords && g.texcoord_bits.is_some() {
            put_floats(out, &g.texcoord_origin);
            out.extend(g.texcoord_step.to_le_bytes());
        }
        out.push(self.blocks.len() as u8);
        self.blocks.iter().for_each(|b| b.put_short(out));
    }

    fn flags(&self) -> u8 {
        let a = self.attribute_set;
        u8::from(a.normals) | u8::from(a.colors) << 1 | u8::from(a.texcoords) << 2 | u8::from(self.has_seams) << 3
    }

    /// The fields of version 0.
    fn long(&self, out: &mut Vec<u8>) {
        let (a, g) = (self.attribute_set, &self.grids);
        out.push(self.flags());
        out.extend([g.position_bits, g.normal_bits, g.color_bits, g.texcoord_bits].map(|b| b.unwrap_or(0)));
        out.extend(self.file_id.to_le_bytes());
        put_floats(out, &self.bounds.0);
        put_floats(out, &self.bounds.1);
        if g.position_bits.is_some() {
            put_floats(out, &g.position_origin);
            out.extend(g.position_step.to_le_bytes());
        }
        if a.texcoords && g.texcoord_bits.is_some() {
            put_floats(out, &g.texcoord_origin);
            out.extend(g.texcoord_step.to_le_bytes());
        }
        out.push(self.blocks.len() as u8);
        for b in &self.blocks {
            out.push(b.kind as u8);
            put(out, b.byte_count);
            out.extend(b.checksum.to_le_bytes());
            if b.kind == BlockKind::Level {
                put(out, b.new_vertices);
                put(out, b.new_triangles);
                put_floats(out, &[b.error]);
            }
        }
    }

    /// The length of the header, from its first [`PREAMBLE_BYTES`].
    pub(crate) fn byte_count(preamble: &[u8; PREAMBLE_BYTES], container: Container) -> Result<usize, DecodeError> {
        let known = container.version();
        if preamble[8] > known {
            // Files for views have a version of their own, and are told before they come here.
            let known =
                if matches!(container, Container::Pmesh | Container::Compact) { known.max(super::VIEWS_VERSION) } else { known };
            return Err(DecodeError::NewerVersion { format: container.extension(), found: preamble[8], known });
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
        if crc32fast::hash(body).to_le_bytes() != checksum && !crate::FUZZING {
            return Err(DecodeError::Checksum { place: Place::Byte(0), what: "the header".into() });
        }
        let mut reader = Reader { rest: &body[PREAMBLE_BYTES..] };
        let kinds = [Container::Compact, Container::Patches, Container::Forest];
        let is = |c: &Container| body.starts_with(&c.signature()) && body[PREAMBLE_BYTES - 3] == c.version();
        let container = kinds.into_iter().find(is).unwrap_or_default();
        let parse = if container.version() == 1 { Self::parse_short } else { Self::parse };
        let parsed = parse(&mut reader, container).and_then(|h| match reader.rest {
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
        let (attribute_set, has_seams) = attributes(r)?;
        let mut grids = Quantisation {
            position_bits: bits(r, 8, 16)?,
            normal_bits: bits(r, 4, 16)?,
            color_bits: bits(r, 1, 16)?,
            texcoord_bits: bits(r, 4, 20)?,
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
        let blocks = table(r, Block::parse)?;
        Ok(Self { container, file_id, attribute_set, has_seams, grids, base_shift: 0, bounds, blocks })
    }

    fn parse_short(r: &mut Reader, container: Container) -> Result<Self, ReadError> {
        let (attribute_set, has_seams) = attributes(r)?;
        let mut grids = Quantisation { position_bits: bits(r, 8, 16)?, ..Default::default() };
        if attribute_set.normals {
            grids.normal_bits = bits(r, 4, 16)?;
        }
        if attribute_set.colors {
            grids.color_bits = bits(r, 1, 16)?;
        }
        if attribute_set.texcoords {
            grids.texcoord_bits = bits(r, 4, 20)?;
        }
        let file_id = u64::from(u32::from_le_bytes(r.array()?));
        let bounds;
        let mut base_shift = 0;
        if grids.position_bits.is_some() {
            base_shift = r.u8()?;
            if base_shift > SHIFT_LIMIT {
                return Err(ReadError::Bad("the base lacks too many bits"));
            }
            grids.position_origin = floats(r)?;
            grids.position_step = step(r)?;
            let mut top = grids.position_origin;
            for x in &mut top {
                *x = (f64::from(*x) + f64::from(r.varint()?) * grids.position_step) as f32;
            }
            bounds = (grids.position_origin, top);
        } else {
            bounds = (floats(r)?, floats(r)?);
        }
        if attribute_set.texcoords && grids.texcoord_bits.is_some() {
            grids.texcoord_origin = floats(r)?;
            grids.texcoord_step = step(r)?;
        }
        let blocks = table(r, Block::parse_short)?;
        Ok(Self { container, file_id, attribute_set, has_seams, grids, base_shift, bounds, blocks })
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
            shows_parts: self.container.shows_parts(),
        }
    }
}

/// What is set for attributes, and whether there are seams.
fn attributes(r: &mut Reader) -> Result<(AttributeSet, bool), ReadError> {
    let flags = r.u8()?;
    if flags > 15 {
        return Err(ReadError::Bad("unknown attribute flags"));
    }
    Ok((AttributeSet { normals: flags & 1 != 0, colors: flags & 2 != 0, texcoords: flags & 4 != 0 }, flags & 8 != 0))
}

fn bits(r: &mut Reader, low: u8, high: u8) -> Result<Option<u8>, ReadError> {
    match r.u8()? {
        0 => Ok(None),
        b if (low..=high).contains(&b) => Ok(Some(b)),
        _ => Err(ReadError::Bad("a precision is out of range")),
    }
}

fn table(r: &mut Reader, entry: fn(&mut Reader) -> Result<Block, ReadError>) -> Result<Vec<Block>, ReadError> {
    let count = usize::from(r.u8()?);
    if count > BLOCK_LIMIT {
        return Err(ReadError::Bad("the table has more than 64 entries"));
    }
    let blocks = (0..count).map(|_| entry(r)).collect::<Result<Vec<_>, _>>()?;
    if !blocks.iter().any(|b| b.kind == BlockKind::Level) {
        return Err(ReadError::Bad("the table has no level"));
    }
    let total = |f: fn(&Block) -> u32| blocks.iter().map(|b| u64::from(f(b))).sum::<u64>();
    if total(|b| b.new_vertices) >= 1 << 30 || total(|b| b.new_triangles) >= 1 << 30 {
        return Err(ReadError::Bad("more than 2^30 vertices or triangles"));
    }
    Ok(blocks)
}

/// A positive float's upper half, no smaller than it.
fn upper_half(x: f32) -> u16 {
    ((u64::from(x.max(0.0).to_bits()) + 0xffff) >> 16) as u16
}

impl Block {
    /// As version 1 has it: how much fewer than twice as many triangles as vertices, half of the error, half of the checksum.
    fn put_short(&self, out: &mut Vec<u8>) {
        put(out, self.byte_count);
        out.push(self.kind as u8);
        out.extend((self.checksum as u16).to_le_bytes());
        if self.kind == BlockKind::Level {
            put(out, self.new_vertices);
            let missing = i64::from(self.new_vertices) * 2 - i64::from(self.new_triangles);
            put(out, (missing << 1 ^ missing >> 63) as u32);
            out.extend(upper_half(self.error).to_le_bytes());
        }
    }
    fn parse_short(r: &mut Reader) -> Result<Self, ReadError> {
        let byte_count = r.varint()?;
        let kind = BlockKind::parse(r.u8()?)?;
        let checksum = u32::from(u16::from_le_bytes(r.array()?));
        let mut block = Block { kind, byte_count, checksum, new_vertices: 0, new_triangles: 0, error: 0.0 };
        if kind == BlockKind::Level {
            block.new_vertices = r.varint()?;
            let folded = r.varint()?;
            let missing = i64::from(folded >> 1) ^ -i64::from(folded & 1);
            let triangles = i64::from(block.new_vertices) * 2 - missing;
            block.new_triangles =
                u32::try_from(triangles).map_err(|_| ReadError::Bad("a number of triangles is out of range"))?;
            block.error = f32::from_bits(u32::from(u16::from_le_bytes(r.array()?)) << 16);
            if !block.error.is_finite() {
                return Err(ReadError::Bad("a number is not finite"));
            }
        }
        Ok(block)
    }
    fn parse(r: &mut Reader) -> Result<Self, ReadError> {
        let kind = BlockKind::parse(r.u8()?)?;
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

fn put_floats(out: &mut Vec<u8>, floats: &[f32]) {
    floats.iter().for_each(|x| out.extend(x.to_le_bytes()));
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
