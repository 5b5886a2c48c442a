//! Wavelet pictures (C.15): lossless, lossy, with alpha; every part sharpens; any bytes end in an error or a picture.

use pmesh_codec::wavelet::{Picture, PictureDecoder, encode, parts};
use proptest::prelude::*;

/// Smooth ground, an edge, some noise.
fn painted(width: u32, height: u32, alpha: bool) -> Picture {
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
            let noise = (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503)) >> 28;
            let edge = if u + v > 1.0 { 90.0 } else { 0.0 };
            let byte = |f: f32| (f + noise as f32).clamp(0.0, 255.0) as u8;
            pixels.extend([byte(150.0 * u + edge), byte(80.0 + 60.0 * (9.0 * v).sin()), byte(200.0 * v)]);
            pixels.push(if alpha && (u - 0.5).hypot(v - 0.5) > 0.4 { 0 } else { 255 });
        }
    }
    Picture { width, height, pixels }
}

fn decoded(parts: &[Vec<u8>]) -> (Picture, u32) {
    let mut decoder = PictureDecoder::default();
    for part in parts {
        decoder.push(part);
        while decoder.work().expect("it decodes") {}
    }
    let (picture, count) = decoder.picture();
    (Picture::clone(picture), count)
}

/// Root mean square difference of the channels, what is smaller stretched.
fn error(a: &Picture, b: &Picture) -> f64 {
    let sum: f64 = (0..a.height)
        .flat_map(|y| (0..a.width).map(move |x| (x, y)))
        .map(|(x, y)| {
            let i = (y * a.width + x) as usize * 4;
            let j = ((y * b.height / a.height) * b.width + x * b.width / a.width) as usize * 4;
            (0..4).map(|k| (f64::from(a.pixels[i + k]) - f64::from(b.pixels[j + k])).powi(2)).sum::<f64>()
        })
        .sum();
    (sum / a.pixels.len() as f64).sqrt()
}

#[test]
fn all_parts_are_the_image_and_each_is_sharper() {
    for alpha in [false, true] {
        let image = painted(333, 200, alpha);
        let all = encode(&image, None).expect("it encodes");
        assert!(all.len() >= 5, "{} parts", all.len());
        let mut before = f64::INFINITY;
        for count in 1..=all.len() {
            let (picture, versions) = decoded(&all[..count]);
            assert_eq!(versions as usize, count);
            let now = error(&image, &picture);
            assert!(now < before, "{count} of {} parts: {now} after {before}", all.len());
            before = now;
        }
        assert_eq!(decoded(&all).0, image);
        let first = error(&image, &decoded(&all[..1]).0);
        assert!(all[0].len() < 1500 && first < 40.0, "{} bytes: {first}", all[0].len());
    }
}

#[test]
fn a_limit_is_kept_and_more_bytes_are_better() {
    let image = painted(256, 256, true);
    let mut before = f64::INFINITY;
    for limit in [2_000, 5_000, 15_000, 30_000] {
        let all = encode(&image, Some(limit)).expect("it encodes");
        let bytes: usize = all.iter().map(Vec::len).sum();
        // A bit plane of one band goes over it at most.
        assert!(bytes < limit * 3 / 2, "{bytes} for {limit}");
        let now = error(&image, &decoded(&all).0);
        assert!(now < before, "{limit} bytes: {now} after {before}");
        before = now;
    }
}

#[test]
fn large_images_are_believed_from_their_first_part_on() {
    let image = painted(2500, 2000, false);
    let all = encode(&image, Some(20_000)).expect("it encodes");
    assert!(all.len() > 2 && all[0].len() >= 2500 * 2000 / 2048, "{}", all[0].len());
    let mut decoder = PictureDecoder::default();
    for part in &all {
        decoder.push(part);
        while decoder.work().expect("it decodes") {}
    }
    assert_eq!((decoder.picture().0.width, decoder.picture().0.height), (2500, 2000));
}

#[test]
fn parts_may_wait_for_each_other() {
    let image = painted(100, 60, false);
    let all = encode(&image, None).expect("it encodes");
    let mut decoder = PictureDecoder::default();
    all.iter().for_each(|p| decoder.push(p));
    while decoder.work().expect("it decodes") {}
    // One picture is made of all that waits.
    assert_eq!((&**decoder.picture().0, decoder.picture().1), (&image, 1));
}

#[test]
fn flat_images_and_single_pixels_come_back() {
    for (width, height, color) in [
        (1, 1, [3, 4, 5, 6]),
        (1, 300, [9; 4]),
        (4096, 700, [255; 4]),
        (7, 5, [0, 0, 0, 0]),
        (16, 16, [255, 0, 0, 128]),
        (2, 2, [128; 4]),
    ] {
        let pixels = color.repeat((width * height) as usize);
        let image = Picture { width, height, pixels };
        assert_eq!(decoded(&encode(&image, None).expect("it encodes")).0, image);
    }
    for (width, height) in [(0, 4), (5000, 1)] {
        let pixels = vec![0; (width * height * 4) as usize];
        assert!(encode(&Picture { width, height, pixels }, None).is_err());
    }
}

#[test]
fn framing_survives_being_cut() {
    let bytes = [[3u8, 0, 0, 0, 1, 2, 3].as_slice(), &[0; 4], &[9, 0, 0, 0, 1]].concat();
    assert_eq!(parts(&bytes), [&[1u8, 2, 3][..], &[]]);
}

proptest! {
    #[test]
    fn any_small_image_comes_back(width in 1u32..24, height in 1u32..24, kind in 0u8..3, seed in prop::collection::vec(any::<u8>(), 24 * 24 * 4)) {
        let mut pixels = seed[..(width * height * 4) as usize].to_vec();
        for p in pixels.chunks_exact_mut(4) {
            if kind < 2 { p[3] = 255; }
            if kind == 0 { (p[1], p[2]) = (p[0], p[0]); }
        }
        let image = Picture { width, height, pixels };
        prop_assert_eq!(decoded(&encode(&image, None).expect("it encodes")).0, image);
    }

    #[test]
    fn any_bytes_end_in_an_error_or_a_picture(head in prop::collection::vec(any::<u8>(), 0..12), noise in prop::collection::vec(any::<u8>(), 0..400), cut in 0usize..2000) {
        let mut decoder = PictureDecoder::default();
        let good = encode(&painted(40, 30, true), None).expect("it encodes");
        // Noise from the start, and noise after a good beginning.
        for parts in [vec![[head, noise.clone()].concat()], vec![good[0][..cut.min(good[0].len())].to_vec(), noise]] {
            parts.iter().for_each(|p| decoder.push(p));
            let mut steps = 0u32;
            while decoder.work().is_ok_and(|more| more) {
                steps += 1;
                prop_assert!(steps < 100_000);
            }
            prop_assert!(decoder.picture().0.pixels.len() < 1 << 24);
            decoder = PictureDecoder::default();
        }
    }
}
