//! The stages on the GPU against their CPU twins, and their code without a device.

use std::sync::Arc;

use wgpu::naga;

use super::antialias::gpu::AntialiasParams;
use super::cartoon::gpu::{CartoonParams, FlowParams};
use super::device::{GpuStages, STAGE_KERNELS};
use super::motion_blur::gpu::CopiesParams;
use super::noise::gpu::NoiseParams;
use crate::film::Picture;
use crate::gpu::harness::test_device;
use crate::gpu::kernel::reflect_bindings;
use crate::gpu::{Composer, Features};
use crate::math::{hash_combine, uniform_from_bits};
use crate::scene::{
    AntialiasSettings, CartoonSettings, CartoonStyle, MotionBlurSettings, NoiseFit, NoiseMethod,
    NoiseProfile, NoiseSettings,
};
use crate::stages::EncodedImage;
use crate::stages::antialias::antialias;
use crate::stages::cartoon::cartoon;
use crate::stages::motion_blur::{Copies, draw_copies};
use crate::stages::noise::{NoiseInput, NoiseStage};

const SIZE: (u32, u32) = (101, 67);

fn stages() -> Option<GpuStages> {
    test_device().map(|gpu| GpuStages::new(Arc::clone(gpu)))
}

fn random(index: usize, stream: u32) -> f32 {
    uniform_from_bits(hash_combine(index as u32, stream))
}

/// Blobs, gradients and noise, linear, some of it dark and some above 1.
fn picture(stream: u32) -> Picture {
    let (width, height) = SIZE;
    let linear = (0..(width * height) as usize)
        .map(|i| {
            let (x, y) = ((i as u32 % width) as f32, (i as u32 / width) as f32);
            let blob = |cx: f32, cy: f32, r: f32| f32::from(u8::from((x - cx).hypot(y - cy) < r));
            let base = 0.4 * x / width as f32 + 0.3 * blob(30.0, 30.0, 15.0);
            let rgb = [
                base,
                0.5 * base + 0.4 * blob(70.0, 40.0, 12.0),
                0.9 * y / height as f32,
            ];
            std::array::from_fn(|c| rgb[c] + 0.05 * (random(3 * i + c, stream) - 0.3))
        })
        .collect();
    Picture {
        width,
        height,
        linear,
    }
}

/// A disc with a hard border.
fn mask() -> Vec<f32> {
    (0..SIZE.0 * SIZE.1)
        .map(|i| {
            let (x, y) = ((i % SIZE.0) as f32, (i / SIZE.0) as f32);
            f32::from(u8::from((x - 50.0).hypot(y - 33.0) < 25.0))
        })
        .collect()
}

/// Share of values that differ by more than one 8-bit code, and the largest difference in codes.
fn codes_apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> (f64, i32) {
    let code = |x: f32| i32::from(crate::scene::srgb::encode8(x));
    let apart: Vec<i32> = a
        .as_flattened()
        .iter()
        .zip(b.as_flattened())
        .map(|(a, b)| (code(*a) - code(*b)).abs())
        .collect();
    let beyond = apart.iter().filter(|d| **d > 1).count();
    (
        beyond as f64 / apart.len() as f64,
        apart.into_iter().max().unwrap_or(0),
    )
}

fn profile() -> NoiseProfile {
    let mut profile = NoiseProfile::from_fit(NoiseFit { a: 0.1, b: 9.0 }, 4);
    for (c, lags) in profile.autocorrelation.iter_mut().enumerate() {
        lags[0][2] = 0.5;
        lags[0][4] = 0.5;
        lags[1][3] = 0.4 - 0.1 * c as f64;
        lags[1][2] = 0.2;
        lags[1][4] = 0.2;
    }
    profile.channel_correlation = [0.5, 0.2, 0.4];
    profile
}

