//! Invariant 6: aperture 0 is the pinhole, blur is the thin lens's circle of confusion, bokeh has the aperture's shape.

use mixray::scene::{Aperture, BackendChoice, Scene};

use super::support::*;

const SIDE_PX: u32 = 40;
const FX: f64 = 100.0;
/// Width of the emitter's sharp image, pixels.
const EMITTER_PX: f64 = 4.0;
const APERTURE_M: f64 = 0.2;

fn aperture_0_is_the_pinhole(backend: BackendChoice) {
    let ball = r#"
[[virtual]]
shape = "sphere"
segments = 32
scale = 0.3
translation = [0.05, 0.3, 0]
material = { base_color = [0.6, 0.3, 0.2], roughness = 0.4 }
"#;
    let mut pinhole = scene(&format!("{CAMERA}{TABLE}{LAMP}{ball}"));
    pinhole.settings.rays_per_pixel = 16;
    let expected = bits(&render(&pinhole, backend).picture());
    for aperture in [Aperture::Disc, Aperture::Square, Aperture::Blades(6)] {
        for focus_distance_m in [0.5, f64::INFINITY] {
            let mut with_lens = pinhole.clone();
            with_lens.lens.aperture = aperture;
            with_lens.lens.focus_distance_m = focus_distance_m;
            with_lens.lens.aperture_radius_m = 0.0;
            assert!(bits(&render(&with_lens, backend).picture()) == expected);
            with_lens.lens.aperture_radius_m = 1e-3;
            assert!(
                bits(&render(&with_lens, backend).picture()) != expected,
                "control: a millimetre shows"
            );
        }
    }
}

/// A small square in front of nothing, on the axis at this distance.
fn emitter(distance_m: f64, focus_distance_m: f64, aperture: Aperture, rotation_deg: f64) -> Scene {
    let half = 0.5 * EMITTER_PX / FX * distance_m;
    let mut scene = scene(&format!(
        r#"
[camera]
width = {SIDE_PX}
height = {SIDE_PX}
fx = {FX}
position = [0, 0, 0]
look_at = [0, 0, -1]

[[virtual]]
shape = "quad"
corner = [{}, {}, {}]
edge_u = [{}, 0, 0]
edge_v = [0, {}, 0]
material = {{ unlit = true }}

[render]
rays_per_pixel = 1024
max_bounces = 1
"#,
        -half,
        -half,
        -distance_m,
        2.0 * half,
        2.0 * half
    ));
    scene.lens.aperture_radius_m = APERTURE_M;
    scene.lens.focus_distance_m = focus_distance_m;
    scene.lens.aperture = aperture;
    scene.lens.blade_rotation_deg = rotation_deg;
    scene
}

/// Diameter of the disc whose second moments the mask has, pixels: a disc's variance along an axis is a quarter of its squared radius,
/// to which the square emitter and the pixel grid (Sheppard) add a twelfth of their squared widths.
fn measured_diameter_px(mask: &[f64]) -> f64 {
    let (mut sum, mut second) = (0.0, 0.0);
    for (i, m) in mask.iter().enumerate() {
        let centre = 0.5 * f64::from(SIDE_PX);
        let x = (i as u32 % SIDE_PX) as f64 + 0.5 - centre;
        let y = (i as u32 / SIDE_PX) as f64 + 0.5 - centre;
        sum += m;
        second += m * 0.5 * (x * x + y * y);
    }
    let variance = second / sum - (EMITTER_PX * EMITTER_PX + 1.0) / 12.0;
    2.0 * (4.0 * variance).sqrt()
}

fn blur_is_the_circle_of_confusion(backend: BackendChoice) {
    for (distance_m, focus_distance_m) in [(2.0, 1.0), (1.0, 1.8), (4.0, 2.0), (1.4, f64::INFINITY)]
    {
        let scene = emitter(distance_m, focus_distance_m, Aperture::Disc, 0.0);
        let diameter = |df: f64| {
            let relative = if df.is_finite() {
                (distance_m - df).abs() / (distance_m * df)
            } else {
                1.0 / distance_m
            };
            2.0 * APERTURE_M * relative * FX
        };
        let expected = diameter(focus_distance_m);
        let measured = measured_diameter_px(&mask(render(&scene, backend).film()));
        println!(
            "circle of confusion at {distance_m} m, focus {focus_distance_m} m: {measured:.3} px for {expected:.3}"
        );
        assert!((measured / expected - 1.0).abs() < 0.01);
        let other = diameter(focus_distance_m.min(1e3) * 0.95);
        assert!(
            focus_distance_m.is_infinite() || (measured / other - 1.0).abs() > 0.02,
            "control: 5% of focus distance shows"
        );
    }
}

