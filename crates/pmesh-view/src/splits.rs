//! Packets of splits: what refines a client's hierarchy.
//!
//! A packet holds any set of nodes that are not split yet, each with those above it that are not either. Both ends walk down from the roots through what
//! the client has; so a node's name costs the choices on the way, shared by all that lie together. Both know the neighbours of a node in the mesh of all that the client has: of
//! each split come which of these are its cuts, where the second child is, predicted by them, and the bounds of both children, each against their parent's. A split that waits for another
//! of the packet says so, and comes after the walk. Choices are coded by chances that learn as long as the session lasts, some 140 kB at either end.

use crate::error::ProtocolError;
use crate::fans::{Fan, FanBounds};
use crate::message::Packets;
use crate::model::Model;
use crate::numbers::{SIZES, number, syntax};
use crate::sides::{Known, Reading, Sending, Told, assumed, size_of_node};
use crate::tags::ActiveTags;
use pmesh_codec::compact::{Ring, RingModel, RingSplit, RingVertex};
use pmesh_codec::pmesh::Quantisation;
use pmesh_codec::range::{Chance, Coder, Encoder, RangeDecoder};
use pmesh_core::hierarchy::{Bounds, Front, NodeId, Split};
use rustc_hash::FxHashSet;

/// Most splits of a packet.
pub const PACKET_LIMIT: u32 = 1 << 16;

/// Most neighbours of all nodes of a packet, and how many more for each byte of it: real ones have two a byte.
const RING_LIMIT: usize = 1 << 20;
const RINGS_A_BYTE: usize = 1 << 11;

/// Bits that splits take, by what they say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Which nodes split.
    pub names: f64,
    /// Where the children are.
    pub positions: f64,
    /// The fundamental cut vertices.
    pub cuts: f64,
    /// Bounds of the children.
    pub bounds: f64,
}

impl Spent {
    /// Adds what others took.
    pub fn add(&mut self, other: &Self) {
        self.names += other.names;
        self.positions += other.positions;
        self.cuts += other.cuts;
        self.bounds += other.bounds;
    }
}

/// What is learnt from packet to packet; both ends have the same.
#[derive(Clone, Debug)]
pub struct SplitModels {
    /// Bits so far.
    pub spent: Spent,
    /// [`Packets::CutsOnly`].
    pub(crate) cuts_only: bool,
    /// Below which children there are splits.
    below: [Chance; 4],
    /// A new child splits too.
    again: [[Chance; SIZES]; 2],
    /// A split waits for another.
    waits: Chance,
    rings: RingModel,
    leaf: [[Chance; SIZES]; 2],
    bounds: FanBounds,
    /// Scratch: those about the node at hand.
    pub(crate) ring: Ring,
    pub(crate) about: Vec<u32>,
}

impl Default for SplitModels {
    fn default() -> Self {
        let chance = Chance::default();
        Self {
            spent: Spent::default(),
            cuts_only: false,
            below: [chance; 4],
            again: [[chance; SIZES]; 2],
            waits: chance,
            rings: RingModel::default(),
            leaf: [[chance; SIZES]; 2],
            bounds: FanBounds::default(),
            ring: Ring::default(),
            about: Vec::new(),
        }
    }
}

impl SplitModels {
    /// Chances that have learnt nothing, for packets of that kind.
    pub(crate) fn of(packets: Packets) -> Box<Self> {
        Box::new(Self { cuts_only: packets == Packets::CutsOnly, ..Default::default() })
    }
    /// Bytes that they take.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.rings.memory_bytes() + self.bounds.memory_bytes()
    }
}

/// What is said of the split of node `i`, which has children.
pub fn split_of(model: &Model, i: u32) -> Split {
    let h = model.hierarchy();
    let child = h.nodes()[i as usize].child;
    let bounds = [child, child + 1].map(|c| h.nodes()[c as usize].bounds);
    Split { id: h.id(i).unwrap_or(NodeId::root(0)), cuts: model.cuts(i), position: h.position(child + 1), bounds }
}

