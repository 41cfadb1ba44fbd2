//! Invariant 4: in a white furnace what absorbs nothing is invisible, and rough GGX shows its single-scattering albedo.

use std::f64::consts::{PI, TAU};

use mixray::scene::{BackendChoice, Scene};

use super::support::*;

/// A photograph of the furnace itself, radiance 1 from everywhere.
fn furnace(objects: &str) -> Scene {
    let mut scene = scene(&format!(
        r#"
[camera]
width = 24
height = 18
vertical_fov_deg = 30
position = [0, 0.4, 3]
look_at = [0, 0, 0]

[environment]
radiance = [1, 1, 1]

[render]
rays_per_pixel = 64
max_bounces = 64
multiple_scattering = false
{objects}"#
    ));
    scene.photo = Some(constant_photo(scene.camera.width, scene.camera.height, 1.0));
    scene
}

fn ball(material: &str) -> String {
    format!(
        "[[virtual]]\nshape = \"sphere\"\nsegments = 160\nscale = 0.5\nmaterial = {{ {material} }}\n"
    )
}

/// Largest distance of any channel of any pixel from 1, and the mean's.
fn errors(scene: &Scene, backend: BackendChoice) -> (f64, f64) {
    let renderer = render(scene, backend);
    assert!(renderer.film().counts().virtual_ > 30);
    let picture = renderer.picture();
    let worst = picture
        .linear
        .as_flattened()
        .iter()
        .map(|&c| (f64::from(c) - 1.0).abs())
        .fold(0.0, |a: f64, b| if a.is_nan() || a > b { a } else { b });
    let means: Vec<f64> = picture.linear.iter().map(|&p| grey(p)).collect();
    (worst, mean(&means) - 1.0)
}

/// Every path carries exactly 1, so every pixel must be 1 to rounding.
fn smooth_white_objects_vanish(backend: BackendChoice) {
    for (name, material) in [
        ("metal", "metallic = 1.0, roughness = 0.0"),
        ("glass", "transmission = 1.0, roughness = 0.0"),
        ("diamond", "transmission = 1.0, roughness = 0.0, ior = 2.4"),
        (
            "thin glass",
            "transmission = 1.0, roughness = 0.0, thin_walled = true",
        ),
    ] {
        let (worst, mean) = errors(&furnace(&ball(material)), backend);
        println!("furnace, {name}: worst pixel {worst:.1e}, mean {mean:+.1e}");
        assert!(worst < 1e-5, "{name}: {worst}");
    }
    let absorbing = ball("metallic = 1.0, roughness = 0.0, base_color = [0.999, 0.999, 0.999]");
    let (worst, _) = errors(&furnace(&absorbing), backend);
    assert!(worst > 5e-4, "control: {worst}");
}

/// Next event and BSDF sampling share each path's light, so single paths differ from 1; their mean must not.
fn white_lambertian_objects_vanish(backend: BackendChoice) {
    let lambertian = ball("specular = 0.0");
    let table = r#"
[[real]]
shape = "quad"
corner = [-1, -0.5, 1]
edge_u = [2, 0, 0]
edge_v = [0, 0, -2]
material = { base_color = [1, 1, 1], specular = 0.0 }
"#;
    let grey_ball = ball("specular = 0.0, base_color = [0.99, 0.99, 0.99]");
    for (name, objects, vanishes) in [
        ("Lambertian ball", lambertian.clone(), true),
        ("Lambertian ball on a table", lambertian + table, true),
        ("control, albedo 0.99", grey_ball, false),
    ] {
        let mut scene = furnace(&objects);
        scene.settings.rays_per_pixel = 32;
        let ones = vec![vec![1.0; 30]; 2];
        let means = over_seeds(&scene, backend, 0..48);
        let difference = Difference::between(&means, &ones);
        println!("furnace, {name}: {difference}");
        assert_eq!(difference.is_none(), vanishes, "{name}: {difference}");
    }
}

/// Share of light from everywhere that glTF's rough surface sends to a viewer at this cosine: glTF 2.0, appendix B, in f64.
///
/// The specular part is summed over half vectors, distributed as D(h) cos(h): tan^2 = alpha^2 u / (1 - u) with u = 1 - v^2, which takes
/// the root singularity at the horizon away.
fn directional_albedo(cos: f64, roughness: f64, base: f64, metallic: f64) -> f64 {
    const STEPS: usize = 600;
    let alpha2 = roughness.powi(4);
    let wo = glam::DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let f0 = 0.04 + (base - 0.04) * metallic;
    let fresnel = |c: f64, f0: f64| f0 + (1.0 - f0) * (1.0 - c).powi(5);
    let masking = |c: f64| 2.0 * c / (c + (alpha2 + (1.0 - alpha2) * c * c).sqrt());
    let fraction = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let spherical = |z: f64, phi: f64| {
        let sin = (1.0 - z * z).max(0.0).sqrt();
        glam::DVec3::new(sin * phi.cos(), sin * phi.sin(), z)
    };
    let (mut specular, mut diffuse) = (0.0, 0.0);
    for i in 0..STEPS {
        for j in 0..STEPS {
            let (u, phi) = (fraction(i), TAU * fraction(j));
            let v = u;
            let z = v / (v * v + alpha2 * (1.0 - v * v)).sqrt();
            let h = spherical(z, phi);
            let oh = wo.dot(h);
            let wi = h * (2.0 * oh) - wo;
            if oh > 0.0 && wi.z > 0.0 {
                let f = fresnel(oh, f0);
                specular += 2.0 * v * f * masking(cos) * masking(wi.z) * oh / (cos * z);
            }
            // Cosine-weighted directions of the diffuse part under the interface.
            let wi = spherical((1.0 - u).sqrt(), phi);
            let half = (wo + wi).normalize();
            diffuse += 1.0 - fresnel(wo.dot(half), 0.04);
        }
    }
    (specular + base * (1.0 - metallic) * diffuse) / (STEPS * STEPS) as f64
}

