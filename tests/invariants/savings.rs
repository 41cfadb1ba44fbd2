//! What is left out changes the result no more than is said of it, and is worth it: each saving with its switch on and off.

use std::ops::Range;

use mixray::film::Picture;
use mixray::renderer::{CameraNoise, ErrorGoal, Renderer, RendererOptions, Skip, Watcher};
use mixray::scene::{BackendChoice, NoiseFit, Scene};

use super::support::*;

/// Pictures that are compared bit by bit.
const SEEDS: u32 = 16;
/// From 8 on the pilot measures.
const RAYS: u32 = 16;

const LENS: &str = "
[lens]
aperture_radius_m = 0.05
focus_distance_m = 2.4
";
const SKY: &str = "
[environment]
radiance = [0.8, 0.9, 1.0]
";

/// A ball out of focus on a table, under these lights, with something behind it to look at.
fn ball_under(lights: &str, radius_m: f64, max_bounces: u32) -> Scene {
    let mut scene = scene(&format!(
        r#"{CAMERA}{LENS}{TABLE}{lights}
[[real]]
shape = "quad"
corner = [-0.9, 0, -0.9]
edge_u = [0.7, 0, 0]
edge_v = [0, 0.5, 0]
material = {{ base_color = [0.4, 0.6, 0.7], specular = 0.0 }}

[[virtual]]
shape = "sphere"
segments = 24
scale = {radius_m}
translation = [0.1, {height_m}, 0]
material = {{ base_color = [0.8, 0.5, 0.3], specular = 0.0 }}
"#,
        height_m = radius_m + 0.05
    ));
    scene.settings.max_bounces = max_bounces;
    scene.settings.rays_per_pixel = RAYS;
    scene
}

/// Every surface mirrors, roughly.
fn glossy(mut scene: Scene) -> Scene {
    for object in &mut scene.objects {
        for instance in &mut object.instances {
            let material = std::sync::Arc::make_mut(&mut instance.material);
            (material.specular, material.roughness) = (1.0, 0.5);
        }
    }
    scene
}

fn without(scene: &Scene, backend: BackendChoice, skip: Option<Skip>) -> Renderer {
    let options = RendererOptions {
        without: skip.into_iter().collect(),
        ..RendererOptions::default()
    };
    renderer(scene, backend, options)
}

/// A picture a seed, and the rays of all together.
struct Pictures {
    pictures: Vec<Picture>,
    rays: u64,
}

impl Pictures {
    fn of(mut renderer: Renderer, seeds: Range<u32>, goal: Option<&ErrorGoal>) -> Self {
        let pictures = seeds.map(|seed| {
            renderer
                .set_samples(RAYS, seed, &Watcher::none())
                .expect("it restarts");
            match goal {
                None => complete(&mut renderer),
                Some(goal) => renderer
                    .render_to_error(goal, &Watcher::none())
                    .expect("it renders"),
            }
            renderer.picture()
        });
        Self {
            pictures: pictures.collect(),
            rays: renderer.rays().traced(),
        }
    }

    fn block_means(&self) -> Vec<Vec<f64>> {
        self.pictures.iter().map(block_means).collect()
    }

    /// Variance of a pixel, mean over the picture.
    fn variance(&self) -> f64 {
        let count = self.pictures.len() as f64;
        let pixels = self.pictures[0].linear.len();
        let of_pixel = |pixel: usize| {
            let values: Vec<f64> = (self.pictures.iter().map(|p| grey(p.linear[pixel]))).collect();
            let mean = mean(&values);
            values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0)
        };
        mean(&(0..pixels).map(of_pixel).collect::<Vec<_>>())
    }

    /// Rays times squared error.
    fn cost(&self) -> f64 {
        self.rays as f64 * self.variance()
    }
}

/// The same bits from fewer rays.
fn nothing_changes(scene: &Scene, backend: BackendChoice, skip: Skip) {
    let with = Pictures::of(without(scene, backend, None), 0..SEEDS, None);
    let without = Pictures::of(without(scene, backend, Some(skip)), 0..SEEDS, None);
    for (a, b) in with.pictures.iter().zip(&without.pictures) {
        assert!(bits(a) == bits(b), "{skip:?}");
    }
    let [first, second] = [0, 1].map(|seed| bits(&with.pictures[seed]));
    assert!(first != second, "control: another seed shows");
    eprintln!("{skip:?}: {} rays instead of {}", with.rays, without.rays);
    assert!(with.rays < without.rays, "{skip:?}");
}

