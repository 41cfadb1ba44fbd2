//! Light goes straight through panes: thin walls without roughness, and volumes of index 1.

use mixray::scene::{BackendChoice, Estimator, Scene};

use super::support::*;

const SUN: &str = r#"
[[light]]
kind = "directional"
direction = [0.3, -1, -0.2]
irradiance = [3, 2, 1]
"#;
const BULB: &str = r#"
[[light]]
kind = "point"
position = [0.4, 2.0, -0.3]
intensity = [4, 5, 6]
"#;
const SPOT: &str = r#"
[[light]]
kind = "spot"
position = [-0.3, 2.0, 0.2]
direction = [0.1, -1, 0]
intensity = [4, 5, 6]
inner_deg = 20
outer_deg = 40
"#;
const TINT: [f64; 3] = [0.9, 0.5, 0.2];
const HEIGHT: f64 = 0.5;

/// A sheet above the table, larger than what the camera sees of it.
fn sheet(side: &str, material: &str) -> String {
    format!(
        r#"
[[{side}]]
shape = "quad"
corner = [-1.5, {HEIGHT}, 1.5]
edge_u = [3, 0, 0]
edge_v = [0, 0, -3]
material = {{ {material} }}
"#
    )
}

const CARD: &str = "base_color = [0, 0, 0], specular = 0.0";

fn glass(roughness: f64) -> String {
    format!(
        "base_color = [0.9, 0.5, 0.2, 1.0], transmission = 1.0, ior = 1.5, thin_walled = true, roughness = {roughness}"
    )
}

/// Looks at the table from below the sheet.
fn below(rest: &str) -> Scene {
    let mut scene = scene(&format!(
        r#"
[camera]
width = 16
height = 12
vertical_fov_deg = 40
position = [0, 0.4, 0.6]
look_at = [0, 0, 0]
{TABLE}{rest}"#
    ));
    scene.settings.max_bounces = 1;
    scene.settings.rays_per_pixel = 1;
    scene
}

/// What a sheet of index 1.5 reflects of light at that angle, both sides of it (Fresnel's equations, f64).
fn reflected(cos: f64) -> f64 {
    let sin_t = (1.0 - cos * cos).sqrt() / 1.5;
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let s = (cos - 1.5 * cos_t) / (cos + 1.5 * cos_t);
    let p = (1.5 * cos - cos_t) / (1.5 * cos + cos_t);
    let once = 0.5 * (s * s + p * p);
    2.0 * once / (1.0 + once)
}

fn picture(scene: &Scene, backend: BackendChoice) -> Vec<[f64; 3]> {
    let picture = render(scene, backend).picture();
    (picture.linear.iter())
        .map(|rgb| rgb.map(f64::from))
        .collect()
}

/// The cosine at which light of the lamp arrives at the middle of the picture.
fn cosine(direction: [f64; 3]) -> f64 {
    let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
    direction[1].abs() / length
}

/// Sample by sample a sheet of glass takes as much of a light without size as Fresnel's equations and its tint say, of what a card takes.
fn a_sheet_passes_lights_without_size_exactly(backend: BackendChoice) {
    // Near the middle of the picture; the angle changes by a degree over it.
    let cases = [
        ("sun", SUN, cosine([0.3, -1.0, -0.2]), 2e-5),
        ("bulb", BULB, cosine([0.4, 2.0, -0.3]), 2e-2),
        ("spot", SPOT, cosine([-0.3, 2.0, 0.2]), 2e-2),
    ];
    for estimator in [Estimator::Direct, Estimator::Paper] {
        for (name, light, cos, tolerance) in cases {
            for roughness in [0.0, 0.001, 0.01] {
                let rendered = |material: &str| {
                    let mut scene = below(&format!("{light}{}", sheet("virtual", material)));
                    scene.settings.estimator = estimator;
                    picture(&scene, backend)
                };
                let (card, glass) = (rendered(CARD), rendered(&glass(roughness)));
                let middle = 6 * 16 + 8;
                for c in 0..3 {
                    let taken = glass[middle][c] / card[middle][c];
                    let expected = 1.0 - TINT[c] * (1.0 - reflected(cos));
                    let off = (taken - expected).abs() / expected;
                    assert!(off < tolerance, "{name} {roughness}: {taken} {expected}");
                    let doubled = 1.0 - TINT[c] * (1.0 - reflected(cos)).powi(2);
                    assert!((taken - doubled).abs() > 0.02 * TINT[c], "control");
                }
            }
        }
    }
}

