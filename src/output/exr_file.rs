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
    /// The preview filter has smoothed the picture.
    pub filtered: bool,
}

impl Metadata {
    /// Of a picture as rendered: fewer rays per pixel than the scene asks for where the render was ended early.
    pub fn of(renderer: &Renderer) -> Self {
        let scene = renderer.scene();
        Self {
            rays_per_pixel: renderer.samples(),
            filtered: renderer.is_filtered(),
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
        let distortion = camera.distortion.map(|k| k.to_string()).join(" ");
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
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers};

    fn planes() -> Planes {
        let rgb = |start: f32| (0..6).map(|i| [start, start + i as f32, -0.5]).collect();
        let one = |start: f32| (0..6).map(|i| start + i as f32).collect();
        Planes {
            mixed: rgb(10.0),
            real: rgb(20.0),
            difference: rgb(-30.0),
            variance: rgb(40.0),
            mask: one(0.25),
            samples: one(49.0),
            depth: vec![1.0, f32::INFINITY, 2.0, 3.0, 1e-30, 1e30],
            normal: rgb(50.0),
            albedo: rgb(60.0),
        }
    }

    #[test]
    fn every_layer_and_attribute_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::picture(&folder.path().join("a.exr")).unwrap();
        let picture = Picture {
            width: 3,
            height: 2,
            linear: (0..6).map(|i| [i as f32, -1e-20, 1e5]).collect(),
        };
        let mut world_from_camera = glam::DMat4::from_rotation_y(0.5);
        world_from_camera.w_axis.x = 4.25;
        let metadata = Metadata {
            rays_per_pixel: 49,
            max_bounces: 4,
            seed: u32::MAX,
            estimator: Estimator::Direct,
            sampler: SamplerKind::Sobol,
            scrambles: Some(16),
            filtered: true,
            camera: Camera {
                width: 3,
                height: 2,
                fx: 520.9,
                fy: 521.0,
                cx: 1.5,
                cy: 1.0,
                distortion: [0.1, 0.0, 0.0, 0.0, -0.2],
                world_from_camera,
            },
        };
        let planes = planes();
        write_exr(&target, &picture, &planes, &metadata).unwrap();

        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(target.path())
            .unwrap();
        assert_eq!(image.attributes.chromaticities, Some(rec709()));
        let layer = &image.layer_data;
        let channel = |name: &str| -> Vec<f32> {
            layer
                .channel_data
                .list
                .iter()
                .find(|c| c.name.to_string() == name)
                .unwrap_or_else(|| panic!("{name} is missing"))
                .sample_data
                .values_as_f32()
                .collect()
        };
        let rgb = [
            ("", &picture.linear),
            ("mixed.", &planes.mixed),
            ("real.", &planes.real),
            ("difference.", &planes.difference),
            ("variance.", &planes.variance),
            ("albedo.", &planes.albedo),
        ];
        for (prefix, values) in rgb {
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let truth: Vec<f32> = values.iter().map(|v| v[c]).collect();
                assert_eq!(channel(&format!("{prefix}{name}")), truth);
            }
        }
        for (c, name) in ["normal.X", "normal.Y", "normal.Z"].into_iter().enumerate() {
            let truth: Vec<f32> = planes.normal.iter().map(|v| v[c]).collect();
            assert_eq!(channel(name), truth);
        }
        assert_eq!(channel("mask.Y"), planes.mask);
        assert_eq!(channel("depth.Z"), planes.depth);
        assert_eq!(channel("samples.Y"), planes.samples);
        assert_ne!(channel("mixed.R"), channel("real.R"), "control");
        assert_eq!(layer.channel_data.list.len(), 24);

        let attribute = |name: &str| &layer.attributes.other[&Text::from(name)];
        let text = |s: &str| AttributeValue::Text(Text::from(s));
        assert_eq!(*attribute("mixray.estimator"), text("direct"));
        assert_eq!(*attribute("mixray.sampler"), text("sobol"));
        let variance = "of the mean of 16 independent scrambles";
        assert_eq!(*attribute("mixray.variance"), text(variance));
        let filter = "preview: the difference is smoothed, biased";
        assert_eq!(*attribute("mixray.filter"), text(filter));
        assert_eq!(
            *attribute("mixray.version"),
            text(env!("CARGO_PKG_VERSION"))
        );
        assert_eq!(
            *attribute("mixray.seed"),
            AttributeValue::F64(4_294_967_295.0)
        );
        assert_eq!(*attribute("mixray.raysPerPixel"), AttributeValue::F64(49.0));
        assert_eq!(*attribute("mixray.camera.fx"), AttributeValue::F64(520.9));
        let AttributeValue::Matrix4x4(matrix) = attribute("mixray.camera.worldFromCamera") else {
            panic!("not a matrix");
        };
        assert_eq!(matrix[3], 4.25, "row-major: the translation ends the rows");
    }

    /// A hash map of attributes has another order each time.
    #[test]
    fn one_picture_is_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, value: f64| {
            let target = Target::picture(&folder.path().join(name)).unwrap();
            let mut channels = Channels::new();
            push_channel(&mut channels, "R", vec![0.5f32; 6]);
            let attributes = (0..9)
                .map(|i| {
                    (
                        Text::from(format!("a{i}").as_str()),
                        AttributeValue::F64(value),
                    )
                })
                .collect();
            write_channels(&target, 3, 2, channels, attributes).unwrap();
            let file = exr::prelude::MetaData::read_from_file(target.path(), true).unwrap();
            assert_eq!(file.headers[0].own_attributes.other.len(), 9);
            std::fs::read(target.path()).unwrap()
        };
        let first = write("0.exr", 1.0);
        for number in 1..8 {
            assert_eq!(write(&format!("{number}.exr"), 1.0), first);
        }
        assert_ne!(write("other.exr", 2.0), first, "control");
        let cut = &first[..first.len().min(300)];
        assert!(sort_attributes(&mut std::io::Cursor::new(cut.to_vec())).is_err());
    }

    #[test]
    fn planes_that_were_not_asked_for_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::picture(&folder.path().join("a.exr")).unwrap();
        let mut planes = planes();
        (planes.depth, planes.normal, planes.albedo) = Default::default();
        let picture = Picture {
            width: 3,
            height: 2,
            linear: vec![[0.0; 3]; 6],
        };
        let metadata = Metadata {
            rays_per_pixel: 1,
            max_bounces: 1,
            seed: 0,
            estimator: Estimator::Paper,
            sampler: SamplerKind::Cmj,
            scrambles: None,
            filtered: false,
            camera: Camera {
                width: 3,
                height: 2,
                fx: 1.0,
                fy: 1.0,
                cx: 1.5,
                cy: 1.0,
                distortion: [0.0; 5],
                world_from_camera: glam::DMat4::IDENTITY,
            },
        };
        write_exr(&target, &picture, &planes, &metadata).unwrap();
        let file = exr::prelude::MetaData::read_from_file(target.path(), true).unwrap();
        assert_eq!(file.headers[0].channels.list.len(), 17);
    }
}
