//! Bit planes of a channel: which coefficients begin in a plane, their signs, and the next bit of those that have begun.

use super::layout::{BLOCK, Band, Kind, Layout, Segment, blocks};
use crate::range::{Chance, Coder};

/// Classes of what stands around a coefficient.
const AROUND: usize = 10;
/// Classes of what the coarser band has there.
const PARENTS: usize = 4;

/// Chances, one set for brightness, one for colours, one for alpha.
struct Model {
    /// Whether anything begins in a block.
    block: [Chance; 3 * 3 * 2],
    begins: [Chance; 3 * AROUND * PARENTS],
    sign: [Chance; 3 * 9],
    next: [Chance; AROUND * 3],
}

impl Default for Model {
    fn default() -> Self {
        Self {
            block: [Chance::default(); 3 * 3 * 2],
            begins: [Chance::default(); 3 * AROUND * PARENTS],
            sign: [Chance::default(); 3 * 9],
            next: [Chance::default(); AROUND * 3],
        }
    }
}

/// A segment that is being coded.
struct Current {
    segment: Segment,
    blocks: Vec<Band>,
    at: usize,
}

/// The coefficients of all channels as far as they are known, and the coder of either direction.
pub(super) struct Planes {
    pub(super) layout: Layout,
    /// Bit planes of each channel.
    pub(super) counts: Vec<u32>,
    /// By channel: coefficients, their lower planes 0; made when the channel's first plane comes.
    pub(super) values: Vec<Vec<i16>>,
    /// By channel and resolution: the last plane that is known, or `None`.
    pub(super) known: Vec<Vec<Option<u32>>>,
    /// By channel and resolution, by block: something has begun in it.
    begun: Vec<Vec<Vec<bool>>>,
    models: [Model; 3],
    current: Option<Current>,
}

fn model_of(channel: usize) -> usize {
    match channel {
        0 => 0,
        1 | 2 => 1,
        _ => 2,
    }
}

/// Classes of a sum of magnitudes in halves of the plane's bit.
fn class(sum: u32) -> usize {
    match sum {
        0..=3 => sum as usize,
        4..=5 => 4,
        6..=8 => 5,
        9..=12 => 6,
        13..=20 => 7,
        21..=40 => 8,
        _ => 9,
    }
}

impl Planes {
    pub(super) fn new(layout: Layout, counts: Vec<u32>) -> Self {
        let resolutions = layout.depth as usize + 1;
        Self {
            layout,
            counts,
            values: vec![Vec::new(); layout.channels],
            known: vec![vec![None; resolutions]; layout.channels],
            begun: vec![vec![Vec::new(); resolutions]; layout.channels],
            models: Default::default(),
            current: None,
        }
    }

    /// Codes about `limit` blocks of a segment; true once it is whole. `truth` are the channel's coefficients.
    pub(super) fn step(&mut self, coder: &mut impl Coder, segment: Segment, truth: Option<&[i16]>, limit: usize) -> bool {
        let Segment { channel, resolution, .. } = segment;
        let r = resolution as usize;
        let mut current = match self.current.take() {
            Some(c) if c.segment == segment => c,
            _ => {
                let blocks = blocks(&self.layout.bands(resolution));
                self.begun[channel][r].resize(blocks.len(), false);
                self.values[channel].resize(self.layout.samples(), 0);
                Current { segment, blocks, at: 0 }
            }
        };
        let end = current.at.saturating_add(limit).min(current.blocks.len());
        for i in current.at..end {
            self.block(coder, segment, &current.blocks, i, truth);
        }
        current.at = end;
        if end < current.blocks.len() {
            self.current = Some(current);
            return false;
        }
        self.known[channel][r] = Some(segment.plane);
        true
    }

