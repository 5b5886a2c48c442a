//! Blocks to levels, in steps that [`Decoder::work`] takes. A block is decoded once it is whole; a level of a compact stream as far
//! as its bytes are there, and its checksum is looked at once they all are.

use super::base::BaseCoder;
use super::rows::Rows;
use super::{Levels, item_limit};
use crate::pmesh::channels::Channels;
use crate::pmesh::header::{BlockKind, Container, Header, PREAMBLE_BYTES};
use crate::pmesh::texture::texture_of;
use crate::range::{Coder, LOOK_AHEAD, OVERRUN, RangeDecoder};
use crate::{DecodeError, Decoder, Event, Place};
use crc32fast::Hasher;
use pmesh_core::Level;
use pmesh_core::surface::{Surface, SurfaceBuilder};
use std::collections::VecDeque;

/// Triangles or vertices a step: a fraction of a millisecond.
const STEP: usize = 512;
/// Bytes with which a level may begin: what says how it can be cut, and what is read ahead.
const FIRST_BYTES: usize = 5 + LOOK_AHEAD;

/// A block that is being decoded.
enum Job {
    Base(RangeDecoder, Box<BaseCoder>, usize),
    Level(RangeDecoder),
    /// The base is there; what lies across its edges is being found.
    Surface(Box<SurfaceBuilder>),
}

/// Push decoder of a base and refinements of it.
pub struct RefinementDecoder {
    container: Container,
    levels_of: Box<dyn Levels>,
    head: Vec<u8>,
    header: Option<Header>,
    /// Bytes that wait for their block to be whole or for the one before to be decoded.
    pending: VecDeque<u8>,
    block: usize,
    job: Option<Job>,
    /// Of the bytes of the block so far.
    checksum: Hasher,
    /// Bytes of the block that are to come.
    missing: usize,
    /// The level is decoded, whether or not its last bytes have arrived.
    all_there: bool,
    channels: Channels,
    surface: Surface,
    rows: Rows,
    emitted_rows: u32,
    emitted_seams: usize,
    levels: u32,
    offset: u64,
    base: (u32, u64),
    level_bytes: u64,
    /// Vertices of no triangle, and images.
    other_bytes: [u64; 2],
    failed: bool,
    events: VecDeque<Event>,
}

impl RefinementDecoder {
    pub(crate) fn new(container: Container, levels_of: Box<dyn Levels>) -> Self {
        Self {
            container,
            levels_of,
            head: Vec::new(),
            header: None,
            pending: VecDeque::new(),
            block: 0,
            job: None,
            checksum: Hasher::new(),
            missing: 0,
            all_there: false,
            channels: Channels::default(),
            surface: Surface::default(),
            rows: Rows::default(),
            emitted_rows: 0,
            emitted_seams: 0,
            levels: 0,
            offset: 0,
            base: (0, 0),
            level_bytes: 0,
            other_bytes: [0; 2],
            failed: false,
            events: VecDeque::new(),
        }
    }

    fn read_header(&mut self, bytes: &[u8]) -> Result<usize, DecodeError> {
        let want = match self.head.first_chunk::<PREAMBLE_BYTES>() {
            None => PREAMBLE_BYTES,
            Some(preamble) => Header::byte_count(preamble, self.container)?,
        };
        let taken = (want - self.head.len()).min(bytes.len());
        self.head.extend_from_slice(&bytes[..taken]);
        self.offset += taken as u64;
        if want == PREAMBLE_BYTES || self.head.len() < want {
            return Ok(taken);
        }
        let header = Header::from_bytes(&self.head)?;
        for (i, b) in header.blocks.iter().enumerate() {
            if u64::from(b.new_vertices.max(b.new_triangles)) > item_limit(b.byte_count) {
                let message = format!("block {i} announces more than its {} bytes can hold", b.byte_count);
                return Err(DecodeError::syntax(Place::Byte(0), message));
            }
        }
        self.channels = Channels::new(header.attribute_set, header.grids);
        self.rows.width = self.channels.count();
        self.rows.has_seams = header.has_seams;
        self.rows.shift = header.base_shift.into();
        self.events.push_back(Event::Info(header.info(self.offset)));
        self.header = Some(header);
        Ok(taken)
    }

