//! What a client knows of a hierarchy, and its front: nodes one on each way down, with the mesh that they make.

use super::geomorph::Geomorphs;
use super::known::KnownMesh;
use super::ordered::Order;
use super::{Bounds, FrontMesh, HierarchyError, NONE, NodeId, View};

/// A split as it arrives: the children of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// The node, so far a leaf of what the client knows.
    pub id: NodeId,
    /// Its fundamental cut vertices: leaves of the whole hierarchy (E.3).
    pub cuts: [Option<NodeId>; 2],
    /// Where the second child is; the first is where the node was.
    pub position: [f32; 3],
    /// Of both children.
    pub bounds: [Bounds; 2],
}

/// A node that the client knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub(super) parent: u32,
    pub(super) child: u32,
    /// Its vertex in the mesh, that of the first child too.
    pub(super) vertex: u32,
    /// Place in the list of the front, or [`NONE`].
    pub(super) at: u32,
    /// Steps from its root.
    pub(super) depth: u8,
    /// Something below it is in the front.
    pub(super) is_above: bool,
    pub(super) bounds: Bounds,
}

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownNode {
    /// The node above, or [`NONE`].
    pub parent: u32,
    /// The first of its children, or [`NONE`].
    pub child: u32,
    /// Where it is.
    pub position: [f32; 3],
    /// What lies below it; nothing where it is a leaf of the whole hierarchy.
    pub bounds: Bounds,
    /// Of one with children: its fundamental cut vertices.
    pub cuts: [Option<NodeId>; 2],
}

/// What [`Front::refine`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Nodes looked at.
    pub looked: u32,
    /// Nodes split.
    pub splits: u32,
    /// Pairs collapsed, or sent on their way there.
    pub collapses: u32,
    /// A node in the front is too coarse and has no children here: the server must be asked (E.13).
    pub wants_more: bool,
    /// A node in the front is too coarse, but there are as many triangles as allowed.
    pub denied: bool,
}

/// The client's side: a partial hierarchy, the front in it, and its mesh (E.6). 24 bytes a node, 52 a split, 32 a triangle, and a list of the front.
#[derive(Clone, Debug, Default)]
pub struct Front {
    pub(super) known: Vec<Known>,
    /// Of the nodes with children, in the order in which these came.
    pub(super) cuts: Vec<[NodeId; 2]>,
    /// Where the front was above these cuts when last looked: a step or two from where it is.
    pub(super) near: Vec<[u32; 2]>,
    /// Of the mesh's vertices.
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) mesh: FrontMesh,
    pub(super) roots: u32,
    pub(super) base_triangles: u32,
    unit: f64,
    pub(super) front: Vec<u32>,
    /// Where in the list the next look begins.
    pub(super) cursor: usize,
    stack: Vec<u32>,
    /// Nodes without children here that were too coarse, when last looked at.
    pub(super) wanted: Vec<u32>,
    /// Triangles beyond which nothing is split.
    limit: usize,
    pub(super) geomorphs: Option<Geomorphs>,
    /// The mesh of all that is known, if cuts are told by it.
    pub(super) whole: Option<KnownMesh>,
    /// What it keeps to, if to any.
    pub(super) order: Option<Order>,
}

/// Most splits that stand in each other's way. Real ones are a few.
const FORCED_LIMIT: usize = 1024;

/// Most nodes that are remembered as too coarse.
const WANTED_LIMIT: usize = 1 << 16;

/// Stands for a cut that is not there.
const NO_CUT: NodeId = NodeId { tree: 0, node: 0 };

