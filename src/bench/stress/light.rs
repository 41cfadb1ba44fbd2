//! Light and sums against closed forms.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use super::backend::{Backend, StressError};
use super::scenes::{contact, glowing, named, square};
use super::{At, Effort, Measured};
use crate::bench::scenes::{camera, matt, object, place, scene};
use crate::scene::shape::sphere;
use crate::scene::{EncodedPhoto, Environment, EnvironmentMap, Photo, Scene, Side};

fn mean_of(pixels: impl Iterator<Item = [f32; 3]>) -> f64 {
    let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), p| {
        (
            sum + p.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0,
            count + 1.0,
        )
    });
    sum / count
}

const SKY_WIDTH: u32 = 512;
const SKY_HEIGHT: u32 = 256;
/// Column and row of the one bright texel: 40 degrees above the horizon, to the right.
const SUN_TEXEL: [u32; 2] = [330, 71];

/// Unit direction of a place on a lat-long map, in texels from its corner.
fn sky_direction(x: f64, y: f64) -> DVec3 {
    let (sin_phi, cos_phi) = ((x / f64::from(SKY_WIDTH) - 0.5) * TAU).sin_cos();
    let (sin_theta, cos_theta) = (y / f64::from(SKY_HEIGHT) * PI).sin_cos();
    DVec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

fn sun_direction() -> DVec3 {
    let [x, y] = SUN_TEXEL.map(|c| f64::from(c) + 0.5);
    sky_direction(x, y)
}

/// Irradiance of a plane that faces up under a sun of radiance 1: one texel, bilinear to its neighbours' centres.
fn sun_irradiance() -> f64 {
    const STEPS: u32 = 400;
    let mut sum = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS) * 2.0 - 1.0;
            let (du, dv) = (at(i), at(j));
            let [x, y] = SUN_TEXEL.map(|c| f64::from(c) + 0.5);
            let direction = sky_direction(x + du, y + dv);
            let sin_theta = (1.0 - direction.y * direction.y).sqrt();
            sum += (1.0 - du.abs()) * (1.0 - dv.abs()) * direction.y * sin_theta;
        }
    }
    let step = 2.0 / f64::from(STEPS);
    sum * (step * TAU / f64::from(SKY_WIDTH)) * (step * PI / f64::from(SKY_HEIGHT))
}

const SUNNY_ALBEDO: f32 = 0.5;

/// Left: a real table in the full shadow of a virtual screen. Right half: a virtual sheet in the full sun.
fn sunny(radiance: f64, rays_per_pixel: u32) -> Scene {
    let camera = camera([16, 8], 16.0, DVec3::Y * 2.0, DVec3::ZERO, -DVec3::Z);
    let gray = matt([SUNNY_ALBEDO; 3]);
    let sun = sun_direction();
    let above = DVec3::new(-0.625, 0.0, 0.0) + sun * 6.0;
    let across = DMat4::from_translation(above)
        * DMat4::from_quat(glam::DQuat::from_rotation_arc(DVec3::Y, sun));
    let mut scene = scene(
        camera,
        rays_per_pixel,
        vec![
            object(
                Side::Real,
                "table",
                square(4.0),
                gray.clone(),
                DMat4::IDENTITY,
            ),
            object(
                Side::Virtual,
                "sheet",
                square(0.5),
                gray,
                place(DVec3::new(0.5, 0.002, 0.0), 0.0),
            ),
            object(Side::Virtual, "screen", square(0.3), matt([0.0; 3]), across),
        ],
    );
    let mut texels = vec![[0.0; 3]; (SKY_WIDTH * SKY_HEIGHT) as usize];
    texels[(SUN_TEXEL[1] * SKY_WIDTH + SUN_TEXEL[0]) as usize] = [radiance as f32; 3];
    scene.environment = Some(Environment {
        map: EnvironmentMap::LatLong {
            width: SKY_WIDTH,
            height: SKY_HEIGHT,
            texels: Arc::new(texels),
        },
        rotation_deg: 0.0,
        scale: 1.0,
    });
    scene
}

/// The larger relative error of the sunlit sheet's radiance and of what the shadow takes. Control: a sun a tenth brighter.
pub(super) fn one_pixel_sun(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let rays = match at.effort {
        Effort::Quick => 256,
        Effort::Full => 4096,
    };
    let brighter = if at.control { 1.1 } else { 1.0 };
    let shown = backend.render(&sunny(at.value * brighter, rays))?;
    let lit = f64::from(SUNNY_ALBEDO) / PI * sun_irradiance() * at.value;
    // 8 pixels are a metre; the shadow's edges and the sheet's are left out.
    let mean = |columns: Range<usize>, rows: Range<usize>| {
        let pixels = shown.picture.linear.iter().enumerate();
        mean_of(
            pixels
                .filter(|(i, _)| columns.contains(&(i % 16)) && rows.contains(&(i / 16)))
                .map(|(_, value)| *value),
        )
    };
    let sheet = mean(9..15, 2..6) / lit - 1.0;
    let shadow = mean(2..4, 3..5) / -lit - 1.0;
    Ok(Measured {
        figure: worst([sheet.abs(), shadow.abs()]),
        ..Measured::of_film(&shown.film)
    })
}

/// The largest; not a number if one is not, which `f64::max` would pass over.
fn worst(figures: impl IntoIterator<Item = f64>) -> f64 {
    let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
    figures.into_iter().fold(0.0, larger)
}

