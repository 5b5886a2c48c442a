//! Meshes to levels: read a file ([`import`]) or make a [`sample`], collapse it ([`simplify`]), cut the collapses into
//! levels ([`pipeline`]), and hand them to a codec.
//!
//! Every way to make levels ends in one [`arrange::Forest`], a parent and a level for each vertex, and one function,
//! [`arrange::arrange`], that orders the arrays by it:
//!
//! | source | module | items |
//! |---|---|---|
//! | quadric edge collapse, cut where counts grow by a factor | [`simplify`], [`pipeline`] | A.2, D.9 |
//! | an ordered list of collapses, by the exact rule | [`rule`] | A.7, A.8, D.2–D.5, D.10 |
//! | independent sets of vertices, forests of collapses (streams of their own) | [`simplify`] | C.3–C.5, A.31 |
//! | collapses to a vertex hierarchy, for views | [`hierarchy`] | E.3, E.10, E.15 |
//! | vertex clusterings, topology-changing ones too | [`cluster`] | A.25 |

pub mod arrange;
pub mod cluster;
pub mod compact;
pub mod compare;
mod error;
pub mod hierarchy;
pub mod import;
pub mod measure;
pub mod picture;
pub mod pipeline;
pub mod rule;
pub mod sample;
pub mod simplify;
mod vector;

pub use error::BuildError;