#[test]
fn every_kernel_is_valid_and_its_params_are_the_hosts() {
    let sizes = [
        ("stages::antialias", 0, size_of::<AntialiasParams>()),
        ("stages::cartoon", 0, size_of::<CartoonParams>()),
        ("stages::copies", 0, size_of::<CopiesParams>()),
        ("stages::cartoon::flow", 0, size_of::<CartoonParams>()),
        ("stages::cartoon::flow", 1, size_of::<FlowParams>()),
        ("stages::noise", 0, size_of::<NoiseParams>()),
    ];
    for (module, kernel) in STAGE_KERNELS {
        let wgsl = Composer::default()
            .compose(module, kernel, &Features::default())
            .unwrap_or_else(|error| panic!("{kernel}: {error}"));
        let parsed = naga::front::wgsl::parse_str(&wgsl)
            .unwrap_or_else(|error| panic!("{kernel}: {}", error.emit_to_string(&wgsl)));
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        if let Err(error) = validator.validate(&parsed) {
            panic!("{kernel}: {}", error.emit_to_string(&wgsl));
        }
        for binding in reflect_bindings(&wgsl)
            .unwrap()
            .iter()
            .filter(|b| b.uniform)
        {
            let known = sizes
                .iter()
                .find(|(name, group, _)| name == module && *group == binding.group);
            let (_, _, size) = known.expect("a known uniform");
            assert_eq!(*size, binding.stride as usize, "{kernel}");
        }
    }
}

#[test]
fn the_copies_are_the_same() {
    let Some(gpu) = stages() else { return };
    let settings = MotionBlurSettings::default();
    let copies = |blur| Copies::of(blur, &settings).expect("moves enough");
    let layer = |stream: u32| -> Vec<[f32; 4]> {
        let covered = mask();
        (picture(stream).linear.iter().zip(covered))
            .map(|([r, g, b], a)| [r * a, g * a, b * a, a])
            .collect()
    };
    let (far, near) = (layer(3), layer(4));
    let canvas: Vec<[f32; 4]> = (picture(5).linear.iter())
        .map(|[r, g, b]| [*r, *g, *b, 0.0])
        .collect();
    let layers = [
        (far.as_slice(), copies([17.3, -9.1])),
        (near.as_slice(), copies([-5.2, 0.4])),
        (near.as_slice(), Copies::ONE),
    ];
    let mut on_cpu = canvas.clone();
    for (layer, copies) in &layers {
        draw_copies(&mut on_cpu, SIZE, layer, copies);
    }
    let mut on_gpu = canvas.clone();
    gpu.draw_copies(&mut on_gpu, SIZE, &layers).expect("runs");
    let apart = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let worst = apart(&on_cpu, &on_gpu);
    assert!(worst < 1e-5, "{worst}");
    let mut other = canvas.clone();
    gpu.draw_copies(&mut other, SIZE, &layers[..2])
        .expect("runs");
    assert!(apart(&on_cpu, &other) > 0.01, "control: a layer less");
}

#[test]
fn the_cartoon_is_the_same() {
    let Some(gpu) = stages() else { return };
    let image = EncodedImage::from_picture(&picture(1));
    for style in [CartoonStyle::Photometric, CartoonStyle::Flow] {
        let settings = CartoonSettings {
            style,
            shrunk_width: 43,
            shrunk_height: 31,
            s0: 0.02,
            a0: 0.05,
            ..CartoonSettings::default()
        };
        let on_cpu = cartoon(&image, &settings, true);
        let on_gpu = gpu.cartoon(&image, &settings, true).expect("runs");
        let linear = |image: &EncodedImage| image.to_picture().linear;
        let apart = codes_apart(&linear(&on_cpu.image), &linear(&on_gpu.image));
        assert!(apart.1 <= 1, "{style:?}: {apart:?}");
        let (a, b) = (
            on_cpu.edges.expect("asked for"),
            on_gpu.edges.expect("asked for"),
        );
        assert!(
            a.silhouette.iter().any(|s| *s > 0.5),
            "{style:?}: there are lines"
        );
        for (a, b) in [
            (&a.simplified, &b.simplified),
            (&a.original, &b.original),
            (&a.silhouette, &b.silhouette),
        ] {
            let worst = a
                .iter()
                .zip(b)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(worst < 2e-3, "{style:?}: {worst}");
        }
        let other = CartoonSettings {
            iterations: 6,
            ..settings
        };
        let other = gpu.cartoon(&image, &other, false).expect("runs");
        assert!(
            codes_apart(&linear(&on_cpu.image), &linear(&other.image)).1 > 1,
            "control"
        );
    }
}