/// Independent renders with the saving and without.
fn pair(
    scene: &Scene,
    backend: BackendChoice,
    skip: Skip,
    goal: Option<&ErrorGoal>,
    seeds: u32,
) -> [Pictures; 2] {
    let with = Pictures::of(without(scene, backend, None), 0..seeds, goal);
    let without = Pictures::of(without(scene, backend, Some(skip)), seeds..2 * seeds, goal);
    eprintln!(
        "{skip:?}: {} rays, variance {:.3e}; without {} rays, variance {:.3e}",
        with.rays,
        with.variance(),
        without.rays,
        without.variance()
    );
    [with, without]
}

/// The same expectation. Control: one that is darker by 2% of each block, shadows too.
fn same_expectation([with, without]: &[Pictures; 2], skip: Skip) {
    let (a, b) = (with.block_means(), without.block_means());
    let difference = Difference::between(&a, &b);
    assert!(difference.is_none(), "{skip:?}: {difference}");
    let darker: Vec<Vec<f64>> = (b.iter())
        .map(|means| means.iter().map(|x| x - 0.02 * x.abs()).collect())
        .collect();
    let control = Difference::between(&a, &darker);
    eprintln!("{skip:?}: {difference}; control: {control}");
    assert!(!control.is_none(), "control: {control}");
}

/// In the corners there is nothing but sky.
fn out_of_reach_changes_nothing(backend: BackendChoice) {
    let mut scene = scene(&format!(
        r#"{CAMERA}{LENS}{SKY}
[[real]]
shape = "quad"
corner = [-0.4, 0, 0.4]
edge_u = [0.8, 0, 0]
edge_v = [0, 0, -0.8]

[[virtual]]
shape = "sphere"
segments = 24
scale = 0.2
translation = [0.1, 0.25, 0]
"#
    ));
    scene.settings.max_bounces = 2;
    nothing_changes(&scene, backend, Skip::OutOfReach);
}

fn edge_real_changes_nothing(backend: BackendChoice) {
    nothing_changes(&ball_under(LAMP, 0.3, 2), backend, Skip::EdgeReal);
}

/// Lamps without size, with size, and a sky; on glossy ground, which mirrors the lamp, and on matt ground.
fn virtual_first_changes_nothing(backend: BackendChoice) {
    let point = "
[[light]]
kind = \"point\"
position = [1, 1.5, 1]
intensity = [2, 2, 2.5]
";
    let matt = ball_under(&[LAMP, SKY, point].concat(), 0.3, 3);
    for scene in [glossy(matt.clone()), matt] {
        nothing_changes(&scene, backend, Skip::VirtualFirst);
    }
}

fn the_plan_saves_error(backend: BackendChoice) {
    let pair = pair(&ball_under(SKY, 0.12, 2), backend, Skip::Plan, None, 256);
    same_expectation(&pair, Skip::Plan);
    assert!(pair[0].cost() < pair[1].cost());
}

fn beams_save_rays(backend: BackendChoice) {
    let pair = pair(&ball_under(LAMP, 0.3, 2), backend, Skip::Beams, None, 64);
    same_expectation(&pair, Skip::Beams);
    assert!(pair[0].rays < pair[1].rays);
}

/// A small ball is seldom found by chance: too seldom for a mean to be told to a percent.
fn cones_save_error(backend: BackendChoice) {
    for max_bounces in [1, 3] {
        let pair = |radius_m, seeds| {
            let scene = ball_under(SKY, radius_m, max_bounces);
            pair(&scene, backend, Skip::Cones, None, seeds)
        };
        same_expectation(&pair(0.3, 64), Skip::Cones);
        let [with, without] = pair(0.12, 16);
        assert!(with.cost() < without.cost());
    }
}

/// Glossy ground, where the cones share with the BSDF.
fn cones_save_error_on_gloss_too(backend: BackendChoice) {
    let pair = |radius_m, seeds| {
        let scene = glossy(ball_under(&[LAMP, SKY].concat(), radius_m, 2));
        pair(&scene, backend, Skip::Cones, None, seeds)
    };
    same_expectation(&pair(0.3, 64), Skip::Cones);
    let [with, without] = pair(0.12, 16);
    assert!(with.cost() < without.cost());
}

/// What it saves depends on the scene: least where shadows of the first vertex are most of the noise.
fn sharing_keeps_the_expectation(backend: BackendChoice) {
    for max_bounces in [2, 4] {
        let scene = ball_under(LAMP, 0.3, max_bounces);
        let pair = pair(&scene, backend, Skip::Sharing, None, 64);
        same_expectation(&pair, Skip::Sharing);
        assert!(pair[0].rays != pair[1].rays);
    }
}

