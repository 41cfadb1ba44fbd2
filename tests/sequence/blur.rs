//! Ray-traced shutter time against profiles worked out by hand.

use mixray::film::Film;
use mixray::gpu::harness::test_device;
use mixray::renderer::{Renderer, RendererOptions, Watcher};
use mixray::scene::BackendChoice;

use super::support::{CAMERA, SQUARE, mask_row, render};
use crate::support::{largest, scene};

const SHUTTER: &str = "[shutter]\nexposure_secs = 0.5\n[render]\nrays_per_pixel = 256\n";
/// 0.2 m, or 20 px, in the half second for which the shutter is open.
const OBJECT_MOTION: &str = "[[virtual.motion]]\ntime_secs = -1\ntranslation = [-0.4, 0, 0]\n[[virtual.motion]]\ntime_secs = 1\ntranslation = [0.4, 0, 0]\n";
const CAMERA_MOTION: &str = "[[camera.motion]]\ntime_secs = -1\nposition = [0.4, 0, 0]\nlook_at = [0.4, 0, -1]\n[[camera.motion]]\ntime_secs = 1\nposition = [-0.4, 0, 0]\nlook_at = [-0.4, 0, -1]\n";

/// Share of pixel `x` that lies right of an edge which moves from `from` to `to` at a constant rate, over the time: the mean over the
/// pixel of a linear ramp.
fn ramp(x: usize, from: f64, to: f64) -> f64 {
    // Integral of the clamped ramp.
    let integral = |x: f64| {
        let t = (x - from).clamp(0.0, to - from);
        t * t / (2.0 * (to - from)) + (x - to).max(0.0)
    };
    integral(x as f64 + 1.0) - integral(x as f64)
}

/// M of the square whose edges at rest are at 28 and 68 px, smeared over `width` px about its place.
fn smeared(x: usize, width: f64) -> f64 {
    let half = 0.5 * width;
    ramp(x, 28.0 - half, 28.0 + half) - ramp(x, 68.0 - half, 68.0 + half)
}

fn worst(found: &[f64], expected: impl Fn(usize) -> f64) -> f64 {
    largest((0..found.len()).map(|x| found[x] - expected(x)))
}

#[test]
fn a_moving_object_and_a_moving_camera_smear_a_square_into_linear_ramps() {
    for (name, text) in [
        (
            "object",
            format!("{CAMERA}{SQUARE}{OBJECT_MOTION}{SHUTTER}"),
        ),
        (
            "camera",
            format!("{CAMERA}{CAMERA_MOTION}{SQUARE}{SHUTTER}"),
        ),
        (
            "jittered",
            format!("{CAMERA}{CAMERA_MOTION}{SQUARE}{SHUTTER}sampler = \"jittered\"\n"),
        ),
    ] {
        let row = mask_row(&render(&text, BackendChoice::Cpu), 12);
        let error = worst(&row, |x| smeared(x, 20.0));
        assert!(error < 0.02, "{name}: {error}");
        assert!(
            worst(&row, |x| smeared(x, 16.0)) > 0.05,
            "control: another width"
        );
    }
}

/// Rows are read one after the other: a moving edge leans.
#[test]
fn a_rolling_shutter_leans_by_the_readout() {
    let rolling = "[shutter]\nexposure_secs = 0.0\nreadout_secs = 0.5\nsamples = 64\n[render]\nrays_per_pixel = 64\n";
    for (name, text) in [
        (
            "object",
            format!("{CAMERA}{SQUARE}{OBJECT_MOTION}{rolling}"),
        ),
        (
            "camera",
            format!("{CAMERA}{CAMERA_MOTION}{SQUARE}{rolling}"),
        ),
    ] {
        let renderer = render(&text, BackendChoice::Cpu);
        for row in [0, 6, 12, 23] {
            // The centre moves by 40 px a second, and the row is read this long after the middle one.
            let seconds = 0.5 * (f64::from(row) / 23.0 - 0.5);
            let expected = 48.0 + 40.0 * seconds;
            let mask = mask_row(&renderer, row);
            let area: f64 = mask.iter().sum();
            let centre = mask
                .iter()
                .enumerate()
                .map(|(x, m)| (x as f64 + 0.5) * m)
                .sum::<f64>()
                / area;
            assert!(
                (area - 40.0).abs() < 0.3,
                "{name}: sharp, row {row}: {area}"
            );
            assert!(
                (centre - expected).abs() < 0.5,
                "{name}, row {row}: {centre}, not {expected}"
            );
        }
    }
}

/// Exposure and readout at once: each row is a ramp of the exposure's width about its own place.
#[test]
fn a_rolling_shutter_with_exposure_smears_each_row_about_its_own_place() {
    let both =
        "[shutter]\nexposure_secs = 0.25\nreadout_secs = 0.25\n[render]\nrays_per_pixel = 256\n";
    for (name, text) in [
        ("object", format!("{CAMERA}{SQUARE}{OBJECT_MOTION}{both}")),
        ("camera", format!("{CAMERA}{CAMERA_MOTION}{SQUARE}{both}")),
    ] {
        let renderer = render(&text, BackendChoice::Cpu);
        for row in [0, 10, 23] {
            let shift = 40.0 * 0.25 * (f64::from(row) / 23.0 - 0.5);
            let edge = |x: usize, at: f64| ramp(x, at + shift - 5.0, at + shift + 5.0);
            let mask = mask_row(&renderer, row);
            let error = worst(&mask, |x| edge(x, 28.0) - edge(x, 68.0));
            assert!(error < 0.06, "{name}, row {row}: {error}");
        }
    }
}

