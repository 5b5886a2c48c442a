//! A `.pmesh` file to levels, as its bytes come. Memory: what was inflated and not yet a record, and `Model`.

use super::channels::Channels;
use super::header::{Block, BlockKind, Container, Header, PREAMBLE_BYTES};
use super::inflate_limit;
use super::records::Model;
use super::texture::texture_of;
use super::varint::{ReadError, Reader};
use crate::{DecodeError, Decoder, Event, Place};
use flate2::{Decompress, FlushDecompress, Status};
use pmesh_core::Level;
use std::collections::VecDeque;

/// Vertices a part: small enough that appending one never blocks a page.
const PART_VERTICES: usize = 2048;
/// Inflated bytes at a time.
const INFLATE_BYTES: usize = 16 * 1024;

/// What of a level comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Vertices,
    TriangleCount,
    Triangles(u32),
    MovedCount,
    Moved(u32, Option<u32>),
    End,
    Done,
}

struct LevelState {
    inflate: Decompress,
    pending: Vec<u8>,
    /// Do not try to read before this many bytes are pending: a long record is not parsed again at each byte.
    wait_for: usize,
    stage: Stage,
    part: Level,
    vertices_left: u32,
    triangles_left: u32,
    level_start: u32,
}

enum State {
    Header(Vec<u8>),
    Level(Box<LevelState>),
    Texture(Vec<u8>),
    Finished,
}

/// Push decoder of `.pmesh` version 0.
pub struct PmeshDecoder {
    state: State,
    header: Header,
    channels: Channels,
    model: Model,
    block: usize,
    block_bytes: u32,
    checksum: crc32fast::Hasher,
    offset: u64,
    levels: u32,
    failed: bool,
    events: VecDeque<Event>,
}

impl Default for PmeshDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl PmeshDecoder {
    /// A decoder at the first byte.
    pub fn new() -> Self {
        Self {
            state: State::Header(Vec::new()),
            header: Header::default(),
            channels: Channels::default(),
            model: Model::new(3, false),
            block: 0,
            block_bytes: 0,
            checksum: crc32fast::Hasher::new(),
            offset: 0,
            levels: 0,
            failed: false,
            events: VecDeque::new(),
        }
    }

    /// Takes what it can of `bytes` and says how much.
    fn step(&mut self, bytes: &[u8]) -> Result<usize, DecodeError> {
        match &mut self.state {
            State::Header(seen) => {
                let want = match seen.first_chunk::<PREAMBLE_BYTES>() {
                    None => PREAMBLE_BYTES,
                    Some(preamble) => Header::byte_count(preamble, Container::Pmesh)?,
                };
                let taken = (want - seen.len()).min(bytes.len());
                seen.extend_from_slice(&bytes[..taken]);
                self.offset += taken as u64;
                if want > PREAMBLE_BYTES && seen.len() == want {
                    self.header = Header::from_bytes(seen)?;
                    self.begin();
                }
                Ok(taken)
            }
            State::Finished => Err(DecodeError::syntax(Place::Byte(self.offset), "bytes after the end of the last level")),
            State::Level(_) | State::Texture(_) => self.block_step(bytes),
        }
    }

    fn begin(&mut self) {
        let h = &self.header;
        self.channels = Channels::new(h.attribute_set, h.grids);
        self.model = Model::new(self.channels.count(), h.has_seams);
        self.events.push_back(Event::Info(h.info(self.offset)));
        self.begin_block();
    }

    fn begin_block(&mut self) {
        self.block_bytes = 0;
        self.checksum = crc32fast::Hasher::new();
        self.state = match self.header.blocks.get(self.block) {
            None => State::Finished,
            Some(b) if b.kind != BlockKind::Level => State::Texture(Vec::new()),
            Some(b) => {
                self.model.begin_level();
                State::Level(Box::new(LevelState {
                    inflate: Decompress::new(false),
                    pending: Vec::new(),
                    wait_for: 0,
                    stage: Stage::Vertices,
                    part: Level::default(),
                    vertices_left: b.new_vertices,
                    triangles_left: b.new_triangles,
                    level_start: self.model.vertex_count(),
                }))
            }
        };
    }

