//! The compact stream: `.pmesh` version 1.
//!
//! A base mesh by a single-rate coder, then levels of vertex splits. A level is coded vertex by vertex: does it split, which arc
//! of its triangles goes to the new vertex, where does that stand. Everything is predicted from what is known by models that
//! learn on the way, and a range coder writes how far the predictions were off.

mod arrival;
mod center;
mod encode;
mod exact;
mod filter;
mod float;
mod lessons;
mod level;
mod mixer;
mod number;
mod options;
mod place;
mod ring;
mod sharpen;
mod site;
mod truth;
mod vector;

pub use center::Side;
pub use encode::{CompactReport, CompactStream, Removed, encode, seams};
pub use level::Spent;
pub use ring::{Ring, RingModel, RingSplit, RingVertex};

use crate::pmesh::header::Container;
use crate::refine::decode::RefinementDecoder;

/// Version of `.pmesh`.
pub const VERSION: u8 = 1;

/// A push decoder at the first byte.
pub fn decoder() -> RefinementDecoder {
    RefinementDecoder::new(Container::Compact, Box::<level::CompactLevels>::default())
}
