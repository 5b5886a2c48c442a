//! Parts to pictures, in small pieces: after each part the whole picture again, sharper.

use super::layout::{Layout, Segment};
use super::planes::Planes;
use super::transform::{Along, join, lines, to_rgb};
use super::{PIXELS_A_BYTE, Picture};
use crate::range::{OVERRUN, RangeDecoder};
use std::collections::VecDeque;
use std::sync::Arc;

/// Blocks of coefficients a piece of work.
const STEP_BLOCKS: usize = 24;
/// Samples a piece of work, where samples are transformed or become pixels.
const STEP_SAMPLES: usize = 1 << 14;
/// Steps of the transform that a picture is finer than what is known of it: it is smooth then, not blocky.
const SMOOTH_STEPS: u32 = 2;

/// Decodes parts as they come.
#[derive(Default)]
pub struct PictureDecoder {
    parts: VecDeque<Vec<u8>>,
    state: Option<State>,
    part: Option<Part>,
    making: Option<Making>,
    picture: Arc<Picture>,
    version: u32,
}

struct State {
    planes: Planes,
    segments: VecDeque<Segment>,
}

struct Part {
    coder: RangeDecoder,
    segments: u16,
}

impl PictureDecoder {
    /// Takes a part, whole.
    pub fn push(&mut self, part: &[u8]) {
        self.parts.push_back(part.to_vec());
    }
    /// The picture as sharp as it was made last, and how many times it was.
    pub fn picture(&self) -> (&Arc<Picture>, u32) {
        (&self.picture, self.version)
    }

    /// Does a piece of what is left to do; false if nothing is. An error says what is wrong with the part.
    pub fn work(&mut self) -> Result<bool, &'static str> {
        if let (Some(making), Some(state)) = (&mut self.making, &self.state) {
            if let Some(picture) = making.step(&state.planes) {
                (self.picture, self.making) = (Arc::new(picture), None);
                self.version += 1;
            }
            return Ok(true);
        }
        if let Some(part) = &mut self.part {
            let State { planes, segments } = self.state.as_mut().ok_or("no header")?;
            if part.segments == 0 {
                self.part = None;
                // Several parts that wait make one picture.
                self.making = self.parts.is_empty().then(|| Making::new(planes));
                return Ok(true);
            }
            let &segment = segments.front().ok_or("more bit planes than there are")?;
            if planes.step(&mut part.coder, segment, None, STEP_BLOCKS) {
                segments.pop_front();
                part.segments -= 1;
            }
            if part.coder.overrun() > OVERRUN {
                return Err("it ends before all that it announces");
            }
            return Ok(true);
        }
        let Some(mut bytes) = self.parts.pop_front() else { return Ok(false) };
        let mut at = 0;
        if self.state.is_none() {
            let (state, length) = header(&bytes)?;
            (self.state, at) = (Some(state), length);
        }
        let count = bytes.get(at..at + 2).and_then(|b| b.try_into().ok()).ok_or("it is shorter than its header")?;
        let rest = bytes.split_off(at + 2);
        self.part = Some(Part { coder: RangeDecoder::new(rest), segments: u16::from_le_bytes(count) });
        Ok(true)
    }
}

/// Size, channels and planes from the front of the first part, and how long that is.
fn header(bytes: &[u8]) -> Result<(State, usize), &'static str> {
    let [w0, w1, h0, h1, channels] = *bytes.first_chunk::<5>().ok_or("it is shorter than its header")?;
    let size = (u16::from_le_bytes([w0, w1]).into(), u16::from_le_bytes([h0, h1]).into());
    let layout = Layout::new(size.0, size.1, channels.into()).ok_or("an image of a size or of channels that it cannot have")?;
    if layout.samples() as u64 > bytes.len() as u64 * PIXELS_A_BYTE {
        return Err("it announces more pixels than its bytes can hold");
    }
    let planes: Vec<u32> =
        bytes.get(5..5 + layout.channels).ok_or("it is shorter than its header")?.iter().map(|&p| p.into()).collect();
    if planes.iter().any(|&p| p > 14) {
        return Err("more bit planes than a coefficient has");
    }
    let segments = layout.segments(&planes).into();
    let state = State { planes: Planes::new(layout, planes), segments };
    Ok((state, 5 + layout.channels))
}