    /// Begins the next block if enough of its bytes are here; true if it did.
    fn begin(&mut self) -> Result<bool, DecodeError> {
        let Some(header) = &self.header else { return Ok(false) };
        let Some(&block) = header.blocks.get(self.block) else {
            let place = Place::Byte(self.offset);
            return if self.pending.is_empty() {
                Ok(false)
            } else {
                Err(DecodeError::syntax(place, "bytes after the last level"))
            };
        };
        let size = block.byte_count as usize;
        let refines = block.kind == BlockKind::Level && self.levels > 0 && block.new_triangles > 0;
        let enough = if refines && self.container.shows_parts() { size.min(FIRST_BYTES) } else { size };
        if self.pending.len() < enough {
            return Ok(false);
        }
        let mut bytes: Vec<u8> = self.pending.drain(..size.min(self.pending.len())).collect();
        self.missing = size - bytes.len();
        self.offset += size as u64;
        let place = Place::Byte(self.offset);
        self.checksum = Hasher::new();
        self.checksum.update(&bytes);
        if self.missing == 0 {
            self.check()?;
        }
        if block.kind != BlockKind::Level {
            self.other_bytes[1] += size as u64;
            self.events.push_back(Event::Texture(texture_of(block.kind, bytes, place)?));
            self.block += 1;
            return Ok(true);
        }
        let last = !header.blocks[self.block + 1..].iter().any(|b| b.kind == BlockKind::Level);
        self.job = Some(if self.levels > 0 && block.new_triangles == 0 && last {
            // Vertices that no triangle uses.
            self.other_bytes[0] += size as u64;
            let total = self.rows.count() + block.new_vertices;
            let rest = BaseCoder::new(total, 0, self.rows.width);
            Job::Base(RangeDecoder::new(bytes), Box::new(rest), 0)
        } else if self.levels == 0 {
            self.base = (block.new_vertices, u64::from(block.byte_count));
            let base = BaseCoder::new(block.new_vertices, block.new_triangles, self.rows.width);
            Job::Base(RangeDecoder::new(bytes), Box::new(base), 0)
        } else {
            self.level_bytes += u64::from(block.byte_count);
            // A vertex brings two triangles; along a boundary, which compact levels refine, one.
            let (new, twice) = (u64::from(block.new_triangles), 2 * u64::from(block.new_vertices));
            let coming = header.blocks[self.block..].iter().filter(|b| b.kind == BlockKind::Level && b.new_triangles > 0);
            self.levels_of.expect(coming.map(|b| u64::from(b.new_vertices)).sum());
            let counts = if self.container == Container::Compact { twice / 2..=twice } else { twice..=twice };
            if !counts.contains(&new) || !self.levels_of.begin(&mut bytes, block.new_vertices, self.rows.width) {
                return Err(DecodeError::syntax(place, format!("block {} is no level that refines the one before", self.block)));
            }
            self.all_there = false;
            Job::Level(if self.missing == 0 { RangeDecoder::new(bytes) } else { RangeDecoder::with_first(bytes) })
        });
        Ok(true)
    }

    /// The checksum of the block whose bytes have all arrived.
    fn check(&self) -> Result<(), DecodeError> {
        let expected = self.header.as_ref().and_then(|h| h.blocks.get(self.block)).map(|b| b.checksum);
        if expected == Some(self.container.checksum_of(self.checksum.clone())) || crate::FUZZING {
            return Ok(());
        }
        Err(DecodeError::Checksum { place: Place::Byte(self.offset), what: format!("block {}", self.block) })
    }

    /// Gives the level that is being decoded the bytes that have arrived since; true if it can go on.
    fn feed(&mut self) -> Result<bool, DecodeError> {
        let Some(Job::Level(coder)) = &mut self.job else { return Ok(true) };
        if coder.is_whole() {
            return Ok(true);
        }
        let count = self.missing.min(self.pending.len());
        if count > 0 {
            let bytes: Vec<u8> = self.pending.drain(..count).collect();
            self.missing -= count;
            self.checksum.update(&bytes);
            coder.feed(&bytes, self.missing == 0);
            if self.missing == 0 {
                self.check()?;
                return Ok(true);
            }
        }
        Ok(!self.all_there && coder.has(self.levels_of.reach()))
    }

