//! Photons and shared second vertices where their weights are extreme, against closed forms.

use glam::{DMat4, DVec3};

use super::backend::{Backend, Shown, StressError};
use super::scenes::{mirror, placed, square};
use super::{At, Effort, Measured};
use crate::bench::scenes::{camera, matt, object, scene};
use crate::scene::shape::{quad, sphere};
use crate::scene::{Environment, EnvironmentMap, Light, LightKind, Scene, Side};

const SIDE: u32 = 16;
const ALBEDO: f64 = 0.6;
const SUN: f64 = 3.0;
/// The sun's steepness: metres along the axis for each metre across.
const ALONG: f64 = 1.0 / 3.0;

/// A wall before the lens and a mirror behind it, which alone lights the side that is seen. `mirror_half`: half its side, at least 13 m.
fn lit_from_behind(mirror_half: f64, brighter: f64, rays_per_pixel: u32) -> Scene {
    let camera = camera([SIDE; 2], 16.0, DVec3::ZERO, -DVec3::Z, DVec3::Y);
    let upright = |z: f64, half: f64| {
        quad(
            DVec3::new(-half, -half, z),
            DVec3::X * 2.0 * half,
            DVec3::Y * 2.0 * half,
        )
    };
    let wall = matt([ALBEDO as f32; 3]);
    let mut scene = scene(
        camera,
        rays_per_pixel,
        vec![
            object(
                Side::Real,
                "wall",
                upright(-1.0, 3.0),
                wall,
                DMat4::IDENTITY,
            ),
            object(
                Side::Virtual,
                "mirror",
                upright(2.0, mirror_half),
                mirror([1.0; 3], 0.0),
                DMat4::IDENTITY,
            ),
        ],
    );
    scene.settings.max_bounces = 2;
    scene.lens.aperture_radius_m = 1.0;
    scene.lens.focus_distance_m = 4.0;
    scene.lights = vec![Light {
        kind: LightKind::Directional {
            direction: [1.0, 0.0, ALONG],
            irradiance: [(SUN * brighter) as f32; 3],
        },
        side: Side::Real,
    }];
    scene
}

