//! What can go wrong between a file and its levels.

use thiserror::Error;

/// An error of an importer or of a simplifier's input.
#[derive(Debug, Error)]
#[allow(missing_docs)] // the fields are named in the messages
pub enum BuildError {
    #[error("{format}, line {line}: {message}")]
    Line { format: &'static str, line: usize, message: String },
    #[error("{format}, byte {offset}: {message}")]
    Byte { format: &'static str, offset: usize, message: String },
    #[error("{format}: {message}")]
    File { format: &'static str, message: String },
    #[error("the format of {name:?} is not known: OBJ, PLY, STL, OFF, glTF and GLB are read")]
    UnknownFormat { name: String },
    #[error("the mesh is not valid: {0}")]
    Mesh(#[from] pmesh_core::MeshError),
    #[error("the mesh has no vertices: there is nothing to show")]
    Empty,
    #[error("{0}")]
    Option(String),
}
