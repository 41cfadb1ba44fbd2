//! A picture without a render behind it: just R, G and B.

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Text,
    Vec2, WritableImage,
};

use super::exr_file::rec709;
use super::target::write_atomically;
use super::{Format, OutputError, PngBits, Target, write_png};
use crate::film::Picture;
use crate::scene::Photo;

/// Writes a linear Rec.709 picture: PNG of `bits` a channel, or EXR.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_image(target: &Target, picture: &Picture, bits: PngBits) -> Result<(), OutputError> {
    match target.format() {
        Format::Png => write_png(target, picture, None, bits),
        Format::Exr => write_rgb(target, picture),
    }
}

/// [`write_image`] of a picture over `photo`: pixels that equal the photograph's bit for bit get the photograph's own codes.
///
/// # Errors
/// As [`write_image`].
pub fn write_composite(
    target: &Target,
    picture: &Picture,
    photo: &Photo,
    bits: PngBits,
) -> Result<(), OutputError> {
    match target.format() {
        Format::Png => write_png(target, picture, Some(photo), bits),
        Format::Exr => write_rgb(target, picture),
    }
}

fn write_rgb(target: &Target, picture: &Picture) -> Result<(), OutputError> {
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(c, name)| {
            let samples = picture.linear.iter().map(|pixel| pixel[c]).collect();
            AnyChannel::new(Text::from(name), FlatSamples::F32(samples))
        })
        .collect();
    let attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("mixray ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    let mut image = Image::from_layer(Layer::new(
        Vec2(picture.width as usize, picture.height as usize),
        attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    ));
    image.attributes.chromaticities = Some(rec709());
    write_atomically(target.path(), |file| {
        image
            .write()
            .to_buffered(file)
            .map_err(|error| OutputError::Encode {
                path: target.path().into(),
                message: error.to_string(),
            })
    })
}
