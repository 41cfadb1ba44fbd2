//! A filter for previews of a few rays per pixel. Biased: it blurs what the samples cannot tell from noise.
//!
//! What virtual objects change on diffuse real surfaces is smooth once divided by the albedo. It is smoothed by the edge-avoiding a-trous
//! wavelet (Dammertz et al. 2010), guided by the real surface's plane and normal and by the variance (Schied et al. 2017, the spatial part),
//! and multiplied back. The photograph and virtual surfaces are not touched.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Film, PixelSums, Sum3};
use crate::math::luminance;
use rows::Canvas;

mod rows;

/// The real surface that a pixel's rays meet, mean over the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealSurface {
    /// Relative to any point, metres.
    pub position: Vec3,
    /// Metres along the view axis.
    pub depth_m: f32,
    /// World space, unit.
    pub normal: Vec3,
    /// Linear, 0..1.
    pub albedo: Vec3,
}

/// Spacing of the taps doubles from 1 pixel; the last level reaches 16.
const LEVELS: u32 = 5;
/// Distance from the surface's plane, relative to its depth, at which a tap has fallen to 1/e.
const PLANE_TOLERANCE: f32 = 0.01;
/// A power of two.
const NORMAL_POWER: u32 = 32;
/// Albedo is taken to be no less.
const LEAST_ALBEDO: f32 = 0.01;
/// With fewer samples a pixel's own tell no variance, and its neighbours' spread has to.
const ENOUGH_SAMPLES: u32 = 4;

/// The film with its difference smoothed where `surfaces` (one a pixel) knows a diffuse real surface and samples met it.
pub fn filter_difference(film: &Film, surfaces: &[Option<RealSurface>]) -> Film {
    let smoothed = smoothed_difference(film, surfaces);
    let mut out = film.clone();
    // What photons brought is smoothed with the rest.
    out.set_photons(false);
    for (pixel, (sums, smoothed)) in out.pixels.iter_mut().zip(smoothed).enumerate() {
        *sums = film.sums(pixel);
        sums.diff = smoothed.unwrap_or(sums.diff);
    }
    out
}

/// By pixel, the sum of its differences after smoothing; `None`: it stays as it is.
pub fn smoothed_difference(film: &Film, surfaces: &[Option<RealSurface>]) -> Vec<Option<Sum3>> {
    let surfaces: Vec<_> = (film.pixels.par_iter().zip(surfaces))
        .map(|(sums, surface)| surface.filter(|_| sums.m < sums.n))
        .collect();
    let pixels = surfaces.par_iter().enumerate();
    let lights = pixels.map(|(pixel, surface)| {
        surface.map_or(Light::default(), |surface| {
            Light::of(&film.sums(pixel), divisor(&surface))
        })
    });
    let canvas = Canvas::new(film.width as usize, &surfaces);
    let mut values = canvas.values(&lights.collect::<Vec<_>>());
    for level in 0..LEVELS {
        values = canvas.level(1 << level, &values);
    }
    let pixels = surfaces.par_iter().enumerate();
    let smoothed = pixels.map(|(pixel, surface)| {
        let light = values.light(pixel) * divisor(surface.as_ref()?);
        let sum = light.as_dvec3() * real_samples(&film.pixels[pixel]);
        Some(Sum3 {
            hi: sum.as_vec3().to_array(),
            lo: [0.0; 3],
        })
    });
    smoothed.collect()
}

/// What samples tell of a pixel; 0 where it is not filtered.
#[derive(Clone, Copy, Default)]
struct Light {
    /// The mean difference over the albedo.
    mean: Vec3,
    /// They are enough to tell a variance.
    has_enough: bool,
    /// Variance of the mean's brightness, where there are enough and no other pixel's are among them.
    variance: Option<f32>,
}

impl Light {
    fn of(sums: &PixelSums, divisor: Vec3) -> Self {
        Self {
            mean: (sums.diff.value() / real_samples(sums)).as_vec3() / divisor,
            has_enough: sums.n >= ENOUGH_SAMPLES,
            variance: own_variance(sums, divisor),
        }
    }
}

fn real_samples(sums: &PixelSums) -> f64 {
    f64::from((sums.n - sums.m).max(1))
}

fn divisor(surface: &RealSurface) -> Vec3 {
    surface.albedo.max(Vec3::splat(LEAST_ALBEDO))
}

/// Variance of the brightness of a pixel's mean, from its own samples, where they tell.
fn own_variance(sums: &PixelSums, divisor: Vec3) -> Option<f32> {
    if sums.n < ENOUGH_SAMPLES || sums.m > 0 {
        return None;
    }
    let n = f64::from(sums.n);
    let mean = sums.diff.value() / n;
    let spread = (sums.sq.value() / n - mean * mean).max(DVec3::ZERO) / (n - 1.0);
    let deviation = luminance(spread.as_vec3().map(f32::sqrt) / divisor);
    Some(deviation * deviation)
}

/// 1 where both face the same way, towards 0 elsewhere; from the cosine between their normals.
#[inline]
fn same_way(cos: f32) -> f32 {
    let mut power = cos.max(0.0);
    for _ in 0..NORMAL_POWER.ilog2() {
        power *= power;
    }
    power
}

/// What a metre off a surface's plane counts for at such a depth.
#[inline]
fn plane_exponent_per_m(depth_m: f32) -> f32 {
    -1.0 / (PLANE_TOLERANCE * depth_m.max(f32::MIN_POSITIVE))
}

/// 1 where both lie in one plane and face the same way, towards 0 elsewhere.
pub(super) fn same_surface(a: &RealSurface, b: &RealSurface) -> f32 {
    let off_plane_m = a.normal.dot(b.position - a.position).abs();
    same_way(a.normal.dot(b.normal)) * (off_plane_m * plane_exponent_per_m(a.depth_m)).exp()
}

#[cfg(test)]
mod tests;