fn mean(shown: &Shown) -> f64 {
    let values = shown.picture.linear.as_flattened();
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

/// Relative error of the picture's mean.
fn of_the_wall(backend: &mut Backend, scene: &Scene) -> Result<Measured, StressError> {
    let shown = backend.render(scene)?;
    let cos = ALONG / (1.0 + ALONG * ALONG).sqrt();
    let should = ALBEDO / std::f64::consts::PI * SUN * cos;
    Ok(Measured {
        figure: (mean(&shown) / should - 1.0).abs(),
        ..Measured::of_film(&shown.film)
    })
}

fn rays(at: At) -> u32 {
    match at.effort {
        Effort::Quick => 1024,
        Effort::Full => 4096,
    }
}

fn brighter(at: At) -> f64 {
    if at.control { 1.2 } else { 1.0 }
}

/// Photons land so far from the lens plane. Control: a sun a fifth brighter.
pub(super) fn at_the_lens(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = lit_from_behind(13.0, brighter(at), rays(at));
    of_the_wall(backend, &placed(&scene, at.value, DVec3::ZERO))
}

/// The same in a world that is moved, in f64. Control: a sun a fifth brighter.
pub(super) fn moved_photons(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = lit_from_behind(13.0, brighter(at), rays(at));
    let offset = DVec3::new(1.0, 0.7, -0.3) * at.value;
    of_the_wall(backend, &placed(&scene, 1.0, offset))
}

/// The mirror is so large that about so many of the pilot's photons are seen. Control: a sun three times brighter.
pub(super) fn few_pilot_photons(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    // With the least mirror 55 of them are: the wall's share of the mirror's bounding sphere, and a fifth of what the lens may see.
    let half = 13.0 * (55.0 / at.value).sqrt();
    let scene = lit_from_behind(half, if at.control { 3.0 } else { 1.0 }, 8 * rays(at));
    of_the_wall(backend, &scene)
}

const FOCAL_PX: f64 = 20.0;
const EYE_M: f64 = 3.0;

/// Whether a column of pixels shows a strip rather than the floor: of the pixels of a sharing tile, every second.
fn shows_strip(column: u32) -> bool {
    column / 2 % 2 == 1
}

/// A floor seen from above through strips near the lens, under an even sky and a black ball aside, as high over the floor as given.
fn floor_and_strips(strip_depth_m: f64, ball: DVec3, radius: f64, rays_per_pixel: u32) -> Scene {
    let camera = camera(
        [SIDE; 2],
        FOCAL_PX,
        DVec3::Y * EYE_M,
        DVec3::ZERO,
        -DVec3::Z,
    );
    let gray = matt([ALBEDO as f32; 3]);
    let real = |name, primitive| object(Side::Real, name, primitive, gray.clone(), DMat4::IDENTITY);
    let at = |column: u32| (f64::from(column) - 0.5 * f64::from(SIDE)) / FOCAL_PX * strip_depth_m;
    let mut objects = vec![real("floor", square(5.0))];
    for first in (2..SIDE).step_by(4) {
        let corner = DVec3::new(at(first), EYE_M - strip_depth_m, strip_depth_m);
        let across = DVec3::X * (at(first + 2) - at(first));
        objects.push(real(
            "strip",
            quad(corner, across, DVec3::Z * -2.0 * strip_depth_m),
        ));
    }
    let place = DMat4::from_translation(ball) * DMat4::from_scale(DVec3::splat(radius));
    objects.push(object(
        Side::Virtual,
        "ball",
        sphere(320),
        matt([0.0; 3]),
        place,
    ));
    let mut scene = scene(camera, rays_per_pixel, objects);
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    scene
}

/// Relative errors of what the ball takes from the strips and from the floor, the larger.
fn taken(
    backend: &mut Backend,
    scene: &Scene,
    strip_depth_m: f64,
    ball: DVec3,
    radius: f64,
) -> Result<Measured, StressError> {
    let shown = backend.render(scene)?;
    let (mut is, mut should) = ([0.0; 2], [0.0; 2]);
    for (pixel, value) in shown.picture.linear.iter().enumerate() {
        let (column, row) = (pixel as u32 % SIDE, pixel as u32 / SIDE);
        let strip = shows_strip(column);
        let depth = if strip { strip_depth_m } else { EYE_M };
        is[usize::from(strip)] += value.iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0;
        const POINTS: u32 = 4;
        for i in 0..POINTS * POINTS {
            let at = |pixel: u32, k: u32| {
                let px = f64::from(pixel) + (f64::from(k) + 0.5) / f64::from(POINTS);
                (px - 0.5 * f64::from(SIDE)) / FOCAL_PX * depth
            };
            let point = DVec3::new(at(column, i % POINTS), EYE_M - depth, at(row, i / POINTS));
            let to = ball - point;
            // -albedo L (r/d)^2 cos
            should[usize::from(strip)] -= ALBEDO * radius * radius / to.length_squared()
                * (to.y / to.length())
                / f64::from(POINTS * POINTS);
        }
    }
    let error = |of: usize| (is[of] / should[of] - 1.0).abs();
    Ok(Measured {
        figure: if error(0).is_nan() {
            f64::NAN
        } else {
            error(0).max(error(1))
        },
        ..Measured::of_film(&shown.film)
    })
}

/// Every second pixel of a sharing tile is so many times nearer than the others. Control: the ball a twentieth larger.
pub(super) fn apart(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let (ball, radius) = (DVec3::new(4.0, 3.6, 0.5), 0.25);
    let depth = EYE_M / at.value;
    let larger = if at.control { 1.05 } else { 1.0 };
    let scene = floor_and_strips(depth, ball, radius * larger, rays(at));
    taken(backend, &scene, depth, ball, radius)
}

/// The ball is seen from the floor and the strips at such an angle to them, radians. Control: the ball a twentieth larger.
pub(super) fn grazing_links(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    // The strips lie in the floor.
    let (distance, depth) = (8.0, EYE_M);
    let ball = DVec3::new(distance, at.value * distance, 0.0);
    let radius = 0.5 * at.value * distance;
    let larger = if at.control { 1.05 } else { 1.0 };
    let mut scene = floor_and_strips(0.5 * EYE_M, ball, radius * larger, rays(at));
    scene.objects.retain(|object| object.name != "strip");
    taken(backend, &scene, depth, ball, radius)
}
