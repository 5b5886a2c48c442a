//! The truly selective scheme: a vertex hierarchy, any front of which is a mesh (E.1–E.5, E.10–E.16).
//!
//! Source: Kim & Lee 2004, and 2001 for the fundamental cut vertices. A node stands for the vertices of the finest mesh below it; a front has
//! one node on each way from a root to a leaf. Its mesh is the finest one with each corner at the front's node above it. A split can be
//! done at once wherever its two cut vertices lie, unless they stand at one node: then that node goes first.
//!
//! [`VertexHierarchy`] is all of it, as a server has it; [`Front`] is what a client knows, with the mesh of its front; [`View`] says what is
//! to be refined, [`Allowance`] how coarse it must be for a limit on triangles. [`NodeId`] names nodes where one side does not know the other's numbers.

mod allowance;
mod bounds;
mod finest;
mod forget;
mod front;
mod geomorph;
mod id;
mod known;
mod mesh;
mod ordered;
mod tree;
mod view;

pub use allowance::Allowance;
pub use bounds::Bounds;
pub use front::{Front, KnownNode, Progress, Split};
pub use geomorph::UnderWay;
pub use id::{IdBits, NodeId};
pub use mesh::FrontMesh;
pub use tree::{HierarchyError, Node, VertexHierarchy};
pub use view::{View, ViewError};

/// Stands for "nothing there".
pub const NONE: u32 = u32::MAX;
