//! A hierarchy in blocks: which splits lie together, and their coding.
//!
//! A block has roots, nodes of the block above it, and of what lies below them the splits that a view of the whole needs first. Where it ends, at nodes side by side in
//! the walk, the next blocks begin: so each is a region of the surface at a band of detail. It is decoded with nothing but the blocks above it, whatever else the client has.

use crate::model::Model;
use crate::sides::Writing;
use crate::splits::Spent;
use crate::ways::{BlockModels, walk_block};
use pmesh_codec::range::Encoder;
use pmesh_core::hierarchy::{Bounds, NONE};
use rustc_hash::FxHashSet;
use std::collections::BinaryHeap;

/// Splits of a block, under a kilobyte: those that lie side by side are fetched together, and what a view does not need stays little.
pub(crate) const BLOCK_SPLITS: u32 = 128;
/// Blocks below a block. More are fewer requests one after the other, and more that a view does not need.
const FANOUT: u64 = 2;
/// Most splits that a block may announce.
pub(crate) const SPLITS_LIMIT: u32 = 1 << 16;

/// A block as it is packed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    pub(crate) bytes: Vec<u8>,
    pub(crate) splits: u32,
    pub(crate) roots: u32,
    /// The first block below it, and how many there are.
    pub(crate) child: u32,
    pub(crate) children: u32,
}

/// The roots of the first block: those trees that have splits, along a space-filling curve, so that neighbours are in one block further down. O(n log n).
pub(crate) fn first_roots(positions: &[[f32; 3]], bounds: &[Bounds], [low, high]: [[f32; 3]; 2]) -> Vec<u32> {
    let size = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(0.0, f64::max);
    let key = |p: [f32; 3]| {
        let cell =
            [0, 1, 2].map(|k| if size > 0.0 { ((f64::from(p[k]) - f64::from(low[k])) / size * 1023.0) as u32 & 1023 } else { 0 });
        (0..10).rev().fold(0u32, |key, bit| (0..3).fold(key, |key, k| key << 1 | (cell[k] >> bit & 1)))
    };
    let mut roots: Vec<u32> =
        (0..positions.len() as u32).filter(|&i| bounds.get(i as usize).is_some_and(|b| !b.is_leaf())).collect();
    roots.sort_by_key(|&i| (key(positions[i as usize]), i));
    roots
}

/// Packs all of a model, the blocks in the order of their rank: the first, then those below it, then those below these. O(n log n).
pub(crate) fn pack(model: &Model) -> (Vec<Packed>, Spent) {
    let h = model.hierarchy();
    let nodes = h.nodes();
    // Splits below each node, itself included.
    let mut weight = vec![0u64; nodes.len()];
    for i in (0..nodes.len()).rev() {
        let child = nodes[i].child;
        if child != NONE {
            weight[i] = 1 + weight[child as usize] + weight[child as usize + 1];
        }
    }
    let positions: Vec<_> = (0..h.root_count()).map(|i| h.position(i)).collect();
    let bounds: Vec<_> = nodes[..positions.len()].iter().map(|n| n.bounds).collect();
    let mut block_of = vec![NONE; nodes.len()];
    // Roots of each block, and the block above it.
    let first = first_roots(&positions, &bounds, model.extent());
    let mut plan = if first.is_empty() { Vec::new() } else { vec![(first, NONE)] };
    let (mut packed, mut spent) = (Vec::<Packed>::new(), Spent::default());
    let mut at = 0;
    while at < plan.len() {
        let roots = plan[at].0.clone();
        // What is farthest off first.
        let rank = |i: u32| {
            (
                nodes[i as usize].bounds.uniform.max(nodes[i as usize].bounds.directional),
                nodes[i as usize].bounds.radius,
                u32::MAX - i,
            )
        };
        let mut heap: BinaryHeap<_> = roots.iter().map(|&i| (rank(i), i)).collect();
        let mut splits = 0;
        while let Some((_, i)) = heap.pop().filter(|_| splits < BLOCK_SPLITS) {
            splits += 1;
            block_of[i as usize] = at as u32;
            let child = nodes[i as usize].child;
            heap.extend([child, child + 1].into_iter().filter(|&c| nodes[c as usize].child != NONE).map(|c| (rank(c), c)));
        }
        let above = |b: u32| Some(b).filter(|&b| b != NONE);
        let chain: Vec<u32> = std::iter::successors(above(plan[at].1), |&b| above(plan[b as usize].1)).collect();
        let knew = |i: u32| chain.contains(&block_of[i as usize]);
        let wanted = |i: u32| block_of[i as usize] == at as u32;
        let mut side = Writing { model, wanted: &wanted, done: FxHashSet::default(), knew: &knew };
        let (mut models, mut coder) = (BlockModels::default(), Encoder::new());
        // What is written is what was asked for: nothing can be wrong with it.
        let ends = walk_block(&mut coder, &mut models, &mut side, &roots, splits).unwrap_or_default();
        spent.add(&models.spent);
        // Runs of about the same weight.
        let all: u64 = ends.iter().map(|&i| weight[i as usize]).sum();
        let count = all.div_ceil(u64::from(BLOCK_SPLITS)).min(FANOUT);
        let (mut run, mut sum, mut children) = (Vec::new(), 0, 0);
        for i in ends {
            run.push(i);
            sum += weight[i as usize];
            if sum * count >= all * (children + 1) {
                plan.push((std::mem::take(&mut run), at as u32));
                children += 1;
            }
        }
        let (child, roots) = (plan.len() as u32 - children as u32, roots.len() as u32);
        packed.push(Packed { bytes: coder.finish(), splits, roots, child, children: children as u32 });
        at += 1;
    }
    (packed, spent)
}
