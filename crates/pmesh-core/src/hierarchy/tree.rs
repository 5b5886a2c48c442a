//! All of a hierarchy, as a server has it: static, shared by its sessions.

use super::finest::Finest;
use super::{Bounds, IdBits, NONE, NodeId};
use thiserror::Error;

/// Why collapses make no hierarchy, or a split is none.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs)] // the fields are named in the messages
pub enum HierarchyError {
    #[error("collapse {collapse} names vertex {vertex}: it does not exist, is gone by then, or is both ends")]
    BadVertex { collapse: u32, vertex: u32 },
    #[error("collapse {collapse} lies more than {} steps below its root", NodeId::DEPTH_LIMIT)]
    TooDeep { collapse: u32 },
    #[error("{count} vertices: at most {limit}")]
    TooMany { count: u64, limit: u64 },
    #[error("there is no node {}:{}", id.tree, id.node)]
    NoSuchNode { id: NodeId },
    #[error("node {}:{} has children already", id.tree, id.node)]
    SplitTwice { id: NodeId },
    #[error("node {}:{} cannot be cut at {}:{}", id.tree, id.node, cut.tree, cut.node)]
    BadCut { id: NodeId, cut: NodeId },
    #[error("node {}:{} has no neighbours where it is cut", id.tree, id.node)]
    NotAdjacent { id: NodeId },
    #[error("triangle {triangle} of the base mesh names a vertex that is not there")]
    BadTriangle { triangle: u32 },
    #[error("node {}:{} must be split first, and its children are not here", id.tree, id.node)]
    NotHere { id: NodeId },
    #[error("where node {}:{} is cut is known no further than {}:{}", id.tree, id.node, at.tree, at.node)]
    OpenCut { id: NodeId, at: NodeId },
    #[error("node {}:{} has no collapse of its own in the order, or the front is not where that begins", id.tree, id.node)]
    OtherOrder { id: NodeId },
    #[error("a front that keeps to an order learns nothing more")]
    Ordered,
    #[error("a position or a length that is not finite")]
    NotFinite,
}

/// Most vertices: nodes are twice as many, and their numbers 32 bits.
const VERTEX_LIMIT: u64 = 1 << 30;

/// A collapse: `blue` goes onto `red`. The two triangles at the edge between them vanish; `cuts` are their third corners, in the finest mesh:
/// of (blue, red, cut), then of (blue, cut, red). At a boundary one is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// The node above, or [`NONE`].
    pub parent: u32,
    /// The first of two children, or [`NONE`]: the red one, which stays where the node is. The blue one is the next.
    pub child: u32,
    /// Leaves whose ancestors in a front are the ends of the cut, or [`NONE`]: the fundamental cut vertices.
    pub cuts: [u32; 2],
    /// The vertex whose position it has.
    pub vertex: u32,
    /// What lies below it.
    pub bounds: Bounds,
}

/// Nodes in the order in which a breadth-first walk would have them, roots first: every parent is before its children, and what a coarse front has
/// before what a fine one has (E.14).
#[derive(Clone, Debug, Default)]
pub struct VertexHierarchy {
    nodes: Vec<Node>,
    positions: Vec<[f32; 3]>,
    roots: u32,
    depth: u32,
    base_triangles: Vec<[u32; 3]>,
    unit: f64,
    pub(super) finest: Finest,
}

impl VertexHierarchy {
    /// From collapses (blue, red, the two cuts as vertices or [`NONE`]) in the order in which they were made, and the triangles that are left, corners at
    /// vertices. Bounds are zero: [`Self::set_bounds`]. O(n). Errors: as [`HierarchyError`] says.
    pub fn new(
        positions: Vec<[f32; 3]>,
        collapses: &[(u32, u32, [u32; 2])],
        base_triangles: &[[u32; 3]],
    ) -> Result<Self, HierarchyError> {
        let n = positions.len();
        if n as u64 > VERTEX_LIMIT {
            return Err(HierarchyError::TooMany { count: n as u64, limit: VERTEX_LIMIT });
        }
        if positions.iter().flatten().any(|x| !x.is_finite()) {
            return Err(HierarchyError::NotFinite);
        }
        let mut is_gone = vec![false; n];
        for (i, &(blue, red, cuts)) in collapses.iter().enumerate() {
            let gone = |v: u32| is_gone.get(v as usize).is_none_or(|&g| g);
            let bad_cut = cuts.into_iter().find(|&c| c != NONE && c as usize >= n);
            let bad = [blue, red].into_iter().find(|&v| gone(v)).or(bad_cut).or((blue == red).then_some(blue));
            if let Some(vertex) = bad {
                return Err(HierarchyError::BadVertex { collapse: i as u32, vertex });
            }
            is_gone[blue as usize] = true;
        }
        let base: Vec<u32> = (0..n as u32).filter(|&v| !is_gone[v as usize]).collect();
        let mut node_of = vec![NONE; n];
        let node = |parent: u32, vertex: u32| Node { parent, child: NONE, cuts: [NONE; 2], vertex, bounds: Bounds::default() };
        let mut nodes = Vec::with_capacity(base.len() + 2 * collapses.len());
        let mut depths = Vec::with_capacity(nodes.capacity());
        for (i, &v) in base.iter().enumerate() {
            node_of[v as usize] = i as u32;
            nodes.push(node(NONE, v));
            depths.push(0u32);
        }
        let triangle = |(i, t): (usize, &[u32; 3])| {
            let corners = t.map(|v| node_of.get(v as usize).copied().unwrap_or(NONE));
            if corners.contains(&NONE) { Err(HierarchyError::BadTriangle { triangle: i as u32 }) } else { Ok(corners) }
        };
        let base_triangles = base_triangles.iter().enumerate().map(triangle).collect::<Result<_, _>>()?;
        for (i, &(blue, red, cuts)) in collapses.iter().enumerate().rev() {
            let (s, child) = (node_of[red as usize], nodes.len() as u32);
            let depth = depths[s as usize] + 1;
            if depth > NodeId::DEPTH_LIMIT {
                return Err(HierarchyError::TooDeep { collapse: i as u32 });
            }
            nodes[s as usize].child = child;
            nodes[s as usize].cuts = cuts;
            nodes.extend([node(s, red), node(s, blue)]);
            depths.extend([depth; 2]);
            (node_of[red as usize], node_of[blue as usize]) = (child, child + 1);
        }
        // What were vertices are their leaves.
        for cut in nodes.iter_mut().flat_map(|n| &mut n.cuts).filter(|c| **c != NONE) {
            *cut = node_of[*cut as usize];
        }
        let depth = depths.into_iter().max().unwrap_or(0);
        Ok(Self { nodes, positions, roots: base.len() as u32, depth, base_triangles, ..Default::default() })
    }

