//! Caustics: photons against closed forms, and against the eye's paths.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use mixray::renderer::{RendererOptions, Skip};
use mixray::scene::{BackendChoice, Scene};

use super::support::*;

const WIDTH: usize = 48;
const HEIGHT: usize = 36;
const SEEDS: u32 = 8;
const EYE: DVec3 = DVec3::new(0.0, 1.6, 2.4);
const LOOK_AT: DVec3 = DVec3::new(0.0, 0.0, 0.3);
const FOV_DEG: f64 = 36.0;
const ALBEDO: f64 = 0.6;
const SUN: f64 = 2.0;

/// A floor under a sun that travels along `direction`.
fn sunny_floor(direction: [f64; 3], objects: &str, max_bounces: u32) -> Scene {
    let mut scene = scene(&format!(
        r#"
[camera]
width = {WIDTH}
height = {HEIGHT}
vertical_fov_deg = {FOV_DEG}
position = [{}, {}, {}]
look_at = [{}, {}, {}]

[[light]]
kind = "directional"
direction = {direction:?}
irradiance = [{SUN}, {SUN}, {SUN}]

[[real]]
shape = "quad"
corner = [-4, 0, 4]
edge_u = [8, 0, 0]
edge_v = [0, 0, -8]
material = {{ base_color = [{ALBEDO}, {ALBEDO}, {ALBEDO}], specular = 0.0 }}
{objects}
"#,
        EYE.x, EYE.y, EYE.z, LOOK_AT.x, LOOK_AT.y, LOOK_AT.z
    ));
    scene.settings.max_bounces = max_bounces;
    scene.settings.rays_per_pixel = 64;
    scene
}

/// What photons bring: block means of pictures with them less the same without, a list a seed.
fn brought(scene: &Scene, backend: BackendChoice) -> Vec<Vec<f64>> {
    let means = |without: Option<Skip>, seed| {
        let options = RendererOptions {
            without: without.into_iter().collect(),
            ..RendererOptions::default()
        };
        let mut scene = scene.clone();
        scene.settings.seed = seed;
        let mut renderer = renderer(&scene, backend, options);
        complete(&mut renderer);
        block_means(&renderer.picture())
    };
    (0..SEEDS)
        .map(|seed| {
            let with = means(None, seed);
            let without = means(Some(Skip::Photons), seed);
            with.iter().zip(&without).map(|(a, b)| a - b).collect()
        })
        .collect()
}

/// Block means of the radiance of a floor with this irradiance; NaN in blocks that the camera sees something else in.
fn truth(irradiance: impl Fn(DVec2) -> f64, is_hidden: impl Fn(DVec3) -> bool) -> Vec<f64> {
    const SUB: usize = 8;
    const BLOCK: usize = 4;
    let back = (EYE - LOOK_AT).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let half = (FOV_DEG.to_radians() * 0.5).tan();
    let side = (BLOCK * SUB) as f64;
    let block = |i: usize| {
        let (left, top) = (i % (WIDTH / BLOCK) * BLOCK, i / (WIDTH / BLOCK) * BLOCK);
        let mut sum = 0.0;
        for at in 0..BLOCK * BLOCK * SUB * SUB {
            let (x, y) = (at % (BLOCK * SUB), at / (BLOCK * SUB));
            let px = left as f64 + (x as f64 + 0.5) / SUB as f64;
            let py = top as f64 + (y as f64 + 0.5) / SUB as f64;
            let u = (2.0 * px - WIDTH as f64) / HEIGHT as f64 * half;
            let v = (1.0 - 2.0 * py / HEIGHT as f64) * half;
            let direction = (right * u + up * v - back).normalize();
            if direction.y >= 0.0 || is_hidden(direction) {
                return f64::NAN;
            }
            let floor = EYE - direction * (EYE.y / direction.y);
            sum += ALBEDO / std::f64::consts::PI * irradiance(DVec2::new(floor.x, floor.z));
        }
        sum / (side * side)
    };
    (0..WIDTH / BLOCK * (HEIGHT / BLOCK)).map(block).collect()
}

/// The means of `found` are `truth`, within standard errors and `bias` (of the brightest block). Control: 2% less in the mean.
fn agrees(found: &[Vec<f64>], truth: &[f64], bias: f64) {
    let brightest = truth
        .iter()
        .copied()
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max);
    let (mut worst, mut sum, mut expected, mut variance) = (0.0f64, 0.0, 0.0, 0.0);
    for (i, &truth) in truth
        .iter()
        .enumerate()
        .filter(|(_, truth)| truth.is_finite())
    {
        let values: Vec<f64> = found.iter().map(|means| means[i]).collect();
        let mean = mean(&values);
        let spread: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        let n = values.len() as f64;
        let squared_error = spread / (n * (n - 1.0));
        worst = worst.max((mean - truth).abs() / (5.0 * squared_error.sqrt() + bias * brightest));
        sum += mean;
        expected += truth;
        variance += squared_error;
    }
    let z = |expected: f64| (sum - expected) / (3.0 * variance.sqrt() + 0.003 * expected);
    eprintln!(
        "worst block {worst:.2}, whole {sum:.5} of {expected:.5} ({:.2})",
        z(expected)
    );
    assert!(worst < 1.0, "{worst}");
    assert!(z(expected).abs() < 1.0, "{sum} {expected}");
    assert!(
        z(0.98 * expected).abs() > 1.0,
        "control: 2% less is noticed"
    );
}

