//! The two ends of a packet or a block, while it is written or read: what each knows, in the same words.

use crate::error::ProtocolError;
use crate::model::Model;
use crate::splits::split_of;
use crate::tags::ActiveTags;
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Bounds, Front, NONE, NodeId, Split};
use std::collections::HashSet;

/// One end of a packet, while it is written or read: what the client has so far.
pub(crate) trait Side {
    fn roots(&self) -> u32;
    /// The first child of a node that has them here.
    fn child(&self, i: u32) -> Option<u32>;
    fn parent(&self, i: u32) -> Option<u32>;
    fn id(&self, i: u32) -> NodeId;
    fn row(&self, i: u32) -> [i32; 3];
    fn bounds(&self, i: u32) -> Bounds;
    /// Of a node with children.
    fn cuts(&self, i: u32) -> [Option<NodeId>; 2];
    /// The writer: node `i` is to be split, or one below it is.
    fn is_wanted(&self, i: u32) -> bool;
    /// The writer: what is to be said of a node's split.
    fn truth(&self, i: u32) -> Option<Split>;
    /// Has the children from now on; gives the first.
    fn add(&mut self, i: u32, split: &Split) -> Result<u32, ProtocolError>;
    fn grid(&self) -> &Quantisation;
    fn unit(&self) -> f64;
}

/// The end that has the model.
pub(crate) struct Writing<'a> {
    pub(crate) model: &'a Model,
    /// Splits to be written, and what is above them.
    pub(crate) wanted: HashSet<u32>,
    /// Splits that are written.
    pub(crate) done: HashSet<u32>,
    /// Splits that the other end counts on beside these.
    pub(crate) knew: &'a dyn Fn(u32) -> bool,
    /// The front after it, if cuts are told as they stand in it.
    pub(crate) cut_at: Option<&'a ActiveTags>,
}

impl Side for Writing<'_> {
    fn roots(&self) -> u32 {
        self.model.hierarchy().root_count()
    }
    fn child(&self, i: u32) -> Option<u32> {
        (self.done.contains(&i) || (self.knew)(i)).then(|| self.model.hierarchy().nodes()[i as usize].child)
    }
    fn parent(&self, i: u32) -> Option<u32> {
        Some(self.model.hierarchy().nodes()[i as usize].parent).filter(|&p| p != NONE)
    }
    fn id(&self, i: u32) -> NodeId {
        self.model.hierarchy().id(i).unwrap_or(NodeId::root(0))
    }
    fn row(&self, i: u32) -> [i32; 3] {
        self.model.row(i)
    }
    fn bounds(&self, i: u32) -> Bounds {
        let own = self.model.hierarchy().nodes()[i as usize].bounds;
        if self.cut_at.is_none() || i < self.roots() {
            return own;
        }
        // What the other end takes them for.
        let id = self.id(i);
        assumed(self.bounds(id.tree), id.depth().unwrap_or(0), own.is_leaf())
    }
    fn cuts(&self, i: u32) -> [Option<NodeId>; 2] {
        self.model.cuts(i)
    }
    fn is_wanted(&self, i: u32) -> bool {
        self.wanted.contains(&i)
    }
    fn truth(&self, i: u32) -> Option<Split> {
        let h = self.model.hierarchy();
        let mut split = split_of(self.model, i);
        if let Some(tags) = self.cut_at {
            let at = |cut: u32| if cut == NONE { None } else { h.id(h.active_ancestor(cut, |n| tags.contains(n))?) };
            split.cuts = h.nodes()[i as usize].cuts.map(at);
        }
        Some(split)
    }
    fn add(&mut self, i: u32, _: &Split) -> Result<u32, ProtocolError> {
        self.done.insert(i);
        Ok(self.model.hierarchy().nodes()[i as usize].child)
    }
    fn grid(&self) -> &Quantisation {
        self.model.grid()
    }
    fn unit(&self) -> f64 {
        self.model.hierarchy().unit()
    }
}

/// The end that learns.
pub(crate) struct Reading<'a> {
    pub(crate) front: &'a mut Front,
    pub(crate) grid: &'a Quantisation,
    /// Nodes of the whole hierarchy.
    pub(crate) total: u64,
    pub(crate) scope: Option<Scope<'a>>,
}

/// What a block may be told by, of all that the client knows.
pub(crate) struct Scope<'a> {
    /// Block of each split that is known, in their order.
    pub(crate) block_of: &'a mut Vec<u32>,
    pub(crate) block: u32,
    /// The blocks above it.
    pub(crate) chain: Vec<u32>,
    /// Nodes whose split has been read.
    pub(crate) done: HashSet<u32>,
}

impl Side for Reading<'_> {
    fn roots(&self) -> u32 {
        self.front.root_count()
    }
    fn child(&self, i: u32) -> Option<u32> {
        let child = self.front.node(i).map(|n| n.child).filter(|&c| c != NONE)?;
        let Some(scope) = &self.scope else { return Some(child) };
        let block = scope.block_of.get((child - self.front.root_count()) as usize / 2);
        (scope.done.contains(&i) || block.is_some_and(|b| scope.chain.contains(b))).then_some(child)
    }
    fn parent(&self, i: u32) -> Option<u32> {
        self.front.node(i).map(|n| n.parent).filter(|&p| p != NONE)
    }
    fn id(&self, i: u32) -> NodeId {
        self.front.id(i)
    }
    fn row(&self, i: u32) -> [i32; 3] {
        self.front.node(i).map_or([0; 3], |n| self.grid.position_row(n.position))
    }
    fn bounds(&self, i: u32) -> Bounds {
        self.front.node(i).map_or(Bounds::default(), |n| n.bounds)
    }
    fn cuts(&self, i: u32) -> [Option<NodeId>; 2] {
        self.front.node(i).map_or([None; 2], |n| n.cuts)
    }
    fn is_wanted(&self, _: u32) -> bool {
        false
    }
    fn truth(&self, _: u32) -> Option<Split> {
        None
    }
    fn add(&mut self, i: u32, split: &Split) -> Result<u32, ProtocolError> {
        if let Some(scope) = &mut self.scope {
            scope.done.insert(i);
            // A part of a block may be here already.
            if let Some(child) = self.front.node(i).map(|n| n.child).filter(|&c| c != NONE) {
                return Ok(child);
            }
        }
        let child = self.front.known() as u32;
        if u64::from(child) + 2 > self.total {
            return Err(ProtocolError::Unexpected("more nodes than the base mesh announces"));
        }
        self.front.learn(split)?;
        if let Some(scope) = &mut self.scope {
            scope.block_of.push(scope.block);
        }
        Ok(child)
    }
    fn grid(&self) -> &Quantisation {
        self.grid
    }
    fn unit(&self) -> f64 {
        self.front.unit()
    }
}

/// What a node's bounds are taken for where none are sent: its radius gets smaller from step to step, its error is not known.
pub(crate) fn assumed(root: Bounds, depth: u32, is_leaf: bool) -> Bounds {
    let radius = root.radius.saturating_sub(depth.saturating_mul(2).min(254) as u8).max(1);
    if is_leaf { Bounds::default() } else { Bounds { radius, uniform: 1, sine: Bounds::NO_CONE, ..Default::default() } }
}
