//! Why a session ends.

use pmesh_core::hierarchy::{HierarchyError, ViewError};
use thiserror::Error;

/// What is wrong with a message. The session is over then; nothing else is affected.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ProtocolError {
    /// A message that cannot be read.
    #[error("byte {at}: {what}")]
    Syntax {
        /// Byte of the message.
        at: usize,
        /// What is wrong there.
        what: &'static str,
    },
    /// A message that may not come now.
    #[error("{0}")]
    Unexpected(&'static str),
    /// Of another model, or of another version of it.
    #[error("the model has changed since: expected {expected:016x}, not {found:016x}; load it anew")]
    OtherModel {
        /// The model's fingerprint.
        expected: u64,
        /// What the message says.
        found: u64,
    },
    /// Of a file: the checksum is another.
    #[error("byte {at} of the file and what follows is damaged, or the file has changed since; load it anew")]
    Damaged {
        /// First byte of the part that is damaged.
        at: u64,
    },
    /// A view that is none.
    #[error(transparent)]
    View(#[from] ViewError),
    /// Splits that do not fit.
    #[error(transparent)]
    Hierarchy(#[from] HierarchyError),
    /// What the other end says of why it closes.
    #[error("the server says: {0}")]
    Closed(String),
    /// The same, and it would say so again.
    #[error("the server says: {0}")]
    Refused(String),
}
