//! Patch-coloured streams (Fogel, Cohen-Or, Ironi & Zvi 2001; C.3–C.6): `.pits`, for ProgIndexedTriSet.
//!
//! A coarser mesh is made by removing an independent set of vertices and filling each hole with a patch. To refine it, its
//! triangles are coloured, three colours and "no patch"; each connected piece of a colour is a patch, gives way to a star, and
//! the star's middle is predicted from the rim and corrected. The base mesh has a single-rate coder of its own ([`crate::refine`]).
//!
//! Departures from the paper: instead of LZ and Huffman an adaptive range coder, which sees what a colour's neighbours are;
//! patches are fans, so that a representative can express them; the predictor looks beyond the rim (C.4 leaves it open).

mod encode;
mod level;

pub use encode::{PatchLevel, PatchReport, PatchStream, Removed, encode};

use crate::pmesh::header::Container;
use crate::refine::decode::RefinementDecoder;

/// First eight bytes of the file.
pub const SIGNATURE: [u8; 8] = [0x89, b'P', b'I', b'T', b'S', 0x0d, 0x0a, 0x1a];

/// A push decoder at the first byte.
pub fn decoder() -> RefinementDecoder {
    RefinementDecoder::new(Container::Patches, Box::<level::PatchLevels>::default())
}
