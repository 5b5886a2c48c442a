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
use rustc_hash::{FxHashMap, FxHashSet};
use std::ops::Range;

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) id: NodeId,
    pub(crate) row: [i32; 3],
    pub(crate) bounds: Bounds,
}

/// Nodes that a block begins at, and the mesh about them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Patch {
    /// The nodes that the block begins at, by their numbers at the end that has it.
    pub(crate) roots: Vec<u32>,
    /// Those about them, whatever becomes of them elsewhere.
    rim: Vec<Place>,
    /// Corners are places in both lists, the rim's behind the roots.
    triangles: Vec<[u32; 3]>,
    /// Places of nodes that the mesh has not, and of those that stand for them.
    stand_ins: Vec<[u32; 2]>,
    open: Vec<OpenCut>,
}

/// A cut of a split of a block above, the way to which goes on in this one: to the node at a corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OpenCut {
    triangle: u32,
    corner: u8,
    which: u8,
    split: NodeId,
}

/// More of the way to a cut: the split, which of its cuts, and the way.
pub(crate) type Longer = (NodeId, usize, NodeId);

impl Patch {
    /// All of the base mesh: the nodes `roots`, then the others of `count`, of which `place` knows.
    pub(crate) fn of_base(roots: Vec<u32>, (count, triangles): (u32, &[[u32; 3]]), place: impl Fn(u32) -> Place) -> Self {
        let mut places = vec![NONE; count as usize];
        roots.iter().zip(0..).for_each(|(&i, k)| places[i as usize] = k);
        let mut rim = Vec::new();
        for i in 0..count {
            if places[i as usize] == NONE {
                places[i as usize] = (roots.len() + rim.len()) as u32;
                rim.push(place(i));
            }
        }
        let triangles = triangles.iter().map(|t| t.map(|v| places[v as usize])).collect();
        Self { roots, rim, triangles, ..Default::default() }
    }
    /// Other numbers of the nodes that it begins at; `None` if one of them has none.
    pub(crate) fn renamed(mut self, number: impl Fn(u32) -> Option<u32>) -> Option<Self> {
        for node in &mut self.roots {
            *node = number(*node)?;
        }
        Some(self)
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        let nodes = 4 * self.roots.len() + size_of::<Place>() * self.rim.len();
        nodes + 12 * self.triangles.len() + 8 * self.stand_ins.len() + size_of::<OpenCut>() * self.open.len()
    }
    /// About how much work it is to split it.
    pub(crate) fn size(&self) -> usize {
        self.roots.len() + self.rim.len() + self.triangles.len()
    }
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
    pub(crate) told: Option<[Option<Way>; 2]>,
}

/// A way to a leaf, as far as the block knows it: a name, and the node that has it here, or [`NONE`].
pub(crate) type Way = (NodeId, u32);

/// All that there is, which the writer has: nodes by their numbers there.
pub(crate) trait Truth {
    fn model(&self) -> Option<&Model>;
    /// The node of a block that has such a number.
    fn node(&self, number: u32) -> Option<u32>;
    fn put(&mut self, number: u32, node: u32);
}
/// The reader has nothing of it.
impl Truth for () {
    fn model(&self) -> Option<&Model> {
        None
    }
    fn node(&self, _: u32) -> Option<u32> {
        None
    }
    fn put(&mut self, _: u32, _: u32) {}
}
/// What the writer has while it writes a block.
pub(crate) struct Written<'a> {
    model: &'a Model,
    nodes: FxHashMap<u32, u32>,
}
impl Truth for Written<'_> {
    fn model(&self) -> Option<&Model> {
        Some(self.model)
    }
    fn node(&self, number: u32) -> Option<u32> {
        self.nodes.get(&number).copied()
    }
    fn put(&mut self, number: u32, node: u32) {
        self.nodes.insert(number, node);
    }
}

/// A patch that is split.
pub(crate) struct Local<'a, T> {
    grid: &'a Quantisation,
    unit: f64,
    nodes: Vec<Node>,
    mesh: Front,
    /// Node of each node of the mesh.
    of_mesh: Vec<u32>,
    /// Node of each split of the mesh.
    followed: Vec<u32>,
    splits: Vec<BlockSplit>,
    roots: u32,
    base_triangles: u32,
    open: Vec<OpenCut>,
    truth: T,
}

