//! At the first vertex of a difference several lights are drawn, spread together; at all others one.

use mixray::renderer::{RendererOptions, Skip};
use mixray::scene::{BackendChoice, Scene};

use super::support::*;

const ALBEDO: f64 = 0.6;
const RADIANCE: f64 = 3.0;
/// Half the side of the lamp, and its height over the table.
const HALF_M: f64 = 1.0;
const HEIGHT_M: f64 = 1.0;
/// The place on the table that the camera sees, along x.
const PLACE_M: f64 = 1.0;
const SEEDS: u32 = 4;

/// A table under a lamp that a black virtual panel hides wholly. All pixels see one place.
fn hidden_lamp(camera: &str, rest: &str, max_bounces: u32) -> Scene {
    scene(&format!(
        r#"
[camera]
width = 32
height = 32
fx = 6400
cx = 16
{camera}
{TABLE_OF_ONE_ALBEDO}
[[light]]
kind = "quad"
corner = [-{HALF_M}, {HEIGHT_M}, -{HALF_M}]
edge_u = [2, 0, 0]
edge_v = [0, 0, 2]
radiance = [{RADIANCE}, {RADIANCE}, {RADIANCE}]

[[virtual]]
shape = "quad"
corner = [-2, 0.7, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
material = {{ base_color = [0, 0, 0], specular = 0.0 }}
{rest}
[render]
rays_per_pixel = 1
max_bounces = {max_bounces}
"#
    ))
}

const TABLE_OF_ONE_ALBEDO: &str = r#"
[[real]]
shape = "quad"
corner = [-2, 0, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
material = { base_color = [0.6, 0.6, 0.6], specular = 0.0 }
"#;

/// Mean and variance of the difference that one direction brings, drawn uniformly from those to the lamp.
fn by_quadrature() -> (f64, f64) {
    let cells = 400;
    let cell = 2.0 * HALF_M / f64::from(cells);
    let at = |i: i32| (f64::from(i) + 0.5) * cell - HALF_M;
    let mut moments = [0.0; 3];
    for (x, z) in (0..cells).flat_map(|x| (0..cells).map(move |z| (at(x), at(z)))) {
        let distance2 = (x - PLACE_M).powi(2) + z * z + HEIGHT_M * HEIGHT_M;
        let cos = HEIGHT_M / distance2.sqrt();
        let solid_angle = cos * cell * cell / distance2;
        for (power, moment) in moments.iter_mut().enumerate() {
            *moment += solid_angle * cos.powi(power as i32);
        }
    }
    let [all, first, second] = moments;
    let scale = -ALBEDO * RADIANCE * all / std::f64::consts::PI;
    let mean = first / all;
    (scale * mean, scale * scale * (second / all - mean * mean))
}

/// Mean and variance of the pixels, and how many there are.
fn measured(scene: &Scene, backend: BackendChoice) -> (f64, f64, f64) {
    let mut values = Vec::new();
    for seed in 0..SEEDS {
        let mut scene = scene.clone();
        scene.settings.seed = seed;
        let options = RendererOptions {
            without: [Skip::Plan].into_iter().collect(),
            ..RendererOptions::default()
        };
        let mut renderer = renderer(&scene, backend, options);
        complete(&mut renderer);
        values.extend(renderer.picture().linear.iter().map(|&value| grey(value)));
    }
    let middle = mean(&values);
    let squares: Vec<f64> = values.iter().map(|v| (v - middle) * (v - middle)).collect();
    (middle, mean(&squares), values.len() as f64)
}

fn contact_shadows_have_a_quarter_of_a_lights_variance(backend: BackendChoice) {
    let (expected, of_one) = by_quadrature();
    let check = |scene: &Scene| {
        let (mean, variance, count) = measured(scene, backend);
        println!("{mean} of {expected}, variance {variance} of {of_one}");
        let error = (variance / count).sqrt();
        assert!((mean - expected).abs() < 5.0 * error - 1e-3 * expected);
        variance
    };
    let seen = "position = [1, 0.2, 0]\nlook_at = [1, 0, 0]\nup = [0, 0, -1]";
    let at_first = check(&hidden_lamp(seen, "", 1));
    assert!(at_first < 0.25 * of_one, "{at_first} {of_one}");
    // The same place in a mirror beside it is a second vertex.
    let mirrored = "position = [1, 0.1, 0]\nlook_at = [1.2, 0.05, 0]";
    let mirror = r#"
[[real]]
shape = "quad"
corner = [1.2, 0, -0.1]
edge_u = [0, 0, 0.2]
edge_v = [0, 0.2, 0]
material = { base_color = [1, 1, 1], metallic = 1.0, roughness = 0.0 }
"#;
    let at_second = check(&hidden_lamp(mirrored, mirror, 2));
    assert!(at_second > 0.8 * of_one, "control: {at_second} {of_one}");
}

on_the_cpu!(contact_shadows_have_a_quarter_of_a_lights_variance);
