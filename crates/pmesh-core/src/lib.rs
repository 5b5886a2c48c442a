//! The progressive multilevel mesh: one structure for every stream, every level of it a prefix of two arrays.
//!
//! # How does it work?
//!
//! The short answer: vertices and triangles are kept coarsest first. A level is a *prefix* of both arrays; a triangle
//! corner that points past the prefix is drawn at its *representative*, followed until it falls inside.
//!
//! The longer answer: simplification maps vertices onto other vertices, and that map is a forest
//! ([`forest`]). A [`Level`] undoes a batch of it: vertices appear, corners of existing triangles move from a
//! representative to a new vertex, triangles appear. [`ProgressiveMultilevelMesh::add_level`] appends one,
//! [`ProgressiveMultilevelMesh::set_level`] asks for any level, fractional ones included, and
//! [`ProgressiveMultilevelMesh::prefix`] says, in four numbers, all that a renderer needs to draw it ([`geomorph`]).
//!
//! This crate reads no bytes, no clock, no file and no randomness.
//!
//! Sources: Guéziec, Taubin, Horn, Lazarus, *A Framework for Streaming Geometry in VRML* (1999), items A.1–A.14;
//! Guéziec, Lazarus, Taubin, *Surface Partitions* (1997), items D.1–D.9. Departures: corners hold the finest vertex
//! that has *arrived*, not the finest of all, so that nothing in the input sizes an array; a vertex that moves
//! between levels becomes a new *version* with the old one as its representative, instead of a secondary array.
//!
//! ```
//! use pmesh_core::{Level, ProgressiveMultilevelMesh, AttributeSet};
//! let mut mesh = ProgressiveMultilevelMesh::new(AttributeSet::default());
//! let mut coarse = Level::default();
//! coarse.vertices.positions = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]];
//! coarse.triangles = vec![[0, 1, 2]];
//! mesh.add_level(&coarse)?;
//! let mut fine = Level::default();
//! fine.vertices.positions = vec![[1., 1., 0.]];
//! fine.representatives = vec![(3, 1)];
//! fine.triangles = vec![[1, 3, 2]];
//! mesh.add_level(&fine)?;
//! assert_eq!(mesh.triangles_at(0)?.len(), 2);
//! mesh.set_level(0.5)?; // half way between the two
//! assert_eq!(mesh.prefix().fraction, 0.5);
//! # Ok::<(), pmesh_core::MeshError>(())
//! ```

mod append;
mod error;
mod export;
pub mod forest;
pub mod geomorph;
pub mod hierarchy;
mod level;
pub mod local;
mod mesh;
mod multilevel;
pub mod normals;
mod pending;
pub mod polygon;
pub mod reference;
mod retired;
mod split;
pub mod stepped;
pub mod surface;
mod versions;

pub use append::Change;
pub use error::MeshError;
pub use geomorph::Prefix;
pub use level::{CornerMove, Level, MovedVertices};
pub use mesh::{AttributeSet, Attributes, IndexedMesh, Vertices, turned};
pub use multilevel::ProgressiveMultilevelMesh;
pub use split::split_levels;
