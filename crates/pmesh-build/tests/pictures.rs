//! Base-colour images on their way through streams (C.15): exact where asked for, in their bytes where not, in every container.

use pmesh_build::picture::{ImageOption, convert, picture_of, to_file};
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::sample::sample;
use pmesh_build::simplify::{ForestOptions, PatchOptions, collapse_forests, remove_patches};
use pmesh_codec::pmesh::EncodeOptions;
use pmesh_codec::{Arrival, Receiver, Texture, patch, split, wavelet};

/// A PNG of 90 × 70 pixels with all kinds of alpha.
fn png() -> (image::RgbaImage, Texture) {
    let image =
        image::RgbaImage::from_fn(90, 70, |x, y| image::Rgba([(x * 2) as u8, (y * 3) as u8, (x ^ y) as u8, (x * y % 256) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("memory");
    (image, Texture { mime: "image/png".into(), bytes: bytes.into_inner() })
}

#[test]
fn a_png_comes_back_bit_for_bit_and_a_jpeg_keeps_its_size() {
    let (image, texture) = png();
    let (converted, warning) = convert(texture.clone(), ImageOption::default()).expect("it converts");
    assert_eq!((converted.mime.as_str(), warning), (wavelet::MIME, None));
    let (ending, file) = to_file(&converted).expect("it decodes");
    assert_eq!((ending, image::load_from_memory(&file).expect("a PNG").to_rgba8()), ("png", image));
    assert_eq!(convert(texture.clone(), ImageOption::Keep).expect("it is kept").0, texture);

    let jpeg = sample("globe").and_then(|m| m.texture).expect("an image");
    let size = jpeg.bytes.len();
    let original = image::load_from_memory(&jpeg.bytes).expect("a JPEG").to_rgba8();
    let (lossy, _) = convert(jpeg.clone(), ImageOption::default()).expect("it converts");
    assert!((size * 9 / 10..size * 12 / 10).contains(&lossy.bytes.len()), "{} for {size}", lossy.bytes.len());
    let decibels = |t: &Texture| {
        let picture = picture_of(t).expect("it decodes");
        let squares: f64 =
            picture.pixels.iter().zip(original.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
        10.0 * (255.0 * 255.0 * picture.pixels.len() as f64 / squares.max(1e-9)).log10()
    };
    let (at_size, small) = (decibels(&lossy), convert(jpeg.clone(), ImageOption::Bytes(5_000)).expect("it converts").0);
    println!("{at_size:.1} dB in {} bytes, {:.1} dB in {}", lossy.bytes.len(), decibels(&small), small.bytes.len());
    assert!(at_size > 36.0 && decibels(&small) > 22.0);
    let (exact, _) = convert(jpeg, ImageOption::Lossless).expect("it converts");
    assert_eq!(picture_of(&exact).expect("it decodes").pixels, *original.as_raw());
}

#[test]
fn what_is_no_image_is_refused_and_what_is_too_large_scaled() {
    let broken = Texture { mime: "image/png".into(), bytes: vec![1, 2, 3] };
    assert!(convert(broken, ImageOption::default()).is_err());
    let wide = image::RgbImage::from_pixel(5000, 3, image::Rgb([9, 8, 7]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    wide.write_to(&mut bytes, image::ImageFormat::Png).expect("memory");
    let (scaled, warning) =
        convert(Texture { mime: "image/png".into(), bytes: bytes.into_inner() }, ImageOption::default()).expect("it converts");
    assert_eq!(picture_of(&scaled).ok().map(|p| (p.width, p.height)), Some((4096, 2)));
    assert!(warning.is_some_and(|w| w.contains("4096")));
}

#[test]
fn parts_come_between_the_levels_of_every_container() {
    let model = sample("globe").expect("it is built in");
    let (texture, _) = convert(model.texture.clone().expect("an image"), ImageOption::default()).expect("it converts");
    let whole = picture_of(&texture).expect("it decodes");
    let mut files = vec![Vec::new(); 3];
    let mut stream = build(&model, &BuildOptions::default(), |_| ()).expect("it builds");
    stream.texture = Some(texture.clone());
    pmesh_codec::pmesh::encode(&stream, EncodeOptions { position_bits: Some(12) }, &mut files[0]).expect("it encodes");
    let mut patches = remove_patches(&model.mesh, PatchOptions::default(), |_| ());
    patches.texture = Some(texture.clone());
    patch::encode(&patches, None, &mut files[1]).expect("it encodes");
    let mut forests = collapse_forests(&model.mesh, ForestOptions::default(), |_| ());
    forests.texture = Some(texture.clone());
    split::encode(&forests, None, &mut files[2]).expect("it encodes");
    for (i, bytes) in files.iter().enumerate() {
        let mut receiver = Receiver::default();
        let (mut levels, mut pictures, mut parts) = (0, Vec::new(), Vec::new());
        for piece in bytes.chunks(1000) {
            receiver.push(piece).expect("it decodes");
            while let Some(arrival) = receiver.poll() {
                match arrival {
                    Arrival::Level { .. } => levels += 1,
                    Arrival::Picture => pictures.push(levels),
                    Arrival::Texture(part) => parts.extend(part.bytes),
                    _ => {}
                }
            }
        }
        receiver.finish().expect("it is whole");
        // Between the levels, from the first on, and whole before the last.
        assert!(pictures.len() >= 5 && pictures[0] >= 1 && pictures[0] <= 2, "{i}: {pictures:?}");
        assert!(pictures.windows(2).filter(|w| w[0] < w[1]).count() >= 2, "{i}: {pictures:?}");
        assert_eq!(**receiver.picture().0, whole, "{i}");
        assert_eq!(parts, texture.bytes, "{i}: what was sent can be sent on");
    }
}
