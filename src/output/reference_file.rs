//! A converged picture with its standard error, for benchmarks.

use super::channels::{Channels, Precision, push_channel, push_three};
use super::exr_file::write_channels;
use super::exr_text::text_value;
use super::{OutputError, Target};
use crate::film::Picture;
use exr::prelude::Text;

/// Writes the picture as R, G, B, its standard error as the layer `error`, the mask, and text attributes.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_reference(
    target: &Target,
    picture: &Picture,
    standard_error: &[[f32; 3]],
    mask: &[f32],
    texts: &[(&str, String)],
) -> Result<(), OutputError> {
    let mut channels = Channels::new();
    for (layer, values) in [("", &*picture.linear), ("error.", standard_error)] {
        let rgb = ["R", "G", "B"];
        push_three(&mut channels, layer, rgb, values, Precision::Single);
    }
    push_channel(&mut channels, "mask.Y", mask.to_vec());
    let attributes = texts
        .iter()
        .map(|(name, text)| (Text::from(*name), text_value(text)))
        .collect();
    write_channels(target, picture.width, picture.height, channels, attributes)
}
