//! Scenes as text: VRML97 (`.wrl`), X3D's classic encoding (`.x3dv`) and its XML (`.x3d`).
//!
//! Plain face sets are one level. FC01's `ProgIndexedTriSet` with `ProgLOD` levels inside it plays level by level (C.7–C.12);
//! GV99's `MultiLevelProgIfs` names another stream (A.19, A.20), which an [`crate::Event::Elsewhere`] passes on. A scene is
//! parsed once it has all arrived; of one that is cut short, the levels that are whole are given.
//!
//! [`write`] writes a patch stream as such nodes.

mod decode;
mod geometry;
mod prog;
pub mod tree;
mod write;
mod x3d;

pub(crate) use decode::BYTE_ORDER_MARK;
pub use decode::{PLAIN, SceneDecoder};
pub use write::{Encoding, write, write_urls};
