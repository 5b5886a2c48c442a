//! Numbers to levels: the blocks of the text format, as they come.

use super::tokens::{Token, Tokens};
use super::{SURFACE_PARTITION_LINE, TextOptions, TextVariant};
use crate::{DecodeError, Decoder, Event, Place, StreamInfo};
use pmesh_core::Level;
use std::collections::{HashSet, VecDeque};

/// Which block is open or comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Block {
    Vertices,
    Triangles,
    Representatives,
}

impl Block {
    fn name(self) -> &'static str {
        match self {
            Block::Vertices => "a vertex block",
            Block::Triangles => "a triangle block",
            Block::Representatives => "the block of representatives",
        }
    }
}

/// Push decoder of the text format.
pub struct TextDecoder {
    tokens: Tokens,
    blocks: Blocks,
    failed: bool,
}

struct Blocks {
    options: TextOptions,
    dimension: Option<usize>,
    next: Block,
    open: bool,
    level: Level,
    level_line: u64,
    coordinates: Vec<f32>,
    /// Corners of the triangle being read.
    corners: Vec<u32>,
    /// Vertices that still lack a representative, the next one last.
    wanted: Vec<u32>,
    vertex_count: u32,
    /// Vertices that have a representative but have not arrived.
    named: HashSet<u32>,
    levels: u32,
    events: VecDeque<Event>,
}

impl TextDecoder {
    /// A decoder; options that are `None` are inferred.
    pub fn new(options: TextOptions) -> Self {
        let blocks = Blocks {
            options,
            dimension: options.dimension.map(usize::from),
            next: Block::Vertices,
            open: false,
            level: Level::default(),
            level_line: 1,
            coordinates: Vec::new(),
            corners: Vec::new(),
            wanted: Vec::new(),
            vertex_count: 0,
            named: HashSet::new(),
            levels: 0,
            events: VecDeque::from([Event::Info(StreamInfo { format: "text", ..Default::default() })]),
        };
        Self { tokens: Tokens::new(), blocks, failed: false }
    }
}

impl Decoder for TextDecoder {
    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        for &byte in bytes {
            let blocks = &mut self.blocks;
            let result = self.tokens.push(byte, |token, line| blocks.token(token, line));
            self.failed |= result.is_err();
            result?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        let blocks = &mut self.blocks;
        self.tokens.end_number(&mut |token, line| blocks.token(token, line))?;
        let between_levels = !self.blocks.open && self.blocks.next == Block::Vertices && self.blocks.levels > 0;
        if between_levels {
            return Ok(());
        }
        let (inside, levels) = (self.blocks.next.name(), self.blocks.levels);
        Err(DecodeError::Truncated { place: self.tokens.place(), inside, levels })
    }

    fn poll(&mut self) -> Option<Event> {
        self.blocks.events.pop_front()
    }
}

impl Blocks {
    fn token(&mut self, token: Token, line: u64) -> Result<(), DecodeError> {
        let place = Place::Line(line);
        match (token, self.open) {
            (Token::FirstComment(text), _) => {
                if text.trim_end() == SURFACE_PARTITION_LINE.trim_start_matches('#') {
                    self.options.variant = TextVariant::SurfacePartition;
                }
                Ok(())
            }
            (Token::Open, false) => {
                self.open = true;
                self.level_line = line;
                Ok(())
            }
            (Token::Open, true) => Err(DecodeError::syntax(place, format!("'{{' inside {}", self.next.name()))),
            (Token::Close, true) => {
                self.open = false;
                self.close(place)
            }
            (Token::Close, false) => Err(DecodeError::syntax(place, "'}' without '{'")),
            (Token::Number(x), true) => self.number(x, place),
            (Token::StrayStop(x), true) => {
                let text = format!("{place}: a full stop behind {x:?} is read as a comma");
                self.events.push_back(Event::Warning(text));
                self.number(x, place)
            }
            (Token::Number(_) | Token::StrayStop(_), false) => {
                Err(DecodeError::syntax(place, "a number outside a block: blocks stand in braces"))
            }
        }
    }

