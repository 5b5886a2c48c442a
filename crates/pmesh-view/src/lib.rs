//! View-dependent streaming (E.6–E.19): a client that moves through a model gets what it looks at, in the order in which it looks, and each
//! piece once.
//!
//! Nothing here knows a socket or a clock: bytes of whole messages go in and come out. [`Model`] is what a server has of a mesh and all its sessions
//! share; [`Session`] is one client at the server: which nodes it has, a bit or so each ([`ActiveTags`]). [`Client`] is the other end. What they say is in
//! docs/PROTOCOL.md; [`message`] writes and reads it, [`splits`] the packets that refine.
//!
//! [`write_file`] packs a model into a file of blocks, and [`FileClient`] says which parts of it a view needs: then any server of files will do. Both clients have a [`Viewer`].

mod base;
mod blocks;
mod client;
mod error;
mod fans;
mod file;
mod file_client;
pub mod message;
mod model;
mod numbers;
mod pack;
mod patch;
mod session;
mod sides;
pub mod splits;
mod tags;
mod viewer;

pub use base::Base;
pub use client::Client;
pub use error::ProtocolError;
pub use file::{Head, is_file, read_model, read_part, read_whole, write_file, write_file_of};
pub use file_client::FileClient;
pub use model::Model;
pub use pack::BlockSizes;
pub use session::{Counts, Session};
pub use tags::ActiveTags;
pub use viewer::{Limits, Viewer};
