//! `shaders/math.wgsl`, `sampler.wgsl` and `lens.wgsl` against their Rust twins on whatever device there is.

use bytemuck::Zeroable;
use glam::{DMat4, DVec3, Vec3};
use mixray::camera::lens::{camera_project, camera_ray, sample_lens};
use mixray::camera::sampler::{MAX_TOTAL, SampleKey, sample_4d};
use mixray::distortion::LENS_RADIAL;
use mixray::gpu::harness::{Probe, test_device};
use mixray::gpu::{Features, SceneBuffers, SceneParts};
use mixray::math::*;
use mixray::pack::camera::frame_camera;
use mixray::packed::Frame;
use mixray::scene::{Aperture, Camera, Distortion, Lens};

/// Runs `body` on records of `N` words and gives `M` words for each; None, said aloud, without a device.
fn on_gpu<const N: usize, const M: usize>(
    prelude: &str,
    body: &str,
    frame: Option<Frame>,
    inputs: &[[u32; N]],
) -> Option<Vec<[u32; M]>> {
    let gpu = test_device()?;
    let scene = frame.map(|frame| {
        let parts = SceneParts {
            frame,
            ..SceneParts::default()
        };
        SceneBuffers::from_parts(gpu, &parts).expect("uploads")
    });
    let words = Probe {
        features: Features {
            // Without a lens the pinhole variant is the one that is tested.
            lens: frame.is_some_and(|frame| frame.aperture_radius > 0.0),
            lens_models: frame.is_some_and(|frame| frame.lens_model != LENS_RADIAL),
            ..Features::default()
        },
        prelude,
        body,
        input_words: N,
        output_words: M,
        scene: scene.as_ref(),
    }
    .run(gpu, inputs.as_flattened())
    .expect("runs");
    Some(words.as_chunks::<M>().0.to_vec())
}

/// Largest difference in units of the last place, each value taken at least as large as `floor`.
fn max_ulps(found: &[f32], want: &[f32], floor: f32) -> f32 {
    assert_eq!(found.len(), want.len());
    found.iter().zip(want).fold(0.0, |worst, (&f, &w)| {
        assert!(!is_non_finite(f) && !is_non_finite(w), "{f} {w}");
        let ulp = f.abs().max(w.abs()).max(floor) * f32::EPSILON;
        let difference = (f - w).abs();
        // Two equal zeros have no unit.
        f32::max(
            worst,
            if difference == 0.0 {
                0.0
            } else {
                difference / ulp
            },
        )
    })
}

fn floats<const M: usize>(words: &[[u32; M]]) -> Vec<f32> {
    words.iter().flatten().map(|&w| f32::from_bits(w)).collect()
}

fn random(i: u32) -> f32 {
    uniform_from_bits(hash_u32(i.wrapping_add(1)))
}

const SAMPLE: &str = "import package::camera::sampler::{sample_4d, SampleKey};";
const SAMPLE_BODY: &str = "
    let v = sample_4d(SampleKey(input(0u), input(1u), input(2u), input(3u), input(4u)), input(5u));
    output_f32(0u, v.x); output_f32(1u, v.y); output_f32(2u, v.z); output_f32(3u, v.w);";

#[test]
fn samplers_agree_bit_for_bit() {
    let totals = [1, 2, 4, 7, 9, 16, 25, 49, 50, 1000, 65_537, MAX_TOTAL, 0];
    let inputs: Vec<[u32; 6]> = (0..60_000u32)
        .map(|i| {
            let total: u32 = totals[(i / 3) as usize % totals.len()];
            let index = hash_u32(i) % total.max(1);
            let set = if i % 2 == 0 { 0 } else { i % 11 };
            [i / 50, index, total, hash_u32(i / 997), i % 3, set]
        })
        .collect();
    let Some(found) = on_gpu::<6, 4>(SAMPLE, SAMPLE_BODY, None, &inputs) else {
        return;
    };
    let want = |shift: u32| {
        inputs
            .iter()
            .map(|&[pixel, index, total, seed, sampler, set]| {
                let key = SampleKey {
                    pixel,
                    index,
                    total,
                    seed,
                    sampler,
                };
                sample_4d(key, set + shift).map(f32::to_bits)
            })
            .collect::<Vec<_>>()
    };
    for (i, (f, w)) in found.iter().zip(want(0)).enumerate() {
        assert_eq!(*f, w, "{:?}", inputs[i]);
    }
    // The control: neighbouring sets agree nowhere.
    let other = want(1);
    let equal = found.iter().zip(&other).filter(|(f, w)| f == w).count();
    assert!(equal * 100 < found.len());
}

type Unary = (&'static str, fn(f32) -> f32, &'static [(f32, f32)], f32);

