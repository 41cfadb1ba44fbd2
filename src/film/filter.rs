//! A filter for previews of a few rays per pixel. Biased: it blurs what the samples cannot tell from noise.
//!
//! What virtual objects change on diffuse real surfaces is smooth once divided by the albedo. It is smoothed by the edge-avoiding a-trous
//! wavelet (Dammertz et al. 2010), guided by the real surface's plane and normal and by the variance (Schied et al. 2017, the spatial part),
//! and multiplied back. The photograph and virtual surfaces are not touched.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Film, PixelSums, Sum3};
use crate::math::luminance;

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

/// Spacing of the taps doubles from 1 pixel; the last level reaches 32.
const LEVELS: u32 = 5;
const KERNEL: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Pixels to either side whose values tell a pixel's variance.
const NEAR: i32 = 3;
/// Distance from the surface's plane, relative to its depth, at which a tap has fallen to 1/e.
const PLANE_TOLERANCE: f32 = 0.01;
const NORMAL_POWER: i32 = 32;
/// Standard deviations of brightness at which a tap has fallen to 1/e.
const DEVIATIONS: f32 = 3.0;
/// Albedo is taken to be no less.
const LEAST_ALBEDO: f32 = 0.01;
/// With fewer samples a pixel's own tell no variance, and its neighbours' spread has to.
const ENOUGH_SAMPLES: u32 = 4;

/// The film with its difference smoothed where `surfaces` (one a pixel) knows a diffuse real surface and samples met it.
pub fn filter_difference(film: &Film, surfaces: &[Option<RealSurface>]) -> Film {
    let canvas = Canvas {
        width: film.width as i32,
        height: film.height as i32,
        surfaces: (film.pixels.iter().zip(surfaces))
            .map(|(sums, surface)| surface.filter(|_| sums.m < sums.n))
            .collect(),
    };
    let light: Vec<Vec3> = canvas.each(|pixel, surface| {
        let sums = film.sums(pixel);
        (sums.diff.value() / real_samples(&sums)).as_vec3() / divisor(surface)
    });
    let own: Vec<f32> =
        canvas.each(|pixel, surface| own_variance(&film.sums(pixel), divisor(surface)));
    let mut variance: Vec<f32> =
        canvas.each(|pixel, surface| canvas.variance(film, pixel, surface, &light, &own));
    let mut light = light;
    for level in 0..LEVELS {
        let smooth = canvas.blurred(&variance);
        let both: Vec<(Vec3, f32)> = canvas.each(|pixel, surface| {
            canvas.level(pixel, surface, 1 << level, &light, &variance, &smooth)
        });
        (light, variance) = both.into_iter().unzip();
    }
    let mut out = film.clone();
    // What photons brought is smoothed with the rest.
    out.set_photons(false);
    for (pixel, sums) in out.pixels.iter_mut().enumerate() {
        *sums = film.sums(pixel);
    }
    out.pixels
        .par_iter_mut()
        .zip(&canvas.surfaces)
        .zip(&light)
        .for_each(|((sums, surface), light)| {
            if let Some(surface) = surface {
                let sum = (*light * divisor(surface)).as_dvec3() * real_samples(sums);
                sums.diff = Sum3 {
                    hi: sum.as_vec3().to_array(),
                    lo: [0.0; 3],
                };
            }
        });
    out
}

fn real_samples(sums: &PixelSums) -> f64 {
    f64::from((sums.n - sums.m).max(1))
}

fn divisor(surface: &RealSurface) -> Vec3 {
    surface.albedo.max(Vec3::splat(LEAST_ALBEDO))
}

/// Variance of the brightness of a pixel's mean, from its own samples; negative where they do not tell.
fn own_variance(sums: &PixelSums, divisor: Vec3) -> f32 {
    if sums.n < ENOUGH_SAMPLES || sums.m > 0 {
        return -1.0;
    }
    let n = f64::from(sums.n);
    let mean = sums.diff.value() / n;
    let spread = (sums.sq.value() / n - mean * mean).max(DVec3::ZERO) / (n - 1.0);
    let deviation = luminance(spread.as_vec3().map(f32::sqrt) / divisor);
    deviation * deviation
}

/// The pixels that the filter works on.
struct Canvas {
    width: i32,
    height: i32,
    surfaces: Vec<Option<RealSurface>>,
}

