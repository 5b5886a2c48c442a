//! The mesh about a block: what its splits are told by.
//!
//! A block is decoded with nothing but the blocks above it. Of what these tell, the nodes that the block begins at matter, and those about them: a patch. Within the block
//! the patch is split as the mesh of a session is. What lies beyond its rim stays as coarse as the blocks above have it, however fine it is elsewhere.

use crate::error::ProtocolError;
use crate::model::Model;
use crate::sides::{Known, Side, Told};
use pmesh_codec::compact::RingSplit;
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Bounds, Front, HierarchyError, NONE, NodeId, Split};
use pmesh_core::turned;
use rustc_hash::{FxHashMap, FxHashSet};

/// Nodes that a block begins at, and the mesh about them; nodes by their numbers at the end that has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Patch {
    /// First those that the block begins at, then those about them.
    pub(crate) nodes: Vec<u32>,
    pub(crate) roots: u32,
    /// Corners are places in `nodes`.
    triangles: Vec<[u32; 3]>,
    /// Places of nodes that the mesh has not, and of those that stand for them.
    stand_ins: Vec<[u32; 2]>,
}

impl Patch {
    /// All of the base mesh: the nodes `roots`, then the others of `count`.
    pub(crate) fn of_base(roots: Vec<u32>, count: u32, triangles: &[[u32; 3]]) -> Self {
        let mut place = vec![NONE; count as usize];
        let first = roots.len() as u32;
        let mut nodes = roots;
        (0..first).for_each(|k| place[nodes[k as usize] as usize] = k);
        for i in 0..count {
            if place[i as usize] == NONE {
                place[i as usize] = nodes.len() as u32;
                nodes.push(i);
            }
        }
        let triangles = triangles.iter().map(|t| t.map(|v| place[v as usize])).collect();
        Self { nodes, roots: first, triangles, stand_ins: Vec::new() }
    }
    /// The nodes that the block begins at.
    pub(crate) fn roots(&self) -> &[u32] {
        &self.nodes[..self.roots as usize]
    }
    /// Other numbers of the nodes; `None` if one of them has none.
    pub(crate) fn renamed(mut self, number: impl Fn(u32) -> Option<u32>) -> Option<Self> {
        for node in &mut self.nodes {
            *node = number(*node)?;
        }
        Some(self)
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        4 * self.nodes.len() + 12 * self.triangles.len() + 8 * self.stand_ins.len()
    }
    /// About how much work it is to split it.
    pub(crate) fn size(&self) -> usize {
        self.nodes.len() + self.triangles.len()
    }
}

/// What is known of a node of a patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) id: NodeId,
    pub(crate) row: [i32; 3],
    pub(crate) bounds: Bounds,
}

/// A node while its block is coded.
#[derive(Clone, Copy, Debug)]
struct Node {
    place: Place,
    /// The first of its children, or [`NONE`].
    child: u32,
    /// Its number in the mesh, or that of the node that stands for it.
    at: u32,
    /// Its number beyond the block.
    number: u32,
    /// The mesh has it not: it came from a split that the mesh could not follow.
    is_out: bool,
}

/// A split of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockSplit {
    pub(crate) node: u32,
    /// Of one that the mesh could not follow: what its cuts were told by.
    told: Option<[Option<Way>; 2]>,
}

/// A way to a leaf, as far as the block knows it: a name, and the node that has it here, or [`NONE`].
pub(crate) type Way = (NodeId, u32);

/// A patch that is split.
pub(crate) struct Local<'a> {
    grid: &'a Quantisation,
    unit: f64,
    nodes: Vec<Node>,
    mesh: Front,
    /// Node of each node of the mesh.
    of_mesh: Vec<u32>,
    splits: Vec<BlockSplit>,
    /// The writer's: all that there is, and the nodes here by their numbers there.
    truth: Option<(&'a Model, FxHashMap<u32, u32>)>,
}

