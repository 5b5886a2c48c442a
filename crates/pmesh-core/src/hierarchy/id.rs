//! Names of nodes that tell the way to them.

/// A node by its tree (its base vertex) and the way down: the root is 1, the children of `i` are `2 i` and `2 i + 1` (E.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId {
    /// Number of the base vertex.
    pub tree: u32,
    /// The way down; its highest bit is the root's. 0 names nothing.
    pub node: u64,
}

impl NodeId {
    /// Deepest level of a node, the root's being 0: ways are 64 bits.
    pub const DEPTH_LIMIT: u32 = 63;

    /// The root of a tree.
    pub fn root(tree: u32) -> Self {
        Self { tree, node: 1 }
    }
    /// Steps from the root; `None` if the way is 0, which leads nowhere.
    pub fn depth(self) -> Option<u32> {
        self.node.checked_ilog2()
    }
    /// The node above; `None` of a root.
    pub fn parent(self) -> Option<Self> {
        (self.node > 1).then_some(Self { node: self.node >> 1, ..self })
    }
    /// The second child if `second`, else the first; `None` below [`Self::DEPTH_LIMIT`].
    pub fn child(self, second: bool) -> Option<Self> {
        let node = (self.node >> 63 == 0).then_some(self.node << 1 | u64::from(second))?;
        Some(Self { node, ..self })
    }
    /// True if `self` is on the way to `other`, or is `other`.
    pub fn is_above(self, other: Self) -> bool {
        match (self.depth(), other.depth()) {
            (Some(own), Some(below)) => self.tree == other.tree && own <= below && other.node >> (below - own) == self.node,
            _ => false,
        }
    }
    /// The first node on the way up that is in the front (E.4). Needs to know nothing below the front. O(depth).
    pub fn active_ancestor(self, is_active: impl Fn(Self) -> bool) -> Option<Self> {
        let mut at = self;
        while !is_active(at) {
            at = at.parent()?;
        }
        Some(at)
    }
    /// Steps down to this node from the root: true is the second child.
    pub fn way(self) -> impl Iterator<Item = bool> {
        let depth = self.depth().unwrap_or(0);
        (0..depth).rev().map(move |i| self.node >> i & 1 == 1)
    }
}

/// Bits that name any node of a hierarchy (E.16).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdBits {
    /// Of the tree.
    pub tree: u32,
    /// Of the way down.
    pub node: u32,
}

impl IdBits {
    /// For so many base vertices, and the deepest node so many steps below its root.
    pub fn new(base_vertices: u32, depth: u32) -> Self {
        Self { tree: base_vertices.max(1).next_power_of_two().ilog2(), node: depth + 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn g19_the_front_above_0_10_is_0_2() {
        let id = NodeId { tree: 0, node: 10 };
        let front = NodeId { tree: 0, node: 2 };
        assert_eq!(id.active_ancestor(|n| n == front), Some(front));
        assert!(front.is_above(id) && !id.is_above(front) && !NodeId::root(1).is_above(id));
        assert_eq!(id.way().collect::<Vec<_>>(), [false, true, false]);
        assert_eq!(NodeId { tree: 0, node: 0 }.active_ancestor(|_| false), None);
        assert_eq!(NodeId { tree: 0, node: u64::MAX }.child(true), None);
    }

    #[test]
    fn g23_bits_of_table_1() {
        // Base vertices and deepest level to the bits of the paper's table.
        for (base, depth, tree, node) in [(62, 15, 6, 16), (75, 13, 7, 14), (12, 27, 4, 28), (146, 22, 8, 23), (65, 24, 7, 25)] {
            assert_eq!(IdBits::new(base, depth), IdBits { tree, node });
        }
    }
}
