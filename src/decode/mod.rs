//! The one door through which files become pictures: PNG, JPEG, WebP, OpenEXR and Radiance HDR, told apart by content.
//!
//! Before a decoder sees a file its stated size is held against limits and against the memory that there is; what a decoder throws comes
//! back as an error. Errors read "problem; expected ...; how to mend" and leave out the path.

mod channels;
mod codes;
mod exr;
mod file;
mod guard;
mod hdr;
mod jpeg;
mod kind;
mod png;
mod profile;
mod tags;

use std::path::{Path, PathBuf};

pub use channels::ChannelFile;
pub(crate) use file::{
    MAX_PICTURE_BYTES, MAX_POSES_BYTES, MAX_TEXT_BYTES, read_file, read_stream, read_text, text_of,
};
#[cfg(feature = "cli")]
pub(crate) use jpeg::jpegs_of_film;
pub(crate) use jpeg::split_jpegs;
pub(crate) use kind::{FileKind, film_kind, kind_of};
pub use profile::ColourProfile;
pub use tags::Tags;
pub(crate) use tags::{turned, turned_size};

use guard::guarded;

/// Longest side of an image, pixels.
pub(crate) const MAX_SIDE_PX: u32 = 32768;
/// Most pixels of an image.
pub(crate) const MAX_PIXELS: u64 = 1 << 28;

/// What is said of a picture whose alpha nobody wants.
pub(crate) const ALPHA: &str = "its alpha channel is ignored";

/// An image as its file holds it, grey spread to three channels, alpha left out, row-major from the top left.
#[derive(Debug)]
pub(crate) struct ImageFile {
    pub width: u32,
    pub height: u32,
    pub pixels: Pixels,
    /// 0 to 1, where any is not 1; else empty.
    pub alpha: Vec<f32>,
    pub tags: Tags,
    pub warnings: Vec<String>,
}

#[derive(Debug)]
pub(crate) enum Pixels {
    /// sRGB, unless the tags bring a profile.
    Codes8(Vec<[u8; 3]>),
    Codes16(Vec<[u16; 3]>),
    /// Finite.
    Linear(Vec<[f32; 3]>),
}

/// Codes of 8 bits with alpha, row-major from the top left.
pub(crate) struct Rgba8 {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[u8; 4]>,
}

/// The file of a path that may end in `#` and the layer of an OpenEXR file, and that layer.
pub(crate) fn split_layer(path: &Path) -> (PathBuf, Option<&str>) {
    let whole = || (path.to_owned(), None);
    let Some(text) = path.to_str().filter(|_| !path.exists()) else {
        return whole();
    };
    match text.rsplit_once('#') {
        Some((file, layer)) if file.to_ascii_lowercase().ends_with(".exr") => {
            (file.into(), Some(layer))
        }
        _ => whole(),
    }
}

/// Reads an image; of an OpenEXR file the layer after `#`, or else the one that is the picture.
pub(crate) fn read_image(path: &Path) -> Result<ImageFile, String> {
    let (file, layer) = split_layer(path);
    let bytes = read_bytes(&file)?;
    decode_layer(&bytes, layer, false)
}

/// As [`read_image`], with the alpha of OpenEXR files.
pub(crate) fn read_image_with_alpha(path: &Path) -> Result<ImageFile, String> {
    let (file, layer) = split_layer(path);
    let bytes = read_bytes(&file)?;
    decode_layer(&bytes, layer, true)
}

fn read_bytes(file: &Path) -> Result<Vec<u8>, String> {
    read_file(file, MAX_PICTURE_BYTES).map_err(|reason| {
        format!(
            "it cannot be read ({reason}); expected an image file; correct the path or the rights"
        )
    })
}

/// Decodes an image file's bytes.
pub(crate) fn decode_image(bytes: &[u8]) -> Result<ImageFile, String> {
    decode_layer(bytes, None, false)
}

/// What can be decoded of an image file's bytes that are cut off, grey behind: of JPEG and PNG what there is, of other formats nothing.
pub(crate) fn decode_cut_image(bytes: &[u8]) -> Option<ImageFile> {
    match bytes {
        [0xff, 0xd8, ..] => guarded(|| codes::read_cut_jpeg(bytes)).ok()?.ok(),
        [0x89, b'P', b'N', b'G', ..] => guarded(|| codes::read_cut_png(bytes)).ok()?.ok(),
        _ => None,
    }
}

fn decode_layer(bytes: &[u8], layer: Option<&str>, with_alpha: bool) -> Result<ImageFile, String> {
    let image = guarded(|| match bytes {
        [0x89, b'P', b'N', b'G', ..] => codes::read_png(bytes),
        [0xff, 0xd8, ..] => codes::read_jpeg(bytes),
        [b'#', b'?', ..] => hdr::read_hdr(bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => exr::read_picture(bytes, layer, with_alpha),
        _ => Err("its format is not known; expected PNG, JPEG, OpenEXR or Radiance HDR; convert the image".to_owned()),
    })
    .unwrap_or_else(|thrown| Err(broken(thrown)))?;
    if let Pixels::Linear(pixels) = &image.pixels {
        refuse_non_finite(pixels, image.width)?;
    }
    Ok(image)
}

/// Decodes the bytes of a PNG, JPEG or WebP image with its alpha channel.
pub(crate) fn decode_rgba8(bytes: &[u8]) -> Result<Rgba8, String> {
    guarded(|| codes::read_rgba8(bytes)).unwrap_or_else(|thrown| Err(broken(thrown)))
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

/// That an image of this size is within the limits.
pub(crate) fn check_size(width: u64, height: u64) -> Result<(u32, u32), String> {
    let side = u64::from(MAX_SIDE_PX);
    if width == 0 || height == 0 || width > side || height > side || width * height > MAX_PIXELS {
        return Err(format!(
            "it has {width} x {height} pixels; expected 1 to {MAX_SIDE_PX} a side and at most {MAX_PIXELS} in all; resize the image"
        ));
    }
    Ok((width as u32, height as u32))
}

/// That there is memory for decoding an image that takes `bytes_per_px` at most at one time.
pub(crate) fn ensure_memory((width, height): (u32, u32), bytes_per_px: u64) -> Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    let what = format!("decoding its {width} x {height} pixels");
    crate::memory::ensure(pixels * bytes_per_px, &what)
        .map_err(|shortage| format!("{shortage}; expected a smaller image; resize it"))
}

/// Decoders' messages may have several lines.
fn broken(error: impl std::fmt::Display) -> String {
    let error = error.to_string();
    let words: Vec<&str> = error.split_whitespace().collect();
    let error = words.join(" ");
    format!("it cannot be decoded ({error}); expected a whole image; save it again")
}
