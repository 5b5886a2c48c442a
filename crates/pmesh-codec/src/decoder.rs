//! The one interface of all decoders, and the choice among them by the first bytes.

use crate::{DecodeError, Place, gzip::GzipDecoder, patch, pmesh::PmeshDecoder, scene, slod, split, text::TextDecoder};
use pmesh_core::{AttributeSet, Level};

/// A level as the stream's own table announces it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelEntry {
    /// Byte at which the level ends, counted from the start of the file: after so many bytes it can be shown.
    pub end_byte: u64,
    /// Vertices of the level, all coarser ones included.
    pub vertex_count: u32,
    /// Triangles of the level, all coarser ones included.
    pub triangle_count: u32,
    /// Geometric error in model units: about how far the level lies from the finest.
    pub error: f32,
}

/// What is known of a stream before its first level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StreamInfo {
    /// Name of the format, for people.
    pub format: &'static str,
    /// Attributes of the vertices.
    pub attribute_set: AttributeSet,
    /// The level table, coarsest first; `None` where the format has none.
    pub levels: Option<Vec<LevelEntry>>,
    /// Number of levels, where the format says that but has no table.
    pub level_count: Option<u32>,
    /// Bounding box of the finest level, where the format says.
    pub bounds: Option<([f32; 3], [f32; 3])>,
    /// Identifies the content of the file, so that a resumed download is not mixed with another file.
    pub file_id: Option<u64>,
    /// Bytes of the whole stream.
    pub total_bytes: Option<u64>,
    /// Byte at which the base-colour image ends, if the stream announces one.
    pub texture_end_byte: Option<u64>,
    /// Bits a coordinate, `None` if positions are exact floats.
    pub position_bits: Option<u8>,
    /// A level can be shown as far as it has arrived: every part ends with a whole surface.
    pub shows_parts: bool,
}

/// A base-colour image, still in its own coding.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// The image file.
    pub bytes: Vec<u8>,
}

/// What a decoder gives.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// First, once.
    Info(StreamInfo),
    /// A part of the level that is arriving.
    Part(Level),
    /// The level is complete.
    LevelEnd,
    /// The image that texture coordinates refer to.
    Texture(Texture),
    /// Something is odd but can be read.
    Warning(String),
    /// The model is in other files, one after the other: URLs relative to this one's.
    Elsewhere(Vec<String>),
}

