//! What can be wrong with a level or a request, each with what was expected and what was got.

use thiserror::Error;

/// An error of [`crate::ProgressiveMultilevelMesh`]. A failed call leaves the mesh as it was.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)] // the fields are named in the messages
pub enum MeshError {
    #[error("level {level} was asked for; there are levels {coarsest} (coarsest) to {finest} (finest that has arrived)")]
    NoSuchLevel { level: f64, coarsest: u32, finest: u32 },
    #[error("the level asked for is not a number")]
    LevelIsNaN,
    #[error("no level has arrived yet")]
    Empty,
    #[error(
        "vertices of this mesh move or triangles are replaced between levels, which cannot be stepped through: use triangles_at"
    )]
    NotStepped,
    #[error("triangle {triangle} is replaced, but it is not of an earlier level, or it is replaced twice")]
    BadRetirement { triangle: u32 },
    #[error("{array} holds {got} entries for {expected} vertices")]
    AttributeLength { array: &'static str, expected: usize, got: usize },
    #[error("vertex {vertex} has a coordinate or attribute that is not finite")]
    NotFinite { vertex: u32 },
    #[error("triangle {triangle} uses vertex {vertex}, which has not arrived and has no representative")]
    MissingVertex { triangle: u32, vertex: u32 },
    #[error(
        "vertex {vertex} has representative {representative}; a representative has a lower index and arrives at an earlier level"
    )]
    BadRepresentative { vertex: u32, representative: u32 },
    #[error("vertex {vertex} is given a second representative, {representative}")]
    SecondRepresentative { vertex: u32, representative: u32 },
    #[error("the chain of representatives of vertex {vertex} is longer than {limit} vertices that have not arrived")]
    ChainTooLong { vertex: u32, limit: u32 },
    #[error("corner {corner} of triangle {triangle} cannot move to vertex {vertex}: {reason}")]
    BadCornerMove { triangle: u32, corner: u8, vertex: u32, reason: &'static str },
    #[error("vertex {vertex} is moved, but it is not of an earlier level, or it moves twice in this one")]
    BadMove { vertex: u32 },
    #[error("vertex {vertex} shares the position of vertex {position_of}, which is not an earlier vertex at that position")]
    BadSharedPosition { vertex: u32, position_of: u32 },
    #[error("{count} {what} exceed the limit of {limit}")]
    TooMany { what: &'static str, count: u64, limit: u64 },
}
