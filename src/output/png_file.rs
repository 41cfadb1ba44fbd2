//! PNG, 8 or 16 bits a channel: sRGB, or the photograph's own colours.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::target::write_atomically;
use super::{OutputError, Target};
use crate::film::Picture;
use crate::scene::srgb::{encode8, encode16};
use crate::scene::{EncodedPhoto, Photo};

/// Its last chunk, which is the same in every file.
pub(crate) const PNG_END: [u8; 12] = *b"\0\0\0\0IEND\xae\x42\x60\x82";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PngBits {
    Eight,
    Sixteen,
}

impl PngBits {
    /// 16 for a 16-bit photograph, else 8.
    pub fn for_photo(photo: Option<&Photo>) -> Self {
        match photo.map(|p| &p.encoded) {
            Some(EncodedPhoto::Codes16(_)) => Self::Sixteen,
            _ => Self::Eight,
        }
    }
}

/// Writes the picture, clamped to 0..1. A pixel that equals the photograph's bit for bit gets the photograph's own code;
/// colours and orientation are as the photograph's tags say.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_png(
    target: &Target,
    picture: &Picture,
    photo: Option<&Photo>,
    bits: PngBits,
) -> Result<(), OutputError> {
    let (bytes, color) = match bits {
        PngBits::Eight => {
            let codes = picture_codes8(picture, photo);
            (codes.into_flattened(), ExtendedColorType::Rgb8)
        }
        PngBits::Sixteen => {
            let encode = Encoding {
                srgb: encode16,
                of_share: |x: f64| (x * 65535.0 + 0.5).floor() as u16,
            };
            let code = code(photo, encode, |encoded, pixel| match encoded {
                EncodedPhoto::Codes8(codes) => Some(codes[pixel].map(|c| u16::from(c) * 257)),
                EncodedPhoto::Codes16(codes) => Some(codes[pixel]),
                EncodedPhoto::Linear => None,
            });
            let values = picture.linear.par_iter().enumerate();
            let codes: Vec<[u16; 3]> = values.map(|(pixel, value)| code(pixel, *value)).collect();
            let bytes = bytemuck::cast_slice(codes.as_flattened()).to_vec();
            (bytes, ExtendedColorType::Rgb16)
        }
    };
    write_atomically(target.path(), |file| {
        let failed = |message: String| OutputError::Encode {
            path: target.path().into(),
            message,
        };
        let mut encoder = PngEncoder::new(file);
        if let Some(tags) = photo.map(|photo| &photo.tags) {
            if let Some(profile) = &tags.profile {
                let set = encoder.set_icc_profile(profile.icc().to_vec());
                set.map_err(|e| failed(e.to_string()))?;
            }
            if let Some(exif) = tags.exif() {
                let set = encoder.set_exif_metadata(exif);
                set.map_err(|e| failed(e.to_string()))?;
            }
        }
        encoder
            .write_image(&bytes, picture.width, picture.height, color)
            .map_err(|e| failed(e.to_string()))
    })
}

/// Codes of 8 bits as [`write_png`] writes them.
pub(crate) fn picture_codes8(picture: &Picture, photo: Option<&Photo>) -> Vec<[u8; 3]> {
    let code = code8(photo);
    let values = picture.linear.par_iter().enumerate();
    values.map(|(pixel, value)| code(pixel, *value)).collect()
}

/// The code of 8 bits of a pixel's linear value.
pub(crate) fn code8(photo: Option<&Photo>) -> impl Fn(usize, [f32; 3]) -> [u8; 3] + Sync {
    let encode = Encoding {
        srgb: encode8,
        of_share: |x: f64| (x * 255.0 + 0.5).floor() as u8,
    };
    code(photo, encode, |encoded, pixel| match encoded {
        EncodedPhoto::Codes8(codes) => Some(codes[pixel]),
        _ => None,
    })
}

/// Codes of linear values, and of encoded ones from 0 to 1.
struct Encoding<S, O> {
    srgb: S,
    of_share: O,
}

/// In the photograph's colours; a pixel of the photograph's own value has its own code.
fn code<T: Copy>(
    photo: Option<&Photo>,
    encode: Encoding<impl Fn(f32) -> T + Sync, impl Fn(f64) -> T + Sync>,
    own_code: impl Fn(&EncodedPhoto, usize) -> Option<[T; 3]> + Sync,
) -> impl Fn(usize, [f32; 3]) -> [T; 3] + Sync {
    let profile = photo.and_then(|photo| photo.tags.profile.as_deref());
    let of_linear = move |value: [f32; 3]| match profile {
        None => value.map(&encode.srgb),
        Some(profile) => profile.encoded(value).map(&encode.of_share),
    };
    move |pixel, value| {
        photo
            .filter(|photo| photo.linear[pixel].map(f32::to_bits) == value.map(f32::to_bits))
            .and_then(|photo| own_code(&photo.encoded, pixel))
            .unwrap_or_else(|| of_linear(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::Tags;
    use crate::scene::srgb::{decode8, decode16};

    fn picture(linear: Vec<[f32; 3]>) -> Picture {
        Picture {
            width: linear.len() as u32,
            height: 1,
            linear,
        }
    }

    fn written(picture: &Picture, photo: Option<&Photo>, bits: PngBits) -> image::DynamicImage {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        write_png(&Target::picture(&path).unwrap(), picture, photo, bits).unwrap();
        image::open(&path).unwrap()
    }

    #[test]
    fn untouched_pixels_get_the_photographs_own_code() {
        // Codes that no decoding of these linear values would give show where the code came from.
        let photo = Photo {
            width: 3,
            height: 1,
            linear: vec![[0.1; 3]; 3],
            encoded: EncodedPhoto::Codes8(vec![[7, 8, 9]; 3]),
            tags: Tags::default(),
        };
        let mut result = picture(photo.linear.clone());
        result.linear[1] = [0.1, 0.1, f32::from_bits(0.1f32.to_bits() + 1)];
        let eight = written(&result, Some(&photo), PngBits::Eight).into_rgb8();
        assert_eq!(eight.get_pixel(0, 0).0, [7, 8, 9]);
        assert_eq!(
            eight.get_pixel(1, 0).0,
            [encode8(0.1); 3],
            "control: a changed pixel is encoded"
        );
        let sixteen = written(&result, Some(&photo), PngBits::Sixteen).into_rgb16();
        assert_eq!(sixteen.get_pixel(2, 0).0, [7 * 257, 8 * 257, 9 * 257]);
    }

    #[test]
    fn codes_survive_the_round_trip() {
        let eight: Vec<[f32; 3]> = (0..=255).map(|c| [decode8(c); 3]).collect();
        let image = written(&picture(eight), None, PngBits::Eight).into_rgb8();
        assert!(image.pixels().enumerate().all(|(i, p)| p.0 == [i as u8; 3]));
        let sixteen: Vec<[f32; 3]> = (0..=65535).step_by(7).map(|c| [decode16(c); 3]).collect();
        let image = written(&picture(sixteen), None, PngBits::Sixteen).into_rgb16();
        assert!(
            image
                .pixels()
                .enumerate()
                .all(|(i, p)| p.0 == [i as u16 * 7; 3])
        );
    }

    #[test]
    fn negative_and_bright_values_clamp() {
        let image = written(&picture(vec![[-3.0, 0.0, 9.0]]), None, PngBits::Eight);
        assert_eq!(image.into_rgb8().get_pixel(0, 0).0, [0, 0, 255]);
    }
}
