//! Numbers, as packets and blocks have them.

use crate::error::ProtocolError;
use pmesh_codec::range::{Chance, Coder};

/// Chances of a number: of its length, by a tree.
pub(crate) type Number = [Chance; 32];
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
pub(crate) fn syntax<T>(coder: &impl Coder, what: &'static str) -> Result<T, ProtocolError> {
    Err(ProtocolError::Syntax { at: coder.byte_position(), what })
}