    fn block_step(&mut self, bytes: &[u8]) -> Result<usize, DecodeError> {
        let block = self.header.blocks[self.block];
        let taken = bytes.len().min((block.byte_count - self.block_bytes) as usize).min(INFLATE_BYTES);
        self.checksum.update(&bytes[..taken]);
        self.block_bytes += taken as u32;
        let last = self.block_bytes == block.byte_count;
        match &mut self.state {
            State::Level(level) => {
                let feeder = Feeder { channels: &self.channels, model: &mut self.model, events: &mut self.events };
                level.push(&bytes[..taken], block.byte_count, feeder).map_err(|what| {
                    DecodeError::syntax(Place::Byte(self.offset), format!("level block {}: {what}", self.block))
                })?;
            }
            State::Texture(seen) => seen.extend_from_slice(&bytes[..taken]),
            State::Header(_) | State::Finished => {}
        }
        self.offset += taken as u64;
        if last {
            self.end_block(block)?;
        }
        Ok(taken)
    }

    fn end_block(&mut self, block: Block) -> Result<(), DecodeError> {
        let place = Place::Byte(self.offset);
        let what = match block.kind {
            BlockKind::Level => format!("level block {}", self.block),
            BlockKind::Texture | BlockKind::Picture => "the texture".to_string(),
        };
        if std::mem::take(&mut self.checksum).finalize() != block.checksum && !crate::FUZZING {
            return Err(DecodeError::Checksum { place, what });
        }
        match &mut self.state {
            State::Level(level) => {
                level.wait_for = 0;
                let feeder = Feeder { channels: &self.channels, model: &mut self.model, events: &mut self.events };
                level.read(feeder).map_err(|e| DecodeError::syntax(place, format!("{what}: {e}")))?;
                if level.stage != Stage::Done || !level.pending.is_empty() {
                    return Err(DecodeError::syntax(place, format!("{what} does not end where the table says")));
                }
                self.levels += 1;
                self.events.push_back(Event::Part(std::mem::take(&mut level.part)));
                self.events.push_back(Event::LevelEnd);
            }
            State::Texture(seen) => {
                self.events.push_back(Event::Texture(texture_of(block.kind, std::mem::take(seen), place)?));
            }
            State::Header(_) | State::Finished => {}
        }
        self.block += 1;
        self.begin_block();
        Ok(())
    }
}

impl Decoder for PmeshDecoder {
    fn push(&mut self, mut bytes: &[u8]) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        while !bytes.is_empty() {
            let taken = self.step(bytes);
            self.failed |= taken.is_err();
            bytes = &bytes[taken?..];
            // A block of no bytes ends at once.
            while matches!(self.state, State::Level(_) | State::Texture(_)) && self.header.blocks[self.block].byte_count == 0 {
                let ended = self.end_block(self.header.blocks[self.block]);
                self.failed |= ended.is_err();
                ended?;
            }
        }
        Ok(())
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        let inside = match &self.state {
            State::Finished => return Ok(()),
            State::Header(_) => "the header",
            State::Level(_) => "a level",
            State::Texture(_) => "the texture",
        };
        Err(DecodeError::Truncated { place: Place::Byte(self.offset), inside, levels: self.levels })
    }
    fn poll(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

struct Feeder<'a> {
    channels: &'a Channels,
    model: &'a mut Model,
    events: &'a mut VecDeque<Event>,
}

impl Feeder<'_> {
    fn again(&mut self) -> Feeder<'_> {
        Feeder { channels: self.channels, model: self.model, events: self.events }
    }
}

