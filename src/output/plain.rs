//! A picture without a render behind it: just R, G and B.

use std::collections::HashMap;

use super::channels::{Channels, Precision, push_three};
use super::exr_file::write_channels;
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
    let mut channels = Channels::new();
    push_three(
        &mut channels,
        "",
        ["R", "G", "B"],
        &picture.linear,
        Precision::Single,
    );
    let nothing_more = HashMap::new();
    write_channels(
        target,
        picture.width,
        picture.height,
        channels,
        nothing_more,
    )
}
