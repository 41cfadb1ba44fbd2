//! Multilayer OpenEXR: 32-bit float, linear Rec.709, one part, layers by channel-name prefix.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Text,
    WritableImage,
};
use exr::prelude::{Vec2, attribute::AttributeValue, attribute::Chromaticities};

use super::exr_header::sort_attributes;
use super::target::write_atomically;
use super::{OutputError, Target};
use crate::distortion::LENS_FISHEYE;
use crate::film::{Picture, Planes};
use crate::renderer::Renderer;
use crate::scene::{Camera, Estimator, SamplerKind};

/// What the file says about how it was made.
#[derive(Clone, Debug)]
pub struct Metadata {
    pub rays_per_pixel: u32,
    pub max_bounces: u32,
    pub seed: u32,
    pub estimator: Estimator,
    pub sampler: SamplerKind,
    pub camera: Camera,
    /// Independent scrambles that the variance plane is taken from; `None`: it is that of the samples.
    pub scrambles: Option<u32>,
    /// A filter has smoothed the picture.
    pub filtered: bool,
}

impl Metadata {
    /// Of a picture as rendered: fewer rays per pixel than the scene asks for where the render was ended early.
    pub fn of(renderer: &Renderer) -> Self {
        let scene = renderer.scene();
        Self {
            rays_per_pixel: renderer.samples(),
            filtered: renderer.filter().is_some(),
            scrambles: renderer.stated().map(|stated| stated.scrambles),
            max_bounces: scene.settings.max_bounces,
            seed: scene.settings.seed,
            estimator: scene.settings.estimator,
            sampler: scene.settings.sampler,
            camera: scene.camera.clone(),
        }
    }

    fn attributes(&self) -> HashMap<Text, AttributeValue> {
        let text = text_value;
        let number = |x: u32| AttributeValue::F64(f64::from(x));
        let estimator = match self.estimator {
            Estimator::Direct => "direct",
            Estimator::Paper => "paper",
        };
        let sampler = match self.sampler {
            SamplerKind::Jittered => "jittered",
            SamplerKind::Cmj => "cmj",
            SamplerKind::Sobol => "sobol",
        };
        let camera = &self.camera;
        let rows = camera.world_from_camera.transpose().to_cols_array();
        let lens = &camera.distortion;
        let is_fisheye = lens.model == LENS_FISHEYE;
        let count = if is_fisheye { 4 } else { 12 };
        let given = &lens.coefficients[..count];
        let distortion = given
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(" ");
        let lens_model = if is_fisheye { "fisheye" } else { "opencv" };
        let filter = if self.filtered {
            "preview: the difference is smoothed, biased"
        } else {
            "none"
        };
        let variance = match self.scrambles {
            Some(count) => format!("of the mean of {count} independent scrambles"),
            None => "of the samples: an upper estimate".to_owned(),
        };
        [
            ("mixray.version", text(env!("CARGO_PKG_VERSION"))),
            ("mixray.raysPerPixel", number(self.rays_per_pixel)),
            ("mixray.maxBounces", number(self.max_bounces)),
            ("mixray.seed", number(self.seed)),
            ("mixray.estimator", text(estimator)),
            ("mixray.sampler", text(sampler)),
            ("mixray.variance", text(&variance)),
            ("mixray.filter", text(filter)),
            ("mixray.camera.fx", AttributeValue::F64(camera.fx)),
            ("mixray.camera.fy", AttributeValue::F64(camera.fy)),
            ("mixray.camera.cx", AttributeValue::F64(camera.cx)),
            ("mixray.camera.cy", AttributeValue::F64(camera.cy)),
            ("mixray.camera.distortion", text(&distortion)),
            ("mixray.camera.lensModel", text(lens_model)),
            // Rows, column vectors: the scene file's own order.
            (
                "mixray.camera.worldFromCamera",
                AttributeValue::Matrix4x4(rows.map(|x| x as f32)),
            ),
        ]
        .into_iter()
        .map(|(name, value)| (Text::from(name), value))
        .collect()
    }
}