/// A card that stands in the sun behind a real window takes what the window lets through.
fn a_real_sheet_passes_the_sun_exactly(backend: BackendChoice) {
    let card = r#"
[[virtual]]
shape = "quad"
corner = [-0.5, 0.25, 0.2]
edge_u = [1, 0, 0]
edge_v = [0, 0, -0.7]
material = { base_color = [0, 0, 0], specular = 0.0 }
"#;
    for estimator in [Estimator::Direct, Estimator::Paper] {
        let rendered = |window: &str| {
            let mut scene = below(&format!("{SUN}{card}{window}"));
            scene.settings.estimator = estimator;
            picture(&scene, backend)
        };
        let (bare, behind) = (rendered(""), rendered(&sheet("real", &glass(0.0))));
        let cos = cosine([0.3, -1.0, -0.2]);
        let middle = 7 * 16 + 8;
        for c in 0..3 {
            let passed = behind[middle][c] / bare[middle][c];
            let expected = TINT[c] * (1.0 - reflected(cos));
            assert!(
                (passed / expected - 1.0).abs() < 2e-5,
                "{passed} {expected}"
            );
            assert!((passed / TINT[c] - 1.0).abs() > 0.05, "control");
        }
    }
}

/// Light goes through a body of index 1 without bending, and is absorbed along the way, as long as it is.
fn a_body_of_index_1_absorbs_the_sun(backend: BackendChoice) {
    let body = |attenuation: &str| {
        format!(
            r#"
[[virtual]]
shape = "box"
size = [3, 0.1, 3]
translation = [0, 0.55, 0]
material = {{ base_color = [1, 1, 1], transmission = 1.0, ior = 1.0, roughness = 0.7{attenuation} }}
"#
        )
    };
    let rendered = |object: &str| picture(&below(&format!("{SUN}{object}")), backend);
    let card = rendered(&sheet("virtual", CARD));
    let clear = rendered(&body(""));
    let dark = rendered(&body(
        ", attenuation_color = [0.5, 0.2, 0.9], attenuation_distance_m = 0.1",
    ));
    let way = 1.0 / cosine([0.3, -1.0, -0.2]);
    for (pixel, card) in card.iter().enumerate() {
        for (c, color) in [0.5_f64, 0.2, 0.9].into_iter().enumerate() {
            assert!(clear[pixel][c].abs() < 1e-6 * card[c].abs(), "{pixel}");
            let taken = dark[pixel][c] / card[c];
            let expected = 1.0 - color.powf(way);
            assert!((taken / expected - 1.0).abs() < 1e-4, "{taken} {expected}");
            assert!((taken / (1.0 - color) - 1.0).abs() > 1e-3, "control");
        }
    }
}