impl LevelState {
    fn push(&mut self, mut bytes: &[u8], block_bytes: u32, mut to: Feeder) -> Result<(), String> {
        loop {
            let (before_in, before_out) = (self.inflate.total_in(), self.inflate.total_out());
            let start = self.pending.len();
            self.pending.reserve(INFLATE_BYTES);
            let status = self.inflate.decompress_vec(bytes, &mut self.pending, FlushDecompress::None);
            let status = status.map_err(|e| format!("damaged data ({e})"))?;
            bytes = &bytes[(self.inflate.total_in() - before_in) as usize..];
            if self.inflate.total_out() > inflate_limit(u64::from(block_bytes)) {
                return Err(format!("it inflates to more than {} bytes", inflate_limit(u64::from(block_bytes))));
            }
            self.read(to.again())?;
            let progress = self.inflate.total_out() > before_out || self.pending.len() < start;
            match status {
                Status::StreamEnd if bytes.is_empty() => return Ok(()),
                Status::StreamEnd => return Err("bytes after the end of its data".into()),
                _ if bytes.is_empty() && !progress => return Ok(()),
                _ if !progress && self.inflate.total_in() == before_in => return Err("damaged data".into()),
                _ => {}
            }
        }
    }

    /// Reads as many records as are whole.
    fn read(&mut self, mut to: Feeder) -> Result<(), String> {
        if self.pending.len() < self.wait_for {
            return Ok(());
        }
        let pending = std::mem::take(&mut self.pending);
        let mut reader = Reader { rest: &pending };
        let ended = loop {
            let before = reader.rest;
            if self.stage == Stage::Done {
                break if before.is_empty() { Ok(()) } else { Err("it goes on after its last record".to_string()) };
            }
            match self.record(&mut reader, &mut to) {
                Ok(()) => {}
                Err(ReadError::End) => {
                    reader.rest = before;
                    break Ok(());
                }
                Err(ReadError::Bad(what)) => break Err(what.to_string()),
            }
            if self.part.vertices.len() >= PART_VERTICES {
                to.events.push_back(Event::Part(std::mem::take(&mut self.part)));
            }
        };
        self.pending = reader.rest.to_vec();
        self.wait_for = if self.pending.len() > 4096 { self.pending.len() + self.pending.len() / 4 } else { 0 };
        ended
    }

    fn record(&mut self, reader: &mut Reader, to: &mut Feeder) -> Result<(), ReadError> {
        self.stage = match self.stage {
            Stage::Vertices if self.vertices_left == 0 => Stage::TriangleCount,
            Stage::Vertices => {
                self.vertex(reader, to)?;
                Stage::Vertices
            }
            Stage::TriangleCount => match reader.varint()? {
                n if n == self.triangles_left => Stage::Triangles(n),
                _ => return Err(ReadError::Bad("another number of triangles than the table announces")),
            },
            Stage::Triangles(0) => Stage::MovedCount,
            Stage::Triangles(left) => {
                self.part.triangles.push(to.model.read_triangle(reader)?);
                Stage::Triangles(left - 1)
            }
            Stage::MovedCount => Stage::Moved(reader.varint()?, None),
            Stage::Moved(0, _) => Stage::End,
            Stage::Moved(left, last) => {
                let (v, row) = to.model.read_moved(reader, last, self.level_start)?;
                self.part.moved.ids.push(v);
                to.channels.push(&row, 0, &mut self.part.moved.values);
                Stage::Moved(left - 1, Some(v))
            }
            Stage::End => match reader.u8()? {
                0 => Stage::Done,
                _ => return Err(ReadError::Bad("no end mark")),
            },
            Stage::Done => Stage::Done,
        };
        Ok(())
    }

    fn vertex(&mut self, reader: &mut Reader, to: &mut Feeder) -> Result<(), ReadError> {
        let v = to.model.vertex_count();
        let r = to.model.read(reader, self.level_start, self.triangles_left)?;
        self.vertices_left -= 1;
        self.triangles_left -= r.triangles.len() as u32;
        to.channels.push(&r.row, 0, &mut self.part.vertices);
        self.part.representatives.extend(r.representative.map(|p| (v, p)));
        self.part.position_of.extend(r.position_of.map(|p| (v, p)));
        self.part.corner_moves.extend_from_slice(&r.corner_moves);
        self.part.triangles.extend_from_slice(&r.triangles);
        Ok(())
    }
}
