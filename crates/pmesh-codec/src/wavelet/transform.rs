//! The reversible 5/3 wavelet and the reversible colour transform, both in whole numbers.

/// One step forward along a line: even samples, smoothed, to the front, details behind. Sides are mirrored.
pub(super) fn split(line: &mut [i16], scratch: &mut Vec<i16>) {
    let n = line.len();
    if n < 2 {
        return;
    }
    scratch.clear();
    scratch.extend_from_slice(line);
    let half = n.div_ceil(2);
    let even = |i: usize| i32::from(scratch[if 2 * i < n { 2 * i } else { 2 * (i - 1) }]);
    for i in 0..n / 2 {
        line[half + i] = (i32::from(scratch[2 * i + 1]) - ((even(i) + even(i + 1)) >> 1)) as i16;
    }
    for i in 0..half {
        let (before, after) = (i32::from(line[half + i.saturating_sub(1)]), i32::from(line[half + i.min(n / 2 - 1)]));
        line[i] = (i32::from(scratch[2 * i]) + ((before + after + 2) >> 2)) as i16;
    }
}

/// The way back.
pub(super) fn join(line: &mut [i16], scratch: &mut Vec<i16>) {
    let n = line.len();
    if n < 2 {
        return;
    }
    scratch.clear();
    scratch.extend_from_slice(line);
    let half = n.div_ceil(2);
    for i in 0..half {
        let (before, after) = (i32::from(scratch[half + i.saturating_sub(1)]), i32::from(scratch[half + i.min(n / 2 - 1)]));
        line[2 * i] = (i32::from(scratch[i]) - ((before + after + 2) >> 2)) as i16;
    }
    for i in 0..n / 2 {
        let (before, after) = (i32::from(line[2 * i]), i32::from(line[if 2 * i + 2 < n { 2 * i + 2 } else { 2 * i }]));
        line[2 * i + 1] = (i32::from(scratch[half + i]) + ((before + after) >> 1)) as i16;
    }
}

/// Rows or columns of a step.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Along {
    Rows,
    Columns,
}

/// Applies `step` to lines `lines` of the top left `size` of a picture that is `stride` wide.
pub(super) fn lines(
    samples: &mut [i16],
    stride: usize,
    size: (usize, usize),
    along: Along,
    lines: std::ops::Range<usize>,
    step: fn(&mut [i16], &mut Vec<i16>),
) {
    let (mut scratch, mut column) = (Vec::new(), vec![0; size.1]);
    for at in lines {
        if along == Along::Rows {
            step(&mut samples[at * stride..][..size.0], &mut scratch);
            continue;
        }
        (0..size.1).for_each(|y| column[y] = samples[y * stride + at]);
        step(&mut column, &mut scratch);
        (0..size.1).for_each(|y| samples[y * stride + at] = column[y]);
    }
}

/// Brightness about 0, and two differences of colour (Malvar & Sullivan 2003).
pub(super) fn to_ycocg([r, g, b]: [u8; 3]) -> [i16; 3] {
    let [r, g, b] = [r, g, b].map(i16::from);
    let co = r - b;
    let t = b + (co >> 1);
    let cg = g - t;
    [t + (cg >> 1) - 128, co, cg]
}

/// The way back; what a lossy stream leaves out of range is clamped.
pub(super) fn to_rgb([y, co, cg]: [i16; 3]) -> [u8; 3] {
    let [y, co, cg] = [i32::from(y) + 128, i32::from(co), i32::from(cg)];
    let t = y - (cg >> 1);
    let g = cg + t;
    let b = t - (co >> 1);
    [b + co, g, b].map(|c| c.clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn joining_undoes_splitting(line in prop::collection::vec(-1020i16..=1020, 1..70)) {
            let mut there = line.clone();
            split(&mut there, &mut Vec::new());
            join(&mut there, &mut Vec::new());
            prop_assert_eq!(there, line);
        }
        #[test]
        fn colours_come_back(color: [u8; 3]) {
            prop_assert_eq!(to_rgb(to_ycocg(color)), color);
        }
    }

    #[test]
    fn a_straight_line_has_no_details() {
        let mut line: Vec<i16> = (0..32).map(|i| 4 * i).collect();
        split(&mut line, &mut Vec::new());
        assert!(line[16..31].iter().all(|&d| d == 0), "{line:?}");
    }
}
