//! Reading photographs and environment maps from files: PNG, JPEG, OpenEXR, Radiance HDR, told apart by content.

use std::io::Cursor;
use std::path::Path;

use exr::prelude as exr;
use exr::{ReadChannels as _, ReadLayers as _};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

/// Longest side of an image, pixels.
pub(super) const MAX_SIDE_PX: u32 = 32768;
/// Most pixels of an image.
pub(super) const MAX_PIXELS: u64 = 1 << 28;

/// An image as its file holds it, grey spread to three channels, alpha left out, row-major from the top left.
#[derive(Debug)]
pub(super) struct ImageFile {
    pub width: u32,
    pub height: u32,
    pub pixels: Pixels,
    pub warnings: Vec<String>,
}

#[derive(Debug)]
pub(super) enum Pixels {
    Srgb8(Vec<[u8; 3]>),
    Srgb16(Vec<[u16; 3]>),
    /// Finite.
    Linear(Vec<[f32; 3]>),
}

/// Reads an image. An error reads "problem; expected ...; how to mend" and leaves out the path.
pub(super) fn read_image(path: &Path) -> Result<ImageFile, String> {
    let bytes = crate::files::read(path).map_err(|error| {
        format!(
            "it cannot be read ({error}); expected an image file; correct the path or the rights"
        )
    })?;
    decode_image(&bytes)
}

/// Decodes an image file's bytes. An error reads as one of [`read_image`].
pub(super) fn decode_image(bytes: &[u8]) -> Result<ImageFile, String> {
    let image = match bytes {
        [0x89, b'P', b'N', b'G', ..] => read_codes(bytes, ImageFormat::Png),
        [0xff, 0xd8, ..] => read_codes(bytes, ImageFormat::Jpeg),
        [b'#', b'?', ..] => read_hdr(bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => read_exr(bytes),
        _ => Err("its format is not known; expected PNG, JPEG, OpenEXR or Radiance HDR; convert the image".to_owned()),
    }?;
    if let Pixels::Linear(pixels) = &image.pixels {
        refuse_non_finite(pixels, image.width)?;
    }
    Ok(image)
}

fn refuse_non_finite(pixels: &[[f32; 3]], width: u32) -> Result<(), String> {
    let bad = pixels
        .iter()
        .position(|pixel| pixel.iter().any(|channel| !channel.is_finite()));
    match bad {
        None => Ok(()),
        Some(index) => Err(format!(
            "pixel ({}, {}) is NaN or infinite; expected finite values; clamp or repair the image",
            index % width as usize,
            index / width as usize
        )),
    }
}

fn check_size(width: u64, height: u64) -> Result<(u32, u32), String> {
    let side = u64::from(MAX_SIDE_PX);
    if width == 0 || height == 0 || width > side || height > side || width * height > MAX_PIXELS {
        return Err(format!(
            "it has {width} x {height} pixels; expected 1 to {MAX_SIDE_PX} a side and at most {MAX_PIXELS} in all; resize the image"
        ));
    }
    Ok((width as u32, height as u32))
}

fn broken(error: impl std::fmt::Display) -> String {
    format!("it cannot be decoded ({error}); expected a whole image; save it again")
}

fn read_codes(bytes: &[u8], format: ImageFormat) -> Result<ImageFile, String> {
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = check_size(width.into(), height.into())?;
    let mut warnings = Vec::new();
    let has_profile = matches!(decoder.icc_profile(), Ok(Some(_)));
    if has_profile {
        warnings.push("its colour profile is ignored: it is read as sRGB".to_owned());
    } else if format == ImageFormat::Png && has_gamma_without_srgb(bytes) {
        warnings.push("its gamma chunk is ignored: it is read as sRGB".to_owned());
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
            Pixels::Srgb16(decoded.into_rgb16().pixels().map(|p| p.0).collect())
        }
        _ => Pixels::Srgb8(decoded.into_rgb8().pixels().map(|p| p.0).collect()),
    };
    Ok(ImageFile {
        width,
        height,
        pixels,
        warnings,
    })
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

fn read_hdr(bytes: &[u8]) -> Result<ImageFile, String> {
    // Files signed "#?RGBE" are common and differ in nothing else; the strict decoder refuses them.
    let decoder =
        image::codecs::hdr::HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = check_size(width.into(), height.into())?;
    let mut warnings = Vec::new();
    if decoder
        .metadata()
        .exposure
        .is_some_and(|exposure| exposure != 1.0)
    {
        warnings.push("its EXPOSURE line is ignored: the pixels are used as stored".to_owned());
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    let pixels = decoded.into_rgb32f().pixels().map(|p| p.0).collect();
    Ok(ImageFile {
        width,
        height,
        pixels: Pixels::Linear(pixels),
        warnings,
    })
}

fn read_exr(bytes: &[u8]) -> Result<ImageFile, String> {
    let meta =
        ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        check_size(header.layer_size.x() as u64, header.layer_size.y() as u64)?;
    }
    let image = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;

    let find = |layer: &exr::Layer<exr::AnyChannels<exr::FlatSamples>>, name: &str| {
        let channels = &layer.channel_data.list;
        channels.iter().position(|channel| channel.name.eq(name))
    };
    let picked = image.layer_data.iter().find_map(|layer| {
        let rgb = [find(layer, "R")?, find(layer, "G")?, find(layer, "B")?];
        Some((layer, rgb))
    });
    let picked = picked.or_else(|| {
        image.layer_data.iter().find_map(|layer| {
            // With RY and BY beside it, Y alone would lose the colour.
            let grey = find(layer, "Y").filter(|_| find(layer, "RY").is_none())?;
            Some((layer, [grey; 3]))
        })
    });
    let Some((layer, rgb)) = picked else {
        return Err(
            "it has no channels R, G, B or Y; expected an RGB or grey image; convert it".to_owned(),
        );
    };
    let window = image.attributes.display_window;
    if layer.attributes.layer_position != window.position || layer.size != window.size {
        return Err(
            "its data window is not its display window; expected a whole image; crop or pad it"
                .to_owned(),
        );
    }
    let mut warnings = Vec::new();
    if image
        .attributes
        .chromaticities
        .is_some_and(|c| !is_rec709(&c))
    {
        warnings.push("its chromaticities are ignored: it is read as linear Rec.709".to_owned());
    }
    if find(layer, "A").is_some() {
        warnings.push("its alpha channel is ignored".to_owned());
    }
    let (width, height) = check_size(layer.size.x() as u64, layer.size.y() as u64)?;
    let mut pixels = vec![[0.0; 3]; layer.size.area()];
    for (channel, index) in rgb.into_iter().enumerate() {
        let samples = &layer.channel_data.list[index].sample_data;
        for (pixel, sample) in pixels.iter_mut().zip(samples.values_as_f32()) {
            pixel[channel] = sample;
        }
    }
    Ok(ImageFile {
        width,
        height,
        pixels: Pixels::Linear(pixels),
        warnings,
    })
}

fn is_rec709(c: &::exr::meta::attribute::Chromaticities) -> bool {
    let given = [
        c.red.0, c.red.1, c.green.0, c.green.1, c.blue.0, c.blue.1, c.white.0, c.white.1,
    ];
    let rec709 = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
    given
        .iter()
        .zip(rec709)
        .all(|(given, rec709)| (given - rec709).abs() < 1e-3)
}
