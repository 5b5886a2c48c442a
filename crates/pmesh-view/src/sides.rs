//! The two ends of a packet, while it is written or read: what each knows, in the same words.

use crate::error::ProtocolError;
use crate::model::Model;
use crate::numbers::SIZES;
use crate::tags::ActiveTags;
use pmesh_codec::compact::RingSplit;
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Bounds, Front, NONE, Split};
use rustc_hash::FxHashSet;

/// One end of a packet or a block, while it is written or read: what the other has so far.
pub(crate) trait Side {
    fn roots(&self) -> u32;
    /// The first child of a node that has them here.
    fn child(&self, i: u32) -> Option<u32>;
    fn row(&self, i: u32) -> [i32; 3];
    fn bounds(&self, i: u32) -> Bounds;
    /// The writer: node `i` is to be split, or one below it is.
    fn is_wanted(&self, i: u32) -> bool;
    fn grid(&self) -> &Quantisation;
    fn unit(&self) -> f64;
}

/// The end that learns.
pub(crate) struct Reading<'a> {
    pub(crate) front: &'a mut Front,
    pub(crate) grid: &'a Quantisation,
    /// Nodes of the whole hierarchy.
    pub(crate) total: u64,
}

impl Side for Reading<'_> {
    fn roots(&self) -> u32 {
        self.front.root_count()
    }
    fn child(&self, i: u32) -> Option<u32> {
        self.front.node(i).map(|n| n.child).filter(|&c| c != NONE)
    }
    fn row(&self, i: u32) -> [i32; 3] {
        self.front.node(i).map_or([0; 3], |n| self.grid.position_row(n.position))
    }
    fn bounds(&self, i: u32) -> Bounds {
        self.front.node(i).map_or(Bounds::default(), |n| n.bounds)
    }
    fn is_wanted(&self, _: u32) -> bool {
        false
    }
    fn grid(&self) -> &Quantisation {
        self.grid
    }
    fn unit(&self) -> f64 {
        self.front.unit()
    }
}

/// A split as a packet tells it.
pub(crate) struct Told {
    pub(crate) ring: RingSplit,
    /// The cuts, nodes as the end numbers them.
    pub(crate) cuts: [Option<u32>; 2],
    /// Of both children.
    pub(crate) bounds: [Bounds; 2],
}

/// One end of a packet that is told by the mesh of all that the client knows.
pub(crate) trait Known: Side {
    fn depth(&self, i: u32) -> u32;
    /// Nodes about node `i`, counter-clockwise; true if they close.
    fn neighbours(&mut self, i: u32, out: &mut Vec<u32>) -> bool;
    /// The writer: the node, its neighbours being these, cannot be split yet.
    fn waits(&self, i: u32, about: &[u32]) -> bool;
    /// The writer: what is to be said of a node's split, its neighbours being these, and the bounds of both children.
    fn truth_told(&self, i: u32, about: &[u32]) -> Option<(RingSplit, [Bounds; 2])>;
    /// Has the children from now on; gives the first.
    fn told(&mut self, i: u32, told: &Told) -> Result<u32, ProtocolError>;
}

/// The server's end.
pub(crate) struct Sending<'a> {
    pub(crate) model: &'a Model,
    /// Splits to be written, and what is above them.
    pub(crate) wanted: &'a dyn Fn(u32) -> bool,
    /// Splits that are written.
    pub(crate) done: FxHashSet<u32>,
    /// Splits that the client has beside these.
    pub(crate) knew: &'a dyn Fn(u32) -> bool,
    /// The front after the packet, and its splits.
    pub(crate) tags: &'a ActiveTags,
    pub(crate) new: &'a FxHashSet<u32>,
    /// No bounds are told.
    pub(crate) cuts_only: bool,
}

impl Sending<'_> {
    /// The node above a leaf that has no children at the other end yet.
    fn active(&self, leaf: u32) -> Option<u32> {
        let h = self.model.hierarchy();
        let mut at = h.active_ancestor(leaf, |n| self.tags.contains(n))?;
        loop {
            let parent = h.node(at)?.parent;
            if parent == NONE || !self.new.contains(&parent) || self.done.contains(&parent) {
                return Some(at);
            }
            at = parent;
        }
    }
    /// The node has no children at the other end yet, and is there.
    fn is_active(&self, i: u32) -> bool {
        let is_to_come = |i: u32| self.new.contains(&i) && !self.done.contains(&i);
        let parent = self.model.hierarchy().node(i).map_or(NONE, |n| n.parent);
        (is_to_come(i) || self.tags.contains(i)) && (parent == NONE || !is_to_come(parent))
    }
    /// Places of a node's cuts among its neighbours; their number for one that is not there.
    fn places(&self, i: u32, about: &[u32]) -> [Option<u32>; 2] {
        let h = self.model.hierarchy();
        let place = |c: u32| about.iter().position(|&w| h.is_below(c, w)).unwrap_or(about.len()) as u32;
        h.node(i).map_or([None; 2], |n| n.cuts.map(|c| Some(c).filter(|&c| c != NONE).map(place)))
    }
}

