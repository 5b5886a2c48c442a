//! A hierarchy in blocks: which splits lie together.
//!
//! A block has roots, nodes of the block above it, and of what lies below them the splits that a view of the whole needs first. Where it ends, at nodes that lie side by
//! side, the next blocks begin: so each is a region of the surface at a band of detail. It is decoded with nothing but the blocks above it, whatever else the client has.

use crate::blocks::{BlockModels, code_block};
use crate::error::ProtocolError;
use crate::model::Model;
use crate::patch::{Local, Patch};
use crate::splits::Spent;
use pmesh_codec::range::Encoder;
use pmesh_core::hierarchy::{Bounds, NONE};
use std::ops::Range;

/// Splits of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSizes {
    /// Of the first. Every view needs nearly all of it, and the others begin with what it has taught.
    pub first: u32,
    /// Of each other: those that lie side by side are fetched together, and what a view does not need stays little.
    pub others: u32,
}

impl Default for BlockSizes {
    fn default() -> Self {
        Self { first: 2048, others: 128 }
    }
}

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

/// Packs all of a model, the blocks in the order of their rank: the first, then those below it, then those below these. O(n log n). Errors: a model that cannot be.
pub(crate) fn pack(model: &Model, sizes: BlockSizes) -> Result<(Vec<Packed>, Spent), ProtocolError> {
    let h = model.hierarchy();
    let nodes = h.nodes();
    let sizes = BlockSizes { first: sizes.first.clamp(1, SPLITS_LIMIT), others: sizes.others.clamp(1, SPLITS_LIMIT) };
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
    let first = first_roots(&positions, &bounds, model.extent());
    let mut plan = if first.is_empty() {
        Vec::new()
    } else {
        vec![Patch::of_base(first, (h.root_count(), h.base_triangles()), |i| model.place(i))]
    };
    let (mut packed, mut spent) = (Vec::<Packed>::new(), Spent::default());
    let mut prior = BlockModels::default();
    let mut at = 0;
    while at < plan.len() {
        let patch = std::mem::take(&mut plan[at]);
        let mut local = Local::of(&patch, model)?;
        let all: u64 = patch.roots.iter().map(|&i| weight[i as usize]).sum();
        let most = if at == 0 { sizes.first } else { sizes.others };
        let splits = all.min(most.into()) as u32;
        let (mut models, mut coder) = (prior.clone(), Encoder::new());
        code_block(&mut coder, &mut models, &mut local, splits)?;
        spent.add(&models.take_spent());
        if at == 0 {
            prior = models;
        }
        // Regions of about the same weight.
        let mut ends = local.ends();
        let weigh = |nodes: &[u32]| nodes.iter().map(|&i| weight[local.number(i) as usize]).sum::<u64>();
        let count = weigh(&ends).div_ceil(u64::from(sizes.others)).min(FANOUT).min(ends.len() as u64) as usize;
        let mut left = |nodes: &[u32], parts: Range<usize>| {
            let half = parts.len() / 2;
            let all = weigh(nodes) * half as u64 / parts.len() as u64;
            let mut sum = 0;
            let before = nodes.iter().take_while(|&&i| {
                sum += weight[local.number(i) as usize];
                sum <= all
            });
            before.count().clamp(half, nodes.len() - (parts.len() - half))
        };
        let counts = local.divide(&mut ends, 0..count, &mut left);
        let child = plan.len() as u32;
        let mut rest = &ends[..];
        for count in counts {
            let (run, others) = rest.split_at(count);
            plan.push(local.patch(run));
            rest = others;
        }
        let (roots, children) = (patch.roots.len() as u32, count as u32);
        packed.push(Packed { bytes: coder.finish(), splits, roots, child, children });
        at += 1;
    }
    Ok((packed, spent))
}