    fn block(&mut self, coder: &mut impl Coder, s: Segment, all: &[Band], i: usize, truth: Option<&[i16]>) {
        let block = all[i];
        let stride = self.layout.width as usize;
        let model = &mut self.models[model_of(s.channel)];
        let values = &mut self.values[s.channel];
        let begun = &mut self.begun[s.channel][s.resolution as usize];
        let kind = match block.kind {
            Kind::Coarsest | Kind::Vertical => 0,
            Kind::Horizontal => 1,
            Kind::Diagonal => 2,
        };
        // The band around the block: neighbours are looked for within it.
        let (w, h) = self.layout.size(s.resolution);
        let (cw, ch) = if s.resolution == 0 { (0, 0) } else { self.layout.size(s.resolution - 1) };
        let (left, right) = if block.x >= cw && s.resolution > 0 { (cw, w) } else { (0, if s.resolution == 0 { w } else { cw }) };
        let (top, bottom) = if block.y >= ch && s.resolution > 0 { (ch, h) } else { (0, if s.resolution == 0 { h } else { ch }) };
        let bit = 1i16 << s.plane;
        if !begun[i] {
            let before = usize::from(i > 0 && begun[i - 1]);
            let above = block.y > top && begun[i - (right - left).div_ceil(BLOCK) as usize];
            let rows = || (block.y as usize..(block.y + block.height) as usize).map(|y| y * stride + block.x as usize);
            let begins =
                truth.is_some_and(|t| rows().any(|from| t[from..from + block.width as usize].iter().any(|c| c.abs() >= bit)));
            let context = kind * 6 + (before + usize::from(above)) * 2 + usize::from(s.resolution > 1);
            begun[i] = coder.bit(&mut model.block[context], begins);
            if !begun[i] {
                return;
            }
        }
        let has_parents = s.resolution > 1;
        let (pw, ph) = if has_parents { self.layout.size(s.resolution - 2) } else { (0, 0) };
        for y in block.y..block.y + block.height {
            for x in block.x..block.x + block.width {
                let at = y as usize * stride + x as usize;
                let (up, down, before, after) = (y > top, y + 1 < bottom, x > left, x + 1 < right);
                let value = |there: bool, at: usize| if there { values[at] } else { 0 };
                let (l, r) = (value(before, at.wrapping_sub(1)), value(after, at + 1));
                let (u, d) = (value(up, at.wrapping_sub(stride)), value(down, at + stride));
                let corners = [
                    value(up && before, at.wrapping_sub(stride + 1)),
                    value(up && after, at.wrapping_sub(stride).wrapping_add(1)),
                    value(down && before, at + stride - 1),
                    value(down && after, at + stride + 1),
                ];
                let size = |v: i16| u32::from(v.unsigned_abs());
                // Details from left to right lie along columns, and the other way round.
                let (along, across) =
                    if kind == 1 { (size(u) + size(d), size(l) + size(r)) } else { (size(l) + size(r), size(u) + size(d)) };
                let diagonal: u32 = corners.iter().map(|&c| size(c)).sum();
                let around = class((4 * along + 3 * across + diagonal) >> s.plane >> 1);
                let own = values[at];
                if own != 0 {
                    let digits = match own.unsigned_abs() >> s.plane >> 1 {
                        1 => 0,
                        2 | 3 => 1,
                        _ => 2,
                    };
                    let wanted = truth.is_some_and(|t| t[at].unsigned_abs() & bit as u16 != 0);
                    if coder.bit(&mut model.next[around * 3 + digits], wanted) {
                        values[at] = if own < 0 { own - bit } else { own + bit };
                    }
                    continue;
                }
                let parent = if has_parents {
                    // The same place in the band of the same kind of the next coarser resolution.
                    let px = if x >= cw { pw + (x - cw) / 2 } else { x / 2 };
                    let py = if y >= ch { ph + (y - ch) / 2 } else { y / 2 };
                    let inside = px < cw && py < ch;
                    let size = if inside { size(values[py as usize * stride + px as usize]) >> s.plane } else { 0 };
                    (size as usize).min(PARENTS - 1)
                } else {
                    0
                };
                let context = (kind * AROUND + around) * PARENTS + parent;
                let wanted = truth.map_or(0, |t| t[at]);
                if coder.bit(&mut model.begins[context], wanted.unsigned_abs() >= bit as u16) {
                    let lean = |a: i16, b: i16| (i32::from(a.signum()) + i32::from(b.signum())).signum() + 1;
                    let context = kind * 9 + (lean(l, r) * 3 + lean(u, d)) as usize;
                    values[at] = if coder.bit(&mut model.sign[context], wanted < 0) { -bit } else { bit };
                }
            }
        }
    }
}
