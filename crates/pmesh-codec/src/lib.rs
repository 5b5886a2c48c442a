//! Bytes to levels and back. One file or folder a format; a renderer knows none of them, and they know no renderer.
//!
//! Decoders are *push* decoders: [`Decoder::push`] takes bytes cut at any place, [`Decoder::poll`] gives events, and every
//! cut gives the same events or the same error. [`open`] chooses one by sniffing the first bytes; [`Receiver`] puts one and a
//! [`pmesh_core::ProgressiveMultilevelMesh`] together, which is what most callers want.
//!
//! | format | module | written by |
//! |---|---|---|
//! | `.pmesh`, version 0 | [`pmesh`] | [`pmesh::encode`] |
//! | `.pmesh`, version 1 | [`compact`] | [`compact::encode`] |
//! | text, `.lod` (A.21–A.24, D.7) | [`text`] | [`text::write`] |
//! | smooth levels, `.slod` (B.13–B.16) | [`slod`] | [`slod::encode`] |
//! | patches, `.pits` (C.3–C.6) | [`patch`] | [`patch::encode`] |
//! | forest splits, `.pfs` (A.31) | [`split`] | [`split::encode`] |
//! | VRML97 and X3D, `.wrl`, `.x3dv`, `.x3d` (C.7–C.12, A.19) | [`scene`] | [`scene::write`] |
//! | any of them, gzipped | [`gzip`] | flate2 |
//!
//! Nothing here reads a clock, a file or a socket; memory is bounded by what was pushed.

pub mod compact;
mod corners;
mod decoder;
mod error;
pub mod gzip;
pub mod patch;
pub mod pmesh;
pub mod range;
mod receiver;
pub mod refine;
pub mod scene;
mod single;
pub mod slod;
pub mod split;
pub mod text;
pub mod wavelet;

pub use decoder::{Decoder, Event, LevelEntry, StreamInfo, Texture, open};
pub use error::{DecodeError, EncodeError, Place};
pub use receiver::{Arrival, Receiver};
pub use single::{ITEM_LIMIT, SingleMesh, code_mesh};

/// True in a fuzzer's build: no input that it makes up would have the right checksums.
pub(crate) const FUZZING: bool = cfg!(fuzzing);