/// ITU-R BT.709 primaries and D65.
fn rec709() -> Chromaticities {
    Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    }
}

/// Channels of a file in the making.
pub(super) type Channels = SmallVec<[AnyChannel<FlatSamples>; 4]>;

/// Samples that are empty stand for a plane that was not asked for: it is left out.
pub(super) fn push_channel<T: IntoSamples>(channels: &mut Channels, name: &str, samples: Vec<T>) {
    if !samples.is_empty() {
        channels.push(AnyChannel::new(Text::from(name), T::into_samples(samples)));
    }
}

/// What a channel can hold.
pub(super) trait IntoSamples: Sized {
    fn into_samples(samples: Vec<Self>) -> FlatSamples;
}

impl IntoSamples for f32 {
    fn into_samples(samples: Vec<Self>) -> FlatSamples {
        FlatSamples::F32(samples)
    }
}

impl IntoSamples for u32 {
    fn into_samples(samples: Vec<Self>) -> FlatSamples {
        FlatSamples::U32(samples)
    }
}

/// Three channels of a layer, whose name ends with a dot.
pub(super) fn push_three(
    channels: &mut Channels,
    layer: &str,
    names: [&str; 3],
    values: &[[f32; 3]],
) {
    for (c, name) in names.into_iter().enumerate() {
        let samples: Vec<f32> = values.iter().map(|v| v[c]).collect();
        push_channel(channels, &format!("{layer}{name}"), samples);
    }
}

/// Writes the composite as R, G, B and every plane as its own layer; planes that were not asked for (empty) are left out.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_exr(
    target: &Target,
    picture: &Picture,
    planes: &Planes,
    metadata: &Metadata,
) -> Result<(), OutputError> {
    let nothing_more = std::iter::empty();
    write_layers(
        target,
        picture,
        planes,
        metadata,
        Channels::new(),
        nothing_more,
    )
}

/// As [`write_exr`], with more channels and text attributes.
pub(super) fn write_layers<'a>(
    target: &Target,
    picture: &Picture,
    planes: &Planes,
    metadata: &Metadata,
    mut channels: Channels,
    texts: impl Iterator<Item = (&'a str, &'a str)>,
) -> Result<(), OutputError> {
    for (layer, values) in [
        ("", &picture.linear),
        ("mixed.", &planes.mixed),
        ("real.", &planes.real),
        ("difference.", &planes.difference),
        ("albedo.", &planes.albedo),
        ("variance.", &planes.variance),
    ] {
        push_three(&mut channels, layer, ["R", "G", "B"], values);
    }
    push_three(&mut channels, "normal.", ["X", "Y", "Z"], &planes.normal);
    push_channel(&mut channels, "mask.Y", planes.mask.clone());
    push_channel(&mut channels, "depth.Z", planes.depth.clone());
    push_channel(&mut channels, "samples.Y", planes.samples.clone());

    let mut attributes = metadata.attributes();
    attributes.extend(texts.map(|(name, text)| (Text::from(name), text_value(text))));
    write_channels(target, picture.width, picture.height, channels, attributes)
}

/// As OpenEXR wants it; the crate's own conversion knows Latin-1 alone and panics beyond.
fn utf8(text: &str) -> Text {
    Text::from_bytes_unchecked(SmallVec::from_slice(text.as_bytes()))
}

pub(super) fn text_value(text: &str) -> AttributeValue {
    AttributeValue::Text(utf8(text))
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
    write_atomically(target.path(), |file| {
        (image.write().to_buffered(&mut *file)).map_err(|error| failed(error.to_string()))?;
        file.flush().map_err(|error| failed(error.to_string()))?;
        let mut file: &File = file.get_ref();
        sort_attributes(&mut file).map_err(|error| failed(error.to_string()))
    })
}

#[cfg(test)]
mod tests;
