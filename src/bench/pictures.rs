//! Pictures and their differences as PNG.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};

use crate::film::Picture;
use crate::scene::srgb::encode8;

/// The picture as a display shows it.
///
/// # Errors
/// If it cannot be encoded.
pub fn picture_png(picture: &Picture) -> ImageResult<Vec<u8>> {
    let codes = picture.linear.as_flattened().iter().map(|&x| encode8(x));
    png(&codes.collect::<Vec<u8>>(), picture.width, picture.height)
}

/// `gain` times the difference from the reference about middle grey: brighter is too bright.
///
/// # Errors
/// If it cannot be encoded.
pub fn difference_png(test: &Picture, reference: &Picture, gain: f64) -> ImageResult<Vec<u8>> {
    let pairs = test.linear.as_flattened().iter();
    let codes = pairs
        .zip(reference.linear.as_flattened())
        .map(|(t, r)| {
            let shown = 0.5 + gain * f64::from(t - r);
            (255.0 * shown.clamp(0.0, 1.0)).round() as u8
        })
        .collect::<Vec<u8>>();
    png(&codes, test.width, test.height)
}

/// 8 bits a channel.
pub(super) fn png(rgb: &[u8], width: u32, height: u32) -> ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_difference_is_grey_and_the_gain_multiplies() {
        let picture = |grey: [f32; 3]| Picture {
            width: 3,
            height: 1,
            linear: grey.map(|g| [g; 3]).to_vec(),
        };
        let (test, reference) = (picture([0.5, 0.6, 0.1]), picture([0.5, 0.5, 0.9]));
        let bytes = difference_png(&test, &reference, 2.0).unwrap();
        let image = image::load_from_memory(&bytes).unwrap().into_rgb8();
        let code = |x| image.get_pixel(x, 0).0[0];
        assert_eq!([code(0), code(1), code(2)], [128, 179, 0]);
        let plain = image::load_from_memory(&picture_png(&reference).unwrap()).unwrap();
        assert_eq!(plain.into_rgb8().get_pixel(2, 0).0, [encode8(0.9); 3]);
    }
}