/// Writes a packet of `splits`, nodes whose children the client lacks; `tags` is the front after it. O(splits · (depth + rim)), where the rim is that of a node in the finest mesh. Errors: splits that
/// cannot be made in any order, as only those are that a client is wrong about.
pub fn write(models: &mut SplitModels, model: &Model, tags: &ActiveTags, splits: &[u32]) -> Result<Vec<u8>, ProtocolError> {
    let mut wanted = FxHashSet::default();
    for &i in splits {
        let mut at = Some(i);
        while let Some(i) = at.filter(|&i| wanted.insert(i)) {
            at = model.hierarchy().node(i).map(|n| n.parent);
        }
    }
    let new: FxHashSet<u32> = splits.iter().copied().collect();
    let knew = |i: u32| !tags.contains(i) && !new.contains(&i);
    let wanted = |i: u32| wanted.contains(&i);
    let (done, cuts_only) = (FxHashSet::default(), models.cuts_only);
    let mut side = Sending { model, wanted: &wanted, done, knew: &knew, tags, new: &new, cuts_only };
    let mut coder = Encoder::new();
    walk(&mut coder, models, &mut side, splits.len() as u32)?;
    Ok(coder.finish())
}

/// Reads a packet into what the client knows, of a model on that grid with so many nodes in all; gives how many splits it held. O(splits · depth). Errors: a packet that does not fit; the splits before the place stay.
pub fn read(
    models: &mut SplitModels,
    front: &mut Front,
    (grid, total): (&Quantisation, u64),
    bytes: &[u8],
) -> Result<u32, ProtocolError> {
    let mut coder = RangeDecoder::new(bytes.to_vec());
    walk(&mut coder, models, &mut Reading { front, total, grid }, 0)
}

/// Where the walk is: a node that was there before, in or below which something is to come; a new child; one that has waited.
enum Visit {
    Before(u32),
    New(u32, usize),
    Waited(u32),
}

fn walk<C: Coder>(coder: &mut C, m: &mut SplitModels, side: &mut dyn Known, count: u32) -> Result<u32, ProtocolError> {
    let mut before = coder.position();
    let announced = coder.raw(17, count);
    if announced > PACKET_LIMIT {
        return syntax(coder, "more splits than a packet has");
    }
    let (mut done, mut tree) = (0, 0);
    let (mut stack, mut waiting, mut looked) = (Vec::new(), Vec::new(), 0);
    let mut gaps = [Chance::default(); 32];
    while done < announced {
        // The next tree, or one that waits.
        let next = if C::ENCODES { (tree..side.roots()).find(|&i| side.is_wanted(i)) } else { None };
        let step = number(coder, &mut gaps, next.map_or(0, |n| n - tree + 1));
        if let Some(gap) = step.checked_sub(1) {
            tree = tree.saturating_add(gap);
            if tree >= side.roots() {
                return syntax(coder, "a tree that is not there");
            }
            stack.push(Visit::Before(tree));
            tree += 1;
        } else {
            let bits = 32 - (waiting.len() as u32).leading_zeros();
            let ready = if C::ENCODES { ready(side, &waiting, &mut m.about) } else { 0 };
            let which = coder.raw(bits, ready as u32) as usize;
            if which >= waiting.len() {
                return syntax(coder, "splits that wait for each other");
            }
            stack.push(Visit::Waited(waiting.swap_remove(which)));
        }
        while let Some(visit) = stack.pop() {
            let node = match visit {
                Visit::Before(i) => match side.child(i) {
                    Some(child) => {
                        let both = [child, child + 1].map(|c| side.is_wanted(c));
                        let which = coder.symbol(&mut m.below, u32::from(both[0]) | u32::from(both[1]) << 1);
                        if which == 0 {
                            return syntax(coder, "a way to nothing");
                        }
                        stack.extend((0..2).rev().filter(|k| which >> k & 1 == 1).map(|k| Visit::Before(child + k)));
                        continue;
                    }
                    None => i,
                },
                Visit::New(i, k) => {
                    let size = size_of_node(side, i);
                    if side.bounds(i).is_leaf() || !coder.bit(&mut m.again[k][size], side.is_wanted(i)) {
                        continue;
                    }
                    i
                }
                Visit::Waited(i) => i,
            };
            if side.bounds(node).is_leaf() || done == announced {
                return syntax(coder, "a split of a leaf, or one too many");
            }
            m.ring.closed = side.neighbours(node, &mut m.about);
            look(coder, m, &mut looked)?;
            if !matches!(visit, Visit::Waited(_)) && coder.bit(&mut m.waits, side.waits(node, &m.about)) {
                waiting.push(node);
                continue;
            }
            m.spent.names += coder.position() - before;
            let told = code(coder, m, side, node)?;
            before = coder.position();
            let child = side.told(node, &told)?;
            done += 1;
            if coder.ran_out() {
                return syntax(coder, "it ends before all that it announces");
            }
            stack.extend([Visit::New(child + 1, 1), Visit::New(child, 0)]);
        }
    }
    Ok(done)
}

