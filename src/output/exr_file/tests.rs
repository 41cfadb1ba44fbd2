use super::*;
use crate::film::{Parts, Picture, Planes};
use crate::output::exr_header::is_sealed;
use crate::output::metadata::test_support::metadata;
use crate::scene::{Composite, Estimator, SamplerKind};
use exr::prelude::{ReadChannels, ReadLayers, f16};

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
    let mut metadata = metadata();
    metadata.rays_per_pixel = 49;
    metadata.seed = u32::MAX;
    metadata.estimator = Estimator::Direct;
    metadata.sampler = SamplerKind::Sobol;
    metadata.scrambles = Some(16);
    metadata.filtered = true;
    metadata.camera.fx = 520.9;
    metadata.camera.distortion =
        crate::scene::Distortion::opencv(&[0.1, 0.0, 0.0, 0.0, -0.2]).expect("five");
    metadata.camera.world_from_camera = world_from_camera;
    metadata.composite = Composite::Quotient;
    let planes = planes();
    let mut exr = ExrPicture::new(picture.clone(), planes.clone(), metadata);
    exr.parts = Parts {
        virtual_light: planes.real.clone(),
        coverage: vec![0.1; 6],
        change: planes.mixed.clone(),
        ratio: planes.albedo.clone(),
    };
    exr.added.noise = vec![[0.25, -0.5, 1e-3]; 6];
    exr.keeps_photo = true;
    write_exr(&target, &exr).unwrap();

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
        ("virtual.", &exr.parts.virtual_light),
        ("change.", &exr.parts.change),
        ("ratio.", &exr.parts.ratio),
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
    assert_eq!(channel("virtual.A"), vec![0.1; 6]);
    assert_eq!(channel("noise.B"), vec![f16::from_f32(1e-3).to_f32(); 6]);
    assert_ne!(channel("noise.B"), vec![1e-3; 6], "control: 16 bits");
    assert_eq!(layer.channel_data.list.len(), 37);

    let attribute = |name: &str| &layer.attributes.other[&Text::from(name)];
    let text = |s: &str| AttributeValue::Text(Text::from(s));
    assert_eq!(*attribute("mixray.estimator"), text("direct"));
    assert_eq!(*attribute("mixray.sampler"), text("sobol"));
    assert_eq!(*attribute("mixray.composite"), text("quotient"));
    assert_eq!(*attribute("mixray.stages"), text("none"));
    assert_eq!(
        *attribute("mixray.lens.apertureRadius"),
        AttributeValue::F64(0.0)
    );
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
        assert_eq!(file.headers[0].own_attributes.other.len(), 10);
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
    write_exr(&target, &ExrPicture::new(picture, planes, metadata())).unwrap();
    let file = exr::prelude::MetaData::read_from_file(target.path(), true).unwrap();
    assert_eq!(file.headers[0].channels.list.len(), 17);
}

/// No byte of a file can be lost or changed unseen.
#[test]
fn every_damage_to_a_file_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let target = Target::picture(&folder.path().join("a.exr")).unwrap();
    let picture = Picture {
        width: 3,
        height: 2,
        linear: vec![[0.5; 3]; 6],
    };
    write_exr(&target, &ExrPicture::new(picture, planes(), metadata())).unwrap();
    let whole = std::fs::read(target.path()).unwrap();
    assert!(is_sealed(&whole), "control");
    for length in 0..whole.len() {
        assert!(!is_sealed(&whole[..length]), "{length} bytes");
    }
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 4;
        assert!(!is_sealed(&bytes), "byte {at}");
    }
    assert!(!is_sealed(b""));
}