const RADIUS: f64 = 0.3;
const CENTRE: DVec3 = DVec3::new(0.0, 0.5, -0.2);

/// Straight down through a glass ball, and off it: light that meets it at a distance b from the axis lands at a distance that follows from
/// Snell's law.
fn the_sun_through_a_glass_ball_is_that_of_a_brute_force(backend: BackendChoice) {
    const IOR: f64 = 1.5;
    let scene = sunny_floor(
        [0.0, -1.0, 0.0],
        &format!(
            r#"
[[virtual]]
shape = "sphere"
segments = 256
scale = {RADIUS}
translation = [{}, {}, {}]
material = {{ base_color = [1, 1, 1], transmission = 1.0, roughness = 0.0, ior = {IOR} }}
"#,
            CENTRE.x, CENTRE.y, CENTRE.z
        ),
        3,
    );
    // Power by the distance from the axis at which it lands.
    const RINGS: usize = 1200;
    const REACH: f64 = 4.0;
    const STEPS: usize = 1_000_000;
    let mut power = vec![0.0; RINGS];
    for step in 0..STEPS {
        let b = RADIUS * (step as f64 + 0.5) / STEPS as f64;
        let (sin_i, sin_t) = (b / RADIUS, b / RADIUS / IOR);
        let (cos_i, cos_t) = ((1.0 - sin_i * sin_i).sqrt(), (1.0 - sin_t * sin_t).sqrt());
        let s = ((cos_i - IOR * cos_t) / (cos_i + IOR * cos_t)).powi(2);
        let p = ((IOR * cos_i - cos_t) / (IOR * cos_i + cos_t)).powi(2);
        let passed = 1.0 - 0.5 * (s + p);
        // The ray turns by i - t at each interface, and leaves the ball that far round from where it came in.
        let (i, t) = (sin_i.asin(), sin_t.asin());
        let turned = 2.0 * (i - t);
        let around = std::f64::consts::PI - 2.0 * t;
        let leaves = DVec2::from_angle(std::f64::consts::FRAC_PI_2 - i) * RADIUS;
        let leaves = DVec2::from_angle(-around).rotate(leaves);
        let direction = DVec2::from_angle(-turned).rotate(DVec2::new(0.0, -1.0));
        let mut land = |from: DVec2, direction: DVec2, share: f64| {
            if direction.y >= 0.0 {
                return;
            }
            let landing = from.x - direction.x * ((CENTRE.y + from.y) / direction.y);
            let ring = (landing.abs() / REACH * RINGS as f64) as usize;
            if let Some(power) = power.get_mut(ring) {
                *power += SUN * share * std::f64::consts::TAU * b * RADIUS / STEPS as f64;
            }
        };
        land(leaves, direction, passed * passed);
        let enters = DVec2::from_angle(std::f64::consts::FRAC_PI_2 - i) * RADIUS;
        land(
            enters,
            DVec2::new((2.0 * i).sin(), (2.0 * i).cos()),
            1.0 - passed,
        );
    }
    let irradiance = |at: DVec2| {
        let distance = at.distance(DVec2::new(CENTRE.x, CENTRE.z));
        let ring = (distance / REACH * RINGS as f64) as usize;
        let (inner, outer) = (
            ring as f64 * REACH / RINGS as f64,
            (ring + 1) as f64 * REACH / RINGS as f64,
        );
        let area = std::f64::consts::PI * (outer * outer - inner * inner);
        power.get(ring).map_or(0.0, |power| power / area)
    };
    let is_hidden = |direction: DVec3| {
        let to = CENTRE - EYE;
        to.cross(direction).length() < 1.02 * RADIUS
    };
    agrees(
        &brought(&scene, backend),
        &truth(irradiance, is_hidden),
        0.02,
    );
}

