//! What every client has, wherever splits come from: a front that follows a view, within limits.

use crate::base::Base;
use crate::error::ProtocolError;
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Allowance, Front, Progress, UnderWay, View};

/// What a client may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Triangles of the front. The tolerance gets coarser until the view does with so many.
    pub triangles: usize,
    /// Bytes of what is known ([`Viewer::memory_bytes`]): what lies below the front is forgotten when there are more, and the front stays so small that half of them is enough for it.
    /// From a file, blocks on the way to one that is needed come on top of that: some 400 kB for the first, 25 kB for each other, as many as the file is deep (a dozen for half a million vertices).
    pub memory: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { triangles: usize::MAX, memory: usize::MAX }
    }
}

/// Bytes that a triangle of a front takes at most, what is above the front included: half a node of the front, and as much above it.
const TRIANGLE_BYTES: usize = 100;
/// The same with the mesh of all that is known, which may be as large.
const FOLLOWED_BYTES: usize = TRIANGLE_BYTES + 36;
/// The same with what the blocks of a file begin with.
const BLOCKS_BYTES: usize = TRIANGLE_BYTES + 40;
/// Bytes of a split, without that.
pub(crate) const SPLIT_BYTES: usize = 2 * TRIANGLE_BYTES;

/// Most splits for each byte that came. Real ones take some six bytes, or ten.
pub(crate) const SPLITS_A_BYTE: u64 = 8;

/// A front, and what it is of.
#[derive(Debug, Default)]
pub struct Viewer {
    pub(crate) front: Front,
    pub(crate) grid: Quantisation,
    pub(crate) fingerprint: Option<u64>,
    pub(crate) total: u64,
    extent: [[f32; 3]; 2],
    limits: Limits,
    allowance: Allowance,
    pub(crate) is_drawn: bool,
    pub(crate) splits: u64,
    pub(crate) evictions: u64,
    /// Bytes that it takes to learn more.
    pub(crate) beside: usize,
}

impl Viewer {
    /// The base mesh is here.
    pub(crate) fn begin(&mut self, base: Base) -> Result<(), ProtocolError> {
        self.front = Front::new(base.positions, &base.bounds, base.triangles, base.unit)?;
        if self.is_drawn {
            self.front.draw();
        }
        self.extent = base.extent;
        (self.grid, self.fingerprint, self.total) = (base.grid, Some(base.fingerprint), base.total);
        Ok(())
    }
    /// Looks at up to `budget` nodes, and refines what is too coarse for the view that the limits allow, which it gives, too.
    pub(crate) fn refine(&mut self, view: &View, budget: u32) -> Result<(View, Progress), ProtocolError> {
        let view = self.allowance.view(view);
        let each = if self.front.follows_cuts() {
            FOLLOWED_BYTES
        } else if self.beside > 0 {
            BLOCKS_BYTES
        } else {
            TRIANGLE_BYTES
        };
        let limit = self.limits.triangles.min(self.limits.memory / 2 / each).max(1);
        self.front.limit_triangles(limit);
        let progress = self.front.refine(&view, budget)?;
        let leaving = self.front.under_way().leaving;
        self.allowance.learn(&progress, (self.front.len(), leaving), self.front.triangles(), limit);
        Ok((view, progress))
    }
    /// True if there is so much more than allowed that something should be forgotten, and can be.
    pub(crate) fn is_over(&self, by: usize) -> bool {
        self.memory_bytes() > self.limits.memory.saturating_add(by) && self.front.known() > 2 * self.front.len()
    }

    /// Moves what is under way: [`Front::advance`].
    pub fn advance(&mut self, view: &View, step: f64, budget: u32) -> Result<UnderWay, ProtocolError> {
        Ok(self.front.advance(view, step, budget)?)
    }
    /// What the client may take from now on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }
    pub(crate) fn limits(&self) -> Limits {
        self.limits
    }
    /// The front and its mesh.
    pub fn front(&self) -> &Front {
        &self.front
    }
    /// The front, for who draws it and takes what has changed.
    pub fn front_mut(&mut self) -> &mut Front {
        &mut self.front
    }
    /// True until the base mesh is here.
    pub fn is_empty(&self) -> bool {
        self.fingerprint.is_none()
    }
    /// Smallest and largest corner of the model's bounding box, once the base mesh is here.
    pub fn extent(&self) -> [[f32; 3]; 2] {
        self.extent
    }
    /// Nodes of the whole hierarchy, once the base mesh is here.
    pub fn total(&self) -> u64 {
        self.total
    }
    /// True once nothing is left to ask for.
    pub fn has_all(&self) -> bool {
        self.fingerprint.is_some() && self.front.known() as u64 >= self.total
    }
    /// Bytes of what is known, and, of a file, of what its blocks begin with.
    pub fn memory_bytes(&self) -> usize {
        self.front.memory_bytes() + self.beside
    }
    /// By how much the tolerance is coarser than asked for, for the limits' sake: in quarters of an octave.
    pub fn allowance(&self) -> u32 {
        self.allowance.step()
    }
    /// Times that something was forgotten.
    pub fn evictions(&self) -> u64 {
        self.evictions
    }
    /// Splits received.
    pub fn splits(&self) -> u64 {
        self.splits
    }
}
