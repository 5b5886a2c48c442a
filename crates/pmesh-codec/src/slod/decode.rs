//! Packets to levels, one a split, as their bits come.

use super::bits::BitQueue;
use super::encode::packet_order;
use super::{HEADER_BYTES, NARROW_LIMIT, SIGNATURE, VERSION, VERTEX_LIMIT};
use crate::corners::Corners;
use crate::{DecodeError, Decoder, Event, Place, StreamInfo};
use pmesh_core::{CornerMove, Level};
use std::collections::VecDeque;

/// Stands for "this node has been split".
const SPLIT: u32 = u32::MAX;

/// Push decoder of `.slod`. Memory: 24 bytes a vertex and a corner, and what was pushed.
#[derive(Default)]
pub struct SlodDecoder {
    header: Vec<u8>,
    field_bits: u32,
    counts: (u32, u32),
    bits: BitQueue,
    /// Do not look again before so many bits are there: a long update list is not counted at every byte.
    wait_for: usize,
    /// Vertex of each node, or [`SPLIT`].
    nodes: Vec<u32>,
    corners: Corners,
    vertices: u32,
    triangles: u32,
    update_bits: u64,
    /// The split that may still get triangles, and its parent's vertex.
    open: Option<(Level, u32)>,
    finished: bool,
    failed: bool,
    offset: u64,
    events: VecDeque<Event>,
}

impl SlodDecoder {
    /// A decoder at the first byte.
    pub fn new() -> Self {
        Self::default()
    }
    fn place(&self) -> Place {
        Place::Byte(self.offset - (self.bits.len() / 8) as u64)
    }
    fn bad(&self, message: impl Into<String>) -> DecodeError {
        DecodeError::syntax(self.place(), message)
    }

    fn read_header(&mut self) -> Result<(), DecodeError> {
        let h = &self.header;
        let word = |at: usize| h[at..].first_chunk::<4>().copied().unwrap_or_default();
        if h[..4] != SIGNATURE {
            return Err(DecodeError::syntax(Place::Byte(0), "not a .slod file"));
        }
        if h[4] != VERSION {
            return Err(DecodeError::NewerVersion { format: ".slod", found: h[4], known: VERSION });
        }
        self.field_bits = u32::from(h[5]);
        self.counts = (u32::from_le_bytes(word(6)), u32::from_le_bytes(word(10)));
        let limit = match self.field_bits {
            16 => NARROW_LIMIT,
            32 => VERTEX_LIMIT,
            _ => return Err(DecodeError::syntax(Place::Byte(5), "fields are neither 16 nor 32 bits wide")),
        };
        if self.counts.0 == 0 || self.counts.0 > limit || self.counts.1 >= 1 << 30 {
            return Err(DecodeError::syntax(Place::Byte(6), "the number of vertices or triangles is out of range"));
        }
        let bound = |i: usize| f32::from_le_bytes(word(14 + 4 * i));
        let bounds = ([0, 1, 2].map(bound), [3, 4, 5].map(bound));
        let ordered = (0..3).all(|k| bounds.0[k].is_finite() && bounds.1[k].is_finite() && bounds.0[k] <= bounds.1[k]);
        if !ordered {
            return Err(DecodeError::syntax(Place::Byte(14), "the bounding box is none"));
        }
        self.events.push_back(Event::Info(StreamInfo {
            format: "smooth levels of detail (SS97)",
            level_count: Some(self.counts.0),
            bounds: Some(bounds),
            ..Default::default()
        }));
        Ok(())
    }

    /// Reads as many packets as are whole.
    fn packets(&mut self) -> Result<(), DecodeError> {
        while !self.finished {
            if (self.vertices, self.triangles) == self.counts {
                self.close();
                self.finished = true;
                break;
            }
            if self.bits.len() < self.wait_for.max(1) {
                return Ok(());
            }
            self.wait_for = 0;
            let whole = if self.bits.peek(0, 1) == 0 { self.new_vertex()? } else { self.new_triangle()? };
            if !whole {
                return Ok(());
            }
        }
        let rest = self.bits.len();
        if rest >= 8 || self.bits.peek(0, rest as u32) != 0 {
            return Err(self.bad("bytes after the last packet"));
        }
        Ok(())
    }

    /// The split before gets no more triangles.
    fn close(&mut self) {
        if let Some((level, _)) = self.open.take() {
            self.events.push_back(Event::Part(level));
            self.events.push_back(Event::LevelEnd);
        }
    }

