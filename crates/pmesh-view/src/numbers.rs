//! Numbers, as packets and blocks have them.

use crate::error::ProtocolError;
use pmesh_codec::range::{Chance, Coder};

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