impl Front {
    /// The base mesh: positions and bounds of the roots, triangles between them, the unit of the bounds. O(n). Errors: an index or a number that is no good.
    pub fn new(positions: Vec<[f32; 3]>, bounds: &[Bounds], triangles: Vec<[u32; 3]>, unit: f64) -> Result<Self, HierarchyError> {
        let roots = positions.len() as u32;
        if let Some(i) = triangles.iter().position(|t| t.iter().any(|&v| v >= roots)) {
            return Err(HierarchyError::BadTriangle { triangle: i as u32 });
        }
        if !(unit.is_finite() && unit > 0.0)
            || positions.iter().flatten().any(|x| !x.is_finite())
            || bounds.len() != positions.len()
        {
            return Err(HierarchyError::NotFinite);
        }
        let root = |(i, &bounds): (usize, &Bounds)| Known {
            parent: NONE,
            child: NONE,
            vertex: i as u32,
            at: i as u32,
            depth: 0,
            is_above: false,
            bounds,
        };
        Ok(Self {
            known: bounds.iter().enumerate().map(root).collect(),
            base_triangles: triangles.len() as u32,
            mesh: FrontMesh::new(roots, triangles),
            positions,
            roots,
            unit,
            front: (0..roots).collect(),
            limit: usize::MAX,
            ..Default::default()
        })
    }

    /// Nodes in the front.
    pub fn len(&self) -> usize {
        self.front.len()
    }
    /// True if there is nothing at all.
    pub fn is_empty(&self) -> bool {
        self.front.is_empty()
    }
    /// Nodes known.
    pub fn known(&self) -> usize {
        self.known.len()
    }
    /// The mesh of the front.
    pub fn mesh(&self) -> &FrontMesh {
        &self.mesh
    }
    /// Positions of the mesh's vertices, of those too that are not there now.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }
    /// Leaves of what is known, roots first: what a server must know to go on (E.7).
    pub fn leaves(&self) -> impl Iterator<Item = NodeId> {
        (0..self.known.len() as u32).filter(|&i| self.known[i as usize].child == NONE).map(|i| self.id(i))
    }
    /// Names of the nodes in the front, in no order.
    pub fn front(&self) -> impl Iterator<Item = NodeId> {
        self.front.iter().map(|&i| self.id(i))
    }

    /// Trees: the first nodes.
    pub fn root_count(&self) -> u32 {
        self.roots
    }
    /// Unit of the lengths of bounds.
    pub fn unit(&self) -> f64 {
        self.unit
    }
    /// A node that is known, by its number: roots first, then pairs of children as they came.
    pub fn node(&self, i: u32) -> Option<KnownNode> {
        let Known { parent, child, vertex, bounds, .. } = *self.known.get(i as usize)?;
        let cut = |c: NodeId| (c != NO_CUT).then_some(c);
        let cuts = if child == NONE { [None; 2] } else { self.cuts[self.number(child) as usize].map(cut) };
        Some(KnownNode { parent, child, position: self.positions[vertex as usize], bounds, cuts })
    }
    /// Name of a node; of one that is not known that of the first root.
    pub fn id(&self, i: u32) -> NodeId {
        if i as usize >= self.known.len() {
            return NodeId::root(0);
        }

        let (mut at, mut way, mut bit) = (i, 0u64, 0);
        while self.known[at as usize].parent != NONE {
            let parent = self.known[at as usize].parent;
            way |= u64::from(at != self.known[parent as usize].child) << bit;
            (at, bit) = (parent, bit + 1);
        }
        NodeId { tree: at, node: way | 1 << bit }
    }
    /// Number of a node, if it is known. O(depth).
    pub fn find(&self, id: NodeId) -> Option<u32> {
        id.depth()?;
        let mut at = Some(id.tree).filter(|&t| t < self.roots)?;
        for second in id.way() {
            at = Some(self.known[at as usize].child).filter(|&c| c != NONE)? + u32::from(second);
        }
        Some(at)
    }
    /// The node of the front above a leaf of the whole hierarchy, most of which is not known here (E.4). `None` if the front is below. O(depth).
    pub fn active_ancestor(&self, leaf: NodeId) -> Option<NodeId> {
        let root = Some(leaf.tree).filter(|&t| t < self.roots)?;
        Some(self.id(self.active(leaf, root)?))
    }
    /// The same by number, from a node on the way.
    fn active(&self, leaf: NodeId, from: u32) -> Option<u32> {
        let depth = leaf.depth()?;
        let mut at = from;
        loop {
            let known = &self.known[at as usize];
            if known.at != NONE {
                return Some(at);
            }
            at = if known.is_above {
                let below = depth.checked_sub(u32::from(known.depth) + 1)?;
                known.child + (leaf.node >> below & 1) as u32
            } else {
                Some(known.parent).filter(|&p| p != NONE)?
            };
        }
    }

