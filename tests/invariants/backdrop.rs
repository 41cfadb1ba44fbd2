//! What virtual objects show of the world that is not modelled: the photograph, where the camera shows it.

use mixray::scene::{Backdrop, BackendChoice, EnvironmentMap, Scene};

use super::support::*;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 36;

/// Before a photograph, 3 m from the origin, and nothing else but these objects.
fn before(objects: &str, photo: impl Fn(u32, u32) -> [f32; 3]) -> Scene {
    let mut scene = scene(&format!(
        r#"
[camera]
width = {WIDTH}
height = {HEIGHT}
vertical_fov_deg = 40
position = [0, 0, 3]
look_at = [0, 0, 0]

[render]
max_bounces = 2
{objects}"#
    ));
    let pixels = (0..WIDTH * HEIGHT).map(|i| photo(i % WIDTH, i / WIDTH));
    scene.photo = Some(photo_of(WIDTH, HEIGHT, pixels.collect()));
    scene
}

/// No two neighbours alike.
fn noise(x: u32, y: u32) -> [f32; 3] {
    [7, 13, 29].map(|k| ((x * k + y * 31 * k) % 97) as f32 / 97.0)
}

fn linear(scene: &Scene, backend: BackendChoice) -> Vec<[f32; 3]> {
    render(scene, backend).picture().linear.clone()
}

const INVISIBLE: &str = r#"
[[virtual]]
shape = "quad"
corner = [-2, -2, 0]
edge_u = [4, 0, 0.5]
edge_v = [0, 4, 0]
material = { base_color = [1, 1, 1], transmission = 1.0, roughness = 0.0, ior = 1.0, thin_walled = true }
"#;

/// One ray a pixel through an untinted pane of index 1 shows each pixel itself, whatever lens, exposure and distance.
fn an_invisible_pane_shows_each_pixel_itself(backend: BackendChoice) {
    for (aperture_m, distance_m) in [(0.0, None), (0.02, Some(2.5)), (0.02, Some(f64::INFINITY))] {
        let mut scene = before(INVISIBLE, noise);
        scene.settings.rays_per_pixel = 1;
        scene.settings.exposure = mixray::scene::Exposure::Ev(1.5);
        scene.settings.backdrop = Backdrop::Photograph(distance_m);
        scene.lens.aperture_radius_m = aperture_m;
        let far = |picture: &[[f32; 3]]| {
            let photo = &scene.photo.as_ref().expect("has one").linear;
            let pairs = picture.as_flattened().iter().zip(photo.as_flattened());
            largest(pairs.map(|(a, b)| f64::from((a - b).abs())))
        };
        assert!(far(&linear(&scene, backend)) < 1e-6);
        let mut other = scene.clone();
        other.settings.backdrop = Backdrop::Environment;
        assert!(far(&linear(&other, backend)) > 0.5, "control");
    }
}

/// A glass ball before a photograph that tells its own columns: what a pixel shows of them follows from Snell's law.
fn a_glass_ball_bends_the_photograph(backend: BackendChoice) {
    const IOR: f64 = 1.5;
    const RADIUS: f64 = 0.5;
    let ball = format!(
        r#"
[[virtual]]
shape = "sphere"
segments = 512
scale = {RADIUS}
material = {{ base_color = [1, 1, 1], transmission = 1.0, roughness = 0.0, ior = {IOR} }}
"#
    );
    let ramp = |x: u32, _: u32| [(x as f32 + 0.5) / WIDTH as f32, 1.0, 0.0];
    let mut scene = before(&ball, ramp);
    scene.settings.rays_per_pixel = 256;
    scene.settings.backdrop = Backdrop::Photograph(Some(f64::INFINITY));
    let picture = linear(&scene, backend);
    let focal = f64::from(HEIGHT) / 2.0 / 20.0_f64.to_radians().tan();
    let middle = f64::from(WIDTH) / 2.0;
    let mut seen = 0;
    for x in 17..31u32 {
        // In the plane of the view axis: the ray passes the centre at the distance b, and turns by twice the difference of the angles.
        let angle = ((f64::from(x) + 0.5 - middle) / focal).atan();
        let b = 3.0 * angle.sin() / RADIUS;
        let turned = angle - 2.0 * (b.asin() - (b / IOR).asin());
        let shown = middle + focal * turned.tan();
        if !(3.0..f64::from(WIDTH) - 3.0).contains(&shown) {
            continue;
        }
        let rows = [HEIGHT / 2 - 1, HEIGHT / 2].map(|y| picture[(y * WIDTH + x) as usize]);
        let found = rows.map(|[r, g, _]| f64::from(r / g)).iter().sum::<f64>() / 2.0;
        assert!(
            (found * f64::from(WIDTH) - shown).abs() < 0.35,
            "{x}: {found} {shown}"
        );
        seen += usize::from((found * f64::from(WIDTH) - f64::from(x)).abs() > 2.0);
    }
    assert!(
        seen > 8,
        "control: most pixels show other columns than their own"
    );
    scene.settings.backdrop = Backdrop::Environment;
    let dark = linear(&scene, backend)[(HEIGHT / 2 * WIDTH + WIDTH / 2) as usize];
    assert_eq!(dark, [0.0; 3], "control: there is no environment");
}

