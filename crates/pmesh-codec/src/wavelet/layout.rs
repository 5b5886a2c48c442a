//! Where coefficients stand, and in which order their bit planes are sent.
//!
//! A channel of w × h is split into its even samples (the coarser picture, ⌈w/2⌉ × ⌈h/2⌉) and three bands of details, again and
//! again, and stored like that: the coarsest picture in the top left corner, the details of each step around it.

use super::SIDE_LIMIT;

/// Samples of the coarsest picture's longer side, about.
const COARSEST: u32 = 8;
/// Side of a block of coefficients that a single bit can say nothing of.
pub(super) const BLOCK: u32 = 16;

/// Size and channels of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    /// 1 grey, 3 colours, 4 with alpha.
    pub(super) channels: usize,
    /// Steps of the transform.
    pub(super) depth: u32,
}

/// A rectangle of coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Band {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) kind: Kind,
}

/// What a band's coefficients are details of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Coarsest,
    /// Across rows: details from left to right.
    Horizontal,
    Vertical,
    Diagonal,
}

/// A bit plane of one channel's bands of one resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) channel: usize,
    /// 0 is the coarsest picture.
    pub(super) resolution: u32,
    pub(super) plane: u32,
}

impl Layout {
    pub(super) fn new(width: u32, height: u32, channels: usize) -> Option<Self> {
        let fits = |n: u32| (1..=SIDE_LIMIT).contains(&n);
        if !fits(width) || !fits(height) || ![1, 3, 4].contains(&channels) {
            return None;
        }
        let mut depth = 0;
        while width.max(height) >> depth > COARSEST && depth < 8 {
            depth += 1;
        }
        Some(Self { width, height, channels, depth })
    }
    pub(super) fn samples(&self) -> usize {
        self.width as usize * self.height as usize
    }
    /// Size of the picture of a resolution, 0 to `depth`.
    pub(super) fn size(&self, resolution: u32) -> (u32, u32) {
        let steps = self.depth - resolution;
        (self.width.div_ceil(1 << steps), self.height.div_ceil(1 << steps))
    }
    /// The bands that a resolution adds to the one before.
    pub(super) fn bands(&self, resolution: u32) -> Vec<Band> {
        let (w, h) = self.size(resolution);
        if resolution == 0 {
            return vec![Band { x: 0, y: 0, width: w, height: h, kind: Kind::Coarsest }];
        }
        let (x, y) = self.size(resolution - 1);
        vec![
            Band { x, y: 0, width: w - x, height: y, kind: Kind::Horizontal },
            Band { x: 0, y, width: x, height: h - y, kind: Kind::Vertical },
            Band { x, y, width: w - x, height: h - y, kind: Kind::Diagonal },
        ]
    }
    /// All bit planes, in the order in which they are sent: by what a bit of theirs changes in the picture. `planes` says how many
    /// each channel has.
    pub(super) fn segments(&self, planes: &[u32]) -> Vec<Segment> {
        let mut all = Vec::new();
        for (channel, &count) in planes.iter().enumerate() {
            for resolution in 0..=self.depth {
                all.extend((0..count).map(|plane| Segment { channel, resolution, plane }));
            }
        }
        all.sort_by_key(|s| (std::cmp::Reverse(self.weight(s)), s.channel, s.resolution));
        all
    }
    /// Twice the logarithm of what a bit of the plane adds to the root mean square of the picture, about: norms of the 5/3
    /// wavelet's synthesis, and of the colour transform's, that of the differences a little less, as eyes have it.
    fn weight(&self, s: &Segment) -> i32 {
        let steps = (self.depth + 1 - s.resolution.max(1)) as i32;
        let norm = match (s.resolution, steps) {
            (0, n) => 2 * n - 1,
            (_, 1) => 0,
            (_, n) => 2 * n - 3,
        };
        let channel = match s.channel {
            1 => -3,
            2 => -2,
            _ => 0,
        };
        2 * s.plane as i32 + norm + channel
    }
}

/// Blocks of the bands, each cut at its band's edge.
pub(super) fn blocks(bands: &[Band]) -> Vec<Band> {
    let mut out = Vec::new();
    for b in bands {
        for y in (0..b.height).step_by(BLOCK as usize) {
            for x in (0..b.width).step_by(BLOCK as usize) {
                let (width, height) = ((b.width - x).min(BLOCK), (b.height - y).min(BLOCK));
                out.push(Band { x: b.x + x, y: b.y + y, width, height, kind: b.kind });
            }
        }
    }
    out
}