/// Counts the nodes about the one at hand. Errors: more than the bytes are worth.
pub(crate) fn look<C: Coder>(coder: &C, m: &SplitModels, looked: &mut usize) -> Result<(), ProtocolError> {
    *looked += m.about.len();
    if !C::ENCODES && *looked > RING_LIMIT + RINGS_A_BYTE * coder.byte_position() {
        return syntax(coder, "splits of nodes with too many neighbours");
    }
    Ok(())
}

/// The first that waits no more.
fn ready(side: &mut dyn Known, waiting: &[u32], about: &mut Vec<u32>) -> usize {
    let is_ready = |&i: &u32| {
        side.neighbours(i, about);
        !side.waits(i, about)
    };
    waiting.iter().position(is_ready).unwrap_or(waiting.len())
}

/// Codes the split of a node whose neighbours are at hand.
pub(crate) fn code<C: Coder>(coder: &mut C, m: &mut SplitModels, side: &dyn Known, i: u32) -> Result<Told, ProtocolError> {
    let (bounds, size) = (side.bounds(i), size_of_node(side, i));
    let about = std::mem::take(&mut m.about);
    let truth = side.truth_told(i, &about);
    let step = if side.grid().position_bits.is_some() { side.grid().position_step } else { 0.0 };
    let steps = |code: u8| if step > 0.0 { (Bounds::length(code, side.unit()) / step).min(1e9) } else { 0.0 };
    let depth = side.depth(i);
    let vertex = |w: u32| {
        let b = side.bounds(w);
        RingVertex {
            row: side.row(w),
            edge: if b.is_leaf() { 0.0 } else { 0.5 * steps(b.radius) as f32 },
            normal: if b.angle < Bounds::NO_CONE { b.direction() } else { [0.0; 3] },
            age: (side.depth(w) + 4).saturating_sub(depth).min(9) as u8,
        }
    };
    m.ring.about.clear();
    m.ring.about.extend(about.iter().map(|&w| vertex(w)));
    m.ring.own = vertex(i);
    let reach = steps(bounds.radius).max(1.0);
    m.ring.off = if step > 0.0 { [bounds.directional, bounds.uniform].map(|e| (steps(e) / reach).min(1.0)) } else { [0.1; 2] };
    m.about = about;
    let before = m.rings.spent;
    let ring = match m.rings.code(coder, &m.ring, truth.map(|t| t.0)) {
        Ok(ring) => ring,
        Err(what) => return syntax(coder, what),
    };
    m.spent.cuts += m.rings.spent[0] - before[0];
    m.spent.positions += m.rings.spent[1] - before[1];
    let start = coder.position();
    let fans = if m.cuts_only { [Fan::default(); 2] } else { fans(side, &m.ring, &ring) };
    let children = code_bounds(coder, m, (&bounds, size), &fans, truth.map(|t| t.1));
    m.spent.bounds += coder.position() - start;
    let cuts = ring.cuts.map(|c| c.and_then(|c| m.about.get(c as usize).copied()));
    Ok(Told { ring, cuts, bounds: children })
}

/// Codes the bounds of both children.
pub(crate) fn code_bounds<C: Coder>(
    coder: &mut C,
    m: &mut SplitModels,
    (bounds, size): (&Bounds, usize),
    fans: &[Fan; 2],
    truth: Option<[Bounds; 2]>,
) -> [Bounds; 2] {
    let mut children = [Bounds::default(); 2];
    for k in 0..2 {
        let b = truth.map_or(Bounds::default(), |t| t[k]);
        if coder.bit(&mut m.leaf[k][size], b.is_leaf()) {
            continue;
        }
        let first = (k == 1 && !children[0].is_leaf()).then_some(children[0]);
        children[k] =
            if m.cuts_only { assumed(bounds) } else { m.bounds.code(coder, (k, size), (bounds, first.as_ref()), &fans[k], &b) };
    }
    children
}