impl<'a> Local<'a, ()> {
    /// `place` says what is known of a node that the block begins at, by its number. Errors: a base mesh that is none.
    pub(crate) fn new(
        patch: &Patch,
        (grid, unit): (&'a Quantisation, f64),
        place: impl Fn(u32) -> Place,
    ) -> Result<Self, ProtocolError> {
        let count = patch.roots.len() + patch.rim.len();
        let mut mesh = Front::new(vec![[0.0; 3]; count], &vec![Bounds::default(); count], patch.triangles.clone(), 1.0)?;
        mesh.follow_cuts();
        let roots = patch.roots.iter().map(|&number| (place(number), number));
        let all = roots.chain(patch.rim.iter().map(|&place| (place, NONE)));
        let node = |((place, number), at)| Node { place, child: NONE, at, number, is_out: false };
        let mut nodes: Vec<Node> = all.zip(0..).map(node).collect();
        for &[i, by] in &patch.stand_ins {
            (nodes[i as usize].at, nodes[i as usize].is_out) = (by, true);
        }
        Ok(Self {
            grid,
            unit,
            nodes,
            mesh,
            of_mesh: (0..count as u32).collect(),
            followed: Vec::new(),
            splits: Vec::new(),
            roots: patch.roots.len() as u32,
            base_triangles: patch.triangles.len() as u32,
            open: patch.open.clone(),
            truth: (),
        })
    }
}

impl<'a> Local<'a, Written<'a>> {
    /// The same for the writer.
    pub(crate) fn of(patch: &Patch, model: &'a Model) -> Result<Self, ProtocolError> {
        let h = model.hierarchy();
        let local = Local::new(patch, (model.grid(), h.unit()), |i| model.place(i))?;
        let Local { grid, unit, mut nodes, mesh, of_mesh, followed, splits, roots, base_triangles, open, .. } = local;
        nodes.iter_mut().for_each(|n| n.number = h.find(n.place.id).unwrap_or(NONE));
        let numbers = nodes.iter().zip(0..).map(|(n, i)| (n.number, i)).collect();
        let truth = Written { model, nodes: numbers };
        Ok(Self { grid, unit, nodes, mesh, of_mesh, followed, splits, roots, base_triangles, open, truth })
    }
}

