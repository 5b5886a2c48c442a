//! Packets of splits: what refines a client's hierarchy.
//!
//! A packet holds any set of nodes that are not split yet, each with those above it that are not either. Both ends walk down from the roots through what
//! the client has; so a node's name costs the choices on the way, shared by all that lie together. Of each split come: where the second child is, as a
//! difference to the first on the grid; the fundamental cut vertices, each as a way that leaves that of a cut known already, on through what is known
//! (the nearer child first), and the rest that nobody can guess; the bounds of both children, each against their parent's. Choices are coded
//! by chances that learn as long as the session lasts, some 16 kB at either end.

use crate::error::ProtocolError;
use crate::message::Packets;
use crate::model::Model;
use crate::sides::{Reading, Side, Writing, assumed};
use crate::tags::ActiveTags;
use pmesh_codec::pmesh::Quantisation;
use pmesh_codec::range::{Chance, Coder, Encoder, RangeDecoder};
use pmesh_core::hierarchy::{Bounds, Front, NodeId, Split};
use std::collections::HashSet;

/// Most splits of a packet.
pub const PACKET_LIMIT: u32 = 1 << 16;

/// Chances of a number: of its length, by a tree.
type Number = [Chance; 32];
/// Cuts that a new one may be told by.
const CANDIDATES: usize = 7;
/// Ancestors whose cuts are among them.
const ANCESTORS: usize = 3;
/// Classes of a radius in steps of the grid, by its length in bits.
const SIZES: usize = 16;
/// Classes of how much an axis of the grid lies along the normal.
const SLOPES: usize = 4;

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
    /// A new child splits too; the last of roots of a block.
    again: [[Chance; SIZES]; 3],
    present: [Chance; 4],
    which: [[Chance; 8]; 2],
    up: Number,
    /// The farther child.
    farther: [Chance; 4],
    /// How far the way goes on below what is known.
    rest: [Number; SIZES],
    position: [[Number; SLOPES]; SIZES],
    sign: [Chance; 3],
    leaf: [[Chance; SIZES]; 2],
    radius: [Number; 2],
    /// By how much less the radius is.
    uniform: [[Number; 4]; 2],
    /// By how much less the other error is; the last where the parent has no cone.
    directional: [[Number; 5]; 2],
    /// Has a cone, by whether the parent has one and which child it is.
    cone: [[Chance; 2]; 2],
    /// By the parent's cone.
    axis: [[Number; 5]; 2],
    sine: [[Number; 5]; 2],
}

impl Default for SplitModels {
    fn default() -> Self {
        let (chance, number) = (Chance::default(), [Chance::default(); 32]);
        Self {
            spent: Spent::default(),
            cuts_only: false,
            below: [chance; 4],
            again: [[chance; SIZES]; 3],
            present: [chance; 4],
            which: [[chance; 8]; 2],
            up: number,
            farther: [chance; 4],
            rest: [number; SIZES],
            position: [[number; SLOPES]; SIZES],
            sign: [chance; 3],
            leaf: [[chance; SIZES]; 2],
            radius: [number; 2],
            uniform: [[number; 4]; 2],
            directional: [[number; 5]; 2],
            cone: [[chance; 2]; 2],
            axis: [[number; 5]; 2],
            sine: [[number; 5]; 2],
        }
    }
}

impl SplitModels {
    /// Chances that have learnt nothing, for packets of that kind.
    pub(crate) fn of(packets: Packets) -> Box<Self> {
        Box::new(Self { cuts_only: packets == Packets::CutsOnly, ..Default::default() })
    }
}

fn number(coder: &mut impl Coder, model: &mut Number, value: u32) -> u32 {
    let length = coder.symbol(model, (32 - value.leading_zeros()).min(31));
    match length {
        0 | 1 => length,
        31 => coder.raw(32, value),
        _ => 1 << (length - 1) | coder.raw(length - 1, value & ((1 << (length - 1)) - 1)),
    }
}
fn signed(coder: &mut impl Coder, model: &mut Number, value: i32) -> i32 {
    let zigzag = number(coder, model, ((value << 1) ^ (value >> 31)) as u32);
    (zigzag >> 1) as i32 ^ -((zigzag & 1) as i32)
}

/// What is said of the split of node `i`, which has children.
pub fn split_of(model: &Model, i: u32) -> Split {
    let h = model.hierarchy();
    let child = h.nodes()[i as usize].child;
    let bounds = [child, child + 1].map(|c| h.nodes()[c as usize].bounds);
    Split { id: h.id(i).unwrap_or(NodeId::root(0)), cuts: model.cuts(i), position: h.position(child + 1), bounds }
}

