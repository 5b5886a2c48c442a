//! Images in and out: PNG and JPEG to the parts of a wavelet picture (C.15), pictures to PNG.

use crate::BuildError;
use image::imageops::{FilterType, resize};
use image::{ImageEncoder, RgbaImage};
use pmesh_codec::Texture;
use pmesh_codec::wavelet::{self, Picture, PictureDecoder};

/// What becomes of a base-colour image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageOption {
    /// A wavelet picture: a PNG bit for bit, a JPEG in as many bytes as it has.
    #[default]
    Wavelet,
    /// A wavelet picture, bit for bit.
    Lossless,
    /// A wavelet picture of so many bytes, about.
    Bytes(usize),
    /// The file as it is: it shows once it is whole.
    Keep,
}

fn bad(what: impl std::fmt::Display) -> BuildError {
    BuildError::Option(format!("the base-colour image: {what}"))
}

/// Decodes a PNG or JPEG file. Errors: what is none, or more than 16,384 pixels a side.
pub fn decode(texture: &Texture) -> Result<RgbaImage, BuildError> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(&texture.bytes)).with_guessed_format().map_err(bad)?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(16_384), Some(16_384));
    reader.limits(limits);
    Ok(reader.decode().map_err(bad)?.to_rgba8())
}

/// The texture as `option` wants it; a warning if pixels were lost. O(pixels).
pub fn convert(texture: Texture, option: ImageOption) -> Result<(Texture, Option<String>), BuildError> {
    if option == ImageOption::Keep || texture.mime == wavelet::MIME && option == ImageOption::Wavelet {
        return Ok((texture, None));
    }
    let limit = match option {
        ImageOption::Bytes(n) => Some(n),
        ImageOption::Wavelet if texture.mime == "image/jpeg" => Some(texture.bytes.len()),
        _ => None,
    };
    let mut warning = None;
    let picture = if texture.mime == wavelet::MIME {
        picture_of(&texture)?
    } else {
        let mut image = decode(&texture)?;
        let (w, h) = image.dimensions();
        if w.max(h) > wavelet::SIDE_LIMIT {
            let to = |n: u32| (u64::from(n) * u64::from(wavelet::SIDE_LIMIT) / u64::from(w.max(h))).max(1) as u32;
            image = resize(&image, to(w), to(h), FilterType::Triangle);
            warning =
                Some(format!("the base-colour image of {w} × {h} pixels is scaled to {} × {}", image.width(), image.height()));
        }
        Picture { width: image.width(), height: image.height(), pixels: image.into_raw() }
    };
    let parts = wavelet::encode(&picture, limit).map_err(bad)?;
    let bytes = parts.iter().flat_map(|p| wavelet::framed(p)).collect();
    Ok((Texture { mime: wavelet::MIME.into(), bytes }, warning))
}

/// The picture that parts make.
pub fn picture_of(texture: &Texture) -> Result<Picture, BuildError> {
    let mut decoder = PictureDecoder::default();
    wavelet::parts(&texture.bytes).into_iter().for_each(|p| decoder.push(p));
    while decoder.work().map_err(bad)? {}
    Ok(Picture::clone(decoder.picture().0))
}

/// The image as a file: its ending, and its bytes. A wavelet picture becomes a PNG.
pub fn to_file(texture: &Texture) -> Result<(&'static str, Vec<u8>), BuildError> {
    match texture.mime.as_str() {
        "image/jpeg" => Ok(("jpg", texture.bytes.clone())),
        wavelet::MIME => {
            let Picture { width, height, pixels } = picture_of(texture)?;
            let mut bytes = Vec::new();
            let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
            encoder.write_image(&pixels, width, height, image::ExtendedColorType::Rgba8).map_err(bad)?;
            Ok(("png", bytes))
        }
        _ => Ok(("png", texture.bytes.clone())),
    }
}