impl<T: Truth> Local<'_, T> {
    /// Nodes that the block begins at: the first ones.
    pub(crate) fn root_count(&self) -> u32 {
        self.roots
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
    /// Nodes below the roots that have no children, but will: in the order of a walk.
    pub(crate) fn ends(&self) -> Vec<u32> {
        let (mut ends, mut stack) = (Vec::new(), Vec::new());
        for root in 0..self.roots {
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
    /// Orders nodes so that those of each of some parts lie together: halves along the longest side of their box, and so on. Of the nodes at hand and their parts `left` says how many are
    /// of the first half of these. Gives how many each part has. O(n log n · log parts).
    pub(crate) fn divide(
        &self,
        nodes: &mut [u32],
        parts: Range<usize>,
        left: &mut dyn FnMut(&[u32], Range<usize>) -> usize,
    ) -> Vec<usize> {
        if parts.len() < 2 {
            return parts.map(|_| nodes.len()).collect();
        }
        let row = |i: u32| self.nodes[i as usize].place.row.map(i64::from);
        let sides = [0, 1, 2].map(|k| {
            let (low, high) = nodes.iter().fold((i64::MAX, i64::MIN), |(l, h), &i| (l.min(row(i)[k]), h.max(row(i)[k])));
            high.saturating_sub(low)
        });
        let axis = if sides[0] >= sides[1] && sides[0] >= sides[2] { 0 } else { 2 - usize::from(sides[1] >= sides[2]) };
        nodes.sort_by_key(|&i| row(i)[axis]);
        let half = parts.start + parts.len() / 2;
        let (a, b) = nodes.split_at_mut(left(nodes, parts.clone()));
        let mut sizes = self.divide(a, parts.start..half, left);
        sizes.extend(self.divide(b, half..parts.end, left));
        sizes
    }
    /// The patch about some of the nodes.
    pub(crate) fn patch(&mut self, roots: &[u32]) -> Patch {
        let mut patch = Patch { roots: roots.iter().map(|&i| self.number(i)).collect(), ..Default::default() };
        let count = roots.len() as u32;
        let mut places: FxHashMap<u32, u32> = roots.iter().zip(0..).map(|(&i, k)| (i, k)).collect();
        let mut place = |i: u32, rim: &mut Vec<Place>| {
            *places.entry(i).or_insert_with(|| {
                rim.push(self.nodes[i as usize].place);
                count + rim.len() as u32 - 1
            })
        };
        let open: FxHashMap<u32, OpenCut> = self.open.iter().map(|c| (c.triangle, *c)).collect();
        let (mut seen, mut fan) = (FxHashSet::default(), Vec::new());
        let mut walked = FxHashSet::default();
        for &i in roots {
            let own = self.stand_in(i);
            let at = place(own, &mut patch.rim);
            if self.is_out(i) {
                let i = place(i, &mut patch.rim);
                patch.stand_ins.push([i, at]);
            }
            if !walked.insert(own) {
                continue;
            }
            self.mesh.triangles_about(self.nodes[own as usize].at, &mut fan);
            for &t in fan.iter().filter(|&&t| seen.insert(t)) {
                let corners = [0, 1, 2].map(|k| self.mesh.node_at(t, k).map_or(NONE, |i| self.of_mesh[i as usize]));
                if corners.contains(&NONE) {
                    continue;
                }
                let triangle = patch.triangles.len() as u32;
                patch.triangles.push(corners.map(|v| place(v, &mut patch.rim)));
                let cut = match t.checked_sub(self.base_triangles) {
                    None => open.get(&t).copied(),
                    Some(t) => self.followed.get(t as usize / 2).map(|&i| OpenCut {
                        triangle,
                        corner: 2 - (t % 2) as u8,
                        which: (t % 2) as u8,
                        split: self.id(i),
                    }),
                };
                // What lies beyond has been told to its end.
                let goes_on = |c: &OpenCut| patch.triangles[triangle as usize][usize::from(c.corner)] < count;
                patch.open.extend(cut.filter(goes_on).map(|c| OpenCut { triangle, ..c }));
            }
        }
        patch
    }

    /// The node above a cut that has no children here, or is in the mesh without any.
    pub(crate) fn active(&self, cut: u32) -> Option<u32> {
        let model = self.truth.model()?;
        let mut at = cut;
        loop {
            match self.truth.node(at) {
                Some(i) => return Some(self.stand_in(i)),
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
        let node = self.truth.model().and_then(|model| model.hierarchy().node(self.number(i)));
        node.map_or([None; 2], |n| n.cuts.map(|c| Some(c).filter(|&c| c != NONE)))
    }
    /// The writer: a node's cuts, by name.
    pub(crate) fn cut_names(&self, i: u32) -> [Option<NodeId>; 2] {
        self.truth.model().map_or([None; 2], |model| model.cuts(self.number(i)))
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
    pub(crate) fn add_out(
        &mut self,
        i: u32,
        told: [Option<Way>; 2],
        row: [i32; 3],
        bounds: [Bounds; 2],
    ) -> Result<u32, ProtocolError> {
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
            let above = self.truth.model().and_then(|model| model.hierarchy().node(own.number));
            let number = above.map_or(NONE, |n| n.child + k as u32);
            self.truth.put(number, child + k as u32);
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
            Some((self.id(i), i))
        })
    }
    /// The block or those below it will say the rest of a way: it ends at a node of its own that has no children yet.
    pub(crate) fn goes_on(&self, (_, i): Way) -> bool {
        i != NONE && self.nodes[i as usize].child == NONE && self.mesh.id(self.nodes[i as usize].at).tree < self.roots
    }
    /// Cuts from the blocks above whose ways go on here, as far as is known now.
    pub(crate) fn open_cuts(&self) -> Vec<(NodeId, usize, Way)> {
        let way = |c: &OpenCut| {
            let i = *self.of_mesh.get(self.mesh.node_at(c.triangle, c.corner.into())? as usize)?;
            Some((c.split, usize::from(c.which), (self.id(i), i)))
        };
        self.open.iter().filter_map(way).collect()
    }
    /// The writer: the name of a cut of a split of any block.
    pub(crate) fn cut_name(&self, split: NodeId, k: usize) -> Option<NodeId> {
        let model = self.truth.model()?;
        model.cuts(model.hierarchy().find(split)?)[k]
    }
}

impl<T: Truth> Side for Local<'_, T> {
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

impl<T: Truth> Known for Local<'_, T> {
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
        let model = self.truth.model()?;
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
        self.followed.push(i);
        let first = self.add(i, told.ring.place, told.bounds, Some(child))?;
        self.of_mesh.extend([first, first + 1]);
        Ok(first)
    }
}