impl<'a> Local<'a> {
    /// `place` says what is known of a node by its number. Errors: a base mesh that is none.
    pub(crate) fn new(
        patch: &Patch,
        (grid, unit): (&'a Quantisation, f64),
        place: impl Fn(u32) -> Place,
    ) -> Result<Self, ProtocolError> {
        let count = patch.nodes.len();
        let mut mesh = Front::new(vec![[0.0; 3]; count], &vec![Bounds::default(); count], patch.triangles.clone(), 1.0)?;
        mesh.follow_cuts();
        let node = |(i, &number): (usize, &u32)| Node { place: place(number), child: NONE, at: i as u32, number, is_out: false };
        let mut nodes: Vec<Node> = patch.nodes.iter().enumerate().map(node).collect();
        for &[i, by] in &patch.stand_ins {
            (nodes[i as usize].at, nodes[i as usize].is_out) = (by, true);
        }
        Ok(Self { grid, unit, nodes, mesh, of_mesh: (0..count as u32).collect(), splits: Vec::new(), truth: None })
    }
    /// The same for the writer.
    pub(crate) fn of(patch: &Patch, model: &'a Model) -> Result<Self, ProtocolError> {
        let h = model.hierarchy();
        let place = |i: u32| Place {
            id: h.id(i).unwrap_or(NodeId::root(0)),
            row: model.row(i),
            bounds: h.nodes()[i as usize].bounds,
        };
        let mut local = Self::new(patch, (model.grid(), h.unit()), place)?;
        let numbers = patch.nodes.iter().enumerate().map(|(i, &n)| (n, i as u32)).collect();
        local.truth = Some((model, numbers));
        Ok(local)
    }

    pub(crate) fn splits(&self) -> &[BlockSplit] {
        &self.splits
    }
    pub(crate) fn id(&self, i: u32) -> NodeId {
        self.nodes[i as usize].place.id
    }
    pub(crate) fn number(&self, i: u32) -> u32 {
        self.nodes[i as usize].number
    }
    /// The first child of a node that has split, or [`NONE`].
    pub(crate) fn child_of(&self, i: u32) -> u32 {
        self.nodes[i as usize].child
    }
    /// Numbers of a pair of children: this, and the next.
    pub(crate) fn set_number(&mut self, first: u32, number: u32) {
        self.nodes[first as usize].number = number;
        self.nodes[first as usize + 1].number = number + 1;
    }
    /// The mesh has it not.
    pub(crate) fn is_out(&self, i: u32) -> bool {
        self.nodes[i as usize].is_out
    }
    /// The node of the mesh that stands for one.
    pub(crate) fn stand_in(&self, i: u32) -> u32 {
        self.of_mesh[self.nodes[i as usize].at as usize]
    }
    /// Nodes below the first `roots` that have no children, but will: in the order of a walk.
    pub(crate) fn ends(&self, roots: u32) -> Vec<u32> {
        let (mut ends, mut stack) = (Vec::new(), Vec::new());
        for root in 0..roots {
            stack.push(root);
            while let Some(i) = stack.pop() {
                match self.nodes[i as usize] {
                    Node { child: NONE, place, .. } if !place.bounds.is_leaf() => ends.push(i),
                    Node { child: NONE, .. } => {}
                    Node { child, .. } => stack.extend([child + 1, child]),
                }
            }
        }
        ends
    }
    /// The patch about some of the nodes.
    pub(crate) fn patch(&mut self, roots: &[u32]) -> Patch {
        let mut patch = Patch { roots: roots.len() as u32, ..Default::default() };
        let mut places: FxHashMap<u32, u32> = FxHashMap::default();
        let (mut seen, mut ring) = (FxHashSet::default(), Vec::new());
        let mut place = |i: u32, nodes: &mut Vec<u32>, number: u32| {
            *places.entry(i).or_insert_with(|| {
                nodes.push(number);
                nodes.len() as u32 - 1
            })
        };
        for &i in roots {
            place(i, &mut patch.nodes, self.number(i));
        }
        for &i in roots {
            let own = self.stand_in(i);
            let at = place(own, &mut patch.nodes, self.number(own));
            if self.is_out(i) {
                let i = place(i, &mut patch.nodes, self.number(i));
                patch.stand_ins.push([i, at]);
            }
            let closed = self.neighbours(own, &mut ring);
            let n = ring.len();
            for k in 0..if closed { n } else { n.saturating_sub(1) } {
                let triangle = turned([own, ring[k], ring[(k + 1) % n]]);
                if seen.insert(triangle) {
                    let corners = triangle.map(|v| place(v, &mut patch.nodes, self.number(v)));
                    patch.triangles.push(corners);
                }
            }
        }
        patch
    }

    /// The node above a cut that has no children here, or is in the mesh without any.
    pub(crate) fn active(&self, cut: u32) -> Option<u32> {
        let (model, numbers) = self.truth.as_ref()?;
        let mut at = cut;
        loop {
            match numbers.get(&at) {
                Some(&i) => return Some(self.stand_in(i)),
                None => at = model.hierarchy().node(at)?.parent,
            }
        }
    }
    /// The writer: places of a node's cuts among those about it; their number for one that is not there.
    fn places(&self, i: u32, about: &[u32]) -> [Option<u32>; 2] {
        let cuts = self.cuts(i);
        let place = |cut: u32| {
            let active = self.active(cut);
            about.iter().position(|&w| Some(w) == active).unwrap_or(about.len()) as u32
        };
        cuts.map(|c| c.map(place))
    }
    /// The writer: a node's cuts, by their numbers.
    pub(crate) fn cuts(&self, i: u32) -> [Option<u32>; 2] {
        let node = self.truth.as_ref().and_then(|(model, _)| model.hierarchy().node(self.number(i)));
        node.map_or([None; 2], |n| n.cuts.map(|c| Some(c).filter(|&c| c != NONE)))
    }
    /// The writer: a node's cuts, by name.
    pub(crate) fn cut_names(&self, i: u32) -> [Option<NodeId>; 2] {
        self.truth.as_ref().map_or([None; 2], |(model, _)| model.cuts(self.number(i)))
    }
    /// The writer: the mesh can follow the split of a node, those about it being these.
    pub(crate) fn fits(&self, i: u32, about: &[u32], closed: bool) -> bool {
        let n = about.len() as u32;
        match self.places(i, about) {
            [Some(from), Some(to)] => from < n && to < n && from != to && (closed || from < to),
            [Some(end), None] | [None, Some(end)] => end < n && !closed,
            [None, None] => false,
        }
    }
    /// Has the children of a node from now on, that the mesh cannot follow.
    pub(crate) fn add_out(&mut self, i: u32, told: [Option<Way>; 2], row: [i32; 3], bounds: [Bounds; 2]) -> Result<u32, ProtocolError> {
        self.splits.push(BlockSplit { node: i, told: Some(told) });
        self.add(i, row, bounds, None)
    }
    fn add(&mut self, i: u32, row: [i32; 3], bounds: [Bounds; 2], at: Option<u32>) -> Result<u32, ProtocolError> {
        let child = self.nodes.len() as u32;
        let own = self.nodes[i as usize];
        self.nodes[i as usize].child = child;
        for (k, bounds) in bounds.into_iter().enumerate() {
            let id = own.place.id.child(k == 1).ok_or(HierarchyError::NoSuchNode { id: own.place.id })?;
            let place = Place { id, row: if k == 0 { own.place.row } else { row }, bounds };
            let number = match &mut self.truth {
                Some((model, numbers)) => {
                    let number = model.hierarchy().node(own.number).map_or(NONE, |n| n.child + k as u32);
                    numbers.insert(number, child + k as u32);
                    number
                }
                None => NONE,
            };
            let at_mesh = at.map_or(own.at, |at| at + k as u32);
            self.nodes.push(Node { place, child: NONE, at: at_mesh, number, is_out: at.is_none() });
        }
        Ok(child)
    }
    /// What is known of the ways to the cuts of a split.
    pub(crate) fn ways(&self, split: &BlockSplit) -> [Option<Way>; 2] {
        if let Some(told) = split.told {
            return told;
        }
        let cuts = self.mesh.node(self.nodes[split.node as usize].at).map_or([None; 2], |n| n.cuts);
        cuts.map(|cut| {
            let i = *self.of_mesh.get(self.mesh.find(cut?)? as usize)?;
            Some((self.nodes[i as usize].place.id, i))
        })
    }
}

impl Side for Local<'_> {
    fn roots(&self) -> u32 {
        self.mesh.root_count()
    }
    fn child(&self, i: u32) -> Option<u32> {
        Some(self.nodes[i as usize].child).filter(|&c| c != NONE)
    }
    fn row(&self, i: u32) -> [i32; 3] {
        self.nodes[i as usize].place.row
    }
    fn bounds(&self, i: u32) -> Bounds {
        self.nodes[i as usize].place.bounds
    }
    fn is_wanted(&self, _: u32) -> bool {
        false
    }
    fn grid(&self) -> &Quantisation {
        self.grid
    }
    fn unit(&self) -> f64 {
        self.unit
    }
}