/// The way from coefficients to pixels, in pieces.
struct Making {
    /// Resolution of the picture that is made.
    resolution: u32,
    channel: usize,
    /// The step of the transform that is being undone, 0 while coefficients are copied.
    step: u32,
    along: Along,
    at: usize,
    channels: Vec<Vec<i16>>,
    pixels: Vec<u8>,
}

impl Making {
    fn new(planes: &Planes) -> Self {
        let finest = planes.known.iter().filter_map(|k| k.iter().rposition(|p| p.is_some())).max().unwrap_or(0) as u32;
        let resolution = (finest + SMOOTH_STEPS).min(planes.layout.depth);
        Self { resolution, channel: 0, step: 0, along: Along::Rows, at: 0, channels: Vec::new(), pixels: Vec::new() }
    }

    /// A piece; the picture once it is made.
    fn step(&mut self, planes: &Planes) -> Option<Picture> {
        let layout = planes.layout;
        let (w, h) = layout.size(self.resolution);
        let (width, height) = (w as usize, h as usize);
        let rows = (STEP_SAMPLES / width).max(1);
        if self.channel == layout.channels {
            let end = (self.at + rows).min(height);
            for i in self.at * width..end * width {
                let value = |c: usize| self.channels[c][i];
                let color = if layout.channels == 1 { [value(0), 0, 0] } else { [value(0), value(1), value(2)] };
                let alpha = if layout.channels == 4 { (value(3) + 128).clamp(0, 255) as u8 } else { 255 };
                self.pixels.extend(to_rgb(color));
                self.pixels.push(alpha);
            }
            self.at = end;
            return (end == height).then(|| Picture { width: w, height: h, pixels: std::mem::take(&mut self.pixels) });
        }
        if self.step == 0 {
            if self.at == 0 {
                self.channels.push(Vec::with_capacity(width * height));
            }
            let end = (self.at + rows).min(height);
            (self.at..end).for_each(|y| self.copy_row(planes, y, width));
            self.at = end;
            if end == height {
                (self.step, self.at, self.along) = (1, 0, Along::Rows);
                self.past_last_step();
            }
            return None;
        }
        let (w, h) = layout.size(self.step);
        let size = (w as usize, h as usize);
        let (all, length) = if self.along == Along::Rows { (size.1, size.0) } else { (size.0, size.1) };
        let end = (self.at + (STEP_SAMPLES / length).max(1)).min(all);
        lines(&mut self.channels[self.channel], width, size, self.along, self.at..end, join);
        self.at = end;
        if end == all {
            self.at = 0;
            if self.along == Along::Rows {
                self.along = Along::Columns;
            } else {
                (self.along, self.step) = (Along::Rows, self.step + 1);
                self.past_last_step();
            }
        }
        None
    }

    fn past_last_step(&mut self) {
        if self.step > self.resolution {
            (self.channel, self.step) = (self.channel + 1, 0);
        }
    }

    /// Copies a row of coefficients, each amid the values that it can still have.
    fn copy_row(&mut self, planes: &Planes, y: usize, width: usize) {
        let layout = planes.layout;
        let channel = self.channel;
        let stride = layout.width as usize;
        let Some(row) = planes.values[channel].get(y * stride..y * stride + width) else {
            // Nothing of the channel has come; nothing will of one without planes, which is all 0. Alpha is full until it does.
            let (w, h) = layout.size(0);
            let waits = channel == 3 && planes.counts[3] > 0;
            let full = |x: usize| if waits && x < w as usize && y < h as usize { 127 } else { 0 };
            self.channels[channel].extend((0..width).map(full));
            return;
        };
        let half: Vec<i16> = (0..=layout.depth as usize)
            .map(|r| planes.known[channel][r].map_or(0, |plane| if plane == 0 { 0 } else { 1 << (plane - 1) }))
            .collect();
        let row_of = (0..layout.depth).find(|&r| y < layout.size(r).1 as usize).unwrap_or(layout.depth);
        let mut column_of = 0;
        for (x, &v) in row.iter().enumerate() {
            while column_of < layout.depth && x >= layout.size(column_of).0 as usize {
                column_of += 1;
            }
            self.channels[channel].push(v + v.signum() * half[row_of.max(column_of) as usize]);
        }
    }
}
