//! Invariant 9: the stated error predicts the true one.

use mixray::film::{Picture, planes};
use mixray::renderer::{ErrorGoal, Renderer, RendererOptions, SCRAMBLES, Watcher};
use mixray::scene::{BackendChoice, Composite, Scene};

use super::support::*;

const SEEDS: u32 = 64;

fn defocused() -> Scene {
    let mut scene = scene(&format!(
        r#"{CAMERA}{TABLE}{LAMP}
[lens]
aperture_radius_m = 0.05
focus_distance_m = 2.4

[[virtual]]
shape = "sphere"
segments = 24
scale = 0.3
translation = [0.1, 0.35, 0]
material = {{ base_color = [0.8, 0.5, 0.3], specular = 0.0 }}
"#
    ));
    scene.settings.max_bounces = 2;
    scene
}

fn goal(standard_error: f64) -> ErrorGoal {
    ErrorGoal {
        standard_error: Some(standard_error),
        noise: None,
        max_rays_per_pixel: 4096,
    }
}

fn to_error(scene: &Scene, backend: BackendChoice, goal: &ErrorGoal) -> Renderer {
    let mut renderer = renderer(scene, backend, RendererOptions::default());
    renderer
        .render_to_error(goal, &Watcher::none())
        .expect("it renders");
    renderer
}

/// Mean square of (estimate - reference) / stated error over the values whose stated error is not 0, and how many these are.
fn squared_z(picture: &Picture, reference: &Picture, variance: &[[f32; 3]]) -> (f64, u32) {
    let values = picture.linear.as_flattened().iter();
    let values = values.zip(reference.linear.as_flattened());
    let (mut sum, mut count) = (0.0, 0);
    for ((x, truth), variance) in values.zip(variance.as_flattened()) {
        if *variance > 0.0 {
            sum += f64::from(x - truth).powi(2) / f64::from(*variance);
            count += 1;
        }
    }
    (sum, count)
}

/// Mean square of z by the stated variance, and by that of the samples.
fn mean_squared_z(mut scene: Scene, standard_error: f64, backend: BackendChoice) -> (f64, f64) {
    scene.settings.rays_per_pixel = 2048;
    scene.settings.seed = 999;
    let reference = render(&scene, backend).picture();
    scene.settings.rays_per_pixel = 16;
    let (mut stated, mut sampled) = ((0.0, 0), (0.0, 0));
    for seed in 0..SEEDS {
        scene.settings.seed = seed;
        let renderer = to_error(&scene, backend, &goal(standard_error));
        let picture = renderer.picture();
        let add = |sum: &mut (f64, u32), variance: &[[f32; 3]]| {
            let (z, n) = squared_z(&picture, &reference, variance);
            *sum = (sum.0 + z, sum.1 + n);
        };
        add(&mut stated, &renderer.planes().variance);
        let photo = renderer.scene().photo.as_ref();
        add(&mut sampled, &planes(renderer.film(), photo).variance);
    }
    let mean = |(sum, n): (f64, u32)| sum / f64::from(n.max(1));
    (mean(stated), mean(sampled))
}

/// The bound of 0.8 to 1.25 is for 200 seeds (`cargo bench --bench adaptive`); fewer get more room. Control: the variance of the samples.
fn the_stated_error_predicts_the_true_one(backend: BackendChoice) {
    let (stated, sampled) = mean_squared_z(defocused(), 0.004, backend);
    assert!((0.75..1.35).contains(&stated), "{stated}");
    assert!(!(0.75..1.35).contains(&sampled), "control: {sampled}");
}

/// Where most pixels are dark and a few samples bright.
fn it_does_so_where_light_is_rare(backend: BackendChoice) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/far/scene.toml");
    let scene = mixray::scene::load(std::path::Path::new(path)).expect("the scene loads");
    let (stated, sampled) = mean_squared_z(mixray::bench::shrink(scene, 10), 0.02, backend);
    assert!((0.75..1.35).contains(&stated), "{stated}");
    assert!(!(0.75..1.35).contains(&sampled), "control: {sampled}");
}

/// The goal is met in every tile unless the rays do not suffice, and a goal a quarter as high takes more rays.
fn the_goal_is_met(backend: BackendChoice) {
    let scene = defocused();
    let coarse = to_error(&scene, backend, &goal(0.01));
    let fine = to_error(&scene, backend, &goal(0.0025));
    for renderer in [&coarse, &fine] {
        let stated = renderer.stated().expect("scrambles");
        assert_eq!(stated.scrambles, SCRAMBLES);
        assert_eq!(stated.tiles_above_goal, 0);
    }
    let stinted = ErrorGoal {
        max_rays_per_pixel: 64,
        ..goal(0.0005)
    };
    let stinted = to_error(&scene, backend, &stinted);
    let most = stinted.film().pixels.iter().map(|sums| sums.n).max();
    assert!(most <= Some(64), "{most:?}");
    let stated = stinted.stated().expect("scrambles");
    assert!(stated.tiles_above_goal > 0, "control: {stated:?}");
    assert!(coarse.error() < 0.01 && fine.error() < 0.0025);
    let rays = |r: &Renderer| r.stated().map_or(0.0, |s| s.mean_rays_per_pixel);
    assert!(rays(&fine) > 1.5 * rays(&coarse));
    assert!(rays(&coarse) >= f64::from(SCRAMBLES));
}

/// However an edge comes to light, late or at once, its real rays are complete, and threads do not matter.
fn edges_are_complete_and_threads_do_not_matter(backend: BackendChoice) {
    for composite in [Composite::Additive, Composite::Quotient] {
        let mut scene = defocused();
        scene.settings.composite = composite;
        let with_threads = |threads: usize| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a thread pool")
                .install(|| to_error(&scene, backend, &goal(0.01)))
        };
        let one = with_threads(1);
        let film = one.film();
        assert!((0..film.pixels.len()).all(|pixel| !film.needs_real(pixel)));
        assert!(film.counts().edge > 20, "{:?}", film.counts());
        assert_eq!(film, with_threads(3).film());
        scene.settings.seed += 1;
        let other = to_error(&scene, backend, &goal(0.01));
        assert_ne!(film, other.film(), "control: the seed shows");
    }
}

/// Nothing virtual: the photograph, no ray, no error.
fn nothing_to_do_is_done(backend: BackendChoice) {
    let scene = scene(&format!("{CAMERA}{TABLE}{LAMP}"));
    let renderer = to_error(&scene, backend, &goal(0.001));
    assert_eq!(renderer.rays().primary, 0);
    assert_eq!(renderer.error(), 0.0);
}

on_the_cpu!(
    the_stated_error_predicts_the_true_one,
    it_does_so_where_light_is_rare,
    the_goal_is_met,
    edges_are_complete_and_threads_do_not_matter,
    nothing_to_do_is_done,
);