/// Writes a packet of `splits`, nodes whose children the client lacks; `tags` is the front after it. O(splits · depth).
pub fn write(models: &mut SplitModels, model: &Model, tags: &ActiveTags, splits: &[u32]) -> Vec<u8> {
    let mut wanted = HashSet::new();
    for &i in splits {
        let mut at = Some(i);
        while let Some(i) = at.filter(|&i| wanted.insert(i)) {
            at = model.hierarchy().node(i).map(|n| n.parent);
        }
    }
    let new: HashSet<u32> = splits.iter().copied().collect();
    let cut_at = models.cuts_only.then_some(tags);
    let mut side = Writing { model, wanted, done: HashSet::new(), knew: &|i| !tags.contains(i) && !new.contains(&i), cut_at };
    let mut coder = Encoder::new();
    // What is written is what was asked for: nothing can be wrong with it.
    let written = walk(&mut coder, models, &mut side, splits.len() as u32);
    debug_assert_eq!(written.ok(), Some(splits.len() as u32));
    coder.finish()
}

/// Reads a packet into what the client knows, of a model on that grid with so many nodes in all; gives how many splits it held. O(splits · depth). Errors: a packet that does not fit; the splits before the place stay.
pub fn read(
    models: &mut SplitModels,
    front: &mut Front,
    (grid, total): (&Quantisation, u64),
    bytes: &[u8],
) -> Result<u32, ProtocolError> {
    let mut coder = RangeDecoder::new(bytes.to_vec());
    walk(&mut coder, models, &mut Reading { front, total, grid, scope: None }, 0)
}

pub(crate) fn syntax<T>(coder: &impl Coder, what: &'static str) -> Result<T, ProtocolError> {
    Err(ProtocolError::Syntax { at: coder.byte_position(), what })
}

/// Where the walk is: a node that was there before, in or below which something is to come, or a new child.
enum Visit {
    Before(u32),
    New(u32, usize),
}

fn walk<C: Coder>(coder: &mut C, m: &mut SplitModels, side: &mut dyn Side, count: u32) -> Result<u32, ProtocolError> {
    let mut before = coder.position();
    let announced = coder.raw(17, count);
    if announced > PACKET_LIMIT {
        return syntax(coder, "more splits than a packet has");
    }
    let (mut done, mut tree) = (0, 0);
    let mut stack = Vec::new();
    let mut gaps = [Chance::default(); 32];
    while done < announced {
        let next = (tree..side.roots()).find(|&i| !C::ENCODES || side.is_wanted(i)).unwrap_or(tree);
        tree = tree.saturating_add(number(coder, &mut gaps, next - tree));
        if tree >= side.roots() {
            return syntax(coder, "a tree that is not there");
        }
        stack.push(Visit::Before(tree));
        tree += 1;
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
            };
            if side.bounds(node).is_leaf() || done == announced {
                return syntax(coder, "a split of a leaf, or one too many");
            }
            m.spent.names += coder.position() - before;
            let split = code(coder, m, side, node)?;
            before = coder.position();
            let child = side.add(node, &split)?;
            done += 1;
            if coder.ran_out() {
                return syntax(coder, "it ends before all that it announces");
            }
            stack.extend([Visit::New(child + 1, 1), Visit::New(child, 0)]);
        }
    }
    Ok(done)
}

/// A block: splits below `roots`, `count` in all, in the order of a walk. Gives the nodes where the walk ended before the end of the tree, in that order; what lies below them is in other blocks.
pub(crate) fn walk_block<C: Coder>(
    coder: &mut C,
    m: &mut SplitModels,
    side: &mut dyn Side,
    roots: &[u32],
    count: u32,
) -> Result<Vec<u32>, ProtocolError> {
    let (mut ends, mut done) = (Vec::new(), 0);
    let mut stack: Vec<(u32, usize)> = roots.iter().rev().map(|&i| (i, 2)).collect();
    while let Some((node, kind)) = stack.pop() {
        if side.bounds(node).is_leaf() {
            continue;
        }
        let before = coder.position();
        let size = size_of_node(side, node);
        let splits = done < count && coder.bit(&mut m.again[kind][size], side.is_wanted(node));
        m.spent.names += coder.position() - before;
        if !splits {
            ends.push(node);
            continue;
        }
        let split = code(coder, m, side, node)?;
        let child = side.add(node, &split)?;
        done += 1;
        if coder.ran_out() {
            return syntax(coder, "it ends before all that it announces");
        }
        stack.extend([(child + 1, 1), (child, 0)]);
    }
    if done < count {
        return syntax(coder, "fewer splits than it announces");
    }
    Ok(ends)
}

