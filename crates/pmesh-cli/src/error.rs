//! Everything that can end a command, with the file it concerns.

use std::path::{Path, PathBuf};
use thiserror::Error;

#[derive(Debug, Error)]
pub enum CliError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Decode { path: PathBuf, source: pmesh_codec::DecodeError },
    #[error("{}: {source}", path.display())]
    Build { path: PathBuf, source: pmesh_build::BuildError },
    #[error("{}: {source}", path.display())]
    Encode { path: PathBuf, source: pmesh_codec::EncodeError },
    #[error("{0}")]
    Mesh(#[from] pmesh_core::MeshError),
    /// What was asked for cannot be, whatever the file holds.
    #[error("{0}")]
    Usage(String),
    #[error("{0}")]
    Other(String),
}

pub type Result<T> = std::result::Result<T, CliError>;

impl CliError {
    /// 2 where the command line is wrong, 1 for all else.
    pub fn exit_code(&self) -> u8 {
        use pmesh_build::BuildError;
        match self {
            CliError::Usage(_) | CliError::Build { source: BuildError::Option(_), .. } => 2,
            _ => 1,
        }
    }
    /// A scene that only names other files: no file is read that was not asked for.
    pub fn elsewhere(path: &Path, urls: &[String]) -> Self {
        let join = if urls.len() > 1 { format!(" (joined: cat {} > model.pits)", urls.join(" ")) } else { String::new() };
        CliError::Other(format!("{}: the model is in other files; name them instead: {}{join}", path.display(), urls.join(", ")))
    }
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| CliError::Io { path: path.into(), source }
    }
    pub fn build(path: &Path) -> impl FnOnce(pmesh_build::BuildError) -> Self + '_ {
        |source| CliError::Build { path: path.into(), source }
    }
    pub fn encode(path: &Path) -> impl FnOnce(pmesh_codec::EncodeError) -> Self + '_ {
        |source| CliError::Encode { path: path.into(), source }
    }
}
