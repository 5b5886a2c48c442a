//! Splits of a block, told by the mesh of what the blocks above it hold.
//!
//! Which nodes split is not said: those that are farthest off, as the bounds of all have it. Each is told as in a packet of a session (`splits`): by those about it. Where both cuts
//! are still at one node, because what lies beyond the block's rim is coarse, the mesh cannot follow: such a split and those below it are told by names. After the splits
//! come the ways of all cuts, on from where the block knows them to be.

use crate::error::ProtocolError;
use crate::fans::Fan;
use crate::numbers::{Number, SIZES, number, syntax};
use crate::patch::{Local, Longer, Truth, Way};
use crate::sides::{Known, Side, size_of_node};
use crate::splits::{Spent, SplitModels, code, code_bounds, look};
use pmesh_codec::range::{Chance, Coder};
use pmesh_core::hierarchy::{Bounds, NONE, NodeId};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Times that a node waits for others to split before it.
const TRIES: usize = 2;
/// Codes by which its error is taken for less each time: an octave.
const LATER: u8 = 4;

/// What is learnt of splits in blocks.
#[derive(Clone, Debug)]
pub(crate) struct BlockModels {
    splits: SplitModels,
    /// The mesh cannot follow, yet or at all; by how often that was said.
    waits: [Chance; TRIES + 1],
    /// How far a way goes on below what is known.
    rest: [Number; SIZES],
    /// Of splits that the mesh cannot follow: which cut is missing, and where the second child is.
    missing: [Chance; 4],
    position: Number,
}

impl Default for BlockModels {
    fn default() -> Self {
        let (chance, number) = (Chance::default(), [Chance::default(); 32]);
        Self {
            splits: SplitModels::default(),
            waits: [chance; TRIES + 1],
            rest: [number; SIZES],
            missing: [chance; 4],
            position: number,
        }
    }
}

impl BlockModels {
    /// Bits by what they said, since last asked.
    pub(crate) fn take_spent(&mut self) -> Spent {
        std::mem::take(&mut self.splits.spent)
    }
}

/// A node by what it is off by, the worst first.
fn rank(b: &Bounds, tries: usize, i: u32) -> (u8, u8, Reverse<u32>) {
    (b.uniform.max(b.directional).saturating_sub(LATER * tries as u8), b.radius, Reverse(i))
}

/// What a block says of cuts.
pub(crate) struct Told {
    /// Of each split: ways to them, which end at leaves or at nodes where blocks below this one go on.
    pub(crate) cuts: Vec<[Option<NodeId>; 2]>,
    /// Of splits of the blocks above.
    pub(crate) longer: Vec<Longer>,
}

/// Codes `count` splits below the roots of a patch. Errors: a block that cannot be.
pub(crate) fn code_block<C: Coder, T: Truth>(
    coder: &mut C,
    m: &mut BlockModels,
    local: &mut Local<T>,
    count: u32,
) -> Result<Told, ProtocolError> {
    let mut next = BinaryHeap::new();
    let push = |next: &mut BinaryHeap<_>, local: &Local<T>, i: u32, tries: usize| {
        let bounds = local.bounds(i);
        if !bounds.is_leaf() {
            next.push((rank(&bounds, tries, i), tries));
        }
    };
    (0..local.root_count()).for_each(|i| push(&mut next, local, i, 0));
    let (mut done, mut looked) = (0, 0);
    while done < count {
        let Some(((.., Reverse(i)), tries)) = next.pop() else { return syntax(coder, "more splits than there can be") };
        let child = if local.is_out(i) {
            code_out(coder, m, local, i, &mut looked)?
        } else {
            let closed = local.neighbours(i, &mut m.splits.about);
            m.splits.ring.closed = closed;
            look(coder, &m.splits, &mut looked)?;
            let waits = coder.bit(&mut m.waits[tries], !local.fits(i, &m.splits.about, closed));
            if waits && tries < TRIES {
                push(&mut next, local, i, tries + 1);
                continue;
            }
            if waits {
                code_out(coder, m, local, i, &mut looked)?
            } else {
                let told = code(coder, &mut m.splits, local, i)?;
                local.told(i, &told)?
            }
        };
        if coder.ran_out() {
            return syntax(coder, "it ends before all that it announces");
        }
        done += 1;
        [child, child + 1].into_iter().for_each(|c| push(&mut next, local, c, 0));
    }
    let start = coder.position();
    let mut told = Told { cuts: Vec::with_capacity(local.splits().len()), longer: Vec::new() };
    for split in local.splits() {
        let names = local.cut_names(split.node);
        let mut cuts = [None; 2];
        for (k, way) in local.ways(split).into_iter().enumerate() {
            let Some(way) = way else { continue };
            let goes_on = split.told.is_none() && local.goes_on(way);
            cuts[k] = Some(if goes_on { way.0 } else { rest(coder, m, local, way, names[k])? });
        }
        told.cuts.push(cuts);
    }
    for (split, k, way) in local.open_cuts() {
        let name = local.cut_name(split, k);
        let cut = if local.goes_on(way) { way.0 } else { rest(coder, m, local, way, name)? };
        told.longer.push((split, k, cut));
    }
    m.splits.spent.cuts += coder.position() - start;
    Ok(told)
}

