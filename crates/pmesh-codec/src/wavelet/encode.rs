//! A picture to parts.

use super::PIXELS_A_BYTE;
use super::Picture;
use super::layout::Layout;
use super::planes::Planes;
use super::transform::{Along, lines, split, to_ycocg};
use crate::EncodeError;
use crate::range::Encoder;

/// Bytes of the first part, about; each later one doubles the stream.
const FIRST_PART: usize = 1000;

/// The parts of a picture: all of it, or as many bytes as `limit` says, about. O(pixels × bit planes). Errors: a picture without
/// pixels or too large.
pub fn encode(picture: &Picture, limit: Option<usize>) -> Result<Vec<Vec<u8>>, EncodeError> {
    let Picture { width, height, pixels } = picture;
    let opaque = pixels.chunks_exact(4).all(|p| p[3] == 255);
    let grey = opaque && pixels.chunks_exact(4).all(|p| p[0] == p[1] && p[1] == p[2]);
    let channels = if grey { 1 } else { 3 + usize::from(!opaque) };
    let layout = Layout::new(*width, *height, channels);
    let Some(layout) = layout.filter(|l| l.samples() * 4 == pixels.len()) else {
        let got = format!("{width} × {height} pixels in {} bytes", pixels.len());
        let expected = "1 to 4096 pixels a side, four bytes each: scale it down";
        return Err(EncodeError::BadOption { what: "the image", got, expected });
    };
    let coefficients = coefficients(layout, pixels);
    let count = |c: &Vec<i16>| c.iter().map(|v| 16 - v.unsigned_abs().leading_zeros()).max().unwrap_or(0);
    let planes: Vec<u32> = coefficients.iter().map(count).collect();
    let mut header = [*width as u16, *height as u16].map(u16::to_le_bytes).concat();
    header.push(channels as u8);
    header.extend(planes.iter().map(|&p| p as u8));
    let mut coder_planes = Planes::new(layout, planes.clone());
    let mut parts: Vec<Vec<u8>> = Vec::new();
    let (mut coder, mut segments, mut total) = (Encoder::new(), 0u16, 0);
    let close = |coder: &mut Encoder, segments: &mut u16, parts: &mut Vec<Vec<u8>>| {
        let mut part = if parts.is_empty() { header.clone() } else { Vec::new() };
        part.extend(std::mem::take(segments).to_le_bytes());
        part.extend(std::mem::take(coder).finish());
        let length = part.len();
        parts.push(part);
        length
    };
    // What is announced must be believed after the first part alone.
    let least = (layout.samples() as u64).div_ceil(PIXELS_A_BYTE) as usize;
    let first_part = FIRST_PART.max(least);
    for s in layout.segments(&planes) {
        if limit.is_some_and(|most| total + coder.byte_count() >= most) {
            break;
        }
        while !coder_planes.step(&mut coder, s, Some(&coefficients[s.channel]), usize::MAX) {}
        segments += 1;
        if coder.byte_count() >= first_part.max(total) {
            total += close(&mut coder, &mut segments, &mut parts);
        }
    }
    if segments > 0 || parts.is_empty() {
        close(&mut coder, &mut segments, &mut parts);
    }
    // What packs better than a decoder believes is filled up.
    if let Some(first) = parts.first_mut().filter(|first| first.len() < least) {
        first.resize(least, 0);
    }
    Ok(parts)
}

/// Each channel transformed.
fn coefficients(layout: Layout, pixels: &[u8]) -> Vec<Vec<i16>> {
    let mut out = vec![Vec::with_capacity(layout.samples()); layout.channels];
    for p in pixels.chunks_exact(4) {
        let colors = if layout.channels == 1 { [i16::from(p[0]) - 128, 0, 0] } else { to_ycocg([p[0], p[1], p[2]]) };
        let all = [colors[0], colors[1], colors[2], i16::from(p[3]) - 128];
        out.iter_mut().zip(all).for_each(|(channel, v)| channel.push(v));
    }
    let stride = layout.width as usize;
    for channel in &mut out {
        for resolution in (1..=layout.depth).rev() {
            let (w, h) = layout.size(resolution);
            let size = (w as usize, h as usize);
            lines(channel, stride, size, Along::Columns, 0..size.0, split);
            lines(channel, stride, size, Along::Rows, 0..size.1, split);
        }
    }
    out
}
