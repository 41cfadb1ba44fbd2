//! PNG, JPEG and WebP: encoded codes of 8 or 16 bits.

use std::borrow::Cow;
use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::jpeg::{MAX_SCANS, outline, with_standard_tables};
use super::{ImageFile, Pixels, Rgba8, broken, check_size, ensure_memory};

/// Of a decoded pixel in linear light, which a photograph keeps beside its codes.
const LINEAR_BYTES: u64 = 12;
/// Of the coefficients that a JPEG decoder keeps a pixel, at most.
const COEFFICIENT_BYTES: u64 = 8;

pub(super) fn read_png(bytes: &[u8]) -> Result<ImageFile, String> {
    let mut image = read_codes(bytes, ImageFormat::Png)?;
    if !image.warnings.iter().any(|w| w == PROFILE) && has_gamma_without_srgb(bytes) {
        let warning = "its gamma chunk is ignored: it is read as sRGB".to_owned();
        image.warnings.insert(0, warning);
    }
    Ok(image)
}

pub(super) fn read_jpeg(bytes: &[u8]) -> Result<ImageFile, String> {
    read_codes(&checked_jpeg(bytes)?, ImageFormat::Jpeg)
}

/// Refuses what a decoder would take long for or pass over in silence; brings the tables that a picture may leave out.
fn checked_jpeg(bytes: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    let outline = outline(bytes, 0);
    if outline.scans > MAX_SCANS {
        return Err(format!(
            "it has {} scans; expected at most {MAX_SCANS}; save it again",
            outline.scans
        ));
    }
    if outline.end.is_none() {
        return Err(broken("it ends before its end-of-image marker"));
    }
    Ok(match outline.has_tables {
        true => Cow::Borrowed(bytes),
        false => Cow::Owned(with_standard_tables(bytes)),
    })
}

const PROFILE: &str = "its colour profile is ignored: it is read as sRGB";

fn read_codes(bytes: &[u8], format: ImageFormat) -> Result<ImageFile, String> {
    let (mut decoder, (width, height)) = open(bytes, format)?;
    let codes = match decoder.color_type().bytes_per_pixel() / decoder.color_type().channel_count()
    {
        1 => 3,
        _ => 6,
    };
    ensure_decoding(&decoder, (width, height), format, codes + LINEAR_BYTES)?;
    let mut warnings = Vec::new();
    if matches!(decoder.icc_profile(), Ok(Some(_))) {
        warnings.push(PROFILE.to_owned());
    }
    if !matches!(
        decoder.orientation(),
        Ok(Orientation::NoTransforms) | Err(_)
    ) {
        warnings.push("its orientation tag is ignored: the pixels are used as stored".to_owned());
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    if has_transparency(&decoded) {
        warnings.push("its alpha channel is ignored".to_owned());
    }
    let pixels = match decoded {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            Pixels::Srgb16(in_threes(decoded.into_rgb16().into_raw()))
        }
        _ => Pixels::Srgb8(in_threes(decoded.into_rgb8().into_raw())),
    };
    Ok(ImageFile {
        width,
        height,
        pixels,
        warnings,
    })
}

pub(super) fn read_rgba8(bytes: &[u8]) -> Result<Rgba8, String> {
    let format = image::guess_format(bytes).ok();
    let format = format
        .filter(|f| matches!(f, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP))
        .ok_or("its format is not known; expected PNG, JPEG or WebP; convert the image")?;
    let bytes = match format {
        ImageFormat::Jpeg => checked_jpeg(bytes)?,
        _ => Cow::Borrowed(bytes),
    };
    let (decoder, size) = open(&bytes, format)?;
    ensure_decoding(&decoder, size, format, 4)?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    let codes = decoded.into_rgba8().into_raw();
    Ok(Rgba8 {
        width: size.0,
        height: size.1,
        pixels: bytemuck::allocation::try_cast_vec(codes)
            .unwrap_or_else(|(_, codes)| codes.as_chunks().0.to_vec()),
    })
}

fn open(bytes: &[u8], format: ImageFormat) -> Result<(impl ImageDecoder, (u32, u32)), String> {
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size = check_size(width.into(), height.into())?;
    Ok((decoder, size))
}

/// `kept`: bytes a pixel of what becomes of it.
fn ensure_decoding(
    decoder: &impl ImageDecoder,
    size: (u32, u32),
    format: ImageFormat,
    kept: u64,
) -> Result<(), String> {
    let decoded = u64::from(decoder.color_type().bytes_per_pixel());
    let inside = match format {
        ImageFormat::Jpeg => COEFFICIENT_BYTES,
        ImageFormat::WebP => decoded,
        _ => 0,
    };
    ensure_memory(size, decoded + inside + kept)
}

/// Without a copy where the capacity allows.
pub(super) fn in_threes<T: bytemuck::Pod>(samples: Vec<T>) -> Vec<[T; 3]> {
    bytemuck::allocation::try_cast_vec(samples)
        .unwrap_or_else(|(_, samples)| samples.as_chunks().0.to_vec())
}

fn has_transparency(image: &DynamicImage) -> bool {
    match image {
        DynamicImage::ImageLumaA8(image) => image.pixels().any(|p| p.0[1] != u8::MAX),
        DynamicImage::ImageRgba8(image) => image.pixels().any(|p| p.0[3] != u8::MAX),
        DynamicImage::ImageLumaA16(image) => image.pixels().any(|p| p.0[1] != u16::MAX),
        DynamicImage::ImageRgba16(image) => image.pixels().any(|p| p.0[3] != u16::MAX),
        _ => false,
    }
}

/// A gAMA chunk beside an sRGB chunk is only the fallback that the PNG standard asks for.
fn has_gamma_without_srgb(bytes: &[u8]) -> bool {
    let (mut gamma, mut srgb) = (false, false);
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((header, tail)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, name @ ..] = header;
        match name {
            b"gAMA" => gamma = true,
            b"sRGB" => srgb = true,
            b"IDAT" => break,
            _ => {}
        }
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        rest = tail.get(length.saturating_add(4)..).unwrap_or_default();
    }
    gamma && !srgb
}
