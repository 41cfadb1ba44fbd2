//! `[photo]`: the camera image and the exposure that ties the scene to it.

use std::path::{Path, PathBuf};

use super::error::Result;
use super::reader::{Choice, Node, Table};
use super::srgb::{decode8, decode16};
use super::{Backdrop, EncodedPhoto, Exposure, Photo};
use crate::decode::{
    ALPHA, ImageFile, Pixels, Tags, decode_cut_image, decode_image, read_image,
    read_image_with_alpha, turned, turned_size,
};
use crate::refusal::Refusal;
use image::metadata::Orientation;

const KEYS: &[&str] = &[
    "image",
    "exposure_ev",
    "orientation",
    "backdrop",
    "backdrop_distance_m",
];

pub(super) fn read_photo(
    root: &Table,
    given: Option<Photo>,
    warnings: &mut Vec<String>,
) -> Result<(Option<Photo>, PhotoSettings)> {
    let Some(table) = root.table("photo", "[photo]", KEYS)? else {
        warnings.extend(given.as_ref().and_then(Photo::orientation_note));
        return Ok((given, PhotoSettings::default()));
    };
    let mut file = None;
    let photo = match given {
        Some(photo) => {
            table.optional("image", Node::note_file)?;
            Some(photo)
        }
        None => {
            let read = table.optional("image", |node| read_photo_image(node, warnings))?;
            read.map(|(path, photo)| {
                file = Some(path);
                photo
            })
        }
    };
    let exposure = table.optional("exposure_ev", |node| read_exposure(node, photo.is_some()))?;
    let upright = table.optional("orientation", |node| match node.string()? {
        "apply" => Ok(true),
        "keep" => Ok(false),
        _ => Err(node.impossible("\"apply\" or \"keep\"")),
    })?;
    let upright_photo = upright.unwrap_or(false);
    let photo = photo.map(|photo| match upright_photo {
        true if photo.is_turned() => photo.upright(),
        true => photo,
        false => {
            warnings.extend(photo.orientation_note());
            photo
        }
    });
    let settings = PhotoSettings {
        file,
        exposure: exposure.unwrap_or(Exposure::Ev(0.0)),
        upright_photo,
        backdrop: read_backdrop(&table)?,
    };
    Ok((photo, settings))
}

/// What is set beside the image.
pub(super) struct PhotoSettings {
    /// The image's; `None`: the photograph came otherwise, or there is none.
    pub file: Option<PathBuf>,
    pub exposure: Exposure,
    pub upright_photo: bool,
    pub backdrop: Backdrop,
}

impl Default for PhotoSettings {
    fn default() -> Self {
        Self {
            file: None,
            exposure: Exposure::Ev(0.0),
            upright_photo: false,
            backdrop: Backdrop::Photograph(None),
        }
    }
}

