//! PNG, 8 or 16 bits a channel: sRGB, or the photograph's own colours.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::kept_codes::keep_codes;
use super::target::write_atomically;
use super::{OutputError, Target};
use crate::decode::ColourProfile;
use crate::film::Picture;
use crate::scene::srgb::{KEPT_CODES, encode8, encode8_near, encode16};
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

/// Writes the picture, clamped to 0..1. A pixel that equals the photograph's bit for bit gets the photograph's own code, and at 8 bits a channel that
/// hardly changes ([`super::kept_codes`]); colours and orientation are as the photograph's tags say.
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
            let code = code16(photo);
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
    let values = picture.linear.par_iter().enumerate();
    if let Some(photo) = photo
        && photo.tags.profile.is_none()
        && let EncodedPhoto::Codes8(own) = &photo.encoded
    {
        let code =
            |(pixel, value): (usize, &[f32; 3])| match is_photos_own(Some(photo), pixel, *value) {
                true => own[pixel],
                false => value.map(encode8),
            };
        let mut codes: Vec<_> = values.map(code).collect();
        keep_codes(&mut codes, picture, photo, own);
        return codes;
    }
    let code = code8(photo);
    values.map(|(pixel, value)| code(pixel, *value)).collect()
}

/// The code of 8 bits of a pixel's linear value, in the photograph's colours, without a look at the pixels around: for drafts, and photographs with a profile. A
/// channel that comes within [`KEPT_CODES`] of the photograph's code keeps it, so that noise does not roughen what hardly changes.
pub(crate) fn code8(photo: Option<&Photo>) -> impl Fn(usize, [f32; 3]) -> [u8; 3] + Sync {
    let profile = profile_of(photo);
    let codes = photo.and_then(|photo| match &photo.encoded {
        EncodedPhoto::Codes8(codes) => Some(codes),
        EncodedPhoto::Codes16(_) | EncodedPhoto::Linear => None,
    });
    let nearest = |code: f64| (code + 0.5).floor() as u8;
    move |pixel, value| {
        let own = codes.map(|codes| codes[pixel]);
        match (own, profile) {
            (Some(own), _) if is_photos_own(photo, pixel, value) => own,
            (Some(own), None) => [0, 1, 2].map(|c| encode8_near(value[c], own[c])),
            (None, None) => value.map(encode8),
            (own, Some(profile)) => {
                let shares = profile.encoded(value).map(|share| share * 255.0);
                let own = own.map_or(shares.map(nearest), |own| own);
                [0, 1, 2].map(
                    |c| match (shares[c] - f64::from(own[c])).abs() < KEPT_CODES {
                        true => own[c],
                        false => nearest(shares[c]),
                    },
                )
            }
        }
    }
}

/// The same of 16 bits; a pixel of the photograph's own value has its own code.
fn code16(photo: Option<&Photo>) -> impl Fn(usize, [f32; 3]) -> [u16; 3] + Sync {
    let profile = profile_of(photo);
    let own_code = move |pixel: usize| match &photo?.encoded {
        EncodedPhoto::Codes8(codes) => Some(codes[pixel].map(|c| u16::from(c) * 257)),
        EncodedPhoto::Codes16(codes) => Some(codes[pixel]),
        EncodedPhoto::Linear => None,
    };
    move |pixel, value| match (own_code(pixel), profile) {
        (Some(own), _) if is_photos_own(photo, pixel, value) => own,
        (_, None) => value.map(encode16),
        (_, Some(profile)) => {
            let shares = profile.encoded(value);
            shares.map(|share| (share * 65535.0 + 0.5).floor() as u16)
        }
    }
}

fn profile_of(photo: Option<&Photo>) -> Option<&ColourProfile> {
    photo.and_then(|photo| photo.tags.profile.as_deref())
}

fn is_photos_own(photo: Option<&Photo>, pixel: usize, value: [f32; 3]) -> bool {
    photo.is_some_and(|photo| photo.linear[pixel].map(f32::to_bits) == value.map(f32::to_bits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::Tags;
    use crate::math::{hash_u32, uniform_from_bits};
    use crate::scene::srgb::{decode, decode8, decode16};

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
        result.linear[1] = [0.2; 3];
        let eight = written(&result, Some(&photo), PngBits::Eight).into_rgb8();
        assert_eq!(eight.get_pixel(0, 0).0, [7, 8, 9]);
        assert_eq!(
            eight.get_pixel(1, 0).0,
            [encode8(0.2); 3],
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

    /// A photograph of 64 x 64 pixels, and the codes of a change of so many codes under noise of that deviation.
    fn changed(change: f64, noise: f64) -> (Vec<[u8; 3]>, Vec<[u8; 3]>) {
        let own: Vec<[u8; 3]> = (0..64 * 64_u32)
            .map(|i| [i % 200 + 20, i / 9 % 200 + 20, 128].map(|code| code as u8))
            .collect();
        let photo = Photo::from_srgb8(64, 64, own.clone());
        let at = |i: usize, c: usize| {
            let sum: f32 = (0..12)
                .map(|k| uniform_from_bits(hash_u32((i * 3 + c) as u32 * 12 + k)))
                .sum();
            let code = f64::from(own[i][c]) - change + noise * f64::from(sum - 6.0);
            decode(code / 255.0) as f32
        };
        let linear = (0..own.len()).map(|i| [0, 1, 2].map(|c| at(i, c)));
        let picture = Picture {
            width: 64,
            height: 64,
            linear: linear.collect(),
        };
        (picture_codes8(&picture, Some(&photo)), own)
    }

    /// A soft shadow of a code keeps its mean over 32 x 32 pixels within a tenth; next to none leaves the photograph as it is. Control: nearest codes.
    #[test]
    fn what_hardly_changes_keeps_the_photographs_codes() {
        for noise in [0.0, 0.1, 0.2, 0.5] {
            let (codes, own) = changed(1.0, noise);
            for window in 0..4 {
                let inside = |i: &usize| i % 64 / 32 == window % 2 && i / 64 / 32 == window / 2;
                let off = |i: usize| {
                    (0..3)
                        .map(|c| f64::from(own[i][c]) - f64::from(codes[i][c]))
                        .sum::<f64>()
                };
                let mean = (0..64 * 64).filter(inside).map(off).sum::<f64>() / (3.0 * 32.0 * 32.0);
                assert!(
                    (mean - 1.0).abs() < 0.1,
                    "noise {noise}, window {window}: {mean}"
                );
            }
        }
        let changed_share = |change: f64, noise: f64| {
            let (codes, own) = changed(change, noise);
            let count = codes.iter().zip(&own).filter(|(a, b)| a != b).count();
            count as f64 / own.len() as f64
        };
        for noise in [0.1, 0.3] {
            let share = changed_share(0.4, noise);
            assert!(share < 0.01, "noise {noise}: {share}");
        }
        let share = changed_share(0.9, 0.1);
        assert!(share > 0.9, "control: {share}");
    }

    #[test]
    fn negative_and_bright_values_clamp() {
        let image = written(&picture(vec![[-3.0, 0.0, 9.0]]), None, PngBits::Eight);
        assert_eq!(image.into_rgb8().get_pixel(0, 0).0, [0, 0, 255]);
    }
}