/// Rough glass before a constant photograph in a sky of the same radiance is a furnace, however its light is found.
fn a_constant_backdrop_is_a_furnace(backend: BackendChoice) {
    for (name, material, tolerance) in [
        ("frosted", "transmission = 1.0, roughness = 0.5", 0.012),
        ("matt metal", "metallic = 1.0, roughness = 0.6", 0.012),
        (
            "thin",
            "transmission = 1.0, roughness = 0.4, thin_walled = true",
            0.012,
        ),
    ] {
        let objects = format!(
            "[environment]\nradiance = [0.5, 0.5, 0.5]\n[[virtual]]\nshape = \"sphere\"\nsegments = 96\nscale = 0.6\nmaterial = {{ {material} }}\n"
        );
        let mut scene = before(&objects, |_, _| [0.5; 3]);
        scene.settings.max_bounces = 32;
        scene.settings.rays_per_pixel = 64;
        scene.settings.backdrop = Backdrop::Photograph(Some(4.0));
        let inside = |picture: &[[f32; 3]]| {
            let near = |i: usize| {
                let (x, y) = (i % WIDTH as usize, i / WIDTH as usize);
                x.abs_diff(24).pow(2) + y.abs_diff(18).pow(2) < 36
            };
            let means: Vec<f64> = (0..picture.len())
                .filter(|&i| near(i))
                .map(|i| grey(picture[i]))
                .collect();
            mean(&means)
        };
        let found = inside(&linear(&scene, backend));
        assert!((found / 0.5 - 1.0).abs() < tolerance, "{name}: {found}");
        // Control: what glass shows is the photograph, and what faces the camera mirrors the sky behind it.
        if name == "matt metal" {
            let sky = scene.environment.as_mut().expect("has one");
            sky.map = EnvironmentMap::Constant([1.0; 3]);
        } else {
            scene.photo = Some(constant_photo(WIDTH, HEIGHT, 1.0));
        }
        let brighter = inside(&linear(&scene, backend));
        assert!(brighter > found * 1.05, "{name}: {brighter}");
    }
}

/// Light that falls on what scatters it never comes from the photograph, and neither does what is seen in the mirror of a real surface.
fn diffuse_surfaces_are_not_lit_by_the_photograph(backend: BackendChoice) {
    let matt = r#"
[[virtual]]
shape = "sphere"
scale = 0.5
material = { base_color = [0.8, 0.8, 0.8], roughness = 0.6 }
"#;
    let mut scene = before(matt, |_, _| [1.0; 3]);
    scene.settings.rays_per_pixel = 4;
    scene.settings.max_bounces = 6;
    let picture = linear(&scene, backend);
    let middle = (HEIGHT / 2 * WIDTH + WIDTH / 2) as usize;
    assert_eq!(picture[middle], [0.0; 3]);
    assert_eq!(picture[0], [1.0; 3], "control: the photograph itself");
}

on_the_cpu!(
    an_invisible_pane_shows_each_pixel_itself,
    a_glass_ball_bends_the_photograph,
    a_constant_backdrop_is_a_furnace,
    diffuse_surfaces_are_not_lit_by_the_photograph,
);