/// A quad that fills the view of a far camera, its normal at this angle to the view axis.
fn tilted_quad(angle_deg: f64, material: &str) -> Scene {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let mut scene = furnace(&format!(
        "[[virtual]]\nshape = \"quad\"\ncorner = [{}, -2, {}]\nedge_u = [{}, 0, {}]\nedge_v = [0, 4, 0]\nmaterial = {{ {material} }}\n",
        -2.0 * cos,
        2.0 * sin,
        4.0 * cos,
        -4.0 * sin
    ));
    scene.camera.width = 8;
    scene.camera.height = 8;
    (scene.camera.fx, scene.camera.fy) = (2000.0, 2000.0);
    (scene.camera.cx, scene.camera.cy) = (4.0, 4.0);
    scene.camera.world_from_camera = glam::DMat4::from_translation(glam::DVec3::new(0.0, 0.0, 3.0));
    scene.photo = Some(constant_photo(8, 8, 1.0));
    scene.settings.rays_per_pixel = 256;
    scene
}

/// Mean and standard error over 16 seeds.
fn shown_albedo(scene: &Scene, backend: BackendChoice) -> (f64, f64) {
    let means: Vec<f64> = over_seeds(scene, backend, 0..16)
        .iter()
        .map(|blocks| mean(blocks))
        .collect();
    let m = mean(&means);
    let variance = means.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (15.0 * 16.0);
    (m, variance.sqrt())
}

fn rough_surfaces_show_their_single_scattering_albedo(backend: BackendChoice) {
    let mut worst = 0.0_f64;
    for (roughness, metallic) in [(0.3, 1.0), (0.6, 1.0), (1.0, 1.0), (0.3, 0.0), (0.8, 0.0)] {
        for angle_deg in [0.0, 50.0, 80.0] {
            let base = if metallic > 0.0 { 1.0 } else { 0.8 };
            let material = format!(
                "base_color = [{base}, {base}, {base}], metallic = {metallic:?}, roughness = {roughness:?}"
            );
            let (shown, error) = shown_albedo(&tilted_quad(angle_deg, &material), backend);
            let cos = angle_deg * PI / 180.0;
            let expected = directional_albedo(cos.cos(), roughness, base, metallic);
            let z = (shown - expected) / error;
            println!(
                "furnace, roughness {roughness}, metallic {metallic}, {angle_deg} deg: {shown:.5} for {expected:.5}, z {z:+.2}"
            );
            assert!(
                (shown - expected).abs() < 5.0 * error + 2e-4,
                "{shown} +- {error} for {expected}"
            );
            worst = worst.max((shown - expected).abs() / expected);
        }
    }
    println!("furnace, rough: largest relative error {worst:.1e}");
    let (shown, error) = shown_albedo(
        &tilted_quad(50.0, "metallic = 1.0, roughness = 0.63"),
        backend,
    );
    let expected = directional_albedo(50.0_f64.to_radians().cos(), 0.6, 1.0, 1.0);
    assert!(
        (shown - expected).abs() > 5.0 * error + 2e-4,
        "control: roughness 0.63 does not pass for 0.6"
    );
}

/// With the light that facets send to each other rough metal and glass lose nothing, at any roughness and angle.
fn rough_white_objects_lose_nothing(backend: BackendChoice) {
    let mut lost = 0.0_f64;
    for material in ["metallic = 1.0", "transmission = 1.0, thin_walled = true"] {
        for roughness in [0.1, 0.35, 0.6, 0.8, 1.0] {
            for angle_deg in [0.0, 50.0, 80.0] {
                let material = format!("{material}, roughness = {roughness:?}");
                let mut scene = tilted_quad(angle_deg, &material);
                let (single, _) = shown_albedo(&scene, backend);
                scene.settings.multiple_scattering = true;
                let (shown, error) = shown_albedo(&scene, backend);
                println!("furnace, {material}, {angle_deg} deg: {shown:.5}, single {single:.5}");
                assert!(
                    (shown - 1.0).abs() < 0.01 + 4.0 * error,
                    "{material} {angle_deg}: {shown}"
                );
                lost = lost.max(1.0 - single);
            }
        }
    }
    assert!(lost > 0.5, "control: single scattering loses light, {lost}");
    for ior in [1.2, 1.5, 2.4] {
        for roughness in [0.2, 0.6, 1.0] {
            let material = format!("transmission = 1.0, ior = {ior:?}, roughness = {roughness:?}");
            let mut scene = furnace(&ball(&material));
            scene.settings.rays_per_pixel = 9;
            // Light is long inside a diamond: 64 bounces lose 1.6% of it.
            scene.settings.max_bounces = 255;
            // Of the picture, a quarter of which is glass.
            let is_one = |(shown, error): (f64, f64)| (shown - 1.0).abs() < 0.0025 + 3.0 * error;
            scene.settings.multiple_scattering = true;
            let shown = shown_albedo(&scene, backend);
            println!("furnace, {material}: {shown:.5?}");
            assert!(is_one(shown), "{material}: {shown:?}");
            scene.settings.multiple_scattering = false;
            let single = shown_albedo(&scene, backend);
            assert!(roughness < 1.0 || !is_one(single), "control: {single:?}");
        }
    }
}

on_the_cpu!(
    rough_white_objects_lose_nothing,
    smooth_white_objects_vanish,
    white_lambertian_objects_vanish,
    rough_surfaces_show_their_single_scattering_albedo,
);