/// A split that the mesh cannot follow.
fn code_out<C: Coder, T: Truth>(
    coder: &mut C,
    m: &mut BlockModels,
    local: &mut Local<T>,
    i: u32,
    looked: &mut usize,
) -> Result<u32, ProtocolError> {
    let start = coder.position();
    let own = local.row(i);
    let truth = local.truth_told(i, &[]);
    let blue = truth.map_or([0; 3], |t| t.0.place);
    let mut row = [0i32; 3];
    for k in 0..3 {
        let off = blue[k].wrapping_sub(own[k]);
        let folded = number(coder, &mut m.position, (off.wrapping_shl(1) ^ (off >> 31)) as u32);
        row[k] = own[k].wrapping_add((folded >> 1) as i32 ^ -((folded & 1) as i32));
    }
    let placed = coder.position();
    m.splits.spent.positions += placed - start;
    // By the node that stands for it, those about that, or by name.
    let by = local.stand_in(i);
    local.neighbours(by, &mut m.splits.about);
    look(coder, &m.splits, looked)?;
    let mut about = std::mem::take(&mut m.splits.about);
    about.push(by);
    let (names, cuts) = (local.cut_names(i), local.cuts(i));
    let missing = names.iter().position(Option::is_none).map_or(0, |k| k + 1);
    let missing = coder.symbol(&mut m.missing, missing as u32) as usize;
    if missing > 2 {
        return syntax(coder, "a split without cuts");
    }
    let bits = 32 - (about.len() as u32).leading_zeros();
    let mut told = [None; 2];
    for k in (0..2).filter(|k| k + 1 != missing) {
        let active = cuts[k].and_then(|c| local.active(c));
        let which = about.iter().position(|&w| Some(w) == active).unwrap_or(about.len());
        let which = coder.raw(bits, which as u32) as usize;
        told[k] = match about.get(which) {
            Some(&w) => Some((local.id(w), w)),
            None if which == about.len() => {
                let name = names[k].unwrap_or(NodeId::root(0));
                Some((NodeId::root(coder.raw(32, name.tree)), NONE))
            }
            None => return syntax(coder, "a cut by one that is not there"),
        };
    }
    m.splits.about = about;
    let cut_off = coder.position();
    m.splits.spent.cuts += cut_off - placed;
    let (bounds, size) = (local.bounds(i), size_of_node(local, i));
    let children = code_bounds(coder, &mut m.splits, (&bounds, size), &[Fan::default(); 2], truth.map(|t| t.1));
    m.splits.spent.bounds += coder.position() - cut_off;
    local.add_out(i, told, row, children)
}

/// The rest of a way to a leaf. Errors: a way that is too long.
fn rest<C: Coder, T: Truth>(
    coder: &mut C,
    m: &mut BlockModels,
    local: &Local<T>,
    (way, node): Way,
    truth: Option<NodeId>,
) -> Result<NodeId, ProtocolError> {
    let depth = |id: NodeId| id.depth().unwrap_or(0);
    if node != NONE && local.bounds(node).is_leaf() {
        return Ok(way);
    }
    let (least, size) = if node == NONE { (0, 0) } else { (1, size_of_node(local, node)) };
    let target = truth.unwrap_or(way);
    let length = number(coder, &mut m.rest[size], depth(target).saturating_sub(depth(way) + least)).saturating_add(least);
    if depth(way).saturating_add(length) > NodeId::DEPTH_LIMIT {
        return syntax(coder, "a cut too deep");
    }
    let mut at = way;
    for i in (0..length).rev() {
        at.node = at.node << 1 | u64::from(coder.raw(1, (target.node >> i & 1) as u32));
    }
    Ok(at)
}