    /// Takes up the children of a node; the front stays where it is (E.12). O(depth). Errors: a node that is not known or has children, a cut that cannot be.
    pub fn learn(&mut self, split: &Split) -> Result<(), HierarchyError> {
        let id = split.id;
        if self.order.is_some() {
            return Err(HierarchyError::Ordered);
        }
        let i = self.find(id).ok_or(HierarchyError::NoSuchNode { id })?;
        if self.known[i as usize].child != NONE {
            return Err(HierarchyError::SplitTwice { id });
        }
        if id.depth().is_none_or(|d| d >= NodeId::DEPTH_LIMIT) {
            return Err(HierarchyError::NoSuchNode { id });
        }
        let given = split.cuts.iter().flatten();
        if let Some(&cut) = given.clone().find(|c| c.node == 0 || c.tree >= self.roots || id.is_above(**c)) {
            return Err(HierarchyError::BadCut { id, cut });
        }
        if given.count() == 0 || split.cuts[0] == split.cuts[1] {
            return Err(HierarchyError::BadCut { id, cut: split.cuts[0].unwrap_or(NO_CUT) });
        }
        if split.position.iter().any(|x| !x.is_finite()) {
            return Err(HierarchyError::NotFinite);
        }
        let child = self.known.len() as u32;
        if self.whole.is_some() {
            self.learn_whole(i, split)?;
        }
        let own = &mut self.known[i as usize];
        own.child = child;
        let (red, depth) = (own.vertex, own.depth + 1);
        let blue = self.positions.len() as u32;
        for (bounds, vertex) in split.bounds.into_iter().zip([red, blue]) {
            self.known.push(Known { parent: i, child: NONE, vertex, at: NONE, depth, is_above: false, bounds });
        }
        self.cuts.push(split.cuts.map(|c| c.unwrap_or(NO_CUT)));
        self.near.push(split.cuts.map(|c| c.map_or(NONE, |c| c.tree)));
        self.positions.push(split.position);
        Ok(())
    }

    /// Number of the split that made the children at `child`.
    pub(super) fn number(&self, child: u32) -> u32 {
        (child - self.roots) / 2
    }

