//! Ranges of samples: put together in any way they are one run, whatever moves in the scene.

use std::time::Duration;

use mixray::film::{Film, PixelSums};
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{BackendChoice, Scene};

use crate::support::scene;

const RAYS: u32 = 8;
const ALL: (u32, u32) = (0, RAYS);
const SPLITS: [&[u32]; 9] = [
    &[1],
    &[2],
    &[3],
    &[4],
    &[5],
    &[6],
    &[7],
    &[1, 4, 5],
    &[1, 2, 3, 4, 5, 6, 7],
];
/// Two units in the last place of an f32.
const TOLERANCE: f64 = 2.4e-7;

const CAMERA: &str = "[camera]\nwidth = 16\nheight = 12\nvertical_fov_deg = 40\nposition = [0, 0.3, 0.7]\nlook_at = [0, 0.05, 0]\n";
const CAMERA_ON_ITS_WAY: &str = "[camera]\nwidth = 16\nheight = 12\nvertical_fov_deg = 40\n[[camera.motion]]\ntime_secs = 0.0\nposition = [0, 0.3, 0.7]\nlook_at = [0, 0.05, 0]\n\
    [[camera.motion]]\ntime_secs = 0.1\nposition = [0.1, 0.3, 0.7]\nlook_at = [0.1, 0.05, 0]\n";
const FLOOR_AND_BALL: &str = "[environment]\nradiance = [1, 1, 1]\n[[real]]\nshape = \"quad\"\ncorner = [-0.5, 0, 0.5]\nedge_u = [1, 0, 0]\nedge_v = [0, 0, -1]\n\
    material = { base_color = [0.5, 0.5, 0.5] }\n[[virtual]]\nshape = \"sphere\"\nsegments = 12\nscale = 0.06\n";
const BALL_MOTION: &str = "[[virtual.motion]]\ntime_secs = 0.0\ntranslation = [0, 0, 0]\n[[virtual.motion]]\ntime_secs = 0.1\ntranslation = [0.05, 0, 0]\n";
const EXPOSURE: &str = "[shutter]\ntime_secs = 0.05\nexposure_secs = 0.02\n";
const READOUT: &str = "readout_secs = 0.01\n";

struct Kind {
    name: &'static str,
    text: String,
    all_planes: bool,
}

fn kinds() -> Vec<Kind> {
    let ball = |parts: &[&str]| [CAMERA, FLOOR_AND_BALL, &parts.concat()].concat();
    let render = format!("[render]\nrays_per_pixel = {RAYS}\nmax_bounces = 1\n");
    let quotient = format!("{render}composite = \"quotient\"\n");
    let few = [BALL_MOTION, EXPOSURE, READOUT, "samples = 3\n"].concat();
    let at_once = "[shutter]\ntime_secs = 0.05\nexposure_secs = 0\nreadout_secs = 0.05\n";
    let kind = |name, text, all_planes| Kind {
        name,
        text,
        all_planes,
    };
    vec![
        kind("still", ball(&[&render]), false),
        kind("still, with planes", ball(&[&render]), true),
        kind("still, quotient", ball(&[&quotient]), false),
        kind(
            "moving camera",
            [
                CAMERA_ON_ITS_WAY,
                FLOOR_AND_BALL,
                EXPOSURE,
                READOUT,
                &render,
            ]
            .concat(),
            false,
        ),
        kind(
            "moving object",
            ball(&[BALL_MOTION, EXPOSURE, &render]),
            false,
        ),
        kind(
            "moving object, read row by row",
            ball(&[BALL_MOTION, EXPOSURE, READOUT, &render]),
            false,
        ),
        kind(
            "moving object, every row at once",
            ball(&[BALL_MOTION, at_once, &render]),
            false,
        ),
        kind(
            "moving object, few instants, quotient",
            ball(&[&few, &quotient]),
            false,
        ),
        kind(
            "moving object, few instants, with planes",
            ball(&[&few, &render]),
            true,
        ),
        kind(
            "everything moves, with planes",
            [CAMERA_ON_ITS_WAY, FLOOR_AND_BALL, &few, &render].concat(),
            true,
        ),
    ]
}

fn renderer(scene: &Scene, range: (u32, u32), all_planes: bool) -> Renderer {
    let options = RendererOptions {
        sample_range: Some(range),
        guides: all_planes,
        real_everywhere: all_planes,
        ..RendererOptions::default()
    };
    Renderer::new(scene.clone(), options, &Watcher::none()).expect("fits")
}