/// What virtual objects show of what is not modelled.
fn read_backdrop(table: &Table) -> Result<Backdrop> {
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

fn read_photo_image(node: &Node, warnings: &mut Vec<String>) -> Result<(PathBuf, Photo)> {
    let path = node.existing_file()?;
    let (photo, notes) = Photo::read(&path).map_err(|problem| node.file_error(&path, problem))?;
    warnings.extend(node.file_warnings(notes));
    Ok((path, photo))
}

/// Width, height and codes of an image file as the camera stored them, with no colour decoded.
///
/// # Errors
/// Why the file cannot be used, in one line without its path.
pub fn read_codes(path: &Path) -> std::result::Result<(u32, u32, EncodedPhoto), Refusal> {
    let image = read_image(path)?;
    let codes = match image.pixels {
        Pixels::Codes8(codes) => EncodedPhoto::Codes8(codes),
        Pixels::Codes16(codes) => EncodedPhoto::Codes16(codes),
        Pixels::Linear(_) => EncodedPhoto::Linear,
    };
    Ok((image.width, image.height, codes))
}

/// Width, height and how much of each pixel is covered, 0 to 1: the alpha channel where there is one, else the red as stored.
///
/// # Errors
/// Why the file cannot be used, in one line without its path.
pub fn read_coverage(path: &Path) -> std::result::Result<(u32, u32, Vec<f32>), Refusal> {
    let image = read_image(path)?;
    let coverage = match image.pixels {
        _ if !image.alpha.is_empty() => image.alpha,
        Pixels::Codes8(codes) => codes.iter().map(|c| f32::from(c[0]) / 255.0).collect(),
        Pixels::Codes16(codes) => codes.iter().map(|c| f32::from(c[0]) / 65535.0).collect(),
        Pixels::Linear(pixels) => pixels.iter().map(|value| value[0]).collect(),
    };
    Ok((image.width, image.height, coverage))
}

/// A picture of another program with its own coverage, linear Rec.709, row-major from the top left.
#[derive(Clone, Debug)]
pub struct LayerPicture {
    pub width: u32,
    pub height: u32,
    pub linear: Vec<[f32; 3]>,
    /// Its alpha; empty where it has none, or none that is not 1.
    pub alpha: Vec<f32>,
    /// Colours are times alpha, as OpenEXR wants them; PNG wants them straight.
    pub is_premultiplied: bool,
}

/// Reads a layer (PNG, OpenEXR and whatever else [`Photo::read`] takes), with warnings of what in it is ignored.
///
/// # Errors
/// Why the file cannot be used, in one line without its path.
pub fn read_layer(path: &Path) -> std::result::Result<(LayerPicture, Vec<String>), Refusal> {
    let mut image = read_image_with_alpha(path)?;
    image.warnings.retain(|warning| warning != ALPHA);
    let alpha = std::mem::take(&mut image.alpha);
    if let Some(bad) = alpha.iter().position(|a| !a.is_finite()) {
        let width = image.width as usize;
        return Err(format!(
            "the alpha of pixel ({}, {}) is NaN or infinite; expected 0 to 1; repair the picture",
            bad % width,
            bad / width
        )
        .into());
    }
    let is_premultiplied = matches!(image.pixels, Pixels::Linear(_)) && !alpha.is_empty();
    let (photo, warnings) = Photo::of(image);
    let layer = LayerPicture {
        width: photo.width,
        height: photo.height,
        linear: photo.linear,
        alpha,
        is_premultiplied,
    };
    Ok((layer, warnings))
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

    /// What can be decoded of an image file's bytes that are cut off.
    pub(crate) fn decode_cut(bytes: &[u8]) -> Option<Self> {
        decode_cut_image(bytes).map(|image| Self::of(image).0)
    }

    /// sRGB codes, row-major from the top left.
    pub fn from_srgb8(width: u32, height: u32, codes: Vec<[u8; 3]>) -> Self {
        Self {
            width,
            height,
            linear: codes.iter().map(|code| code.map(decode8)).collect(),
            encoded: EncodedPhoto::Codes8(codes),
            tags: Tags::default(),
        }
    }

    /// Turned as its tags say.
    #[must_use]
    pub(crate) fn upright(self) -> Self {
        let orientation = self.tags.orientation;
        let size = (self.width, self.height);
        let (width, height) = turned_size(size, orientation);
        Self {
            width,
            height,
            linear: turned(size, &self.linear, orientation),
            encoded: match &self.encoded {
                EncodedPhoto::Codes8(codes) => {
                    EncodedPhoto::Codes8(turned(size, codes, orientation))
                }
                EncodedPhoto::Codes16(codes) => {
                    EncodedPhoto::Codes16(turned(size, codes, orientation))
                }
                EncodedPhoto::Linear => EncodedPhoto::Linear,
            },
            tags: Tags {
                orientation: Orientation::NoTransforms,
                ..self.tags
            },
        }
    }

    /// Its tags say that it is to be turned for a viewer.
    pub(crate) fn is_turned(&self) -> bool {
        self.tags.orientation != Orientation::NoTransforms
    }

    /// What to say where it is not turned.
    pub(crate) fn orientation_note(&self) -> Option<String> {
        self.is_turned().then(|| {
            "the photograph's orientation tag is kept, and its pixels are used as stored; `orientation = \"apply\"` in [photo] turns them".to_owned()
        })
    }

    fn of(image: ImageFile) -> (Self, Vec<String>) {
        let linear = image.linear();
        let (linear, encoded) = match image.pixels {
            Pixels::Codes8(codes) => (linear, EncodedPhoto::Codes8(codes)),
            Pixels::Codes16(codes) => (linear, EncodedPhoto::Codes16(codes)),
            Pixels::Linear(pixels) => (pixels, EncodedPhoto::Linear),
        };
        let photo = Self {
            width: image.width,
            height: image.height,
            linear,
            encoded,
            tags: image.tags,
        };
        (photo, image.warnings)
    }
}

impl ImageFile {
    /// Linear Rec.709 of codes; empty where the pixels are linear.
    pub(super) fn linear(&self) -> Vec<[f32; 3]> {
        match (&self.pixels, &self.tags.profile) {
            (Pixels::Codes8(codes), None) => codes.iter().map(|c| c.map(decode8)).collect(),
            (Pixels::Codes16(codes), None) => codes.iter().map(|c| c.map(decode16)).collect(),
            (Pixels::Codes8(codes), Some(profile)) => {
                let wide = |code: &[u8; 3]| code.map(|c| u16::from(c) * 257);
                codes
                    .iter()
                    .map(|code| profile.linear(wide(code)))
                    .collect()
            }
            (Pixels::Codes16(codes), Some(profile)) => {
                codes.iter().map(|code| profile.linear(*code)).collect()
            }
            (Pixels::Linear(_), _) => Vec::new(),
        }
    }
}