/// A black ball over a matt plane under an even sky: the relative error of what it takes, over the whole picture. Control: the ball a
/// fiftieth larger.
pub(super) fn form_factor(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    const SIDE: u32 = 16;
    const FOCAL_PX: f64 = 20.0;
    const ALBEDO: f64 = 0.6;
    let (height, radius, eye) = (0.55, 0.25, 3.0);
    let camera = camera([SIDE; 2], FOCAL_PX, DVec3::Y * eye, DVec3::ZERO, -DVec3::Z);
    let rays = match at.effort {
        Effort::Quick => 256,
        Effort::Full => 4096,
    };
    let larger = if at.control { 1.02 } else { 1.0 };
    let ball = DMat4::from_translation(DVec3::Y * height)
        * DMat4::from_scale(DVec3::splat(radius * larger));
    let mut scene = scene(
        camera,
        rays,
        vec![
            object(
                Side::Real,
                "plane",
                square(5.0),
                matt([ALBEDO as f32; 3]),
                DMat4::IDENTITY,
            ),
            object(Side::Virtual, "ball", sphere(320), matt([0.0; 3]), ball),
        ],
    );
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    let offset = DVec3::new(1.0, 0.2, -3.0) * at.value;
    let shown = backend.render(&super::scenes::placed(&scene, at.value, offset))?;
    let (mut is, mut should) = (0.0, 0.0);
    for (pixel, sums) in shown.film.pixels.iter().enumerate() {
        if sums.m > 0 {
            continue;
        }
        is += mean_of(std::iter::once(shown.picture.linear[pixel]));
        const POINTS: u32 = 4;
        for i in 0..POINTS * POINTS {
            let at = |pixel: u32, k: u32| {
                let px = f64::from(pixel) + (f64::from(k) + 0.5) / f64::from(POINTS);
                (px - 0.5 * f64::from(SIDE)) / FOCAL_PX * eye
            };
            let (x, z) = (
                at(pixel as u32 % SIDE, i % POINTS),
                at(pixel as u32 / SIDE, i / POINTS),
            );
            let d2 = x * x + z * z + height * height;
            // -albedo L (r/d)^2 cos
            should -=
                ALBEDO * radius * radius / d2 * (height / d2.sqrt()) / f64::from(POINTS * POINTS);
        }
    }
    Ok(Measured {
        figure: (is / should - 1.0).abs(),
        ..Measured::of_film(&shown.film)
    })
}

/// So many samples of one value on one pixel: the relative error of their mean. Control: a plain f32 sum of them.
pub(super) fn many_samples(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let color = [0.1, 0.3, 0.7];
    let camera = camera([1, 1], 1.0, DVec3::Y, DVec3::ZERO, -DVec3::Z);
    let count = at.value as u32;
    let sheet = object(
        Side::Virtual,
        "sheet",
        square(4.0),
        glowing(color),
        DMat4::IDENTITY,
    );
    let shown = backend.render(&scene(camera, count, vec![sheet]))?;
    let mut mean = shown.picture.linear[0];
    if at.control {
        mean = color.map(|c| (0..count).fold(0.0_f32, |sum, _| sum + c) / count as f32);
    }
    let errors = mean
        .iter()
        .zip(color)
        .map(|(&is, should)| (f64::from(is) / f64::from(should) - 1.0).abs());
    Ok(Measured {
        figure: worst(errors),
        ..Measured::of_film(&shown.film)
    })
}

/// A photograph with nothing to add: 0, no geometry at all; 1, real geometry alone. Pixels that are not the photograph's own. Control: a
/// virtual box.
pub(super) fn nothing_virtual(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    let (width, height) = (scene.camera.width, scene.camera.height);
    scene.photo = Some(Photo {
        width,
        height,
        linear: (0..width * height)
            .map(|i| [0.0, 0.37, 0.61].map(|c| (c + 0.001 * i as f32).fract()))
            .collect(),
        encoded: EncodedPhoto::Linear,
        tags: Default::default(),
    });
    if !at.control {
        scene
            .objects
            .retain(|object| object.side == Side::Real && at.value > 0.0);
    }
    let shown = backend.render(&scene)?;
    let photo = scene.photo.iter().flat_map(|photo| &photo.linear);
    let changed = photo
        .zip(&shown.picture.linear)
        .filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    Ok(Measured {
        figure: changed.count() as f64,
        ..Measured::of_film(&shown.film)
    })
}

/// A surface that glows beyond what a sum can hold: samples not counted as unusable, one more if the first is not named so that it can be taken
/// again, one more if the picture is not finite.
/// Control: it glows as others do.
pub(super) fn counted_samples(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    let strength = if at.control { 1.0 } else { at.value as f32 };
    if let Some(object) = named(&mut scene, "tilted box") {
        let mut material = (*object.instances[0].material).clone();
        material.emissive = [strength; 3];
        object.instances[0].material = Arc::new(material);
    }
    // Alone, so that it lights nothing but the camera.
    scene.objects.retain(|object| object.name == "tilted box");
    scene.lights.clear();
    let shown = backend.render(&scene)?;
    let seen: u64 = shown.film.pixels.iter().map(|p| u64::from(p.m)).sum();
    let counted = shown.film.non_finite_samples();
    // What is named makes it again: that sample alone.
    let named = match shown.film.first_non_finite() {
        Some((pixel, sample)) => {
            let again = backend.render_samples(&scene, (sample, sample + 1))?;
            again.film.pixels[pixel].non_finite == 1
        }
        None => false,
    };
    let finite = shown
        .picture
        .linear
        .iter()
        .all(|p| p.iter().all(|c| c.is_finite()));
    let missing = seen.abs_diff(counted) + u64::from(!named) + u64::from(!finite);
    Ok(Measured {
        figure: missing as f64,
        ..Measured::of_film(&shown.film)
    })
}