fn rendered(scene: &Scene, range: (u32, u32), all_planes: bool) -> Renderer {
    let mut renderer = renderer(scene, range, all_planes);
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .expect("renders");
    assert_eq!(
        renderer.samples(),
        range.1 - range.0,
        "all rays of {range:?} are rendered"
    );
    renderer
}

fn load(text: &str) -> Scene {
    let mut scene = scene(text);
    scene.settings.backend = BackendChoice::Cpu;
    scene
}

/// Every sample counted once, and sums that differ by rounding alone.
fn are_one_run(a: &Film, b: &Film) -> bool {
    let counts = |sums: &PixelSums| (sums.n, sums.m, sums.n_real, sums.sample_factor);
    let sums = |film: &Film| -> Vec<f64> {
        let guides = film.guides.iter();
        let guides = guides.flat_map(|g| {
            let vectors = [g.normal, g.albedo].map(|sum| sum.value().to_array());
            [vectors[0], vectors[1], [g.depth(), f64::from(g.hits), 0.0]]
        });
        let pixels = film.pixels.iter();
        let pixels = pixels
            .flat_map(|p| [p.m_im, p.diff, p.m_ir, p.r_ir, p.sq].map(|sum| sum.value().to_array()));
        let groups = film.groups.iter();
        let groups = groups.flat_map(|g| g.diff.map(|sum| sum.value().to_array()));
        pixels.chain(guides).chain(groups).flatten().collect()
    };
    let near = |(a, b): (f64, f64)| (a - b).abs() <= TOLERANCE * a.abs().max(b.abs());
    a.pixels.iter().map(counts).eq(b.pixels.iter().map(counts))
        && sums(a).into_iter().zip(sums(b)).all(near)
}

#[test]
fn every_split_of_every_kind_of_scene_merges_to_one_run() {
    for Kind {
        name,
        text,
        all_planes,
    } in kinds()
    {
        let scene = load(&text);
        let whole = rendered(&scene, ALL, all_planes);
        let counts = whole.film().counts();
        assert!(
            counts.edge > 4 && counts.background > 4,
            "{name}: {counts:?}"
        );
        for split in SPLITS {
            let ends: Vec<u32> = [&[0], split, &[RAYS]].concat();
            let mut parts: Vec<Renderer> = ends
                .windows(2)
                .map(|ends| rendered(&scene, (ends[0], ends[1]), all_planes))
                .collect();
            let mut merged = parts.swap_remove(0);
            assert!(
                !are_one_run(whole.film(), merged.film()),
                "control: {name}: a part is not the whole"
            );
            parts.sort_by_key(|part| part.film().first_sample);
            for part in &parts {
                merged.merge(part.film()).expect("they follow one another");
            }
            assert!(
                are_one_run(whole.film(), merged.film()),
                "{name}, {split:?}"
            );
        }
        // The same samples of another render of the scene.
        let mut other = scene.clone();
        other.settings.seed += 1;
        let mut mixed = rendered(&scene, (0, 3), all_planes);
        let film = rendered(&other, (3, RAYS), all_planes);
        if mixed.merge(film.film()).is_ok() {
            assert!(!are_one_run(whole.film(), mixed.film()), "control: {name}");
        }
    }
}

/// However often it is asked to go on, and wherever it is stopped, the film ends with the bits of one run.
#[test]
fn a_render_in_steps_is_one_run() {
    for Kind {
        name,
        text,
        all_planes,
    } in kinds()
    {
        let scene = load(&text);
        for range in [ALL, (2, 7)] {
            let whole = rendered(&scene, range, all_planes);
            let pixels = u64::from(scene.camera.width * scene.camera.height);
            for budget in [
                Budget::Rays(pixels),
                Budget::Rays(3 * pixels),
                Budget::Time(Duration::from_millis(1)),
            ] {
                let mut steps = renderer(&scene, range, all_planes);
                let mut calls = 0;
                while steps.samples() < range.1 - range.0 {
                    steps.advance(budget, &Watcher::none()).expect("renders");
                    calls += 1;
                    assert!(calls < 10_000, "{name}, {range:?}: {budget:?} does not end");
                    if let Budget::Rays(rays) = budget {
                        let asked = calls * (rays / pixels) as u32;
                        assert_eq!(steps.samples(), asked.min(range.1 - range.0), "{name}");
                    }
                }
                assert!(
                    whole.film() == steps.film(),
                    "{name}, {range:?}, {budget:?}"
                );
            }
            let shorter = rendered(&scene, (range.0, range.1 - 1), all_planes);
            assert!(whole.film() != shorter.film(), "control: {name}");
        }
    }
}
