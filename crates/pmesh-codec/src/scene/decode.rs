//! The push decoder of scenes: collects the text and parses it at its end, and what there is of it each time that doubles, since
//! levels of FC01's node may be whole by then.

use super::geometry::{merged, shapes, url};
use super::prog;
use super::tree::parse;
use super::x3d::parse_xml;
use crate::{DecodeError, Decoder, Event, Place, StreamInfo};
use pmesh_core::{AttributeSet, Level};
use std::collections::VecDeque;

/// [`StreamInfo::format`] of a scene of plain face sets.
pub const PLAIN: &str = "scene";
const PROGRESSIVE: &str = "ProgIndexedTriSet (FC01)";
/// Bytes after which a scene is parsed for the first time.
const FIRST_LOOK: usize = 16 << 10;
/// What some editors write before UTF-8.
pub(crate) const BYTE_ORDER_MARK: [u8; 3] = [0xef, 0xbb, 0xbf];

/// What a base is known by: its attributes and its first triangle.
type Base = (AttributeSet, Option<[u32; 3]>);

fn base(level: &Level) -> Base {
    (level.vertices.set(), level.triangles.first().copied())
}

/// Decodes `.wrl`, `.x3dv` and `.x3d`. Memory: some ten times the text.
#[derive(Default)]
pub struct SceneDecoder {
    text: Vec<u8>,
    /// How many times what there is was looked at.
    looks: u32,
    /// Levels given out, what their base is known by, and whether their base was turned over.
    given: usize,
    base: Option<Base>,
    turned: Option<bool>,
    failed: bool,
    events: VecDeque<Event>,
}

impl SceneDecoder {
    /// A decoder at the first byte.
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives out the levels that are new; `count` is how many there are, if that is known.
    fn levels(&mut self, levels: Vec<Level>, format: &'static str, count: Option<u32>) {
        if self.given == 0 {
            self.base = levels.first().map(base);
            let set = self.base.map(|b| b.0).unwrap_or_default();
            self.events.push_back(Event::Info(StreamInfo {
                format,
                attribute_set: set,
                level_count: count,
                ..Default::default()
            }));
        }
        let new = levels.len().saturating_sub(self.given);
        self.given = self.given.max(levels.len());
        for level in levels.into_iter().rev().take(new).rev() {
            self.events.push_back(Event::Part(level));
            self.events.push_back(Event::LevelEnd);
        }
    }

    /// Parses the first `end` bytes and gives out the levels that are whole there.
    fn look(&mut self, end: usize) {
        let bytes = &self.text[..end];
        let text = String::from_utf8_lossy(bytes.strip_prefix(&BYTE_ORDER_MARK).unwrap_or(bytes));
        let parsed = if text.trim_start().starts_with('<') { parse_xml(&text) } else { parse(&text) };
        let shapes = shapes(&parsed.nodes, &parsed.protos, &mut Vec::new());
        let [shape] = &shapes[..] else { return };
        // Fields before the levels are whole once two levels have begun; the last of them may not be.
        let progressive = shape.node.name == "ProgIndexedTriSet" && shape.node.texts("levelsUrl").is_empty();
        if progressive && shape.node.nodes("levels").count() >= 2 {
            let read = prog::read(shape.node, true, self.turned);
            if read.error.is_none() && read.levels.len() > self.given {
                self.turned = Some(read.turned);
                self.levels(read.levels, PROGRESSIVE, None);
            }
        }
    }
}

impl Decoder for SceneDecoder {
    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        if self.failed {
            return Err(DecodeError::Stopped);
        }
        self.text.extend_from_slice(bytes);
        Ok(())
    }
    fn work(&mut self) -> Result<bool, DecodeError> {
        // The same prefixes however the bytes were cut.
        let due = FIRST_LOOK.checked_shl(self.looks).filter(|&due| due <= self.text.len() && !self.failed);
        due.inspect(|_| self.looks += 1).map_or(Ok(false), |due| {
            self.look(due);
            Ok(true)
        })
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        let bytes = std::mem::take(&mut self.text);
        let text = String::from_utf8_lossy(bytes.strip_prefix(&BYTE_ORDER_MARK).unwrap_or(&bytes));
        if text.starts_with("#VRML V1") {
            self.failed = true;
            let what = "VRML 1.0 is not read: convert it to VRML97 or X3D, which most modelling programs write";
            return Err(DecodeError::syntax(Place::Line(1), what));
        }
        let parsed = if text.trim_start().starts_with('<') { parse_xml(&text) } else { parse(&text) };
        let mut warnings = parsed.warnings;
        let shapes = shapes(&parsed.nodes, &parsed.protos, &mut warnings);
        let mut error = parsed.error;
        let progressive = shapes.iter().map(|s| s.node).find(|n| n.name == "ProgIndexedTriSet");
        if let Some(node) = progressive {
            if shapes.len() > 1 {
                warnings.push(format!("beside ProgIndexedTriSet {} other shapes are left out", shapes.len() - 1));
            }
            if node.texts("levelsUrl").is_empty() {
                let read = prog::read(node, error.is_some(), self.turned);
                warnings.extend(read.warnings);
                error = error.or(read.error);
                let count = read.levels.len() as u32;
                if self.given > 0 && self.base != read.levels.first().map(base) {
                    // It was shown otherwise.
                    let what = "fields of the base stand after the levels: put levels last";
                    error = error.or(Some((node.line, what.into())));
                } else if count > 0 {
                    self.levels(read.levels, PROGRESSIVE, Some(count));
                }
            } else {
                // C.9: then all other fields are ignored.
                self.events.push_back(Event::Elsewhere(node.texts("levelsUrl").into_iter().map(String::from).collect()));
            }
        } else if let Some(node) = shapes.iter().map(|s| s.node).find(|n| n.name == "MultiLevelProgIfs") {
            match url(node) {
                Some(url) => self.events.push_back(Event::Elsewhere(vec![url])),
                None => error = error.or(Some((node.line, "MultiLevelProgIfs has no urlData".into()))),
            }
        } else {
            match merged(&shapes, &mut warnings) {
                Ok(mesh) if !mesh.vertices.is_empty() => {
                    let (vertices, triangles, position_of) = (mesh.vertices, mesh.triangles, mesh.position_of);
                    self.levels(vec![Level { vertices, triangles, position_of, ..Default::default() }], PLAIN, Some(1));
                }
                Ok(_) => error = error.or(Some((1, "the scene has no IndexedFaceSet and no ProgIndexedTriSet".into()))),
                Err(e) => error = error.or(Some(e)),
            }
        }
        self.events.extend(warnings.into_iter().map(Event::Warning));
        match error {
            None => Ok(()),
            Some((line, what)) => {
                self.failed = true;
                Err(DecodeError::syntax(Place::Line(line), what))
            }
        }
    }
    fn poll(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}
