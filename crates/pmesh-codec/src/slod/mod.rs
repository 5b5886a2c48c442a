//! Smooth levels of detail (SS97): a packet a vertex split, every packet boundary a model (B.13–B.16). Files end in `.slod`.
//!
//! The packets are the paper's, bit for bit, most significant bits first:
//!
//! | packet | fields | bits |
//! |---|---|---|
//! | new_vertex | tag 0, parent node F, x y z as IEEE singles, update list N | 1 + F + 96 + N = **113 + N** |
//! | new_triangle | tag 1, vertex F, orientation 1 | 1 + F + 1 = **18** |
//!
//! F is 16 up to 32,768 vertices and 32 beyond. The first packet makes the root: its parent is all ones, its N is 0. The
//! k-th split makes the nodes 2k-1, which keeps the parent's vertex, and 2k, the new one. The update list has a bit for each
//! triangle that holds the parent's vertex, in the order of their arrival: 1 moves it to the new vertex. A triangle is
//! (new vertex, parent's vertex, third), or with orientation 1 (parent's vertex, new vertex, third).
//!
//! Before the packets stand 38 bytes that the paper leaves to the transport: `SLOD`, version 1, F, the numbers of vertices
//! and triangles, and the bounding box. After them, zero bits fill the last byte.

mod bits;
mod decode;
mod encode;

pub use decode::SlodDecoder;
pub use encode::{SlodReport, encode};

/// First bytes of a file.
pub const SIGNATURE: [u8; 4] = *b"SLOD";
/// Version of the 38 bytes.
const VERSION: u8 = 1;
/// Bytes before the packets.
const HEADER_BYTES: usize = 38;
/// Most vertices whose nodes 16 bits can name, all ones excepted.
const NARROW_LIMIT: u32 = 32_768;
/// Most vertices: levels are as many.
const VERTEX_LIMIT: u32 = 1 << 28;