/// Class of a node by its radius.
pub(crate) fn size_of_node(side: &dyn Side, i: u32) -> usize {
    let step = if side.grid().position_bits.is_some() { side.grid().position_step } else { 1.0 };
    let steps = Bounds::length(side.bounds(i).radius, side.unit()) / step;
    (32 - (steps.min(1e9) as u32).leading_zeros()).min(SIZES as u32 - 1) as usize
}

pub(crate) fn code<C: Coder>(coder: &mut C, m: &mut SplitModels, side: &dyn Side, i: u32) -> Result<Split, ProtocolError> {
    let (truth, start) = (side.truth(i), coder.position());
    let (id, own, bounds, size) = (side.id(i), side.row(i), side.bounds(i), size_of_node(side, i));
    let blue = truth.map_or([0; 3], |t| side.grid().position_row(t.position));
    let normal = bounds.direction().map(f64::abs);
    let slope = normal.map(|n| if bounds.sine == Bounds::NO_CONE { 0 } else { 1 + usize::from(n > 0.4) + usize::from(n > 0.8) });
    let mut row = [0i32; 3];
    for k in 0..3 {
        let residual = blue[k].wrapping_sub(own[k]);
        let magnitude = number(coder, &mut m.position[size][slope[k]], residual.unsigned_abs());
        let negative = magnitude > 0 && coder.bit(&mut m.sign[k], residual < 0);
        row[k] = own[k].wrapping_add(if negative { (magnitude as i32).wrapping_neg() } else { magnitude as i32 });
    }
    let placed = coder.position();
    m.spent.positions += placed - start;
    let missing = truth.map_or(0, |t| t.cuts.iter().position(Option::is_none).map_or(0, |k| k + 1));
    let missing = coder.symbol(&mut m.present, missing as u32) as usize;
    // Cuts that are told as they stood have no names that both ends know.
    let mut known = candidates(side, i, if m.cuts_only { 1 } else { CANDIDATES - 1 });
    let mut cuts = [None; 2];
    for k in (0..2).filter(|k| k + 1 != missing) {
        let middle: [i64; 3] = std::array::from_fn(|a| i64::from(own[a]) + i64::from(row[a]));
        let cut = cut(coder, m, side, (k, &known), truth.and_then(|t| t.cuts[k]), middle)?;
        known.push(cut);
        cuts[k] = Some(cut);
    }
    let cut_off = coder.position();
    m.spent.cuts += cut_off - placed;
    let mut children = [Bounds::default(); 2];
    for (k, child) in children.iter_mut().enumerate() {
        let b = truth.map_or(Bounds::default(), |t| t.bounds[k]);
        if coder.bit(&mut m.leaf[k][size], b.is_leaf()) {
            continue;
        }
        if m.cuts_only {
            let root = side.bounds(id.tree);
            *child = assumed(root, id.depth().unwrap_or(0) + 1, false);
            continue;
        }
        // Radii are odd.
        let closer = number(coder, &mut m.radius[k], u32::from(bounds.radius.wrapping_sub(b.radius)) / 2);
        child.radius = bounds.radius.wrapping_sub((closer as u8).wrapping_mul(2));
        let better = number(coder, &mut m.uniform[k][closer.min(3) as usize], bounds.uniform.wrapping_sub(b.uniform).into());
        child.uniform = bounds.uniform.wrapping_sub(better as u8);
        let better = (better as usize).div_ceil(2).min(3);
        let had_cone = bounds.sine < Bounds::NO_CONE;
        // An eighth of a turn and more, and so on.
        let width = if had_cone { (bounds.sine / 8).min(3) as usize } else { 4 };
        child.sine = Bounds::NO_CONE;
        if !coder.bit(&mut m.cone[usize::from(had_cone)][k], b.sine < Bounds::NO_CONE) {
            continue;
        }
        // Without a cone the parent's error is one of both kinds.
        let before = if had_cone { bounds.directional } else { child.uniform };
        let directional =
            signed(coder, &mut m.directional[k][if had_cone { better } else { 4 }], i32::from(before) - i32::from(b.directional));
        child.directional = i32::from(before).wrapping_sub(directional) as u8;
        for a in 0..2 {
            let turn = b.axis[a].wrapping_sub(bounds.axis[a]);
            child.axis[a] = bounds.axis[a].wrapping_add(signed(coder, &mut m.axis[k][width], turn.into()) as i8);
        }
        let sharper = i32::from(bounds.sine) - i32::from(b.sine);
        child.sine = i32::from(bounds.sine).wrapping_sub(signed(coder, &mut m.sine[k][width], sharper)) as u8;
    }
    m.spent.bounds += coder.position() - cut_off;
    Ok(Split { id, cuts, position: side.grid().position_of_row(row), bounds: children })
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

/// Names that the cuts of node `i` may lie near: its sibling, and the cuts of those above.
fn candidates(side: &dyn Side, i: u32, most: usize) -> Vec<NodeId> {
    let mut known = Vec::with_capacity(CANDIDATES + 1);
    let mut at = i;
    for step in 0..ANCESTORS {
        let Some(parent) = side.parent(at) else { break };
        if step == 0 {
            let first = side.child(parent).unwrap_or(at);
            known.push(side.id(if at == first { first + 1 } else { first }));
        }
        known.extend(side.cuts(parent).into_iter().flatten());
        at = parent;
    }
    known.truncate(most);
    known
}

/// Steps that two ways have in common; `None` in other trees.
fn common(a: NodeId, b: NodeId) -> Option<u32> {
    let (p, q) = a.depth().zip(b.depth()).filter(|_| a.tree == b.tree)?;
    let least = p.min(q);
    let differ = (a.node >> (p - least)) ^ (b.node >> (q - least));
    Some(least - (64 - differ.leading_zeros()).min(least))
}

fn cut<C: Coder>(
    coder: &mut C,
    m: &mut SplitModels,
    side: &dyn Side,
    (k, known): (usize, &[NodeId]),
    truth: Option<NodeId>,
    middle: [i64; 3],
) -> Result<NodeId, ProtocolError> {
    let target = truth.unwrap_or(NodeId::root(0));
    let best = known.iter().map(|&c| common(c, target)).enumerate().rev().max_by_key(|(_, steps)| *steps);
    let best = best.filter(|b| b.1.is_some()).map_or(CANDIDATES, |b| b.0);
    let which = coder.symbol(&mut m.which[k], best as u32) as usize;
    let depth = |id: NodeId| id.depth().unwrap_or(0);
    let mut at;
    match known.get(which) {
        Some(&near) => {
            let steps = common(near, target).unwrap_or(0);
            let up = number(coder, &mut m.up, depth(near) - steps.min(depth(near)));
            if up > depth(near) {
                return syntax(coder, "a cut above a root");
            }
            at = NodeId { node: near.node >> up, ..near };
            if up > 0 {
                // It leaves the way there.
                at.node = (near.node >> (up - 1)) ^ 1;
            }
        }
        None if which == CANDIDATES => {
            let bits = 32 - side.roots().saturating_sub(1).leading_zeros();
            let tree = coder.raw(bits, target.tree);
            if tree >= side.roots() {
                return syntax(coder, "a cut in a tree that is not there");
            }
            at = NodeId::root(tree);
        }
        None => return syntax(coder, "a cut by one that is not there"),
    }
    // As far as the client's nodes lead.
    let mut node = at.tree;
    for second in at.way() {
        match side.child(node) {
            Some(child) => node = child + u32::from(second),
            // Below what is known already.
            None if side.bounds(node).is_leaf() => return syntax(coder, "a cut below a leaf"),
            None => {
                let size = size_of_node(side, node);
                return rest(coder, m, size, at, target);
            }
        }
    }
    while let Some(child) = side.child(node) {
        let far = [child, child + 1].map(|c| {
            let row = side.row(c);
            (0..3).map(|a| (2 * i64::from(row[a]) - middle[a]).unsigned_abs() as u128).map(|d| d * d).sum::<u128>()
        });
        let near = far[1] < far[0];
        let second = target.node >> depth(target).saturating_sub(depth(at) + 1) & 1 == 1;
        // Surer where one is much farther.
        let sure = usize::from(far[0].max(far[1]) > 4 * far[0].min(far[1]));
        let farther = coder.bit(&mut m.farther[2 * k + sure], second != near);
        let Some(next) = at.child(farther != near) else { return syntax(coder, "a cut too deep") };
        (node, at) = (child + u32::from(farther != near), next);
    }
    if side.bounds(node).is_leaf() {
        return Ok(at);
    }
    let size = size_of_node(side, node);
    rest(coder, m, size, at, target)
}

/// The rest of a way, below what is known.
fn rest<C: Coder>(coder: &mut C, m: &mut SplitModels, size: usize, at: NodeId, target: NodeId) -> Result<NodeId, ProtocolError> {
    let depth = |id: NodeId| id.depth().unwrap_or(0);
    let length = number(coder, &mut m.rest[size], depth(target).saturating_sub(depth(at)));
    if depth(at).saturating_add(length) > NodeId::DEPTH_LIMIT {
        return syntax(coder, "a cut too deep");
    }
    let mut at = at;
    for i in (0..length).rev() {
        let bit = coder.raw(1, (target.node >> i & 1) as u32);
        at.node = at.node << 1 | u64::from(bit);
    }
    Ok(at)
}
