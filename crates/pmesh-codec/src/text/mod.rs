//! The papers' text format (GV99 Figures 6 and 13, items A.21–A.24) and GV97's Surface Partition variant (D.7).
//!
//! Blocks `{ … }` alternate: vertices of the coarsest level, triangles of the coarsest level, vertices of the next, and
//! so on; `#` starts a comment. A triangle is three global vertex indices, then one representative for each of them
//! that has not arrived and has none yet. In the Surface Partition variant, which begins with the line
//! `#surface partition`, a third block after the first two holds the representatives of all later vertices in order
//! (`-1`: none), and triangles are plain triples.
//!
//! Departures: GV97 gives no syntax, so that first line is ours; "3.0." is read as 3.0 with a warning, since the paper
//! prints it so.

mod reader;
mod tokens;
mod writer;

pub use reader::TextDecoder;
pub use writer::write;

/// Which of the two layouts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextVariant {
    /// GV99: representatives stand where they are first needed.
    #[default]
    Interleaved,
    /// GV97: all representatives after the first triangles.
    SurfacePartition,
}

/// How to read or write it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextOptions {
    /// 2 or 3 coordinates a vertex. Reading, `None` infers it from the first vertex block (A.21); writing, it means 3.
    pub dimension: Option<u8>,
    /// The layout. Reading, the first line may also say so.
    pub variant: TextVariant,
}

/// First line of the Surface Partition variant.
pub const SURFACE_PARTITION_LINE: &str = "#surface partition";