#[test]
fn unary_functions_agree() {
    let functions: [Unary; 6] = [
        (
            "sincos_2pi(x).sin",
            |x| sincos_2pi(x).0,
            &[(-2.0, 2.0), (0.0, 1e5)],
            0.5,
        ),
        (
            "sincos_2pi(x).cos",
            |x| sincos_2pi(x).1,
            &[(-2.0, 2.0), (0.0, 1e5)],
            0.5,
        ),
        ("acos_(x)", acos_, &[(-1.0, 1.0), (0.9999, 1.1)], 0.0),
        ("exp_(x)", exp_, &[(-90.0, 90.0), (-1.0, 1.0)], 0.0),
        ("log_(x)", log_, &[(1e-6, 4.0), (-1.0, 1e30)], 0.0),
        ("safe_sqrt(x)", safe_sqrt, &[(-1.0, 10.0)], 0.0),
    ];
    let prelude = "import package::math::{sincos_2pi, acos_, exp_, log_, safe_sqrt};";
    for (call, twin, ranges, floor) in functions {
        let inputs: Vec<f32> = ranges
            .iter()
            .flat_map(|&(from, to)| (0..20_000).map(move |i| from + (to - from) * random(i)))
            .collect();
        let words: Vec<[u32; 1]> = inputs.iter().map(|x| [x.to_bits()]).collect();
        let body = format!("let x = input_f32(0u); output_f32(0u, {call});");
        let Some(found) = on_gpu::<1, 1>(prelude, &body, None, &words) else {
            return;
        };
        let want: Vec<f32> = inputs.iter().map(|&x| twin(x)).collect();
        let ulps = max_ulps(&floats(&found), &want, floor);
        eprintln!("{call}: {ulps} ulp");
        assert!(ulps <= 2.0, "{call}: {ulps} ulp");
        // The control: four units in the last place are seen.
        let spoiled: Vec<f32> = want
            .iter()
            .map(|w| w * (1.0 + 4.0 * f32::EPSILON))
            .collect();
        assert!(max_ulps(&floats(&found), &spoiled, floor) > 2.0, "{call}");
    }
}

#[test]
fn vector_functions_agree() {
    let inputs: Vec<[u32; 3]> = (0..20_000)
        .map(|i| {
            let v = [0, 1, 2].map(|d| 2.0 * random(3 * i + d) - 1.0);
            v.map(|x| (x * 10.0_f32.powi(i as i32 % 7 - 3)).to_bits())
        })
        .collect();
    let prelude = "import package::math::{atan2_, uniform_from_bits, orthonormal_basis, luminance};
        import package::math::{dot3, cross3, length3, normalize3};";
    let body = "
        let v = input_vec3(0u);
        let n = normalize3(v);
        let basis = orthonormal_basis(n);
        output_vec3(0u, n); output_vec3(3u, basis.t); output_vec3(6u, basis.b);
        output_f32(9u, length3(v)); output_f32(10u, atan2_(v.y, v.x));
        output_f32(11u, uniform_from_bits(input(0u)));
        output_vec3(12u, cross3(n, vec3<f32>(0.6, 0.0, 0.8)));
        output_f32(15u, luminance(abs(v)));
        output_f32(16u, dot3(n, basis.t));";
    let Some(found) = on_gpu::<3, 17>(prelude, body, None, &inputs) else {
        return;
    };
    let want = |scale: f32| -> Vec<f32> {
        inputs
            .iter()
            .flat_map(|w| {
                let v = Vec3::from(w.map(f32::from_bits));
                let n = normalize3(v) * scale;
                let (t, b) = orthonormal_basis(n);
                let mut row = Vec::with_capacity(17);
                for u in [n, t, b] {
                    row.extend(u.to_array());
                }
                row.extend([length3(v), atan2_(v.y, v.x), uniform_from_bits(w[0])]);
                row.extend(cross3(n, Vec3::new(0.6, 0.0, 0.8)).to_array());
                row.extend([luminance(v.abs()), dot3(n, t)]);
                row
            })
            .collect()
    };
    // Differences of nearly equal products are compared at the scale of the products.
    let ulps = max_ulps(&floats(&found), &want(1.0), 0.5);
    eprintln!("vectors: {ulps} ulp");
    assert!(ulps <= 3.0, "{ulps}");
    assert!(max_ulps(&floats(&found), &want(1.00001), 0.5) > 3.0);
}

#[test]
fn bit_tests_and_hashes_agree() {
    let special = [
        0,
        1,
        0x7f7f_ffff,
        0x7f80_0000,
        0xff80_0000,
        0x7fc0_0001,
        0x8000_0000,
    ];
    let inputs: Vec<[u32; 2]> = special
        .into_iter()
        .flat_map(|a| [[a, 7], [hash_u32(a), a]])
        .collect();
    let prelude = "import package::math::{hash_combine, is_non_finite};";
    let body = "output(0u, hash_combine(input(0u), input(1u)));
        output(1u, u32(is_non_finite(input_f32(0u))));";
    let Some(found) = on_gpu::<2, 2>(prelude, body, None, &inputs) else {
        return;
    };
    for ([a, b], found) in inputs.iter().zip(found) {
        assert_eq!(found[0], hash_combine(*a, *b));
        assert_ne!(found[0], hash_combine(*a, b + 1));
        assert_eq!(found[1] == 1, is_non_finite(f32::from_bits(*a)), "{a:x}");
    }
}