/// Smooth things on a table under lights that the eye's paths find too.
fn smooth_under(lights: &str, objects: &str, max_bounces: u32) -> Scene {
    let mut scene = scene(&format!("{CAMERA}{LENS}{TABLE}{lights}{objects}"));
    scene.settings.max_bounces = max_bounces;
    scene.settings.rays_per_pixel = RAYS;
    scene
}

const MIRROR_BALL: &str = r#"
[[virtual]]
shape = "sphere"
segments = 48
scale = 0.25
translation = [0.1, 0.27, 0]
material = { base_color = [0.9, 0.8, 0.7], metallic = 1.0, roughness = 0.0 }
"#;

const GLASS_BALL: &str = r#"
[[virtual]]
shape = "sphere"
segments = 48
scale = 0.25
translation = [0.1, 0.3, 0]
material = { base_color = [1, 0.9, 0.9], transmission = 1.0, roughness = 0.0, ior = 1.5, attenuation_color = [0.5, 0.8, 0.9], attenuation_distance_m = 0.5 }
"#;

/// A window pane, nearly upright between ball and camera or lamp.
const PANE: &str = r#"
[[virtual]]
shape = "quad"
corner = [-0.6, 0.01, 0.45]
edge_u = [1.2, 0, 0]
edge_v = [0, 0.9, -0.3]
material = { base_color = [0.9, 1, 0.9], transmission = 1.0, roughness = 0.0, ior = 1.5, thin_walled = true }
"#;

/// The front of a glass body without a back: light lands inside.
const GLASS_FRONT: &str = r#"
[[virtual]]
shape = "quad"
corner = [-0.6, 0.01, 0.45]
edge_u = [1.2, 0, 0]
edge_v = [0, 0.9, -0.3]
material = { base_color = [0.9, 1, 0.9], transmission = 1.0, roughness = 0.0, ior = 1.5 }
"#;

const COATED_BALL: &str = r#"
[[virtual]]
shape = "sphere"
segments = 48
scale = 0.25
translation = [0.1, 0.27, 0]
material = { base_color = [0.2, 0.3, 0.8], roughness = 0.7, clearcoat = 1.0, clearcoat_roughness = 0.0 }
"#;

/// A sphere that glows.
const GLOWING: &str = r#"
[[real]]
shape = "sphere"
segments = 16
scale = 0.4
translation = [-0.6, 1.2, 0.3]
material = { base_color = [0, 0, 0], emissive = [4, 3.5, 3], specular = 0.0 }
"#;

const POLISHED_BALL: &str = r#"
[[virtual]]
shape = "sphere"
segments = 48
scale = 0.25
translation = [0.1, 0.27, 0]
material = { base_color = [0.9, 0.7, 0.3], metallic = 1.0, roughness = 0.2 }
"#;

/// As wide as photons bring lamps, so that the eye's paths find it well enough to compare.
const WIDE_LAMP: &str = r#"
[[light]]
kind = "quad"
corner = [-0.55, 2, -0.55]
edge_u = [1.1, 0, 0]
edge_v = [0, 0, 1.1]
radiance = [12, 10, 8]
"#;

fn photons_bring_what_the_eye_finds(backend: BackendChoice) {
    // As many seeds as the control takes to be seen.
    for (lights, objects, max_bounces, seeds) in [
        (WIDE_LAMP, MIRROR_BALL, 3, 192),
        (WIDE_LAMP, POLISHED_BALL, 3, 448),
        (WIDE_LAMP, GLASS_BALL, 5, 320),
        (WIDE_LAMP, PANE, 3, 64),
        (WIDE_LAMP, GLASS_FRONT, 3, 64),
        (WIDE_LAMP, &[PANE, MIRROR_BALL].concat(), 4, 96),
        (WIDE_LAMP, COATED_BALL, 3, 256),
        (&[WIDE_LAMP, GLOWING].concat(), MIRROR_BALL, 3, 192),
    ] {
        let scene = smooth_under(lights, objects, max_bounces);
        let pair = pair(&scene, backend, Skip::Photons, None, seeds);
        same_expectation(&pair, Skip::Photons);
    }
}

fn photons_save_error(backend: BackendChoice) {
    for objects in [MIRROR_BALL, POLISHED_BALL] {
        let scene = smooth_under(LAMP, objects, 3);
        let [with, without] = pair(&scene, backend, Skip::Photons, None, 32);
        assert!(with.cost() < without.cost());
    }
}