fn same(a: &Film, b: &Film) -> bool {
    a == b
}

#[test]
fn what_does_not_move_is_bit_identical_with_and_without_a_shutter() {
    let ball = "[environment]\nradiance = [1, 1, 1]\n[[real]]\nshape = \"quad\"\ncorner = [-2, -0.3, 0]\nedge_u = [4, 0, 0]\nedge_v = [0, 0, -4]\n[[virtual]]\nshape = \"sphere\"\nsegments = 16\nscale = 0.1\ntranslation = [0, 0, -1]\n";
    let still = "[[camera.motion]]\ntime_secs = -1\nposition = [0, 0, 0.5]\nlook_at = [0, 0, -1]\n[[camera.motion]]\ntime_secs = 1\nposition = [0, 0, 0.5]\nlook_at = [0, 0, -1]\n";
    let resting = "[[virtual.motion]]\ntime_secs = -9\ntranslation = [0, 0, 0]\n[[virtual.motion]]\ntime_secs = -3\ntranslation = [0, 0, 0]\n";
    let placed = "position = [0, 0, 0.5]\nlook_at = [0, 0, -1]\n";
    let render_text = "[render]\nrays_per_pixel = 16\n";
    let mut backends = vec![BackendChoice::Cpu];
    if test_device().is_some() {
        backends.push(BackendChoice::Gpu);
    }
    for backend in backends {
        let off = render(&format!("{CAMERA}{placed}{ball}{render_text}"), backend);
        let shutter = "[shutter]\nexposure_secs = 0.5\nreadout_secs = 0.1\n[motion_blur]\n";
        let on = render(
            &format!("{CAMERA}{still}{ball}{resting}{render_text}{shutter}"),
            backend,
        );
        assert!(!on.is_moving());
        assert!(same(off.film(), on.film()));
        let moving = still.replace(
            "time_secs = 1\nposition = [0, 0, 0.5]",
            "time_secs = 1\nposition = [0, 0, 0.6]",
        );
        let moved = render(
            &format!("{CAMERA}{moving}{ball}{resting}{render_text}{shutter}"),
            backend,
        );
        assert!(
            moved.is_moving() && !same(off.film(), moved.film()),
            "control"
        );
        let copies = render(
            &format!("{CAMERA}{moving}{ball}{resting}{render_text}{shutter}method = \"copies\"\n"),
            backend,
        );
        assert!(!copies.is_moving(), "the copies are no part of the rays");
    }
}

/// Both backends move the objects alike.
#[test]
fn moving_objects_are_the_same_on_the_gpu() {
    if test_device().is_none() {
        return;
    }
    let text = format!(
        "{CAMERA}[environment]\nradiance = [1, 1, 1]\n[[real]]\nshape = \"quad\"\ncorner = [-2, -0.1, 0]\nedge_u = [4, 0, 0]\nedge_v = [0, 0, -4]\nmaterial = {{ base_color = [0.5, 0.5, 0.5] }}\n\
         [[virtual]]\nshape = \"sphere\"\nsegments = 16\nscale = 0.1\ntranslation = [0, 0, -1]\n{OBJECT_MOTION}[shutter]\nexposure_secs = 0.2\nreadout_secs = 0.1\nsamples = 4\n[render]\nrays_per_pixel = 8\nmax_bounces = 1\n"
    );
    let [cpu, gpu] = [BackendChoice::Cpu, BackendChoice::Gpu].map(|backend| render(&text, backend));
    let values = |renderer: &Renderer| -> Vec<f64> {
        let pixels = renderer.film().pixels.iter();
        pixels
            .flat_map(|p| {
                let n = f64::from(p.n.max(1));
                [
                    p.m_im.value().y / n,
                    p.diff.value().y / n,
                    p.m_ir.value().y / n,
                    f64::from(p.m) / n,
                ]
            })
            .collect()
    };
    let (a, b) = (values(&cpu), values(&gpu));
    let far = a
        .iter()
        .zip(&b)
        .filter(|(a, b)| (*a - *b).abs() > 1e-4 * a.abs() + 1e-5)
        .count();
    assert!(far as f64 <= 1e-3 * a.len() as f64, "{far} of {}", a.len());
    assert!(cpu.film().counts().edge > 100);
}

/// In parts or at once, and however often it is asked to go on.
#[test]
fn a_moving_scene_rendered_in_steps_is_the_same() {
    let text = format!(
        "{CAMERA}{SQUARE}{OBJECT_MOTION}[shutter]\nexposure_secs = 0.5\nsamples = 5\n[render]\nrays_per_pixel = 16\nbackend = \"cpu\"\n"
    );
    let whole = render(&text, BackendChoice::Cpu);
    let mut steps =
        Renderer::new(scene(&text), RendererOptions::default(), &Watcher::none()).expect("fits");
    for _ in 0..40 {
        steps
            .advance(mixray::renderer::Budget::Rays(96 * 24), &Watcher::none())
            .expect("renders");
    }
    assert_eq!(steps.samples(), 16);
    assert!(same(whole.film(), steps.film()));
}