fn frame(distortion: Distortion, aperture: Aperture, aperture_radius_m: f64) -> Frame {
    let camera = Camera {
        width: 640,
        height: 480,
        fx: 520.9,
        fy: 521.0,
        cx: 325.6,
        cy: 250.2,
        distortion,
        world_from_camera: DMat4::from_translation(DVec3::new(0.4, 0.2, -0.7))
            * DMat4::from_rotation_y(0.7)
            * DMat4::from_rotation_x(-0.3),
    };
    let lens = Lens {
        aperture_radius_m,
        focus_distance_m: 1.2,
        aperture,
        blade_rotation_deg: 20.0,
        focal_length_m: 0.0,
    };
    let mut frame = Frame::zeroed();
    frame_camera(&camera, &lens, DVec3::ZERO, &mut frame);
    frame
}

#[test]
fn camera_rays_agree() {
    let prelude = "import package::camera::lens::{camera_ray, camera_project, sample_lens};";
    let body = "
        let ray = camera_ray(input_f32(0u), input_f32(1u), input_f32(2u), input_f32(3u));
        let seen = camera_project(ray.origin + 2.0 * ray.direction);
        let on_lens = sample_lens(input_f32(2u), input_f32(3u));
        output_vec3(0u, ray.origin); output_vec3(3u, ray.direction);
        output_f32(6u, on_lens.x / 0.05); output_f32(7u, on_lens.y / 0.05);
        output_f32(8u, seen.px / 640.0); output_f32(9u, seen.py / 640.0); output_f32(10u, seen.depth);
        output_f32(11u, f32(seen.valid));";
    let inputs: Vec<[u32; 4]> = (0..10_000)
        .map(|i| {
            let v = [0, 1, 2, 3].map(|d| random(4 * i + d));
            [v[0] * 640.0, v[1] * 480.0, v[2], v[3]].map(f32::to_bits)
        })
        .collect();
    let none = Distortion::NONE;
    let barrel = Distortion::opencv(&[-0.28, 0.09, 0.0005, -0.0003, -0.01]).unwrap();
    let rational = Distortion::opencv(&[
        0.2, -0.05, 0.001, -0.0015, 0.002, 0.35, 0.02, 0.001, 0.0012, -0.0008, 0.0006, 0.0004,
    ]);
    let rational = rational.unwrap();
    let fisheye = Distortion::fisheye([0.05, -0.02, 0.004, -0.0005]);
    for (distortion, aperture, radius) in [
        (none, Aperture::Disc, 0.0),
        (none, Aperture::Disc, 0.05),
        (barrel, Aperture::Disc, 0.0),
        (barrel, Aperture::Square, 0.05),
        (none, Aperture::Blades(5), 0.05),
        (rational, Aperture::Disc, 0.0),
        (rational, Aperture::Disc, 0.05),
        (fisheye, Aperture::Disc, 0.0),
        (fisheye, Aperture::Disc, 0.05),
    ] {
        let frame = frame(distortion, aperture, radius);
        let Some(found) = on_gpu::<4, 12>(prelude, body, Some(frame), &inputs) else {
            return;
        };
        // Where a lens sample is aimed at the border, one ulp decides whether the point is inside the photograph.
        let clear = |x: f32, end: f32| (x * 640.0).abs() > 1e-3 && (x * 640.0 - end).abs() > 1e-3;
        let want = |frame: &Frame| -> Vec<f32> {
            inputs
                .iter()
                .flat_map(|w| {
                    let [px, py, u, v] = w.map(f32::from_bits);
                    let ray = camera_ray(frame, px, py, u, v);
                    let seen = camera_project(frame, ray.origin + 2.0 * ray.direction);
                    let at = sample_lens(frame, u, v);
                    let mut row = Vec::with_capacity(12);
                    row.extend(ray.origin.to_array());
                    row.extend(ray.direction.to_array());
                    row.extend([at[0] / 0.05, at[1] / 0.05]);
                    row.extend([seen.px / 640.0, seen.py / 640.0, seen.depth]);
                    row.push(f32::from(u8::from(seen.valid)));
                    row
                })
                .collect()
        };
        let decided = |rows: &[f32], by: &[f32]| -> Vec<f32> {
            let rows = rows.as_chunks::<12>().0.iter();
            rows.zip(by.as_chunks::<12>().0)
                .filter(|(_, by)| clear(by[8], 640.0) && clear(by[9], 480.0))
                .flat_map(|(row, _)| *row)
                .collect()
        };
        let (found, expected) = (floats(&found), want(&frame));
        let ulps = max_ulps(
            &decided(&found, &expected),
            &decided(&expected, &expected),
            0.5,
        );
        eprintln!("{aperture:?}, radius {radius}, distortion {distortion:?}: {ulps} ulp");
        // The projection multiplies a rounding of the ray by the focal length.
        assert!(ulps <= 6.0, "{ulps}");
        let mut moved = frame;
        moved.intrinsics[2] += 0.01;
        assert!(max_ulps(&found, &want(&moved), 0.5) > 6.0);
    }
}
