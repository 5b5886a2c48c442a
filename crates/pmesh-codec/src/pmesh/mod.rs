//! `.pmesh`, version 0: header with a level table, then the levels, coarsest first. Every byte is in docs/FORMAT.md.
//!
//! The container ([`header`], block framing in `decode` and `encode`) knows nothing of how a refinement is packed, which
//! is `records`' and `channels`' own business: a denser coding replaces those two.

pub(crate) mod channels;
mod decode;
mod encode;
pub mod header;
mod records;
pub(crate) mod texture;
pub(crate) mod varint;

pub use channels::{Quantisation, quantise};
pub use decode::PmeshDecoder;
pub(crate) use encode::check_precision;
pub use encode::{EncodeOptions, LevelStream, encode};

/// First eight bytes of the file: not text, not 7-bit, no line ending survives a conversion unseen.
pub const SIGNATURE: [u8; 8] = [0x89, b'P', b'M', b'S', b'H', 0x0d, 0x0a, 0x1a];
/// The version that is no stream of levels but a hierarchy in blocks (the crate `pmesh-view` reads it).
pub const VIEWS_VERSION: u8 = 4;
/// The same before it was settled: refused.
pub(crate) const OLD_VIEWS_VERSIONS: [u8; 2] = [2, 3];
/// The version written and the newest read.
pub const VERSION: u8 = 0;
/// Most bytes that a level block of `block_bytes` may inflate to. Real levels stay below 4 times; deflate could reach 1,032.
fn inflate_limit(block_bytes: u64) -> u64 {
    (block_bytes + 64) * 50
}

/// Most entries of the level table.
pub const BLOCK_LIMIT: usize = 64;
