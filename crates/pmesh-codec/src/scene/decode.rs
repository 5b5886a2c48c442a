//! The push decoder of scenes: collects the text, parses it at its end.

use super::geometry::{merged, shapes, url};
use super::prog;
use super::tree::parse;
use super::x3d::parse_xml;
use crate::{DecodeError, Decoder, Event, Place, StreamInfo};
use pmesh_core::Level;
use std::collections::VecDeque;

/// What some editors write before UTF-8.
pub(crate) const BYTE_ORDER_MARK: [u8; 3] = [0xef, 0xbb, 0xbf];

/// Decodes `.wrl`, `.x3dv` and `.x3d`. Memory: some ten times the text.
#[derive(Default)]
pub struct SceneDecoder {
    text: Vec<u8>,
    failed: bool,
    events: VecDeque<Event>,
}

impl SceneDecoder {
    /// A decoder at the first byte.
    pub fn new() -> Self {
        Self::default()
    }

    fn levels(&mut self, levels: Vec<Level>, format: &'static str) {
        let set = levels.first().map(|l| l.vertices.set()).unwrap_or_default();
        let info = StreamInfo { format, attribute_set: set, level_count: Some(levels.len() as u32), ..Default::default() };
        self.events.push_back(Event::Info(info));
        for level in levels {
            self.events.push_back(Event::Part(level));
            self.events.push_back(Event::LevelEnd);
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
                let read = prog::read(node, error.is_some());
                warnings.extend(read.warnings);
                error = error.or(read.error);
                if !read.levels.is_empty() {
                    self.levels(read.levels, "ProgIndexedTriSet (FC01)");
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
                    self.levels(vec![Level { vertices, triangles, position_of, ..Default::default() }], "scene");
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