    /// A step of the block that is being decoded.
    fn step(&mut self) -> Result<(), String> {
        let Some(mut job) = self.job.take() else { return Ok(()) };
        let mut part = Level::default();
        let mut next_job = None;
        let (done, overrun) = match &mut job {
            Job::Surface(builder) => {
                if builder.step(4 * STEP) {
                    self.surface = std::mem::take(&mut builder.surface);
                } else {
                    self.job = Some(job);
                }
                return Ok(());
            }
            Job::Base(coder, base, emitted) => {
                let done = base.step(coder, &mut self.rows, None, STEP)?;
                part.triangles.extend_from_slice(&base.triangles[*emitted..]);
                *emitted = base.triangles.len();
                if done && self.levels == 0 {
                    let builder = SurfaceBuilder::new(std::mem::take(&mut base.triangles), self.rows.count());
                    next_job = Some(Job::Surface(Box::new(builder)));
                }
                (done, coder.overrun())
            }
            Job::Level(coder) => {
                let done = self.levels_of.step(coder, &mut self.surface, &mut self.rows, STEP, &mut part)?;
                (done, coder.overrun())
            }
        };
        if overrun > OVERRUN {
            return Err("it ends before all that the table announces".into());
        }
        for v in 0..std::mem::take(&mut self.rows.moved) {
            part.moved.ids.push(v);
            self.channels.push(self.rows.row(v), self.rows.shift, &mut part.moved.values);
        }
        for v in self.emitted_rows..self.rows.count() {
            self.channels.push(self.rows.row(v), self.rows.shift, &mut part.vertices);
        }
        self.emitted_rows = self.rows.count();
        part.position_of.extend_from_slice(&self.rows.seams[self.emitted_seams..]);
        self.emitted_seams = self.rows.seams.len();
        self.events.push_back(Event::Part(part));
        self.all_there = done;
        if done && self.missing == 0 {
            self.events.push_back(Event::LevelEnd);
            self.levels += 1;
            self.block += 1;
            self.job = next_job;
        } else {
            self.job = Some(job);
        }
        Ok(())
    }
}

