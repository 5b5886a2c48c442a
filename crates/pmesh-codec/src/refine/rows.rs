//! Vertices as rows of integers, their models, and how a row is coded against its prediction.

use crate::range::{Coder, SignedModel};

/// Magnitude classes of a neighbourhood's size.
const SCALES: usize = 24;

/// Rows of all vertices so far: position first, then attributes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) width: usize,
    pub(crate) values: Vec<i32>,
    /// Low bits of a coordinate that have not come yet: positions are in grid steps of that many doublings.
    pub(crate) shift: u32,
    /// All vertices below this one have new positions that no part has told of yet.
    pub(crate) moved: u32,
    /// True if vertices may share positions.
    pub(crate) has_seams: bool,
    /// (vertex, first vertex at the same position), in the order of the vertices.
    pub(crate) seams: Vec<(u32, u32)>,
}

impl Rows {
    pub(crate) fn count(&self) -> u32 {
        (self.values.len() / self.width.max(1)) as u32
    }
    pub(crate) fn row(&self, v: u32) -> &[i32] {
        &self.values[v as usize * self.width..][..self.width]
    }
    /// The row as it is coded at this precision.
    pub(crate) fn coarse<'a>(&self, own: &'a [i32]) -> impl Iterator<Item = i32> + use<'a> {
        let shift = self.shift;
        own.iter().enumerate().map(move |(k, &x)| if k < 3 { x >> shift } else { x })
    }
    #[inline(always)]
    pub(crate) fn value(&self, v: u32, k: usize) -> i64 {
        i64::from(self.values[v as usize * self.width + k])
    }
}

/// Chances of residuals: those of positions by the size of the neighbourhood, those of attributes by channel.
pub(crate) struct RowModel {
    positions: Vec<SignedModel>,
    attributes: Vec<SignedModel>,
}

impl RowModel {
    pub(crate) fn new(width: usize) -> Self {
        let models = |n: usize| (0..n).map(|_| SignedModel::default()).collect();
        Self { positions: models(SCALES), attributes: models(width.saturating_sub(3)) }
    }
    /// Codes a row against `predicted` and appends it. `scale` is about the length of an edge there, in steps of the grid.
    pub(crate) fn code(&mut self, coder: &mut impl Coder, rows: &mut Rows, truth: Option<&[i32]>, predicted: &[i64], scale: i64) {
        let class = (64 - scale.max(0).leading_zeros() as usize).min(SCALES - 1);
        for (k, &p) in predicted.iter().enumerate() {
            let model = if k < 3 { &mut self.positions[class] } else { &mut self.attributes[k - 3] };
            let p = p as i32;
            let residual = coder.signed(model, truth.map_or(0, |t| t[k].wrapping_sub(p)));
            rows.values.push(p.wrapping_add(residual));
        }
    }
}