/// A lamp with size, by quadrature: its light is found by the table's samples of it, and by those of the table that meet it.
fn a_sheet_passes_a_lamp_as_a_quadrature_says(backend: BackendChoice) {
    let mut scene = below(&format!("{LAMP}{}", sheet("virtual", &glass(0.0))));
    scene.settings.rays_per_pixel = 256;
    let found = picture(&scene, backend);
    let middle = [5 * 16 + 7, 5 * 16 + 8, 6 * 16 + 7, 6 * 16 + 8];
    const CELLS: usize = 200;
    let radiance = [6.0, 5.0, 4.0];
    let albedo = [0.7, 0.6, 0.5];
    for c in 0..3 {
        let (mut expected, mut doubled) = (0.0, 0.0);
        for cell in 0..CELLS * CELLS {
            let at = |i: usize| (i as f64 + 0.5) / CELLS as f64;
            let (x, z) = (-0.4 + 0.8 * at(cell % CELLS), -0.6 + 0.8 * at(cell / CELLS));
            let distance2 = x * x + z * z + 4.0;
            let cos = 2.0 / distance2.sqrt();
            let light = radiance[c] * cos * cos / distance2 * 0.64 / (CELLS * CELLS) as f64;
            let passed = TINT[c] * (1.0 - reflected(cos));
            expected -= albedo[c] / std::f64::consts::PI * light * (1.0 - passed);
            doubled -= albedo[c] / std::f64::consts::PI * light * (1.0 - passed * passed);
        }
        let mean = middle.iter().map(|&pixel| found[pixel][c]).sum::<f64>() / 4.0;
        assert!((mean / expected - 1.0).abs() < 0.005, "{mean} {expected}");
        assert!((mean / doubled - 1.0).abs() > 0.03, "control");
    }
}

/// Share of a sun straight above that a rough sheet sends down to a wide plane, by every facet: independent of the program's own lobes.
fn blurred(roughness: f64) -> f64 {
    let alpha2 = roughness.powi(4);
    let masking = |cos: f64| 2.0 * cos / (cos + (alpha2 + (1.0 - alpha2) * cos * cos).sqrt());
    const STEPS: usize = 100_000;
    let facets = (0..STEPS).map(|step| {
        // Facets by the distribution of their normals: u is its share below the angle.
        let u = (step as f64 + 0.5) / STEPS as f64;
        let cos2 = (1.0 - u) / (1.0 + (alpha2 - 1.0) * u);
        let cos = cos2.sqrt();
        let leaving = 2.0 * cos2 - 1.0;
        if leaving <= 0.0 {
            return 0.0;
        }
        masking(leaving) * (1.0 - reflected(cos))
    });
    facets.sum::<f64>() / STEPS as f64
}

/// The mean of the light under a sheet does not jump where its roughness begins.
fn rougher_sheets_pass_as_much_as_their_facets_do(backend: BackendChoice) {
    let sun = r#"
[[light]]
kind = "directional"
direction = [0, -1, 0]
irradiance = [3, 3, 3]
"#;
    let rendered = |material: &str, rays: u32, seed: u32| {
        let mut scene = below(&format!("{sun}{}", sheet("virtual", material)));
        scene.settings.rays_per_pixel = rays;
        scene.settings.seed = seed;
        scene.settings.max_bounces = 2;
        scene.settings.multiple_scattering = false;
        let found = picture(&scene, backend);
        found.iter().map(|rgb| rgb[0]).sum::<f64>()
    };
    let card = rendered(CARD, 4, 0);
    // Photons of a wide sheet land seldom where the camera looks: that of roughness 0.05 is the noisiest.
    for (roughness, rays, seeds, tolerance) in [
        (0.0, 4, 1, 1e-4),
        (0.001, 4, 1, 1e-4),
        (0.01, 4, 1, 1e-4),
        (0.05, 1024, 12, 0.04),
        (0.3, 256, 4, 0.01),
    ] {
        let expected = TINT[0] * blurred(f64::max(roughness, 1e-4));
        let seeds: Vec<f64> = (0..seeds)
            .map(|seed| 1.0 - rendered(&glass(roughness), rays, seed) / card)
            .collect();
        let passed = mean(&seeds);
        println!("{roughness}: {passed} {expected}");
        assert!(
            (passed - expected).abs() < tolerance,
            "{roughness}: {passed} {expected}"
        );
        assert!((passed - 0.9 * expected).abs() > tolerance, "control");
    }
}

on_the_cpu!(
    a_sheet_passes_lights_without_size_exactly,
    a_real_sheet_passes_the_sun_exactly,
    a_body_of_index_1_absorbs_the_sun,
    a_sheet_passes_a_lamp_as_a_quadrature_says,
    rougher_sheets_pass_as_much_as_their_facets_do,
);