/// The fans of both children.
fn fans(side: &dyn Known, ring: &Ring, split: &RingSplit) -> [Fan; 2] {
    let at = |row: [i32; 3]| side.grid().position_of_row(row).map(f64::from);
    let (n, unit) = (ring.about.len(), side.unit());
    let own = at(ring.own.row);
    let blue = at(split.place);
    // From `from` on there is the second child's, from `to` on the first one's.
    let (from, to) = (split.cuts[0].map(|c| c as usize), split.cuts[1].map(|c| c as usize));
    let arc =
        |from: usize, to: usize| (from..=if to > from || !ring.closed { to } else { to + n }).map(|i| at(ring.about[i % n].row));
    let mut points: Vec<[f64; 3]>;
    let closed = from.is_some() && to.is_some();
    points = arc(from.unwrap_or(0), to.unwrap_or(n - 1)).collect();
    points.insert(if from.is_none() { points.len() } else { 0 }, own);
    let second = Fan::of(blue, &points, closed, unit);
    points.clear();
    let first_closed = match (from, to) {
        (Some(from), Some(to)) if ring.closed => {
            points.extend(arc(to, from));
            points.push(blue);
            true
        }
        (from, to) => {
            // What is before the second child's, that, what is after it.
            points.extend((0..=from.unwrap_or(0)).filter(|_| from.is_some()).map(|i| at(ring.about[i].row)));
            points.push(blue);
            points.extend((to.unwrap_or(n)..n).map(|i| at(ring.about[i].row)));
            false
        }
    };
    [Fan::of(own, &points, first_closed, unit), second]
}

/// Bytes of a split in a plain packet.
const PLAIN_BYTES: usize = 12 + 24 + 24 + 12;

/// A packet as the paper has it (E.9): name, both cuts, positions and bounds of both children, one after the other. O(splits · depth).
pub fn write_plain(model: &Model, splits: &[u32]) -> Vec<u8> {
    let mut out = Vec::with_capacity(splits.len() * PLAIN_BYTES);
    let name = |out: &mut Vec<u8>, id: Option<NodeId>| {
        let id = id.unwrap_or(NodeId { tree: 0, node: 0 });
        out.extend(id.tree.to_le_bytes());
        out.extend(id.node.to_le_bytes());
    };
    for &i in splits {
        let split = split_of(model, i);
        [Some(split.id), split.cuts[0], split.cuts[1]].into_iter().for_each(|id| name(&mut out, id));
        for p in [model.hierarchy().position(i), split.position] {
            p.iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        split.bounds.iter().for_each(|b| out.extend(b.to_bytes()));
    }
    out
}
/// Reads a plain packet, as [`read`] does.
pub fn read_plain(front: &mut Front, total: u64, bytes: &[u8]) -> Result<u32, ProtocolError> {
    if !bytes.len().is_multiple_of(PLAIN_BYTES) {
        return Err(ProtocolError::Syntax { at: bytes.len(), what: "a part of a split" });
    }
    for packed in bytes.chunks_exact(PLAIN_BYTES) {
        let four = |at: usize| [packed[at], packed[at + 1], packed[at + 2], packed[at + 3]];
        let word = |at: usize| u32::from_le_bytes(four(at));
        let id = |at: usize| NodeId { tree: word(at), node: u64::from(word(at + 4)) | u64::from(word(at + 8)) << 32 };
        let cut = |at: usize| Some(id(at)).filter(|c| c.node != 0);
        let bounds = |at: usize| Bounds::from_bytes(std::array::from_fn(|k| packed[at + k]));
        let position = [48, 52, 56].map(|at| f32::from_le_bytes(four(at)));
        if front.known() as u64 + 2 > total {
            return Err(ProtocolError::Unexpected("more nodes than the base mesh announces"));
        }
        front.learn(&Split { id: id(0), cuts: [cut(12), cut(24)], position, bounds: [bounds(60), bounds(66)] })?;
    }
    Ok((bytes.len() / PLAIN_BYTES) as u32)
}
