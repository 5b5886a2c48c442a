//! What an encoder knows of a level that it codes.

use super::center::Side;
use crate::refine::rows::Rows;
use pmesh_core::surface::NONE;

/// A split that the encoder knows of, in coded numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    /// Number in the mesh.
    pub(super) vertex: u32,
    pub(super) side: Side,
    /// First of the vertices between which its triangles lie, and how many these are.
    pub(super) from: u32,
    pub(super) count: u32,
    /// Another split of the same vertex.
    after: u32,
}

/// The splits of a level, by what splits.
pub(super) struct Splits {
    first: Vec<u32>,
    all: Vec<Split>,
}

impl Splits {
    pub(super) fn new(vertices: u32, splits: usize) -> Self {
        Self { first: vec![NONE; vertices as usize], all: Vec::with_capacity(splits) }
    }
    /// Adds `vertex` as one that splits from `p`. Error: `p` is not there, or the chain is empty.
    pub(super) fn add(&mut self, p: u32, (vertex, side): (u32, Side), chain: (u32, u32)) -> Result<(), &'static str> {
        let first = self.first.get_mut(p as usize).filter(|_| chain.1 > 0).ok_or("a split of nothing")?;
        let after = std::mem::replace(first, self.all.len() as u32);
        self.all.push(Split { vertex, side, from: chain.0, count: chain.1, after });
        Ok(())
    }
    pub(super) fn any(&self, p: u32) -> bool {
        self.first[p as usize] != NONE
    }
    /// Takes the split of `p` out that has the least key. Error: one has none.
    pub(super) fn take<K: Ord>(&mut self, p: u32, key: impl Fn(&Split) -> Option<K>) -> Result<Option<(K, Split)>, &'static str> {
        let (mut best, mut before, mut at): (Option<(K, u32, Split)>, _, _) = (None, NONE, self.first[p as usize]);
        while let Some(split) = self.all.get(at as usize) {
            let key = key(split).ok_or("a split elsewhere")?;
            if best.as_ref().is_none_or(|(least, ..)| key < *least) {
                best = Some((key, before, *split));
            }
            (before, at) = (at, split.after);
        }
        Ok(best.map(|(key, before, split)| {
            match self.all.get_mut(before as usize) {
                Some(before) => before.after = split.after,
                None => self.first[p as usize] = split.after,
            }
            (key, split)
        }))
    }
}

/// What the encoder knows.
pub(super) struct LevelTruth<'a> {
    /// By coded vertices.
    pub(super) splits: &'a mut Splits,
    pub(super) rows: &'a Rows,
    /// Low bits of a coordinate that the level lacks.
    pub(super) shift: u32,
    pub(super) vertex_order: &'a mut Vec<u32>,
    /// For each vertex of the mesh the one whose position it shares, or [`NONE`].
    pub(super) position_of: &'a [u32],
}