/// A standing mirror cylinder fans the sun out over the floor. Light that meets it at the angle a from its normal, a height h above the floor,
/// lands s = h / tan(elevation) farther, where its irradiance has fallen to R cos a / (R cos a + 2 s) of the sun's on the floor.
fn the_sun_off_a_mirror_cylinder_is_the_closed_form(backend: BackendChoice) {
    const ELEVATION_DEG: f64 = 40.0;
    const SIDES: u32 = 720;
    let elevation = ELEVATION_DEG.to_radians();
    let (radius, height) = (0.25, 0.6);
    let mut scene = sunny_floor(
        [0.0, -elevation.sin(), -elevation.cos()],
        r#"
[[virtual]]
shape = "sphere"
segments = 8
material = { base_color = [1, 1, 1], metallic = 1.0, roughness = 0.0 }
"#,
        2,
    );
    let axis = DVec2::new(0.0, -0.4);
    let cylinder = scene.objects.last_mut().expect("an object");
    let primitive = Arc::make_mut(&mut cylinder.instances[0].primitive);
    primitive.uvs = Default::default();
    primitive.tangents.clear();
    primitive.colors.clear();
    let at = |i: u32| DVec2::from_angle(f64::from(i) / f64::from(SIDES) * std::f64::consts::TAU);
    let ring = |y: f64| {
        (0..SIDES).map(move |i| {
            let p = at(i) * radius + axis;
            [p.x as f32, y as f32, p.y as f32]
        })
    };
    primitive.positions = ring(0.0).chain(ring(height)).collect();
    primitive.normals = (0..2 * SIDES)
        .map(|i| [at(i).x as f32, 0.0, at(i).y as f32])
        .collect();
    primitive.triangles = (0..SIDES)
        .flat_map(|i| {
            let next = (i + 1) % SIDES;
            [[i, SIDES + i, SIDES + next], [i, SIDES + next, next]]
        })
        .collect();
    let irradiance = |floor: DVec2| {
        // From the cylinder's axis: the sun comes from +z.
        let p = floor - axis;
        // The angle at which light that lands here met the cylinder, by bisection on its signed distance from the point.
        let off = |a: f64| {
            let normal = DVec2::new(a.sin(), a.cos());
            let leaving = DVec2::new((2.0 * a).sin(), (2.0 * a).cos());
            leaving.perp_dot(p - normal * radius)
        };
        let step = |i: u32| f64::from(i) / 64.0 * 1.57 * p.x.signum();
        let changes = |i: &u32| off(step(*i)).signum() != off(step(i + 1)).signum();
        let Some(first) = (0..64).find(changes) else {
            return 0.0;
        };
        let (mut low, mut high) = (step(first), step(first + 1));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if off(middle).signum() == off(low).signum() {
                low = middle;
            } else {
                high = middle;
            }
        }
        let a: f64 = 0.5 * (low + high);
        let leaving = DVec2::new((2.0 * a).sin(), (2.0 * a).cos());
        let s = leaving.dot(p - DVec2::new(a.sin(), a.cos()) * radius);
        if s <= 0.0 || s * elevation.tan() > height {
            return 0.0;
        }
        SUN * elevation.sin() * radius * a.cos() / (radius * a.cos() + 2.0 * s)
    };
    // Blocks that the cylinder covers, with some room.
    let is_hidden = |direction: DVec3| {
        let flat = DVec2::new(direction.x, direction.z);
        let to = axis - DVec2::new(EYE.x, EYE.z);
        let across = flat.normalize().perp_dot(to).abs();
        let floor = EYE - direction * (EYE.y / direction.y);
        across < 1.1 * radius && floor.z < axis.y + 1.2 * radius
    };
    agrees(
        &brought(&scene, backend),
        &truth(irradiance, is_hidden),
        0.02,
    );
}

/// A pane above the ball lets that much of the sun through, and no more changes.
fn the_sun_through_a_pane_and_a_glass_ball(backend: BackendChoice) {
    let ball = format!(
        r#"
[[virtual]]
shape = "sphere"
segments = 64
scale = {RADIUS}
translation = [{}, {}, {}]
material = {{ base_color = [1, 1, 1], transmission = 1.0, roughness = 0.0, ior = 1.5 }}
"#,
        CENTRE.x, CENTRE.y, CENTRE.z
    );
    let pane = r#"
[[virtual]]
shape = "quad"
corner = [-1, 1.2, 1]
edge_u = [2, 0, 0]
edge_v = [0, 0, -2.5]
material = { base_color = [0.8, 0.8, 0.8], transmission = 1.0, roughness = 0.0, thin_walled = true, ior = 1.5 }
"#;
    let bare = brought(&sunny_floor([0.0, -1.0, 0.0], &ball, 3), backend);
    let behind = brought(
        &sunny_floor([0.0, -1.0, 0.0], &format!("{ball}{pane}"), 3),
        backend,
    );
    let once = (0.5_f64 / 2.5).powi(2);
    let passed = 0.8 * (1.0 - 2.0 * once / (1.0 + once));
    let expected: Vec<f64> = (0..bare[0].len())
        .map(|i| passed * mean(&bare.iter().map(|means| means[i]).collect::<Vec<_>>()))
        .collect();
    let total: f64 = expected.iter().sum();
    let found: Vec<f64> = behind.iter().map(|means| means.iter().sum()).collect();
    let found = mean(&found);
    assert!((found / total - 1.0).abs() < 0.02, "{found} {total}");
    assert!((found / total * passed - 1.0).abs() > 0.1, "control");
}

on_the_cpu!(
    the_sun_through_a_pane_and_a_glass_ball,
    the_sun_through_a_glass_ball_is_that_of_a_brute_force,
    the_sun_off_a_mirror_cylinder_is_the_closed_form,
);