#[test]
fn noise_is_the_same() {
    let Some(gpu) = stages() else { return };
    let photo = picture(2);
    let mask = mask();
    let soft: Vec<f32> = mask
        .iter()
        .enumerate()
        .map(|(i, m)| m * random(i, 9))
        .collect();
    let ratio: Vec<[f32; 3]> = (0..mask.len()).map(|i| [0.5 + random(i, 10); 3]).collect();
    let variance: Vec<[f32; 3]> = (0..mask.len()).map(|i| [1e-5 * random(i, 11); 3]).collect();
    let full = NoiseInput {
        photo: Some(&photo.linear),
        mask: Some(&soft),
        ratio: Some(&ratio),
        variance: Some(&variance),
    };
    let alone = NoiseInput::default();
    let mut white = profile();
    white.autocorrelation = [crate::scene::WHITE; 3];
    for (profile, method, input) in [
        (profile(), NoiseMethod::Missing, full),
        (profile(), NoiseMethod::Missing, alone),
        (white, NoiseMethod::Missing, full),
        (profile(), NoiseMethod::Textures, full),
    ] {
        let settings = NoiseSettings {
            method,
            texture_size: 64,
            magnification: 2.5,
            ..NoiseSettings::new(profile)
        };
        let stage = NoiseStage::new(&settings, 77);
        let mut source = picture(3);
        for (i, value) in source.linear.iter_mut().enumerate() {
            if soft[i] == 0.0 {
                *value = photo.linear[i];
            }
        }
        let (mut on_cpu, mut on_gpu) = (source.clone(), source.clone());
        stage.apply(&mut on_cpu, &input, 5);
        gpu.noise(&stage, &mut on_gpu, &input, 5).expect("runs");
        let apart = codes_apart(&on_cpu.linear, &on_gpu.linear);
        assert!(apart.0 < 1e-3, "{method:?}: {apart:?}");
        assert!(
            codes_apart(&on_cpu.linear, &source.linear).1 > 3,
            "there is noise"
        );
        if input.photo.is_some() && method == NoiseMethod::Missing {
            for i in (0..soft.len()).filter(|i| soft[*i] == 0.0) {
                assert_eq!(
                    on_gpu.linear[i].map(f32::to_bits),
                    photo.linear[i].map(f32::to_bits)
                );
            }
        }
        let mut other = source.clone();
        gpu.noise(&stage, &mut other, &input, 6).expect("runs");
        assert!(
            codes_apart(&on_cpu.linear, &other.linear).0 > 0.1,
            "control: another frame"
        );
    }
}

#[test]
fn antialiasing_is_the_same() {
    let Some(gpu) = stages() else { return };
    let (source, mask) = (picture(4), mask());
    let settings = AntialiasSettings { beta: 0.8 };
    let (mut on_cpu, mut on_gpu) = (source.clone(), source.clone());
    assert!(antialias(&mut on_cpu, &mask, &settings));
    assert!(gpu.antialias(&mut on_gpu, &mask, &settings).expect("runs"));
    assert!(codes_apart(&on_cpu.linear, &on_gpu.linear).1 <= 1);
    assert!(codes_apart(&on_cpu.linear, &source.linear).1 > 1, "control");
    let mut soft = mask;
    soft[0] = 0.5;
    assert!(!gpu.antialias(&mut on_gpu, &soft, &settings).expect("runs"));
}