    /// Gives each node its bounds, in the unit of their lengths (positive, finite).
    pub fn set_bounds(&mut self, unit: f64, bounds: impl Fn(u32) -> Bounds) -> Result<(), HierarchyError> {
        if !(unit.is_finite() && unit > 0.0) {
            return Err(HierarchyError::NotFinite);
        }
        self.unit = unit;
        self.nodes.iter_mut().enumerate().for_each(|(i, n)| n.bounds = bounds(i as u32));
        Ok(())
    }

    /// Numbers the roots anew: `order` has their old numbers, `triangles` those of the base mesh in the new ones. What [`Self::set_triangles`] took up is dropped. O(n). Errors: an order that is none, triangles of other
    /// roots.
    pub fn sort_roots(&mut self, order: &[u32], triangles: Vec<[u32; 3]>) -> Result<(), HierarchyError> {
        let roots = self.roots as usize;
        let mut number = vec![NONE; roots];
        for (new, &old) in order.iter().enumerate() {
            match number.get_mut(old as usize).filter(|n| **n == NONE) {
                Some(n) => *n = new as u32,
                None => return Err(HierarchyError::BadVertex { collapse: 0, vertex: old }),
            }
        }
        if order.len() != roots {
            return Err(HierarchyError::BadVertex { collapse: 0, vertex: roots as u32 });
        }
        if let Some(t) = triangles.iter().position(|t| t.iter().any(|&v| v >= self.roots)) {
            return Err(HierarchyError::BadTriangle { triangle: t as u32 });
        }
        let sorted: Vec<Node> = order.iter().map(|&old| self.nodes[old as usize]).collect();
        self.nodes[..roots].copy_from_slice(&sorted);
        let renumber = |i: &mut u32| *i = number.get(*i as usize).copied().unwrap_or(*i);
        for node in &mut self.nodes {
            renumber(&mut node.parent);
            node.cuts.iter_mut().for_each(renumber);
        }
        (self.base_triangles, self.finest) = (triangles, Finest::default());
        Ok(())
    }
    /// All nodes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }
    /// A node, if there is one of that number.
    pub fn node(&self, i: u32) -> Option<&Node> {
        self.nodes.get(i as usize)
    }
    /// Trees: the first nodes.
    pub fn root_count(&self) -> u32 {
        self.roots
    }
    /// Triangles of the base mesh, by roots.
    pub fn base_triangles(&self) -> &[[u32; 3]] {
        &self.base_triangles
    }
    /// Position of a node; of one that is not there the origin.
    pub fn position(&self, i: u32) -> [f32; 3] {
        self.node(i).map_or([0.0; 3], |n| self.positions[n.vertex as usize])
    }
    /// Unit of the lengths of bounds.
    pub fn unit(&self) -> f64 {
        self.unit
    }
    /// Bits that name any of its nodes (E.16).
    pub fn id_bits(&self) -> IdBits {
        IdBits::new(self.roots, self.depth)
    }
    /// Name of a node. O(depth).
    pub fn id(&self, i: u32) -> Option<NodeId> {
        let (mut at, mut way, mut bit) = (i, 0u64, 0);
        while let Some(parent) = self.node(at)?.parent.checked_add(1) {
            let parent = parent - 1;
            way |= u64::from(at != self.nodes[parent as usize].child) << bit;
            (at, bit) = (parent, bit + 1);
        }
        Some(NodeId { tree: at, node: way | 1 << bit })
    }
    /// Number of a node. O(depth).
    pub fn find(&self, id: NodeId) -> Option<u32> {
        id.depth()?;
        let mut at = Some(id.tree).filter(|&t| t < self.roots)?;
        for second in id.way() {
            at = Some(self.nodes[at as usize].child).filter(|&c| c != NONE)? + u32::from(second);
        }
        Some(at)
    }
    /// The node on the way up from `i` that is in the front (E.4). O(depth).
    pub fn active_ancestor(&self, i: u32, is_active: impl Fn(u32) -> bool) -> Option<u32> {
        let mut at = i;
        while !is_active(at) {
            at = self.finest.parent(at).or_else(|| Some(self.node(at)?.parent))?;
        }
        Some(at)
    }
    /// Steps from the root to a node. O(1), after [`Self::set_triangles`].
    pub fn depth(&self, i: u32) -> u32 {
        self.finest.depth(i)
    }
}
