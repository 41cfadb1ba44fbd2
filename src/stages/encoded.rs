//! A picture as it is stored and seen: sRGB-encoded values, nominally 0..=1.

use rayon::prelude::*;

use crate::film::Picture;
use crate::scene::srgb::{decode, encode};
use crate::scene::{EncodedPhoto, Photo};

/// Row-major from the top left. Values may lie outside 0..=1: the curve goes on along its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedImage {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<[f32; 3]>,
}

impl EncodedImage {
    /// The stored codes over their largest; linear images (EXR, HDR) and those of other colours are encoded.
    pub fn from_photo(photo: &Photo) -> Self {
        let rgb = match &photo.encoded {
            _ if photo.tags.profile.is_some() => encoded_pixels(&photo.linear),
            EncodedPhoto::Codes8(codes) => codes
                .iter()
                .map(|pixel| pixel.map(|code| f32::from(code) / 255.0))
                .collect(),
            EncodedPhoto::Codes16(codes) => codes
                .iter()
                .map(|pixel| pixel.map(|code| f32::from(code) / 65535.0))
                .collect(),
            EncodedPhoto::Linear => encoded_pixels(&photo.linear),
        };
        Self {
            width: photo.width,
            height: photo.height,
            rgb,
        }
    }

    pub fn from_picture(picture: &Picture) -> Self {
        Self {
            width: picture.width,
            height: picture.height,
            rgb: encoded_pixels(&picture.linear),
        }
    }

    /// Decoded to linear values.
    pub fn to_picture(&self) -> Picture {
        Picture {
            width: self.width,
            height: self.height,
            linear: self
                .rgb
                .par_iter()
                .map(|pixel| pixel.map(decoded))
                .collect(),
        }
    }

    /// Clamped to 0..=1, for what works on colours as a display shows them.
    #[must_use]
    pub fn clamped(mut self) -> Self {
        for pixel in &mut self.rgb {
            *pixel = pixel.map(|channel| channel.clamp(0.0, 1.0));
        }
        self
    }
}

fn encoded_pixels(linear: &[[f32; 3]]) -> Vec<[f32; 3]> {
    linear.par_iter().map(|pixel| pixel.map(encoded)).collect()
}

/// Encoded value of a linear one.
pub(crate) fn encoded(linear: f32) -> f32 {
    encode(f64::from(linear)) as f32
}

/// Linear value of an encoded one.
pub(crate) fn decoded(encoded: f32) -> f32 {
    decode(f64::from(encoded)) as f32
}