impl Canvas {
    /// A value for each pixel; the default where there is nothing to filter.
    fn each<T: Default + Send>(&self, f: impl Fn(usize, &RealSurface) -> T + Sync) -> Vec<T> {
        let each = self.surfaces.par_iter().enumerate();
        each.map(|(pixel, surface)| surface.as_ref().map_or_else(T::default, |s| f(pixel, s)))
            .collect()
    }

    /// The pixels this far away that lie on the picture and are filtered too.
    fn neighbour(&self, pixel: usize, dx: i32, dy: i32) -> Option<(usize, &RealSurface)> {
        let x = pixel as i32 % self.width + dx;
        let y = pixel as i32 / self.width + dy;
        if x < 0 || y < 0 || x >= self.width || y >= self.height {
            return None;
        }
        let at = (y * self.width + x) as usize;
        Some((at, self.surfaces[at].as_ref()?))
    }

    /// Variance of a pixel's brightness: the neighbourhood's mean of what samples tell, or its spread where they are too few.
    fn variance(
        &self,
        film: &Film,
        pixel: usize,
        surface: &RealSurface,
        light: &[Vec3],
        own: &[f32],
    ) -> f32 {
        let by_samples = film.pixels[pixel].n >= ENOUGH_SAMPLES;
        let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for dy in -NEAR..=NEAR {
            for dx in -NEAR..=NEAR {
                let Some((at, other)) = self.neighbour(pixel, dx, dy) else {
                    continue;
                };
                if by_samples && own[at] < 0.0 {
                    continue;
                }
                let weight = same_surface(surface, other);
                let brightness = luminance(light[at]);
                weights += weight;
                if by_samples {
                    sum += weight * own[at];
                } else {
                    sum += weight * brightness;
                    squares += weight * brightness * brightness;
                }
            }
        }
        if weights <= 0.0 {
            return 0.0;
        }
        let mean = sum / weights;
        if by_samples {
            mean
        } else {
            (squares / weights - mean * mean).max(0.0)
        }
    }

    /// 3 x 3 binomial, so that one pixel's lucky variance does not shut it off.
    fn blurred(&self, variance: &[f32]) -> Vec<f32> {
        self.each(|pixel, _| {
            let (mut weights, mut sum) = (0.0, 0.0);
            for dy in -1..=1_i32 {
                for dx in -1..=1_i32 {
                    if let Some((at, _)) = self.neighbour(pixel, dx, dy) {
                        let weight = 1.0 / (1 << (dx.abs() + dy.abs())) as f32;
                        weights += weight;
                        sum += weight * variance[at];
                    }
                }
            }
            sum / weights
        })
    }

    /// One level of the wavelet: light and its variance.
    fn level(
        &self,
        pixel: usize,
        surface: &RealSurface,
        step: i32,
        light: &[Vec3],
        variance: &[f32],
        smooth: &[f32],
    ) -> (Vec3, f32) {
        let here = luminance(light[pixel]);
        let deviation = DEVIATIONS * smooth[pixel].sqrt() + 1e-6;
        let (mut weights, mut sum, mut spread) = (0.0, Vec3::ZERO, 0.0);
        for dy in -2..=2_i32 {
            for dx in -2..=2_i32 {
                let Some((at, other)) = self.neighbour(pixel, dx * step, dy * step) else {
                    continue;
                };
                let [kx, ky] = [dx, dy].map(|d| KERNEL[d.unsigned_abs() as usize]);
                let off = (luminance(light[at]) - here).abs() / deviation;
                let weight = kx * ky * same_surface(surface, other) * (-off).exp();
                weights += weight;
                sum += light[at] * weight;
                spread += variance[at] * weight * weight;
            }
        }
        (sum / weights, spread / (weights * weights))
    }
}

/// 1 where both lie in one plane and face the same way, towards 0 elsewhere.
pub(super) fn same_surface(a: &RealSurface, b: &RealSurface) -> f32 {
    let off_plane = a.normal.dot(b.position - a.position).abs();
    let normal = a.normal.dot(b.normal).max(0.0).powi(NORMAL_POWER);
    normal * (-off_plane / (PLANE_TOLERANCE * a.depth_m.max(f32::MIN_POSITIVE))).exp()
}

#[cfg(test)]
mod tests;
