//! PNG, JPEG and WebP: encoded codes of 8 or 16 bits.

use std::borrow::Cow;
use std::io::Cursor;
use std::sync::Arc;

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult};

use super::jpeg::{MAX_SCANS, jpegs_of_film, outline, with_standard_tables};
use super::png::{ColourChunks, colour_chunks};
use super::profile::{ColourProfile, Unused};
use super::{ALPHA, ImageFile, Pixels, Rgba8, Tags, broken, check_size, ensure_memory};

/// Of a decoded pixel in linear light, which a photograph keeps beside its codes.
const LINEAR_BYTES: u64 = 12;
/// Of the coefficients that a JPEG decoder keeps a pixel, at most.
const COEFFICIENT_BYTES: u64 = 8;
/// What stands for lost codes, in each of their bytes.
const GREY: u8 = 128;

pub(super) fn read_png(bytes: &[u8]) -> Result<ImageFile, String> {
    read_codes(bytes, ImageFormat::Png, &colour_chunks(bytes), false)
}

pub(super) fn read_jpeg(bytes: &[u8]) -> Result<ImageFile, String> {
    let whole = checked_jpeg(bytes)?;
    let mut image = read_codes(&whole, ImageFormat::Jpeg, &ColourChunks::default(), false)?;
    if let Some(film) = jpegs_of_film(bytes) {
        image.warnings.push(format!(
            "it is a film of {} JPEG pictures: the first is read",
            film.len()
        ));
    }
    Ok(image)
}

/// What can be decoded of a PNG file that is cut off; the rest is grey.
pub(super) fn read_cut_png(bytes: &[u8]) -> Result<ImageFile, String> {
    read_codes(bytes, ImageFormat::Png, &colour_chunks(bytes), true)
}

/// A PNG decoder that keeps the rows before a fault.
struct Cut<D>(D);

impl<D: ImageDecoder> ImageDecoder for Cut<D> {
    fn dimensions(&self) -> (u32, u32) {
        self.0.dimensions()
    }

    fn color_type(&self) -> ColorType {
        self.0.color_type()
    }

    fn read_image(self, codes: &mut [u8]) -> ImageResult<()> {
        let colour = self.0.color_type();
        let is_wide = colour.bytes_per_pixel() == 2 * colour.channel_count();
        codes.fill(GREY);
        if self.0.read_image(codes).is_err() && is_wide {
            // The decoder turns the file's order of bytes to the machine's at its end.
            for code in codes.as_chunks_mut::<2>().0 {
                *code = u16::from_be_bytes(*code).to_ne_bytes();
            }
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, codes: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(codes)
    }
}

/// What can be decoded of a JPEG picture that is cut off; the rest is grey.
pub(super) fn read_cut_jpeg(bytes: &[u8]) -> Result<ImageFile, String> {
    let whole = [bytes, &[0xff, 0xd9]].concat();
    read_jpeg(&whole)
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

const PROFILE: &str = "its colour profile is not understood: it is read as sRGB";

const GAMMA: &str = "its gamma and primaries are not understood: it is read as sRGB";

const HDR: &str = "its codes are of PQ or HLG (HDR), which is not understood: it is read as sRGB, of which neither light nor colours are right; convert it to OpenEXR";

/// cICP wins over an ICC profile, and that over gAMA and cHRM; of what `is_cut` off, the rows before are kept.
fn read_codes(
    bytes: &[u8],
    format: ImageFormat,
    chunks: &ColourChunks,
    is_cut: bool,
) -> Result<ImageFile, String> {
    let (mut decoder, (width, height)) = open(bytes, format)?;
    let codes = match decoder.color_type().bytes_per_pixel() / decoder.color_type().channel_count()
    {
        1 => 3,
        _ => 6,
    };
    ensure_decoding(&decoder, (width, height), format, codes + LINEAR_BYTES)?;
    let mut warnings = Vec::new();
    let mut tags = Tags::default();
    let profile = match (chunks.cicp, decoder.icc_profile()) {
        (Some(cicp), _) => Some(ColourProfile::of_cicp(cicp)),
        (None, Ok(Some(icc))) => Some(ColourProfile::of_icc(icc)),
        (None, _) if chunks.has_profile => Some(Err(Unused::NotUnderstood)),
        (None, _) => chunks.other.map(ColourProfile::of_gamma),
    };
    match profile {
        Some(Ok(profile)) => tags.profile = Some(Arc::new(profile)),
        Some(Err(Unused::NotUnderstood)) => {
            let warning = if chunks.other.is_some() {
                GAMMA
            } else {
                PROFILE
            };
            warnings.push(warning.to_owned());
        }
        Some(Err(Unused::IsHdr)) => warnings.push(HDR.to_owned()),
        Some(Err(Unused::IsSrgb)) | None => {}
    }
    tags.orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let decoded = match is_cut {
        true => DynamicImage::from_decoder(Cut(decoder)),
        false => DynamicImage::from_decoder(decoder),
    }
    .map_err(broken)?;
    let alpha = alpha_of(&decoded);
    if !alpha.is_empty() {
        warnings.push(ALPHA.to_owned());
    }
    let pixels = match decoded {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            Pixels::Codes16(in_threes(decoded.into_rgb16().into_raw()))
        }
        _ => Pixels::Codes8(in_threes(decoded.into_rgb8().into_raw())),
    };
    Ok(ImageFile {
        width,
        height,
        pixels,
        alpha,
        tags,
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

/// 0 to 1; empty where every pixel is opaque.
fn alpha_of(image: &DynamicImage) -> Vec<f32> {
    let eight = |code: u8| f32::from(code) / 255.0;
    let sixteen = |code: u16| f32::from(code) / 65535.0;
    let alpha: Vec<f32> = match image {
        DynamicImage::ImageLumaA8(image) => image.pixels().map(|p| eight(p.0[1])).collect(),
        DynamicImage::ImageRgba8(image) => image.pixels().map(|p| eight(p.0[3])).collect(),
        DynamicImage::ImageLumaA16(image) => image.pixels().map(|p| sixteen(p.0[1])).collect(),
        DynamicImage::ImageRgba16(image) => image.pixels().map(|p| sixteen(p.0[3])).collect(),
        _ => return Vec::new(),
    };
    match alpha.iter().any(|a| *a != 1.0) {
        true => alpha,
        false => Vec::new(),
    }
}
