//! Invariant 5: a black sphere over a Lambertian plane under a constant sky takes away exactly what its form factor says.

use mixray::renderer::Renderer;
use mixray::scene::{BackendChoice, Scene};

use super::support::*;

const ALBEDO: f64 = 0.6;
const SKY: f64 = 1.5;
const RADIUS_M: f64 = 0.25;
const HEIGHT_M: f64 = 0.55;
/// Points per pixel side at which the analytic difference is averaged.
const SUBSAMPLES: u32 = 4;
const RINGS: usize = 3;

/// The camera looks straight down; the sphere is too wide for the middle of the picture, which is left out.
fn black_sphere() -> Scene {
    scene(&format!(
        r#"
[camera]
width = 32
height = 32
fx = 40
cx = 16
position = [0, 3, 0]
look_at = [0, 0, 0]
up = [0, 0, -1]

[environment]
radiance = [{SKY}, {SKY}, {SKY}]

[[real]]
shape = "quad"
corner = [-5, 0, 5]
edge_u = [10, 0, 0]
edge_v = [0, 0, -10]
material = {{ base_color = [{ALBEDO}, {ALBEDO}, {ALBEDO}], specular = 0.0 }}

[[virtual]]
shape = "sphere"
segments = 320
scale = {RADIUS_M}
translation = [0, {HEIGHT_M}, 0]
material = {{ base_color = [0, 0, 0], specular = 0.0 }}

[render]
rays_per_pixel = 200
max_bounces = 1
"#
    ))
}

/// -albedo L (r/d)^2 cos at the pixel's part of the plane, d to the sphere's centre.
fn analytic(pixel: u32) -> f64 {
    let mut sum = 0.0;
    for i in 0..SUBSAMPLES * SUBSAMPLES {
        let at = |k: u32| (f64::from(k) + 0.5) / f64::from(SUBSAMPLES);
        let x = (f64::from(pixel % 32) + at(i % SUBSAMPLES) - 16.0) / 40.0 * 3.0;
        let z = (f64::from(pixel / 32) + at(i / SUBSAMPLES) - 16.0) / 40.0 * 3.0;
        let d2 = x * x + z * z + HEIGHT_M * HEIGHT_M;
        sum -= ALBEDO * SKY * RADIUS_M * RADIUS_M / d2 * (HEIGHT_M / d2.sqrt());
    }
    sum / f64::from(SUBSAMPLES * SUBSAMPLES)
}

/// Means over rings about the axis of the difference over its analytic value; pixels whose rays can meet the sphere are left out.
fn rings(renderer: &Renderer) -> Vec<f64> {
    let mut sums = [(0.0, 0.0); RINGS];
    for (pixel, value) in renderer.picture().linear.iter().enumerate() {
        let (x, y) = (pixel as f64 % 32.0 - 15.5, (pixel / 32) as f64 - 15.5);
        if renderer.film().pixels[pixel].m > 0 {
            continue;
        }
        let ring = ((x.hypot(y) - 5.0) / 5.0).clamp(0.0, RINGS as f64 - 1.0) as usize;
        sums[ring].0 += grey(*value) / analytic(pixel as u32);
        sums[ring].1 += 1.0;
    }
    sums.iter().map(|(sum, n)| sum / n).collect()
}

fn a_black_sphere_takes_its_form_factor(backend: BackendChoice) {
    let scene = black_sphere();
    let seeds: Vec<Vec<f64>> = (0..16)
        .map(|seed| {
            let mut scene = scene.clone();
            scene.settings.seed = seed;
            rings(&render(&scene, backend))
        })
        .collect();
    for ring in 0..RINGS {
        let ratios: Vec<f64> = seeds.iter().map(|s| s[ring]).collect();
        let m = mean(&ratios);
        let error = (ratios.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (15.0 * 16.0)).sqrt();
        println!(
            "form factor, ring {ring}: relative error {:+.2e} +- {error:.1e}",
            m - 1.0
        );
        // The inscribed sphere covers 6e-5 less than the round one.
        assert!(
            (m - 1.0).abs() < 5.0 * error + 1e-4,
            "ring {ring}: {m} +- {error}"
        );
        assert!(error < 5e-3, "the error is known well enough: {error}");
    }
    let mut lower = scene.clone();
    for object in &mut lower.objects {
        if object.side == mixray::scene::Side::Virtual {
            object.world_from_object.w_axis.y *= 0.9;
        }
    }
    let moved = rings(&render(&lower, backend));
    assert!(
        moved.iter().any(|m| (m - 1.0).abs() > 0.03),
        "control: a tenth of height shows: {moved:?}"
    );
}

on_the_cpu!(a_black_sphere_takes_its_form_factor);
