//! Images as a wavelet hierarchy that arrives plane by plane (FC01, C.15): every part sharpens the whole picture.
//!
//! The colours become one of brightness and two of difference (YCoCg-R), each of them and the alpha channel a pyramid of the
//! reversible 5/3 wavelet (Le Gall & Tabatabai 1988): all of the stream is the image bit for bit, any part of it less.
//! Coefficients are sent a bit plane at a time, those first that lower the error most ([`layout`]); the range coder sees
//! what stands around each and what the coarser band has there. The stream is cut into parts ([`encode`]), and streams of
//! levels carry them between their levels.

mod decode;
mod encode;
mod layout;
mod planes;
mod transform;

pub use decode::PictureDecoder;
pub use encode::encode;

/// The type of a [`crate::Texture`] whose bytes are parts: each its length, four bytes, lowest first, and so many bytes.
pub const MIME: &str = "image/x-pmesh-wavelet";
/// Largest side of an image.
pub const SIDE_LIMIT: u32 = 4096;
/// Most pixels that a byte of a stream may stand for, and a few for none: what a decoder believes.
const PIXELS_A_BYTE: u64 = 2048;

/// An image: 8 bits a channel, red green blue alpha, rows from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Picture {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four bytes a pixel.
    pub pixels: Vec<u8>,
}

/// A part as it stands in a texture of type [`MIME`].
pub fn framed(part: &[u8]) -> Vec<u8> {
    [&(part.len() as u32).to_le_bytes(), part].concat()
}

/// The parts of a texture of type [`MIME`]; what is cut off at the end is left out.
pub fn parts(bytes: &[u8]) -> Vec<&[u8]> {
    let mut out = Vec::new();
    let mut rest = bytes;
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let Some((part, more)) = after.split_at_checked(u32::from_le_bytes(*length) as usize) else { break };
        out.push(part);
        rest = more;
    }
    out
}
