//! Multilayer OpenEXR: linear Rec.709, one part, layers by channel-name prefix.

use std::collections::HashMap;
use std::io::Cursor;

use exr::prelude::{AnyChannels, Encoding, Image, Layer, LayerAttributes, Text, WritableImage};
use exr::prelude::{Vec2, attribute::AttributeValue, attribute::Chromaticities};

use super::channels::{Channels, Precision, push_channel, push_three};
use super::cryptomatte::{self, push_mattes};
use super::exr_header::{seal, sort_attributes, unsealed};
use super::exr_text::text_value;
use super::{ExrPicture, Metadata, OutputError, Target, write_bytes};
use crate::renderer::MotionVectors;

/// Of motion vectors, to a pixel.
const VECTOR_STEPS: f32 = 1024.0;

/// ITU-R BT.709 primaries and D65.
fn rec709() -> Chromaticities {
    Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    }
}

/// Writes a picture and its layers.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_exr(target: &Target, exr: &ExrPicture) -> Result<(), OutputError> {
    write_layers(target, exr, Channels::new(), std::iter::empty())
}

/// As [`write_exr`], with more channels and text attributes.
pub(super) fn write_layers<'a>(
    target: &Target,
    exr: &ExrPicture,
    mut channels: Channels,
    texts: impl Iterator<Item = (&'a str, &'a str)>,
) -> Result<(), OutputError> {
    let ExrPicture {
        picture,
        planes,
        parts,
        added,
        motion,
        mattes,
        metadata,
        keeps_photo,
    } = exr;
    let (of_photo, of_change) = match keeps_photo {
        true => (Precision::Single, Precision::Single),
        false => (Precision::Half, Precision::Steps),
    };
    for (layer, values, precision) in [
        ("", &picture.linear, of_photo),
        // Of one type with its A, which needs all bits where little of a bright photograph shows: readers want a layer to be of one.
        ("virtual.", &parts.virtual_light, Precision::Single),
        // It may take nearly all of the photograph's light: what is left are the last bits that this has.
        ("change.", &parts.change, of_change),
        ("ratio.", &parts.ratio, Precision::Half),
        ("sharpness.", &added.sharpness, Precision::Half),
        ("noise.", &added.noise, Precision::Half),
        ("mixed.", &planes.mixed, Precision::Half),
        ("real.", &planes.real, Precision::Half),
        ("difference.", &planes.difference, Precision::Half),
        ("albedo.", &planes.albedo, Precision::Half),
        ("variance.", &planes.variance, Precision::Digits),
    ] {
        push_three(&mut channels, layer, ["R", "G", "B"], values, precision);
    }
    let axes = ["X", "Y", "Z"];
    push_three(
        &mut channels,
        "normal.",
        axes,
        &planes.normal,
        Precision::Half,
    );
    push_channel(&mut channels, "virtual.A", parts.coverage.clone());
    push_channel(&mut channels, "mask.Y", planes.mask.clone());
    push_channel(&mut channels, "depth.Z", planes.depth.clone());
    push_channel(&mut channels, "samples.Y", planes.samples.clone());

    let mut attributes = metadata
        .as_ref()
        .map(Metadata::attributes)
        .unwrap_or_default();
    if let Some(MotionVectors { forward, backward }) = motion {
        for (layer, vectors) in [("forward", forward), ("backward", backward)] {
            for (axis, name) in ["u", "v"].into_iter().enumerate() {
                let rounded =
                    |vector: &[f32; 2]| (vector[axis] * VECTOR_STEPS).round() / VECTOR_STEPS;
                let values: Vec<f32> = vectors.iter().map(rounded).collect();
                push_channel(&mut channels, &format!("{layer}.{name}"), values);
            }
        }
    }
    if let Some(mattes) = mattes {
        push_mattes(&mut channels, mattes);
        attributes.extend(cryptomatte::attributes(mattes));
    }
    attributes.extend(texts.map(|(name, text)| (Text::from(name), text_value(text))));
    write_channels(target, picture.width, picture.height, channels, attributes)
}

/// Writes a file of one part.
pub(super) fn write_channels(
    target: &Target,
    width: u32,
    height: u32,
    channels: Channels,
    attributes: HashMap<Text, AttributeValue>,
) -> Result<(), OutputError> {
    let mut layer_attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("mixray ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    layer_attributes.other = attributes;
    let (name, digest) = unsealed();
    layer_attributes.other.insert(name, digest);
    let layer = Layer::new(
        Vec2(width as usize, height as usize),
        layer_attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    let mut image = Image::from_layer(layer);
    image.attributes.chromaticities = Some(rec709());
    let failed = |message: String| OutputError::Encode {
        path: target.path().into(),
        message,
    };
    let mut file = Cursor::new(Vec::new());
    (image.write().to_buffered(&mut file)).map_err(|error| failed(error.to_string()))?;
    sort_attributes(&mut file).map_err(|error| failed(error.to_string()))?;
    let mut bytes = file.into_inner();
    seal(&mut bytes);
    write_bytes(target.path(), &bytes)
}

#[cfg(test)]
mod tests;