    /// Splits a node of the front whose children are known, and first what stands in its way: a node that both its cuts stand at (E.5, E.11). Gives the splits done. O(depth
    /// + valence) each. Errors: a hierarchy that is none; nothing of the mesh is wrong then.
    pub fn split(&mut self, id: NodeId) -> Result<u32, HierarchyError> {
        let i = self.find(id).filter(|&i| self.known[i as usize].at != NONE).ok_or(HierarchyError::NoSuchNode { id })?;
        let mut done = 0;
        self.split_node(i, &mut done).map(|()| done)
    }
    /// Counts in `done` what is done, of what ends in an error too.
    fn split_node(&mut self, i: u32, done: &mut u32) -> Result<(), HierarchyError> {
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        // Orders are long, and end.
        let limit = if self.order.is_some() { self.known.len() } else { FORCED_LIMIT };
        stack.push(i);
        let result = loop {
            let Some(&s) = stack.last() else { break Ok(()) };
            match self.try_split(s) {
                Ok(None) => {
                    stack.pop();
                    *done += 1;
                }
                // A way that comes back to itself, or does not end, is no hierarchy of a manifold.
                Ok(Some(first)) if stack.len() >= limit || stack.contains(&first) => {
                    break Err(HierarchyError::NotAdjacent { id: self.id(s) });
                }
                Ok(Some(first)) => stack.push(first),
                Err(e) => break Err(e),
            }
        };
        self.stack = stack;
        result
    }
    /// Splits `s`, or gives the node that must go first.
    fn try_split(&mut self, s: u32) -> Result<Option<u32>, HierarchyError> {
        let Known { child, vertex, at, .. } = self.known[s as usize];
        if child == NONE {
            return Err(HierarchyError::NotHere { id: self.id(s) });
        }
        let number = self.number(child);
        if let Some(first) = self.before_in_order(s) {
            return Ok(Some(first));
        }
        let cuts = self.cuts[number as usize];
        let mut ends = [NONE; 2];
        for (k, (end, cut)) in ends.iter_mut().zip(cuts).enumerate().filter(|(_, (_, c))| *c != NO_CUT) {
            let near = self.near[number as usize][k];
            *end = self.active(cut, near).ok_or_else(|| self.lost(s, cut))?;
            self.near[number as usize][k] = *end;
        }
        if ends[0] == ends[1] {
            return Ok(Some(ends[0]));
        }
        let ends = ends.map(|e| if e == NONE { NONE } else { self.known[e as usize].vertex });
        let first = self.base_triangles + 2 * number;
        let blue = self.roots + number;
        if !self.mesh.split(vertex, blue, ends, [first, first + 1]) {
            return Err(HierarchyError::NotAdjacent { id: self.id(s) });
        }
        if let Some(order) = &mut self.order {
            order.take(number, true);
        }
        self.stay(self.known[s as usize].parent);
        if let Some(g) = &mut self.geomorphs {
            g.split(vertex, blue, ends);
        }
        self.known[s as usize].at = NONE;
        self.known[s as usize].is_above = true;
        self.front[at as usize] = child;
        self.known[child as usize].at = at;
        self.known[child as usize + 1].at = self.front.len() as u32;
        self.front.push(child + 1);
        Ok(None)
    }
    /// Why a cut of a node is nowhere in the front.
    fn lost(&self, s: u32, cut: NodeId) -> HierarchyError {
        let id = self.id(s);
        match self.find(cut).map(|i| self.known[i as usize].child) {
            Some(child) if child != NONE => HierarchyError::OpenCut { id, at: cut },
            _ => HierarchyError::BadCut { id, cut },
        }
    }
    /// Collapses the children of a node onto it; false if one of them is not in the front, or the mesh would be no manifold. O(valence).
    pub fn collapse(&mut self, id: NodeId) -> bool {
        self.find(id).is_some_and(|i| self.collapse_node(i))
    }
    pub(super) fn collapse_node(&mut self, i: u32) -> bool {
        let Known { child, vertex, .. } = self.known[i as usize];
        if child == NONE {
            return false;
        }
        let places = [child, child + 1].map(|c| self.known[c as usize].at);
        let number = self.number(child);
        let first = self.base_triangles + 2 * number;
        let may = self.order.as_ref().is_none_or(|o| o.can_collapse(number));
        if places.contains(&NONE) || !may || !self.mesh.collapse(vertex, self.roots + number, [first, first + 1]) {
            return false;
        }
        if let Some(order) = &mut self.order {
            order.take(number, false);
        }
        self.front[places[0] as usize] = i;
        self.known[i as usize].at = places[0];
        self.known[i as usize].is_above = false;
        self.front.swap_remove(places[1] as usize);
        if let Some(&moved) = self.front.get(places[1] as usize) {
            self.known[moved as usize].at = places[1];
        }
        self.known[child as usize].at = NONE;
        self.known[child as usize + 1].at = NONE;
        true
    }

