//! Splits of a block: told by nothing but the blocks above it.
//!
//! Of each come: where the second child is, as a difference to the first on the grid; the fundamental cut vertices, each as a way that leaves that of a cut known already,
//! on through what is known (the nearer child first), and the rest that nobody can guess; the bounds of both children. Packets of a session need not say that much: `splits`.

use crate::error::ProtocolError;
use crate::numbers::{BoundsModel, Number, SIZES, number, syntax};
use crate::sides::{Ways, size_of_node};
use crate::splits::Spent;
use pmesh_codec::range::{Chance, Coder};
use pmesh_core::hierarchy::{Bounds, NodeId, Split};

/// Cuts that a new one may be told by.
const CANDIDATES: usize = 7;
/// Ancestors whose cuts are among them.
const ANCESTORS: usize = 3;
/// Classes of how much an axis of the grid lies along the normal.
const SLOPES: usize = 4;

/// What is learnt within a block.
#[derive(Clone, Debug)]
pub(crate) struct BlockModels {
    /// Bits so far.
    pub(crate) spent: Spent,
    /// A child splits too; the last of roots of a block.
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
    bounds: BoundsModel,
}

impl Default for BlockModels {
    fn default() -> Self {
        let (chance, number) = (Chance::default(), [Chance::default(); 32]);
        Self {
            spent: Spent::default(),
            again: [[chance; SIZES]; 3],
            present: [chance; 4],
            which: [[chance; 8]; 2],
            up: number,
            farther: [chance; 4],
            rest: [number; SIZES],
            position: [[number; SLOPES]; SIZES],
            sign: [chance; 3],
            bounds: BoundsModel::default(),
        }
    }
}

/// A block: splits below `roots`, `count` in all, in the order of a walk. Gives the nodes where the walk ended before the end of the tree, in that order; what lies below them is in other blocks.
pub(crate) fn walk_block<C: Coder>(
    coder: &mut C,
    m: &mut BlockModels,
    side: &mut dyn Ways,
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

fn code<C: Coder>(coder: &mut C, m: &mut BlockModels, side: &dyn Ways, i: u32) -> Result<Split, ProtocolError> {
    let (truth, start) = (side.truth(i), coder.position());
    let (id, own, bounds, size) = (side.id(i), side.row(i), side.bounds(i), size_of_node(side, i));
    let blue = truth.map_or([0; 3], |t| side.grid().position_row(t.position));
    let normal = bounds.direction().map(f64::abs);
    let slope = normal.map(|n| if bounds.angle == Bounds::NO_CONE { 0 } else { 1 + usize::from(n > 0.4) + usize::from(n > 0.8) });
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
    let mut known = candidates(side, i, CANDIDATES - 1);
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
        if !m.bounds.leaf(coder, k, size, b.is_leaf()) {
            *child = m.bounds.code(coder, k, &bounds, &b);
        }
    }
    m.spent.bounds += coder.position() - cut_off;
    Ok(Split { id, cuts, position: side.grid().position_of_row(row), bounds: children })
}

/// Names that the cuts of node `i` may lie near: its sibling, and the cuts of those above.
fn candidates(side: &dyn Ways, i: u32, most: usize) -> Vec<NodeId> {
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
    m: &mut BlockModels,
    side: &dyn Ways,
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
fn rest<C: Coder>(coder: &mut C, m: &mut BlockModels, size: usize, at: NodeId, target: NodeId) -> Result<NodeId, ProtocolError> {
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
