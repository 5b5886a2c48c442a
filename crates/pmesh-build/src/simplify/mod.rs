//! Quadric edge collapse (Garland & Heckbert 1997) to an ordered list of collapses, from the input down to its base.
//!
//! Departures: collapses are chosen a vertex at a time, its cheapest neighbour; costs that a collapse nearby has raised are
//! brought up to date when their turn comes. What would break topology, a boundary or a seam is not forbidden but
//! costs as much as losing the star altogether, so that small components vanish in their turn and every mesh reaches a
//! base of a few dozen triangles. What would turn a triangle over waits until nothing else is left.
//!
//! Half-edge collapses keep vertices in place, for lossless streams; [`Placement::Optimal`] moves the one that stays to
//! the least quadric error, for shapes as close as possible, at the price of sending where it moved.

mod batches;
mod closest;
mod collapser;
mod forests;
mod lattice;
mod patches;
mod quadric;
mod ring;
mod surgery;

pub use batches::{BatchOptions, Profile, collapse_batches};
pub use closest::cluster_closest;
pub use collapser::simplify;
pub use forests::{ForestOptions, collapse_forests};
pub use patches::{PatchOptions, remove_patches};

/// Where the vertex that stays stands after a collapse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// Where it was: half-edge collapses.
    #[default]
    Kept,
    /// At the least quadric error.
    Optimal,
}

/// How far and how to collapse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifyOptions {
    /// Stop at so many triangles; 0 leaves a vertex a component.
    pub target_triangles: usize,
    /// Where vertices stand.
    pub placement: Placement,
}

/// One collapse of a position onto another; where attributes jump, several wedges go at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// One past the last of its (blue, red) wedges in [`Collapses::pairs`].
    pub pairs_end: u32,
    /// Geometric error of the mesh after the step, model units; never falls.
    pub error: f32,
    /// Triangles left after the step.
    pub triangle_count: u32,
    /// Representative vertex of the position that stays.
    pub red: u32,
    /// Where the red position stood before the step (D.9).
    pub red_before: [f32; 3],
}

/// The ordered list of collapses, finest first.
#[derive(Clone, Debug, Default)]
pub struct Collapses {
    /// (blue, red) vertices; each vertex is blue at most once.
    pub pairs: Vec<(u32, u32)>,
    /// The steps.
    pub steps: Vec<Step>,
    /// Positions after the last step, one a vertex of the input.
    pub positions: Vec<[f32; 3]>,
}

impl Collapses {
    /// Leaves out the collapses after the first that reaches `triangles`.
    pub fn truncate(&mut self, triangles: usize) {
        self.steps.truncate(self.steps.partition_point(|s| s.triangle_count as usize > triangles) + 1);
        self.pairs.truncate(self.steps.last().map_or(0, |s| s.pairs_end as usize));
    }
    /// `mesh` simplified to at most `triangles` triangles, or as far as the list goes; vertices keep their indices, and
    /// those that are gone are used by no triangle. O(n).
    pub fn mesh_at(&self, mesh: &pmesh_core::IndexedMesh, triangles: usize) -> pmesh_core::IndexedMesh {
        let done = self.steps.partition_point(|s| s.triangle_count as usize > triangles) + 1;
        let done = done.min(self.steps.len());
        let mut out = mesh.clone();
        out.vertices.positions.clone_from(&self.positions);
        for step in self.steps[done..].iter().rev() {
            out.vertices.positions[step.red as usize] = step.red_before;
        }
        for &(v, p) in &mesh.position_of {
            out.vertices.positions[v as usize] = out.vertices.positions[p as usize];
        }
        let mut to: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
        let pairs = done.checked_sub(1).map_or(0, |last| self.steps[last].pairs_end as usize);
        // Later pairs first: then each red's own representative is known.
        for &(blue, red) in self.pairs[..pairs].iter().rev() {
            to[blue as usize] = to[red as usize];
        }
        out.triangles = mesh.triangles.iter().map(|t| t.map(|v| to[v as usize])).collect();
        out.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        out
    }
}
