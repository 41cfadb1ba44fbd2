//! Radiance HDR.

use std::io::Cursor;

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};

use super::codes::in_threes;
use super::{ImageFile, Pixels, Tags, broken, check_size, ensure_memory};

/// Of a pixel: decoded, and once more while it is copied.
const BYTES_PER_PX: u64 = 24;

pub(super) fn read_hdr(bytes: &[u8]) -> Result<ImageFile, String> {
    // Files signed "#?RGBE" are common and differ in nothing else; the strict decoder refuses them.
    let decoder = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = check_size(width.into(), height.into())?;
    ensure_memory((width, height), BYTES_PER_PX)?;
    let mut warnings = Vec::new();
    if decoder
        .metadata()
        .exposure
        .is_some_and(|exposure| exposure != 1.0)
    {
        warnings.push("its EXPOSURE line is ignored: the pixels are used as stored".to_owned());
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok(ImageFile {
        width,
        height,
        pixels: Pixels::Linear(in_threes(decoded.into_rgb32f().into_raw())),
        alpha: Vec::new(),
        tags: Tags::default(),
        warnings,
    })
}