    fn number(&mut self, x: f64, place: Place) -> Result<(), DecodeError> {
        match self.next {
            Block::Vertices => {
                let value = x as f32;
                if !value.is_finite() {
                    return Err(DecodeError::syntax(place, format!("coordinate {x:e} does not fit a 32-bit float")));
                }
                self.coordinates.push(value);
                Ok(())
            }
            Block::Triangles => self.triangle_index(index(x, place)?, place),
            Block::Representatives if x == -1.0 => {
                self.corners.push(u32::MAX);
                Ok(())
            }
            Block::Representatives => {
                self.corners.push(index(x, place)?);
                Ok(())
            }
        }
    }

    fn missing(&self, v: u32) -> bool {
        v >= self.vertex_count && !self.named.contains(&v)
    }

    fn triangle_index(&mut self, i: u32, place: Place) -> Result<(), DecodeError> {
        if let Some(vertex) = self.wanted.pop() {
            if i >= vertex {
                let message = format!("{i} stands for vertex {vertex}, but a representative has a lower index");
                return Err(DecodeError::syntax(place, message));
            }
            self.level.representatives.push((vertex, i));
            self.named.insert(vertex);
            if self.missing(i) {
                self.wanted.push(i);
            }
        } else {
            self.corners.push(i);
        }
        self.want_next()
    }

    /// With three corners read, asks for the next representative that is lacking, or ends the triangle.
    fn want_next(&mut self) -> Result<(), DecodeError> {
        let [a, b, c] = self.corners[..] else { return Ok(()) };
        if !self.wanted.is_empty() {
            return Ok(());
        }
        let interleaved = self.options.variant == TextVariant::Interleaved;
        match [a, b, c].into_iter().find(|&v| interleaved && self.missing(v)) {
            Some(v) => self.wanted.push(v),
            None => {
                self.level.triangles.push([a, b, c]);
                self.corners.clear();
            }
        }
        Ok(())
    }

    fn close(&mut self, place: Place) -> Result<(), DecodeError> {
        match self.next {
            Block::Vertices => {
                self.close_vertices(place)?;
                self.next = Block::Triangles;
            }
            Block::Triangles => {
                if !self.wanted.is_empty() || !self.corners.is_empty() {
                    let message =
                        "the block ends inside a triangle: three indices, then a representative for each that is missing";
                    return Err(DecodeError::syntax(place, message));
                }
                let first = self.options.variant == TextVariant::SurfacePartition && self.levels == 0;
                if first {
                    self.next = Block::Representatives;
                } else {
                    self.end_level();
                }
            }
            Block::Representatives => {
                let later = (self.vertex_count..).zip(std::mem::take(&mut self.corners));
                self.level.representatives.extend(later.filter(|p| p.1 != u32::MAX));
                self.end_level();
            }
        }
        Ok(())
    }

    fn close_vertices(&mut self, place: Place) -> Result<(), DecodeError> {
        let numbers = std::mem::take(&mut self.coordinates);
        let dimension = *self.dimension.get_or_insert(if numbers.len().is_multiple_of(3) { 3 } else { 2 });
        if !numbers.len().is_multiple_of(dimension) {
            let message = format!("{} numbers are no {dimension}-dimensional vertices", numbers.len());
            return Err(DecodeError::syntax(place, message));
        }
        let point = |c: &[f32]| [c[0], c[1], c.get(2).copied().unwrap_or(0.0)];
        self.level.vertices.positions = numbers.chunks(dimension).map(point).collect();
        let first = self.vertex_count;
        self.vertex_count += self.level.vertices.len() as u32;
        (first..self.vertex_count).for_each(|v| {
            self.named.remove(&v);
        });
        Ok(())
    }

    fn end_level(&mut self) {
        self.events.push_back(Event::Part(std::mem::take(&mut self.level)));
        self.events.push_back(Event::LevelEnd);
        self.levels += 1;
        self.next = Block::Vertices;
    }
}

fn index(x: f64, place: Place) -> Result<u32, DecodeError> {
    // The last two values are sentinels.
    if x.fract() == 0.0 && (0.0..f64::from(u32::MAX - 1)).contains(&x) {
        return Ok(x as u32);
    }
    Err(DecodeError::syntax(place, format!("{x} is not a vertex index")))
}
