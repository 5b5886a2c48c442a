//! Local refinement: parts of a mesh finer than others, by a partial order of its collapses (A.26–A.30, D.11–D.14).
//!
//! A collapse is done (`C`) or undone (`S`). One that changed the star of a later one must be done before it, and undone after it;
//! within that order any set of collapses is a valid mesh. [`ConstraintGraph`] keeps the order and counts what stands in the way of
//! each; [`LocalMesh`] keeps the triangles that follow, at a cost in proportion to what changes; [`Refiner`] chooses what to do by the
//! errors of a view.

mod graph;
mod mesh;
mod refiner;

pub use graph::{ConstraintGraph, Refusal};
pub use mesh::LocalMesh;
pub use refiner::{Refiner, Work};