/// Whether the aperture of radius 1 passes light at this point (right, up), by its definition in the scene file.
fn passes(aperture: Aperture, rotation_deg: f64, x: f64, y: f64) -> bool {
    let (sin, cos) = rotation_deg.to_radians().sin_cos();
    let (u, v) = (x * cos + y * sin, y * cos - x * sin);
    match aperture {
        Aperture::Disc => u.hypot(v) <= 1.0,
        Aperture::Square => u.abs() <= 1.0 && v.abs() <= 1.0,
        Aperture::Blades(blades) => {
            let step = std::f64::consts::TAU / f64::from(blades);
            // Inside every side; a side's normal points between two corners.
            (0..blades).all(|k| {
                let normal = step * (f64::from(k) + 0.5);
                u * normal.cos() + v * normal.sin() <= (0.5 * step).cos()
            })
        }
    }
}

/// The mask of an emitter behind the focus plane: its sharp image moved by every lens point, in f64.
fn expected_mask(
    distance_m: f64,
    focus_distance_m: f64,
    aperture: Aperture,
    rotation_deg: f64,
) -> Vec<f64> {
    const GRID: i32 = 120;
    let scale = APERTURE_M * FX * (1.0 / focus_distance_m - 1.0 / distance_m);
    let centre = 0.5 * f64::from(SIDE_PX);
    let mut mask = vec![0.0; (SIDE_PX * SIDE_PX) as usize];
    let mut points = 0.0;
    let reach = std::f64::consts::SQRT_2;
    for i in -GRID..=GRID {
        for j in -GRID..=GRID {
            let (x, y) = (
                reach * f64::from(i) / f64::from(GRID),
                reach * f64::from(j) / f64::from(GRID),
            );
            if !passes(aperture, rotation_deg, x, y) {
                continue;
            }
            points += 1.0;
            let overlap = |low: f64, pixel: u32| {
                let p = f64::from(pixel);
                ((low + EMITTER_PX).min(p + 1.0) - low.max(p)).max(0.0)
            };
            // Up on the lens is up in the world and so towards smaller pixel y.
            let left = centre + scale * x - 0.5 * EMITTER_PX;
            let top = centre - scale * y - 0.5 * EMITTER_PX;
            for py in 0..SIDE_PX {
                let high = overlap(top, py);
                for px in 0..SIDE_PX {
                    mask[(py * SIDE_PX + px) as usize] += high * overlap(left, px);
                }
            }
        }
    }
    mask.iter().map(|m| m / points).collect()
}

fn bokeh_has_the_shape_of_the_aperture(backend: BackendChoice) {
    let shapes = [
        ("disc", Aperture::Disc, 0.0),
        ("square", Aperture::Square, 0.0),
        ("hexagon", Aperture::Blades(6), 0.0),
        ("triangle", Aperture::Blades(3), 90.0),
        ("triangle upside down", Aperture::Blades(3), -90.0),
    ];
    let (distance_m, focus_distance_m) = (2.0, 1.0);
    let expected: Vec<Vec<f64>> = shapes
        .iter()
        .map(|&(_, aperture, turn)| expected_mask(distance_m, focus_distance_m, aperture, turn))
        .collect();
    for (i, &(name, aperture, turn)) in shapes.iter().enumerate() {
        let scene = emitter(distance_m, focus_distance_m, aperture, turn);
        let shown = mask(render(&scene, backend).film());
        let distances: Vec<f64> = expected
            .iter()
            .map(|e| {
                let off: f64 = e.iter().zip(&shown).map(|(e, s)| (e - s).abs()).sum();
                off / e.iter().sum::<f64>()
            })
            .collect();
        println!("bokeh of the {name}: off each shape by {distances:.3?}");
        for (j, &off) in distances.iter().enumerate() {
            if i == j {
                assert!(off < 0.12, "{name}: off its own shape by {off}");
            } else {
                assert!(off > 0.2, "control: {name} passes for {}", shapes[j].0);
            }
        }
    }
}

on_the_cpu!(
    aperture_0_is_the_pinhole,
    blur_is_the_circle_of_confusion,
    bokeh_has_the_shape_of_the_aperture,
);