    fn new_vertex(&mut self) -> Result<bool, DecodeError> {
        self.close();
        self.corners.begin_level();
        let fixed = 1 + self.field_bits as usize + 96;
        if self.bits.len() < fixed {
            self.wait_for = fixed;
            return Ok(false);
        }
        let new = self.vertices;
        let node = self.bits.peek(1, self.field_bits);
        if new == self.counts.0 {
            return Err(self.bad("more vertices than the header announces"));
        }
        let parent = match self.nodes.get(node as usize) {
            None if new == 0 && node == u32::MAX >> (32 - self.field_bits) => None,
            Some(&vertex) if vertex != SPLIT => Some(vertex),
            _ => return Err(self.bad(format!("node {node} is not one that can be split"))),
        };
        let mut around = Vec::new();
        if let Some(parent) = parent {
            self.corners.of(parent, &mut around);
        }
        let mut candidates: Vec<u32> = around.iter().map(|c| c / 3).collect();
        candidates.dedup();
        if self.bits.len() < fixed + candidates.len() {
            self.wait_for = fixed + candidates.len();
            return Ok(false);
        }
        self.bits.take(1 + self.field_bits);
        let position = [0; 3].map(|_| f32::from_bits(self.bits.take(32)));
        self.update_bits += candidates.len() as u64;
        candidates.retain(|_| self.bits.take(1) == 1);
        let moves = |corner: u32| candidates.binary_search(&(corner / 3)).is_ok();
        let mut level = Level::default();
        level.vertices.positions.push(position);
        level.representatives.extend(parent.map(|p| (new, p)));
        let moved = around.iter().filter(|&&c| moves(c));
        level.corner_moves = moved.map(|&c| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex: new }).collect();
        self.corners.add_vertex();
        match parent {
            None => self.nodes.push(new),
            Some(parent) => {
                self.corners.split(parent, new, &around, |i| moves(around[i]));
                self.nodes[node as usize] = SPLIT;
                self.nodes.extend([parent, new]);
            }
        }
        self.vertices += 1;
        self.open = Some((level, parent.unwrap_or(new)));
        Ok(true)
    }

    fn new_triangle(&mut self) -> Result<bool, DecodeError> {
        let size = 2 + self.field_bits;
        if self.bits.len() < size as usize {
            self.wait_for = size as usize;
            return Ok(false);
        }
        let third = self.bits.peek(1, self.field_bits);
        if self.triangles == self.counts.1 || third >= self.vertices {
            return Err(self.bad("a triangle too many, or one of a vertex that has not arrived"));
        }
        let new = self.vertices.saturating_sub(1);
        let Some((level, parent)) = self.open.as_mut().filter(|(_, parent)| *parent != new) else {
            return Err(self.bad("a triangle before the first split"));
        };
        let orientation = self.bits.peek(1 + self.field_bits as usize, 1);
        let triangle = packet_order(new, *parent, third, orientation);
        level.triangles.push(triangle);
        self.corners.add_triangle(triangle);
        self.bits.take(size);
        self.triangles += 1;
        Ok(true)
    }
}

impl Decoder for SlodDecoder {
    fn push(&mut self, mut bytes: &[u8]) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        self.offset += bytes.len() as u64;
        if self.header.len() < HEADER_BYTES {
            let taken = bytes.len().min(HEADER_BYTES - self.header.len());
            self.header.extend_from_slice(&bytes[..taken]);
            bytes = &bytes[taken..];
            if self.header.len() < HEADER_BYTES {
                return Ok(());
            }
            if let Err(e) = self.read_header() {
                self.failed = true;
                return Err(e);
            }
        }
        self.bits.extend(bytes);
        let read = self.packets();
        self.failed |= read.is_err();
        read
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        if self.finished {
            return Ok(());
        }
        let inside = if self.header.len() < HEADER_BYTES { "the header" } else { "the packets" };
        let levels = self.vertices - u32::from(self.open.is_some());
        Err(DecodeError::Truncated { place: Place::Byte(self.offset), inside, levels })
    }
    fn poll(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
    fn statistics(&self) -> Vec<(&'static str, String)> {
        let (v, t, f) = (u64::from(self.vertices), u64::from(self.triangles), u64::from(self.field_bits));
        let vertex_bits = v * (97 + f) + self.update_bits;
        vec![
            (
                "new_vertex",
                format!(
                    "{v} packets of {} + N bits: {vertex_bits} bits, N {:.2} on average",
                    97 + f,
                    self.update_bits as f64 / v.max(1) as f64
                ),
            ),
            ("new_triangle", format!("{t} packets of {} bits: {} bits", f + 2, t * (f + 2))),
            ("in all", format!("{} bits and a header of {HEADER_BYTES} bytes", vertex_bits + t * (f + 2))),
            (
                "raw mesh",
                format!(
                    "{} bytes (12 a vertex, 6 a triangle, as SS97 counts); this is {:.1} % of it",
                    12 * v + 6 * t,
                    100.0 * self.offset as f64 / (12 * v + 6 * t).max(1) as f64
                ),
            ),
        ]
    }
}
