//! Progressive forest split (A.31; Taubin, Guéziec, Horn & Lazarus 1998): `.pfs`.
//!
//! To refine a mesh, some of its edges are marked, no cycle among them. Each tree is cut open, which makes a polygon of two sides
//! an edge and as many copies of a vertex as edges of the tree meet there, and the polygon is filled with triangles.
//! One copy keeps the vertex's number and place; the others are new and the kept one is their representative: so a split
//! reads as a clustering of the finer mesh.
//!
//! A bit an edge says what is marked; none where it would close a cycle, where the tree would be too large, or where the
//! surface is no surface. The triangles are a bit a step of a parser ("join the last two sides to a triangle, or take the next
//! side"), which is two bits a triangle at most, as A.31 counts; none where a triangle would not vanish in the coarser
//! mesh. Then an adaptive range coder. The base mesh has a single-rate coder of its own ([`crate::refine`]).

mod encode;
mod level;
mod tree;

pub use encode::{SplitReport, SplitStream, encode};

use crate::pmesh::header::Container;
use crate::refine::decode::RefinementDecoder;

/// First eight bytes of the file.
pub const SIGNATURE: [u8; 8] = [0x89, b'P', b'F', b'S', b'P', 0x0d, 0x0a, 0x1a];
/// Most edges of a tree: a decoder does a tree in one go.
pub const TREE_LIMIT: u32 = 256;

/// A push decoder at the first byte.
pub fn decoder() -> RefinementDecoder {
    RefinementDecoder::new(Container::Forest, Box::<level::SplitLevels>::default())
}