impl Decoder for RefinementDecoder {
    fn push(&mut self, mut bytes: &[u8]) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        while self.header.is_none() && !bytes.is_empty() {
            match self.read_header(bytes) {
                Ok(taken) => bytes = &bytes[taken..],
                Err(e) => {
                    self.failed = true;
                    return Err(e);
                }
            }
        }
        self.pending.extend(bytes);
        Ok(())
    }
    fn work(&mut self) -> Result<bool, DecodeError> {
        if self.failed {
            return Ok(false);
        }
        let result = match self.job {
            Some(_) => {
                match self.feed() {
                    Ok(true) => {}
                    other => {
                        self.failed = other.is_err();
                        return other;
                    }
                }
                let step = self.step().map(|()| true);
                step.map_err(|what| DecodeError::syntax(Place::Byte(self.offset), format!("level block {}: {what}", self.block)))
            }
            None => self.begin(),
        };
        self.failed = result.is_err();
        result
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        let place = Place::Byte(self.offset - self.missing as u64 + self.pending.len() as u64);
        match &self.header {
            Some(h) if self.block == h.blocks.len() => Ok(()),
            Some(_) => Err(DecodeError::Truncated { place, inside: "a level", levels: self.levels }),
            None => Err(DecodeError::Truncated { place, inside: "the header", levels: 0 }),
        }
    }
    fn poll(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
    fn components(&self) -> Vec<(&'static str, f64)> {
        let mut all = vec![("headers", self.head.len() as f64), ("base", self.base.1 as f64)];
        let levels: Vec<_> = self.levels_of.components().into_iter().map(|(name, bits)| (name, bits / 8.0)).collect();
        let known: f64 = levels.iter().map(|l| l.1).sum();
        // What the blocks of the levels take beyond that; of one that is arriving, what has been read.
        let rest = (self.level_bytes as f64 - self.missing as f64 - known).max(0.0);
        let name = if levels.is_empty() { "levels" } else { "level_ends" };
        all.extend(levels);
        all.push((name, rest));
        all.extend(["loose", "images"].into_iter().zip(self.other_bytes.map(|b| b as f64)));
        all
    }
    fn statistics(&self) -> Vec<(&'static str, String)> {
        let (base, all) = (self.base.0, self.rows.count());
        let per = |bytes: u64, n: u32| 8.0 * bytes as f64 / f64::from(n.max(1));
        vec![
            ("base", format!("{base} vertices in {} bytes, {:.2} bits each", self.base.1, per(self.base.1, base))),
            (
                "levels",
                format!(
                    "{} vertices in {} bytes, {:.2} bits each",
                    all - base,
                    self.level_bytes,
                    per(self.level_bytes, all - base)
                ),
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Receiver;
    use pmesh_core::{IndexedMesh, Vertices};
    use proptest::prelude::*;

    /// A square of 6 × 6 vertices; a fan taken out of it, a forest of collapses undone, vertices split inside and at the boundary.
    fn files() -> [Vec<u8>; 3] {
        let positions = (0..36).map(|v| [(v % 6) as f32, (v / 6) as f32, 0.0]).collect();
        let cell = |c: u32| {
            let a = c / 5 * 6 + c % 5;
            [[a, a + 1, a + 7], [a, a + 7, a + 6]]
        };
        let triangles: Vec<[u32; 3]> = (0..25).flat_map(cell).collect();
        let mesh = IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() };
        let (mut parents, mut levels) = (vec![0; 36], vec![0; 36]);
        for (v, p) in [(7, 8), (28, 27), (25, 19)] {
            (parents[v], levels[v]) = (p, 1);
        }
        let split = crate::split::SplitStream { mesh: mesh.clone(), parents, levels, ..Default::default() };
        let around = |t: &[u32; 3]| t.contains(&14);
        let mut base: Vec<[u32; 3]> = mesh.triangles.iter().copied().filter(|t| !around(t)).collect();
        let chain = vec![15, 21, 20, 13, 7];
        base.extend(chain.windows(2).map(|w| [8, w[0], w[1]]));
        let removed = vec![crate::patch::Removed { vertex: 14, apex: 8, chain, color: 1 }];
        let levels = vec![crate::patch::PatchLevel { removed }];
        let patch = crate::patch::PatchStream { mesh, base_triangles: base, levels, ..Default::default() };
        let inside = crate::compact::Removed { vertex: 14, apex: 8, chain: vec![15, 21, 20, 13, 7], ..Default::default() };
        let side = crate::compact::Side::Tail;
        let boundary = crate::compact::Removed { vertex: 2, apex: 1, chain: vec![8, 9, 3], side };
        let mut coarse: Vec<[u32; 3]> = patch.base_triangles.clone();
        coarse.retain(|t| *t != [1, 2, 8]);
        coarse.iter_mut().flatten().filter(|v| **v == 2).for_each(|v| *v = 1);
        let levels = vec![vec![inside, boundary]];
        let compact =
            crate::compact::CompactStream { mesh: patch.mesh.clone(), base_triangles: coarse, levels, ..Default::default() };
        let mut out = [Vec::new(), Vec::new(), Vec::new()];
        crate::compact::encode(&compact, None, &mut out[2]).expect("it encodes");
        crate::patch::encode(&patch, None, &mut out[0]).expect("it encodes");
        crate::split::encode(&split, None, &mut out[1]).expect("it encodes");
        out
    }

    /// The file with other bytes for its second level, all checksums right.
    fn forged(file: &[u8], level: &[u8], count: u32) -> Vec<u8> {
        let length = usize::from(u16::from_le_bytes([file[9], file[10]]));
        let mut header = Header::from_bytes(&file[..length]).expect("it is ours");
        let base = &file[length..length + header.blocks[0].byte_count as usize];
        let checksum = header.container.checksum(level);
        let block = &mut header.blocks[1];
        (block.byte_count, block.checksum) = (level.len() as u32, checksum);
        (block.new_vertices, block.new_triangles) = (count, 2 * count);
        [&header.to_bytes()[..], base, level].concat()
    }

    #[test]
    fn the_files_that_are_forged_are_whole() {
        for (file, count) in files().iter().zip([1, 3, 2]) {
            let mut receiver = Receiver::default();
            receiver.push(file).and_then(|()| receiver.finish()).expect("it decodes");
            assert_eq!(receiver.mesh().vertex_count(1).map(|n| n + count), receiver.mesh().vertex_count(0));
        }
    }

    proptest! {
        /// Any bytes for a level on a good base: an error, or a level that the mesh holds.
        #[test]
        fn no_level_makes_it_panic(
            reach in 0u8..40,
            noise in prop::collection::vec(any::<u8>(), 0..60),
            zeros in 0usize..40,
            count in 0u32..12,
            piece in 1usize..30,
        ) {
            let level = [&[reach][..], &vec![0; zeros], &noise].concat();
            for file in files() {
                let forged = forged(&file, &level, count);
                let outcomes = [piece, usize::MAX].map(|piece| {
                    let mut receiver = Receiver::default();
                    let outcome = forged.chunks(piece).try_for_each(|bytes| receiver.push(bytes)).and_then(|()| receiver.finish());
                    receiver.mesh().check_invariants();
                    (outcome, receiver.mesh().arrived_levels(), receiver.newest_mesh())
                });
                prop_assert!(outcomes[0].1 >= 1);
                prop_assert_eq!(&outcomes[0], &outcomes[1]);
            }
        }
    }
}
