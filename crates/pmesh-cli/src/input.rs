//! Files in: streams through the decoders, meshes through the importers. Streams are known by their first bytes.

use crate::error::{CliError, Result};
use pmesh_build::import::{Model, import};
use pmesh_codec::{Arrival, DecodeError, Place, Receiver, Texture};
use pmesh_core::Level;
use pmesh_view::ProtocolError;
use std::fs;
use std::path::{Path, PathBuf};

/// Largest file that a model may name (a glTF's buffer or image).
const NAMED_FILE_LIMIT: u64 = 4 << 30;

pub fn read(path: &Path) -> Result<Vec<u8>> {
    let bytes = fs::read(path).map_err(CliError::io(path))?;
    if bytes.is_empty() { Err(CliError::Other(format!("{}: the file is empty", path.display()))) } else { Ok(bytes) }
}

/// A stream after all its bytes, or as many as were to be read.
pub struct Stream {
    pub receiver: Receiver,
    pub texture: Option<Texture>,
    pub warnings: Vec<String>,
    /// Files that the model is in instead.
    pub elsewhere: Vec<String>,
    /// Byte count after each level.
    pub level_bytes: Vec<u64>,
    /// Why it ended early, if it did.
    pub error: Option<DecodeError>,
}

impl Stream {
    /// True of a scene with plain face sets: a mesh, though a decoder reads it.
    pub fn is_plain_scene(&self) -> bool {
        self.receiver.info().is_some_and(|i| i.format == pmesh_codec::scene::PLAIN)
    }
    /// Says what was odd.
    pub fn warn(&self, path: &Path) {
        self.warnings.iter().for_each(|w| eprintln!("warning: {}: {w}", path.display()));
    }
}

/// True if the bytes are a stream that the decoders know.
pub fn is_stream(path: &Path, bytes: &[u8]) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    bytes.starts_with(&pmesh_codec::pmesh::SIGNATURE)
        || bytes.starts_with(&pmesh_codec::slod::SIGNATURE)
        || bytes.starts_with(&pmesh_codec::patch::SIGNATURE)
        || bytes.starts_with(&pmesh_codec::split::SIGNATURE)
        || bytes.starts_with(&[0x1f, 0x8b])
        || [".pmesh", ".lod", ".lod.gz", ".slod", ".pits", ".pfs", ".wrl", ".x3dv", ".x3d"].iter().any(|e| name.ends_with(e))
}

/// Decodes `bytes`; an error ends it but what came before stays. `whole` says that the stream is meant to end there.
pub fn decode(bytes: &[u8], whole: bool) -> Stream {
    let mut stream = Stream {
        receiver: Receiver::default(),
        texture: None,
        warnings: vec![],
        elsewhere: vec![],
        level_bytes: vec![],
        error: None,
    };
    if pmesh_view::is_file(bytes) {
        stream.error = views(bytes, whole, &mut stream).err();
        return stream;
    }
    // Small pushes, so that the byte count at which a level is complete is close.
    let pushed = bytes.chunks(256).try_for_each(|chunk| {
        let result = stream.receiver.push(chunk);
        drain(&mut stream);
        result
    });
    let result = pushed.and_then(|()| if whole { stream.receiver.finish() } else { Ok(()) });
    drain(&mut stream);
    stream.error = result.err();
    stream
}

/// What stands at the head of a file for views; `None` of other files.
pub fn views_head(bytes: &[u8]) -> Option<pmesh_view::Head> {
    pmesh_view::is_file(bytes).then(|| pmesh_view::Head::read(bytes).ok()?.ok()).flatten()
}

/// A file for views: all of it, or what is there, as one level.
fn views(bytes: &[u8], whole: bool, stream: &mut Stream) -> std::result::Result<(), DecodeError> {
    let at = |at: u64, message: String| DecodeError::Syntax { place: Place::Byte(at), message };
    let failed = |e: ProtocolError| match e {
        ProtocolError::Syntax { at: byte, what } => at(byte as u64, what.into()),
        ProtocolError::Damaged { at: byte } => at(byte, "what begins here is damaged: fetch the file again".into()),
        e => at(0, e.to_string()),
    };
    let (mesh, error) = match pmesh_view::read_whole(bytes) {
        Ok(mesh) => (mesh, None),
        Err(e) => (pmesh_view::read_part(bytes).map_err(failed)?, whole.then(|| failed(e))),
    };
    let level = Level { vertices: mesh.vertices, triangles: mesh.triangles, ..Default::default() };
    stream.receiver.mesh_mut().add_level(&level).map_err(|e| at(0, e.to_string()))?;
    stream.level_bytes.push(bytes.len() as u64);
    error.map_or(Ok(()), Err)
}

fn drain(stream: &mut Stream) {
    while let Some(arrival) = stream.receiver.poll() {
        match arrival {
            Arrival::Level { bytes, .. } => stream.level_bytes.push(bytes),
            Arrival::Texture(texture) => match &mut stream.texture {
                // Parts of one image.
                Some(whole) if whole.mime == texture.mime => whole.bytes.extend(texture.bytes),
                other => *other = Some(texture),
            },
            Arrival::Warning(text) => stream.warnings.push(text),
            Arrival::Elsewhere(urls) => stream.elsewhere = urls,
            Arrival::Info(_) | Arrival::Part(_) | Arrival::Picture => {}
        }
    }
}

/// Decodes a stream that must be whole.
pub fn decode_whole(path: &Path, bytes: &[u8]) -> Result<Stream> {
    let stream = decode(bytes, true);
    match stream.error {
        Some(source) => Err(CliError::Decode { path: path.into(), source }),
        None if !stream.elsewhere.is_empty() => Err(CliError::elsewhere(path, &stream.elsewhere)),
        None => Ok(stream),
    }
}

/// Reads a mesh file.
pub fn model(path: &Path, bytes: &[u8]) -> Result<Model> {
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let name = path.to_string_lossy();
    import(&name, bytes, &mut |uri| named_file(&folder, uri)).map_err(CliError::build(path))
}

pub fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let digits = tail.first_chunk::<2>().filter(|_| first == b'%').and_then(|d| std::str::from_utf8(d).ok());
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A file beside the model. Names that lead elsewhere are refused.
fn named_file(folder: &Path, uri: &str) -> Option<Vec<u8>> {
    let uri = percent_decoded(uri);
    let relative = PathBuf::from(&uri);
    let plain = relative.components().all(|c| matches!(c, std::path::Component::Normal(_) | std::path::Component::CurDir));
    let path = folder.join(relative);
    let small = fs::metadata(&path).is_ok_and(|m| m.len() <= NAMED_FILE_LIMIT);
    (plain && small).then(|| fs::read(path).ok()).flatten()
}
