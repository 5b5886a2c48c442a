//! A front that keeps to the partial order of its collapses: the older scheme (GV97, GV99) by the same front, mesh and refinement as the truly selective one.
//!
//! A split that others are in the way of makes these go first; a collapse waits for those that it requires. So every star is the one that it was when the mesh was taken apart,
//! at the price of splits that the view did not ask for.

use super::{Front, HierarchyError, NONE, NodeId};
use crate::local::ConstraintGraph;

/// The order, and which of its collapses are done.
#[derive(Clone, Debug)]
pub(super) struct Order {
    graph: ConstraintGraph,
    /// The node that each collapse makes.
    node_of: Vec<u32>,
    /// The collapse of each split, in the order in which these came.
    collapse_of: Vec<u32>,
}

impl Order {
    /// A node whose split must come before that of split `number`; or none.
    pub(super) fn before(&self, number: u32) -> Option<u32> {
        let collapse = self.collapse_of[number as usize];
        let first = self.graph.required_by(collapse).iter().find(|&&r| self.graph.is_collapsed(r))?;
        Some(self.node_of[*first as usize])
    }
    /// Split `number` may be undone.
    pub(super) fn can_collapse(&self, number: u32) -> bool {
        self.graph.can_collapse(self.collapse_of[number as usize])
    }
    /// Split `number` is done, or undone. It was asked whether it may be.
    pub(super) fn take(&mut self, number: u32, is_split: bool) {
        let collapse = self.collapse_of[number as usize];
        let taken = if is_split { self.graph.split(collapse) } else { self.graph.collapse(collapse) };
        debug_assert!(taken.is_ok(), "{taken:?}");
    }
}

impl Front {
    /// From now on the front keeps to an order of collapses, all of which are done (A.26, A.27); `collapse_of` gives that of each node. Nothing is learnt or forgotten
    /// any more. O(known). Errors: a front that is not at the base mesh, a node without a collapse of its own, a collapse that is no node's.
    pub fn follow_order(
        &mut self,
        graph: ConstraintGraph,
        collapse_of: impl Fn(NodeId) -> Option<u32>,
    ) -> Result<(), HierarchyError> {
        let mut order = Order { node_of: vec![NONE; graph.len() as usize], collapse_of: vec![NONE; self.cuts.len()], graph };
        if self.front.len() != self.roots as usize || order.node_of.len() != self.cuts.len() {
            return Err(HierarchyError::OtherOrder { id: NodeId::root(0) });
        }
        for i in (0..self.known.len() as u32).filter(|&i| self.known[i as usize].child != NONE) {
            let id = self.id(i);
            let number = self.number(self.known[i as usize].child) as usize;
            let collapse = collapse_of(id).filter(|&c| order.graph.is_collapsed(c)).ok_or(HierarchyError::OtherOrder { id })?;
            if std::mem::replace(&mut order.node_of[collapse as usize], i) != NONE {
                return Err(HierarchyError::OtherOrder { id });
            }
            order.collapse_of[number] = collapse;
        }
        self.order = Some(order);
        Ok(())
    }
    /// The order that the front keeps to, and which of its collapses are done; if it keeps to any.
    pub fn order(&self) -> Option<&ConstraintGraph> {
        self.order.as_ref().map(|o| &o.graph)
    }
    /// The node that must be split before node `s` is, whose children are known: what is above it, or what the order says.
    pub(super) fn before_in_order(&self, s: u32) -> Option<u32> {
        let order = self.order.as_ref()?;
        let mut at = s;
        while self.known[at as usize].at == NONE {
            at = self.known[at as usize].parent;
            if at == NONE {
                return None;
            }
        }
        if at == s { order.before(self.number(self.known[s as usize].child)) } else { Some(at) }
    }
}
