//! Numbers and bounds of nodes, as packets and blocks have them.

use crate::error::ProtocolError;
use pmesh_codec::range::{Chance, Coder};
use pmesh_core::hierarchy::Bounds;

/// Chances of a number: of its length, by a tree.
pub(crate) type Number = [Chance; 32];
/// Chances of a small number.
pub(crate) type Small = [Chance; 64];
/// Classes of a radius in steps of the grid, by its length in bits.
pub(crate) const SIZES: usize = 16;

pub(crate) fn number(coder: &mut impl Coder, model: &mut Number, value: u32) -> u32 {
    let length = coder.symbol(model, (32 - value.leading_zeros()).min(31));
    match length {
        0 | 1 => length,
        31 => coder.raw(32, value),
        _ => 1 << (length - 1) | coder.raw(length - 1, value & ((1 << (length - 1)) - 1)),
    }
}
/// A number of any size, of which those below 63 are learnt each by itself.
pub(crate) fn small(coder: &mut impl Coder, model: &mut Small, value: u32) -> u32 {
    match coder.symbol(model, value.min(63)) {
        63 => number(coder, &mut [Chance::default(); 32], value.wrapping_sub(63)).saturating_add(63),
        few => few,
    }
}
/// The same of either sign.
pub(crate) fn small_signed(coder: &mut impl Coder, model: &mut Small, value: i32) -> i32 {
    let zigzag = small(coder, model, ((value << 1) ^ (value >> 31)) as u32);
    (zigzag >> 1) as i32 ^ -((zigzag & 1) as i32)
}
pub(crate) fn syntax<T>(coder: &impl Coder, what: &'static str) -> Result<T, ProtocolError> {
    Err(ProtocolError::Syntax { at: coder.byte_position(), what })
}

/// What is learnt of bounds: those of a child against those of its parent, by which child it is.
#[derive(Clone, Debug)]
pub(crate) struct BoundsModel {
    leaf: [[Chance; SIZES]; 2],
    radius: [Small; 2],
    /// By how much less the radius is.
    uniform: [[Small; 4]; 2],
    /// It is as little as the other error allows.
    least: [Chance; 8],
    /// By how much less the other error is; the last where the parent has no cone.
    directional: [[Small; 5]; 2],
    /// By the parent's cone.
    angle: [[[Chance; 8]; 5]; 2],
    axis: [[Small; 5]; 2],
}

impl Default for BoundsModel {
    fn default() -> Self {
        let (chance, small) = (Chance::default(), [Chance::default(); 64]);
        Self {
            leaf: [[chance; SIZES]; 2],
            radius: [small; 2],
            uniform: [[small; 4]; 2],
            least: [chance; 8],
            directional: [[small; 5]; 2],
            angle: [[[chance; 8]; 5]; 2],
            axis: [[small; 5]; 2],
        }
    }
}

impl BoundsModel {
    /// Codes whether child `k` of a node of that size is a leaf.
    pub(crate) fn leaf<C: Coder>(&mut self, coder: &mut C, k: usize, size: usize, truth: bool) -> bool {
        coder.bit(&mut self.leaf[k][size], truth)
    }
    /// Codes the bounds of child `k`, which is no leaf, against its parent's.
    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, k: usize, bounds: &Bounds, b: &Bounds) -> Bounds {
        let mut child = Bounds::default();
        // Radii are odd.
        let closer = small(coder, &mut self.radius[k], u32::from(bounds.radius.wrapping_sub(b.radius)) / 2);
        child.radius = bounds.radius.wrapping_sub((closer as u8).wrapping_mul(2));
        let width = bounds.angle.min(Bounds::NO_CONE) as usize;
        child.angle = coder.symbol(&mut self.angle[k][width], b.angle.into()).min(Bounds::NO_CONE.into()) as u8;
        let has_cone = child.angle < Bounds::NO_CONE;
        if has_cone {
            for a in 0..2 {
                let turn = b.axis[a].wrapping_sub(bounds.axis[a]);
                child.axis[a] = bounds.axis[a].wrapping_add(small_signed(coder, &mut self.axis[k][width], turn.into()) as i8);
            }
            // Without a cone the parent's error is one of both kinds.
            let before = if width < 4 { bounds.directional } else { bounds.uniform };
            let class = if width < 4 { closer.min(3) as usize } else { 4 };
            let less = small_signed(coder, &mut self.directional[k][class], i32::from(before) - i32::from(b.directional));
            child.directional = i32::from(before).wrapping_sub(less) as u8;
            child.uniform = Bounds::least_uniform(child.directional);
            if coder.bit(&mut self.least[child.angle as usize * 2 + k], b.uniform == child.uniform) {
                return child;
            }
        }
        let better = small(coder, &mut self.uniform[k][closer.min(3) as usize], bounds.uniform.wrapping_sub(b.uniform).into());
        child.uniform = bounds.uniform.wrapping_sub(better as u8);
        child
    }
}