    /// Sends the children of a node on their way onto it, or collapses them if the front is not drawn; false if that cannot be, or is so already.
    fn leave(&mut self, i: u32) -> bool {
        let Some(g) = &mut self.geomorphs else { return self.collapse_node(i) };
        let Known { child, vertex, .. } = self.known[i as usize];
        let [red, blue] = [child, child + 1].map(|c| self.known[c as usize]);
        if red.at == NONE || blue.at == NONE || g.is_leaving(blue.vertex) {
            return false;
        }
        let number = (child - self.roots) / 2;
        let first = self.base_triangles + 2 * number;
        let may = self.order.as_ref().is_none_or(|o| o.can_collapse(number));
        may && self.mesh.can_collapse(vertex, blue.vertex, [first, first + 1]) && g.leave(blue.vertex)
    }
    /// The children of a node are needed.
    fn stay(&mut self, i: u32) {
        if let (Some(g), Some(parent)) = (&mut self.geomorphs, self.known.get(i as usize)) {
            let blue = self.known[parent.child as usize + 1].vertex;
            g.stay(blue);
        }
    }
    fn want(&mut self, i: u32) {
        if self.wanted.len() < WANTED_LIMIT {
            self.wanted.push(i);
        }
    }
    /// Numbers of nodes without children here that were too coarse, or in the way of what is, when looked at since this was last called; some may have children by now.
    pub fn take_wanted(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.wanted)
    }
    /// Splits nothing more once there are so many triangles; those that are there stay until a view needs them no more.
    pub fn limit_triangles(&mut self, limit: usize) {
        self.limit = limit;
    }
    /// Triangles that stay: those of the mesh without those on their way to nothing.
    pub fn triangles(&self) -> usize {
        self.mesh.shown().len().saturating_sub(2 * self.under_way().leaving as usize)
    }
    /// Bytes of what is known and of its mesh, without room for more.
    pub fn memory_bytes(&self) -> usize {
        let known = size_of::<Known>() * self.known.len() + (size_of::<[NodeId; 2]>() + 8) * self.cuts.len();
        let lists = 12 * self.positions.len() + 4 * self.front.len();
        let whole = self.whole.as_ref().map_or(0, KnownMesh::memory_bytes);
        known + lists + whole + self.mesh.memory_bytes() + self.geomorphs.as_ref().map_or(0, Geomorphs::memory_bytes)
    }

    /// Follows a view (E.13): looks at up to `budget` nodes of the front, going on where the last call stopped; splits what is too coarse, collapses what is needlessly
    /// fine. O(budget · valence). Errors: a hierarchy that is none.
    pub fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, HierarchyError> {
        let mut progress = Progress::default();
        while progress.looked < budget && progress.looked < self.front.len() as u32 {
            if self.cursor >= self.front.len() {
                self.cursor = 0;
            }
            progress.looked += 1;
            let i = self.front[self.cursor];
            let Known { parent, child, .. } = self.known[i as usize];
            if self.is_coarse(i, view) {
                self.stay(parent);
                if self.mesh.shown().len() >= self.limit {
                    progress.denied = true;
                } else if child == NONE {
                    progress.wants_more = true;
                    self.want(i);
                } else {
                    match self.split_node(i, &mut progress.splits) {
                        // The first child takes its place, and is looked at next.
                        Ok(()) => continue,
                        Err(HierarchyError::NotHere { id } | HierarchyError::OpenCut { at: id, .. }) => {
                            progress.wants_more = true;
                            self.find(id).into_iter().for_each(|i| self.want(i));
                        }
                        Err(e) => return Err(e),
                    }
                }
            } else if parent != NONE {
                let first = self.known[parent as usize].child;
                let sibling = first + u32::from(i == first);
                let is_needed = self.known[sibling as usize].at != NONE && self.is_coarse(sibling, view);
                if is_needed || self.is_coarse(parent, view) {
                    self.stay(parent);
                } else {
                    progress.collapses += u32::from(self.leave(parent));
                }
            }
            self.cursor += 1;
        }
        Ok(progress)
    }
    fn is_coarse(&self, i: u32, view: &View) -> bool {
        let Known { vertex, bounds, .. } = self.known[i as usize];
        view.needs_more_than(self.positions[vertex as usize], &bounds, self.unit)
    }
}
