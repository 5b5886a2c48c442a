//! What can be wrong with a stream: each error names the place and the way out.

use pmesh_core::MeshError;
use std::fmt;
use thiserror::Error;

/// Where in the input: a byte offset (of binary formats) or a line (of text).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Offset from the start of the file.
    Byte(u64),
    /// Line number, from 1.
    Line(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Byte(b) => write!(f, "byte {b}"),
            Place::Line(l) => write!(f, "line {l}"),
        }
    }
}

/// Why decoding stopped. What was decoded before stays valid.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs)] // the fields are named in the messages
pub enum DecodeError {
    #[error(
        "this is not a progressive mesh: it begins with {found}; .pmesh, .pits, .pfs, .slod, .lod, VRML97 and X3D files, gzipped or not, are read. Make one with `pmesh encode`"
    )]
    UnknownFormat { found: String },
    #[error(
        "the file has {format} version {found}, and this decoder reads up to {known}: use a newer pmesh, or re-encode the model"
    )]
    NewerVersion { format: &'static str, found: u8, known: u8 },
    #[error("{place}: {message}")]
    Syntax { place: Place, message: String },
    #[error(
        "{place}: the stream ends inside {inside}: it was cut short; fetch the rest, or use the {levels} whole levels before it"
    )]
    Truncated { place: Place, inside: &'static str, levels: u32 },
    #[error("{place}: the checksum of {what} does not match: the file is damaged or changed while it was read; fetch it again")]
    Checksum { place: Place, what: String },
    #[error("{place}: {what} of {got} exceeds the limit of {limit}")]
    Limit { place: Place, what: &'static str, got: u64, limit: u64 },
    #[error("{place}: {source}")]
    Mesh { place: Place, source: MeshError },
    #[error("no more is read after the error before it")]
    Stopped,
}

impl DecodeError {
    pub(crate) fn syntax(place: Place, message: impl Into<String>) -> Self {
        DecodeError::Syntax { place, message: message.into() }
    }
    /// A short stable name, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            DecodeError::UnknownFormat { .. } => "unknown-format",
            DecodeError::NewerVersion { .. } => "newer-version",
            DecodeError::Syntax { .. } => "syntax",
            DecodeError::Truncated { .. } => "truncated",
            DecodeError::Checksum { .. } => "checksum",
            DecodeError::Limit { .. } => "limit",
            DecodeError::Mesh { .. } => "invalid-mesh",
            DecodeError::Stopped => "stopped",
        }
    }
}

/// Why encoding failed.
#[derive(Debug, Error)]
#[allow(missing_docs)]
pub enum EncodeError {
    #[error("cannot write: {0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Mesh(#[from] MeshError),
    #[error("{what} cannot be written in this format: {way_out}")]
    Unsupported { what: &'static str, way_out: &'static str },
    #[error("{what} is {got}; {expected}")]
    BadOption { what: &'static str, got: String, expected: &'static str },
}
