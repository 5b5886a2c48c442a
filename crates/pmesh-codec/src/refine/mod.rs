//! What streams of a base mesh and refinements of its surface have in common: patches (FC01) and forest splits (A.31).
//!
//! The container is `.pmesh`'s ([`crate::pmesh::header`]) with another signature; each block is a level, entropy-coded. The
//! base has a single-rate coder ([`base`]); how a level is coded is its own format's business ([`Levels`]). Encoder and decoder
//! refine the same [`Surface`], so that both number everything alike.

pub(crate) mod base;
pub(crate) mod decode;
pub(crate) mod encode;
pub(crate) mod question;
pub(crate) mod rows;

use crate::range::RangeDecoder;
use pmesh_core::Level;
use pmesh_core::surface::Surface;
use rows::Rows;

/// Most vertices and triangles that a block of `bytes` may announce. Real ones have one or two a byte.
pub(crate) fn item_limit(bytes: u32) -> u64 {
    (u64::from(bytes) + 64) * crate::ITEM_LIMIT as u64
}

/// How the levels after the base are coded.
pub(crate) trait Levels: Send {
    /// Says how many vertices this level and those after it bring, by the table: whoever makes room may heed it, but not believe it.
    fn expect(&mut self, _vertices: u64) {}
    /// Begins a level of `new_vertices` and takes its parameters off the front of `bytes`; false if it is none.
    fn begin(&mut self, bytes: &mut Vec<u8>, new_vertices: u32, width: usize) -> bool;
    /// Most bytes that one piece of work reads: with fewer left of those that have arrived, the level waits.
    fn reach(&self) -> usize {
        usize::MAX
    }
    /// Bits of the levels so far, by what they say: (component, bits).
    fn components(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
    /// Goes on by about `limit` triangles or vertices; true once the level is whole. `part` gets what it brings, vertices
    /// left out: those are `rows`.
    fn step(
        &mut self,
        coder: &mut RangeDecoder,
        surface: &mut Surface,
        rows: &mut Rows,
        limit: usize,
        part: &mut Level,
    ) -> Result<bool, &'static str>;
}