/// What a mirror and a glass show of the table is lit by themselves.
fn the_guide_saves_error(backend: BackendChoice) {
    for (objects, max_bounces, seeds) in [(MIRROR_BALL, 3, 192), (GLASS_BALL, 6, 320)] {
        let scene = smooth_under(WIDE_LAMP, objects, max_bounces);
        let pair = pair(&scene, backend, Skip::Guide, None, seeds);
        same_expectation(&pair, Skip::Guide);
    }
    let scene = smooth_under(LAMP, MIRROR_BALL, 3);
    let [with, without] = pair(&scene, backend, Skip::Guide, None, 64);
    assert!(with.cost() < without.cost());
}

/// At the first vertex of a path, at the second of a difference, and behind the ball.
fn the_last_vertex_saves_rays(backend: BackendChoice) {
    for max_bounces in [1, 2] {
        let scene = ball_under(LAMP, 0.3, max_bounces);
        let pair = pair(&scene, backend, Skip::LastVertex, None, 64);
        same_expectation(&pair, Skip::LastVertex);
        assert!(pair[0].rays < pair[1].rays);
    }
}

fn goal(standard_error: Option<f64>, noise: Option<CameraNoise>) -> ErrorGoal {
    ErrorGoal {
        standard_error,
        noise,
        max_rays_per_pixel: 256,
    }
}

/// Both meet the goal in every tile.
fn adaptive_sampling_saves_rays(backend: BackendChoice) {
    let scene = ball_under(LAMP, 0.3, 2);
    let goal = goal(Some(0.008), None);
    for skip in [None, Some(Skip::Adaptive)] {
        let mut renderer = without(&scene, backend, skip);
        (renderer.render_to_error(&goal, &Watcher::none())).expect("it renders");
        let stated = renderer.stated().expect("scrambles");
        assert_eq!(stated.tiles_above_goal, 0, "{skip:?}");
    }
    let pair = pair(&scene, backend, Skip::Adaptive, Some(&goal), 128);
    same_expectation(&pair, Skip::Adaptive);
    assert!(pair[0].rays < pair[1].rays);
}

/// With it the variance stays under the noise; without it all rays are taken, or another goal is met.
fn stopping_at_the_cameras_noise_saves_rays(backend: BackendChoice) {
    let mut scene = ball_under(SKY, 0.3, 2);
    // About as bright as the proxy: where a shadow would leave less than nothing, no noise is allowed either.
    scene.photo = Some(constant_photo(32, 24, 0.6));
    let noise = CameraNoise {
        fit: [NoiseFit { a: 0.05, b: 2.0 }; 3],
    };
    let at_noise = goal(None, Some(noise));
    let pair = pair(&scene, backend, Skip::CameraNoise, Some(&at_noise), 16);
    same_expectation(&pair, Skip::CameraNoise);
    assert!(pair[0].rays < pair[1].rays);

    let to = |skip: Option<Skip>, goal: &ErrorGoal| {
        let mut renderer = without(&scene, backend, skip);
        (renderer.render_to_error(goal, &Watcher::none())).expect("it renders");
        renderer
    };
    let patient = ErrorGoal {
        max_rays_per_pixel: 2048,
        ..at_noise
    };
    let stopped = to(None, &patient);
    let stated = stopped.stated().expect("scrambles");
    assert_eq!(stated.tiles_above_goal, 0);
    assert!(stated.mean_rays_per_pixel < 256.0, "{stated:?}");
    let not_stopped = to(Some(Skip::CameraNoise), &at_noise);
    let stated = not_stopped.stated().expect("scrambles");
    assert_eq!(stated.mean_rays_per_pixel, 256.0);
    assert_eq!(stated.tiles_above_goal, 0, "there is no goal to be above");
    // With another goal, that one alone decides.
    let both = goal(Some(0.008), Some(noise));
    let film = |skip, goal: &ErrorGoal| to(skip, goal).film().clone();
    let even = film(None, &goal(Some(0.008), None));
    assert!(film(Some(Skip::CameraNoise), &both) == even);
    assert!(film(None, &both) != even, "control");
}

on_the_cpu!(
    out_of_reach_changes_nothing,
    edge_real_changes_nothing,
    virtual_first_changes_nothing,
    the_plan_saves_error,
    beams_save_rays,
    cones_save_error,
    cones_save_error_on_gloss_too,
    sharing_keeps_the_expectation,
    the_last_vertex_saves_rays,
    photons_bring_what_the_eye_finds,
    photons_save_error,
    the_guide_saves_error,
    adaptive_sampling_saves_rays,
    stopping_at_the_cameras_noise_saves_rays,
);
