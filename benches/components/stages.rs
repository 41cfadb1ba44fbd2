//! Camera stages on the CPU, on a picture of 640 x 480 of which a disc of 13% is virtual.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput};
use mixray::film::Picture;
use mixray::scene::{
    AntialiasSettings, CartoonSettings, CartoonStyle, MotionBlurSettings, NoiseFit, NoiseMethod,
    NoiseProfile, NoiseSettings,
};
use mixray::stages::EncodedImage;
use mixray::stages::antialias::antialias;
use mixray::stages::cartoon::cartoon;
use mixray::stages::motion_blur::{Copies, draw_copies};
use mixray::stages::noise::{NoiseInput, NoiseStage};

use crate::processor_time::ProcessorTime;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const RADIUS_PX: f32 = 112.0;
/// Of the disc from one frame to the next.
const MOTION_PX: [f32; 2] = [30.0, 10.0];

pub fn stages(criterion: &mut Criterion<ProcessorTime>) {
    let picture = picture();
    let mask = mask();
    let mut group = criterion.benchmark_group("stages");
    group.throughput(Throughput::Elements(u64::from(WIDTH * HEIGHT)));

    let antialiasing = AntialiasSettings::default();
    group.bench_function("antialias", |b| {
        let blend = |mut picture: Picture| {
            assert!(antialias(&mut picture, &mask, &antialiasing));
            picture
        };
        b.iter_batched(|| picture.clone(), blend, BatchSize::LargeInput);
    });

    for (name, method) in [
        ("noise, missing", NoiseMethod::Missing),
        ("noise, textures", NoiseMethod::Textures),
    ] {
        let stage = NoiseStage::new(&noise_settings(method), 1);
        let input = NoiseInput {
            mask: Some(&mask),
            ..NoiseInput::default()
        };
        group.bench_function(name, |b| {
            let add = |mut picture: Picture| {
                stage.apply(&mut picture, &input, 1);
                picture
            };
            b.iter_batched(|| picture.clone(), add, BatchSize::LargeInput);
        });
    }

    let copies = Copies::of(MOTION_PX, &MotionBlurSettings::default()).expect("long enough");
    let layer: Vec<[f32; 4]> = picture
        .linear
        .iter()
        .zip(&mask)
        .map(|([r, g, b], m)| [r * m, g * m, b * m, *m])
        .collect();
    group.bench_function("motion blur copies", |b| {
        let draw = |mut canvas: Vec<[f32; 4]>| {
            draw_copies(&mut canvas, (WIDTH, HEIGHT), &layer, &copies);
            canvas
        };
        b.iter_batched(|| layer.clone(), draw, BatchSize::LargeInput);
    });

    let image = EncodedImage::from_picture(&picture);
    for (name, style) in [
        ("cartoon, photometric", CartoonStyle::Photometric),
        ("cartoon, flow", CartoonStyle::Flow),
    ] {
        let settings = CartoonSettings {
            style,
            ..CartoonSettings::default()
        };
        group.bench_function(name, |b| {
            b.iter(|| cartoon(black_box(&image), &settings, false));
        });
    }
    group.finish();
}

/// White noise of a usual camera.
fn noise_settings(method: NoiseMethod) -> NoiseSettings {
    NoiseSettings {
        profile: NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 0.5 }, 16),
        method,
        scale: 1.0,
        texture_size: 512,
        magnification: 1.0,
        update_delay_frames: 1,
        eight_bit: false,
    }
}

fn pixels() -> impl Iterator<Item = (f32, f32)> {
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x as f32 + 0.5, y as f32 + 0.5)))
}

/// 1 in a disc about the middle.
fn mask() -> Vec<f32> {
    let (x0, y0) = (0.5 * WIDTH as f32, 0.5 * HEIGHT as f32);
    let inside = |(x, y): (f32, f32)| (x - x0).hypot(y - y0) < RADIUS_PX;
    pixels()
        .map(|at| if inside(at) { 1.0 } else { 0.0 })
        .collect()
}

/// Ramps and stripes.
fn picture() -> Picture {
    let color = |(x, y): (f32, f32)| {
        let stripes = 0.5 + 0.4 * (0.05 * x + 0.02 * y).sin();
        [x / WIDTH as f32, stripes, y / HEIGHT as f32]
    };
    Picture {
        width: WIDTH,
        height: HEIGHT,
        linear: pixels().map(color).collect(),
    }
}