impl Known for Local<'_> {
    fn depth(&self, i: u32) -> u32 {
        self.nodes[i as usize].place.id.depth().unwrap_or(0)
    }
    fn neighbours(&mut self, i: u32, out: &mut Vec<u32>) -> bool {
        let closed = self.mesh.neighbours(self.nodes[i as usize].at, out);
        out.iter_mut().for_each(|w| *w = self.of_mesh[*w as usize]);
        closed
    }
    fn waits(&self, _: u32, _: &[u32]) -> bool {
        false
    }
    fn truth_told(&self, i: u32, about: &[u32]) -> Option<(RingSplit, [Bounds; 2])> {
        let (model, _) = self.truth.as_ref()?;
        let h = model.hierarchy();
        let child = h.node(self.number(i))?.child;
        let ring = RingSplit { cuts: self.places(i, about), place: model.row(child + 1) };
        Some((ring, [child, child + 1].map(|c| h.nodes()[c as usize].bounds)))
    }
    fn told(&mut self, i: u32, told: &Told) -> Result<u32, ProtocolError> {
        let at = self.nodes[i as usize].at;
        let cuts = told.cuts.map(|c| c.map(|c| self.mesh.id(self.nodes[c as usize].at)));
        let child = self.mesh.known() as u32;
        self.mesh.learn(&Split { id: self.mesh.id(at), cuts, position: [0.0; 3], bounds: [Bounds::default(); 2] })?;
        self.splits.push(BlockSplit { node: i, told: None });
        let first = self.add(i, told.ring.place, told.bounds, Some(child))?;
        self.of_mesh.extend([first, first + 1]);
        Ok(first)
    }
}