impl Side for Sending<'_> {
    fn roots(&self) -> u32 {
        self.model.hierarchy().root_count()
    }
    fn child(&self, i: u32) -> Option<u32> {
        (self.done.contains(&i) || (self.knew)(i)).then(|| self.model.hierarchy().nodes()[i as usize].child)
    }
    fn row(&self, i: u32) -> [i32; 3] {
        self.model.row(i)
    }
    fn bounds(&self, i: u32) -> Bounds {
        let own = self.model.hierarchy().nodes()[i as usize].bounds;
        if !self.cuts_only || own.is_leaf() || i < self.roots() {
            return own;
        }
        // What the other end takes them for.
        let (mut at, mut steps) = (i, 0);
        while let Some(parent) = self.model.hierarchy().node(at).map(|n| n.parent).filter(|&p| p != NONE) {
            (at, steps) = (parent, steps + 1);
        }
        (0..steps).fold(self.model.hierarchy().nodes()[at as usize].bounds, |b, _| assumed(&b))
    }
    fn is_wanted(&self, i: u32) -> bool {
        (self.wanted)(i)
    }
    fn grid(&self) -> &Quantisation {
        self.model.grid()
    }
    fn unit(&self) -> f64 {
        self.model.hierarchy().unit()
    }
}

impl Known for Sending<'_> {
    fn depth(&self, i: u32) -> u32 {
        self.model.hierarchy().depth(i)
    }
    fn neighbours(&mut self, i: u32, out: &mut Vec<u32>) -> bool {
        self.model.neighbours(i, |w| self.is_active(w), |leaf| self.active(leaf), out)
    }
    fn waits(&self, i: u32, about: &[u32]) -> bool {
        matches!(self.places(i, about), [Some(a), Some(b)] if a == b)
    }
    fn truth_told(&self, i: u32, about: &[u32]) -> Option<(RingSplit, [Bounds; 2])> {
        let h = self.model.hierarchy();
        let child = h.node(i)?.child;
        // One that is not there is nothing that could be said, and an error.
        let ring = RingSplit { cuts: self.places(i, about), place: self.row(child + 1) };
        let bounds = [child, child + 1].map(|c| h.node(c).map_or(Bounds::default(), |n| n.bounds));
        Some((ring, bounds))
    }
    fn told(&mut self, i: u32, _: &Told) -> Result<u32, ProtocolError> {
        self.done.insert(i);
        Ok(self.model.hierarchy().nodes()[i as usize].child)
    }
}

impl Known for Reading<'_> {
    fn depth(&self, i: u32) -> u32 {
        self.front.depth(i)
    }
    fn neighbours(&mut self, i: u32, out: &mut Vec<u32>) -> bool {
        self.front.neighbours(i, out)
    }
    fn waits(&self, _: u32, _: &[u32]) -> bool {
        false
    }
    fn truth_told(&self, _: u32, _: &[u32]) -> Option<(RingSplit, [Bounds; 2])> {
        None
    }
    fn told(&mut self, i: u32, told: &Told) -> Result<u32, ProtocolError> {
        let cuts = told.cuts.map(|c| c.map(|c| self.front.id(c)));
        let position = self.grid.position_of_row(told.ring.place);
        let child = self.front.known() as u32;
        if u64::from(child) + 2 > self.total {
            return Err(ProtocolError::Unexpected("more nodes than the base mesh announces"));
        }
        self.front.learn(&Split { id: self.front.id(i), cuts, position, bounds: told.bounds })?;
        Ok(child)
    }
}

/// Class of a node by its radius.
pub(crate) fn size_of_node<S: Side + ?Sized>(side: &S, i: u32) -> usize {
    let step = if side.grid().position_bits.is_some() { side.grid().position_step } else { 1.0 };
    let steps = Bounds::length(side.bounds(i).radius, side.unit()) / step;
    (32 - (steps.min(1e9) as u32).leading_zeros()).min(SIZES as u32 - 1) as usize
}

/// What a child's bounds are taken for where none are sent: its radius gets smaller from step to step, its error is not known.
pub(crate) fn assumed(parent: &Bounds) -> Bounds {
    Bounds { radius: parent.radius.saturating_sub(2).max(1), uniform: 1, angle: Bounds::NO_CONE, ..Default::default() }
}