/// A push decoder: bytes in, in any cuts; events out.
pub trait Decoder {
    /// Takes the next bytes. After an error it takes no more; events decoded before can still be polled.
    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError>;
    /// Does a small piece of what the bytes pushed have left to do; false if nothing is left. Call it until then; between two
    /// calls a page may have its turn.
    fn work(&mut self) -> Result<bool, DecodeError> {
        Ok(false)
    }
    /// Says that the stream has ended, once no work is left; an error if it ends in the middle of something.
    fn finish(&mut self) -> Result<(), DecodeError>;
    /// The next event, if there is one.
    fn poll(&mut self) -> Option<Event>;
    /// What the format's own paper counts, for people: (name, value).
    fn statistics(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }
    /// Bytes decoded so far by what they say, fractions counted: (component, bytes). Empty where a format does not keep these apart.
    fn components(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
}

/// A decoder that chooses the format by the first bytes it is given.
pub fn open() -> Box<dyn Decoder + Send> {
    Box::new(Sniffer { seen: Vec::new(), chosen: None, inside_gzip: false })
}

pub(crate) fn open_inside_gzip() -> Box<dyn Decoder + Send> {
    Box::new(Sniffer { seen: Vec::new(), chosen: None, inside_gzip: true })
}

/// White space that a text file may begin with.
const SNIFF_LIMIT: usize = 4096;

struct Sniffer {
    seen: Vec<u8>,
    chosen: Option<Box<dyn Decoder + Send>>,
    inside_gzip: bool,
}

impl Sniffer {
    fn choose(&self) -> Result<Option<Box<dyn Decoder + Send>>, DecodeError> {
        let seen = &self.seen[..];
        let signature = &crate::pmesh::SIGNATURE[..];
        let starts = |sig: &[u8]| sig.starts_with(seen) || seen.starts_with(sig);
        if starts(signature) {
            // The version follows.
            if seen.get(signature.len()) == Some(&crate::pmesh::VIEWS_VERSION) {
                let message =
                    "a file for views: <p-mesh src=\"…\" view-dependent> shows it, pmesh decode makes a mesh of it".into();
                return Err(DecodeError::Syntax { place: Place::Byte(signature.len() as u64), message });
            }
            if seen.get(signature.len()).is_some_and(|v| crate::pmesh::OLD_VIEWS_VERSIONS.contains(v)) {
                let message = "a file for views of an earlier version: encode the mesh once more, by pmesh encode MESH -o FILE.pmesh --profile views".into();
                return Err(DecodeError::Syntax { place: Place::Byte(signature.len() as u64), message });
            }
            return Ok(seen.get(signature.len()).map(|&version| match version {
                crate::pmesh::VERSION => Box::new(PmeshDecoder::new()) as Box<_>,
                // The newest, which refuses what is newer still.
                _ => Box::new(crate::compact::decoder()) as Box<_>,
            }));
        }
        if starts(&patch::SIGNATURE) {
            let whole = seen.len() >= patch::SIGNATURE.len();
            return Ok(whole.then(|| Box::new(patch::decoder()) as Box<_>));
        }
        if starts(&split::SIGNATURE) {
            let whole = seen.len() >= split::SIGNATURE.len();
            return Ok(whole.then(|| Box::new(split::decoder()) as Box<_>));
        }
        if starts(&slod::SIGNATURE) {
            let whole = seen.len() >= slod::SIGNATURE.len();
            return Ok(whole.then(|| Box::new(slod::SlodDecoder::new()) as Box<_>));
        }
        if !self.inside_gzip && starts(&[0x1f, 0x8b]) {
            return Ok((seen.len() >= 2).then(|| Box::new(GzipDecoder::new()) as Box<_>));
        }
        let seen_plain = seen.strip_prefix(&scene::BYTE_ORDER_MARK).unwrap_or(seen);
        if [&b"#VRML"[..], b"#X3D"].iter().any(|sig| seen_plain.starts_with(sig)) {
            return Ok(Some(Box::new(scene::SceneDecoder::new())));
        }
        if seen_plain.len() < 5 && [&b"#VRML"[..], b"#X3D"].iter().any(|sig| sig.starts_with(seen_plain))
            || scene::BYTE_ORDER_MARK.starts_with(seen)
        {
            return Ok(None);
        }
        let head = &seen_plain[..seen_plain.len().min(SNIFF_LIMIT)];
        match head.iter().find(|b| !b.is_ascii_whitespace()) {
            None if seen.len() < SNIFF_LIMIT => Ok(None),
            Some(b'<') => {
                let text = String::from_utf8_lossy(head).to_ascii_lowercase();
                // A web page where a model should be is what servers send for what they lack.
                let page = ["<!doctype html", "<html"].iter().any(|p| text.trim_start().starts_with(p));
                match text.contains("<x3d") {
                    true => Ok(Some(Box::new(scene::SceneDecoder::new()))),
                    false if page || seen.len() >= SNIFF_LIMIT => Err(DecodeError::UnknownFormat { found: describe(seen) }),
                    false => Ok(None),
                }
            }
            Some(b'#' | b'{') => Ok(Some(Box::new(TextDecoder::new(Default::default())))),
            _ => Err(DecodeError::UnknownFormat { found: describe(seen) }),
        }
    }
}

fn describe(bytes: &[u8]) -> String {
    let head = &bytes[..bytes.len().min(12)];
    match std::str::from_utf8(head) {
        Ok(text) => format!("{text:?}"),
        Err(_) => format!("bytes {head:02x?}"),
    }
}

impl Decoder for Sniffer {
    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        if let Some(chosen) = &mut self.chosen {
            return chosen.push(bytes);
        }
        self.seen.extend_from_slice(bytes);
        if self.seen.is_empty() {
            return Ok(());
        }
        if let Some(mut chosen) = self.choose()? {
            let seen = std::mem::take(&mut self.seen);
            let result = chosen.push(&seen);
            self.chosen = Some(chosen);
            return result;
        }
        Ok(())
    }
    fn work(&mut self) -> Result<bool, DecodeError> {
        self.chosen.as_mut().map_or(Ok(false), |c| c.work())
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        match &mut self.chosen {
            Some(chosen) => chosen.finish(),
            None => {
                let place = crate::Place::Byte(self.seen.len() as u64);
                Err(DecodeError::Truncated { place, inside: "the first bytes", levels: 0 })
            }
        }
    }
    fn poll(&mut self) -> Option<Event> {
        self.chosen.as_mut()?.poll()
    }
    fn statistics(&self) -> Vec<(&'static str, String)> {
        self.chosen.as_ref().map_or_else(Vec::new, |c| c.statistics())
    }
    fn components(&self) -> Vec<(&'static str, f64)> {
        self.chosen.as_ref().map_or_else(Vec::new, |c| c.components())
    }
}
