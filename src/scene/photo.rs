//! `[photo]`: the camera image and the exposure that ties the scene to it.

use std::path::Path;

use super::error::Result;
use super::reader::{Choice, Node, Table};
use super::srgb::{decode8, decode16};
use super::{Backdrop, EncodedPhoto, Exposure, Photo};
use crate::decode::{ImageFile, Pixels, decode_image, read_image};
use crate::refusal::Refusal;

const KEYS: &[&str] = &["image", "exposure_ev", "backdrop", "backdrop_distance_m"];

pub(super) fn read_photo(
    root: &Table,
    given: Option<Photo>,
    warnings: &mut Vec<String>,
) -> Result<(Option<Photo>, Exposure)> {
    let Some(table) = root.table("photo", "[photo]", KEYS)? else {
        return Ok((given, Exposure::Ev(0.0)));
    };
    let photo = match given {
        Some(photo) => {
            table.optional("image", Node::note_file)?;
            Some(photo)
        }
        None => table.optional("image", |node| read_photo_image(node, warnings))?,
    };
    let exposure = table.optional("exposure_ev", |node| read_exposure(node, photo.is_some()))?;
    Ok((photo, exposure.unwrap_or(Exposure::Ev(0.0))))
}

/// What virtual objects show of what is not modelled.
pub(super) fn read_backdrop(root: &Table) -> Result<Backdrop> {
    let Some(table) = root.table("photo", "[photo]", KEYS)? else {
        return Ok(Backdrop::Photograph(None));
    };
    let distance_m = table.optional("backdrop_distance_m", Node::positive_or_infinite)?;
    let choice = table.optional("backdrop", |node| node.choice::<BackdropChoice>())?;
    Ok(match choice.unwrap_or(BackdropChoice::Photograph) {
        BackdropChoice::Environment => Backdrop::Environment,
        BackdropChoice::Photograph => Backdrop::Photograph(distance_m),
    })
}

#[derive(Clone, Copy, PartialEq)]
enum BackdropChoice {
    Environment,
    Photograph,
}

impl Choice for BackdropChoice {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("photograph", Self::Photograph),
        ("environment", Self::Environment),
    ];
}

fn read_exposure(node: &Node, has_photo: bool) -> Result<Exposure> {
    if !node.is_string() {
        let expected = "a number from -64 to 64, or \"auto\"";
        return Ok(Exposure::Ev(node.number(expected, |ev| ev.abs() <= 64.0)?));
    }
    if node.string()? != "auto" {
        return Err(node.impossible("a number, or \"auto\""));
    }
    if !has_photo {
        return Err(node.error(
            "`exposure_ev` is \"auto\" without a photograph",
            "`image` beside it",
            "add the photograph or give a number",
        ));
    }
    Ok(Exposure::Auto)
}

fn read_photo_image(node: &Node, warnings: &mut Vec<String>) -> Result<Photo> {
    let path = node.existing_file()?;
    let (photo, notes) = Photo::read(&path).map_err(|problem| node.file_error(&path, problem))?;
    warnings.extend(node.file_warnings(notes));
    Ok(photo)
}

/// Width, height and codes of an image file as the camera stored them, with no colour decoded.
///
/// # Errors
/// Why the file cannot be used, in one line without its path.
pub fn read_codes(path: &Path) -> std::result::Result<(u32, u32, EncodedPhoto), Refusal> {
    let image = read_image(path)?;
    let codes = match image.pixels {
        Pixels::Srgb8(codes) => EncodedPhoto::Srgb8(codes),
        Pixels::Srgb16(codes) => EncodedPhoto::Srgb16(codes),
        Pixels::Linear(_) => EncodedPhoto::Linear,
    };
    Ok((image.width, image.height, codes))
}

impl Photo {
    /// Reads and decodes an image file (PNG, JPEG, OpenEXR, Radiance HDR), with warnings of what in it is ignored.
    ///
    /// # Errors
    /// Why the file cannot be used, in one line without its path.
    pub fn read(path: &Path) -> std::result::Result<(Self, Vec<String>), Refusal> {
        Ok(Self::of(read_image(path)?))
    }

    /// Decodes the bytes of an image file.
    ///
    /// # Errors
    /// Why they cannot be used, in one line.
    pub fn decode(bytes: &[u8]) -> std::result::Result<(Self, Vec<String>), Refusal> {
        Ok(Self::of(decode_image(bytes)?))
    }

    /// sRGB codes, row-major from the top left.
    pub fn from_srgb8(width: u32, height: u32, codes: Vec<[u8; 3]>) -> Self {
        Self {
            width,
            height,
            linear: codes.iter().map(|code| code.map(decode8)).collect(),
            encoded: EncodedPhoto::Srgb8(codes),
        }
    }

    fn of(image: ImageFile) -> (Self, Vec<String>) {
        let (linear, encoded) = match image.pixels {
            Pixels::Srgb8(codes) => {
                let photo = Self::from_srgb8(image.width, image.height, codes);
                return (photo, image.warnings);
            }
            Pixels::Srgb16(codes) => (
                codes.iter().map(|code| code.map(decode16)).collect(),
                EncodedPhoto::Srgb16(codes),
            ),
            Pixels::Linear(linear) => (linear, EncodedPhoto::Linear),
        };
        let photo = Self {
            width: image.width,
            height: image.height,
            linear,
            encoded,
        };
        (photo, image.warnings)
    }
}
