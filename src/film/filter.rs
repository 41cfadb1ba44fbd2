//! A filter for previews of a few rays per pixel. Biased: it blurs what the samples cannot tell from noise.
//!
//! What virtual objects change on diffuse real surfaces is smooth once divided by the albedo. It is smoothed by the edge-avoiding a-trous
//! wavelet (Dammertz et al. 2010), guided by the real surface's plane and normal and by the variance (Schied et al. 2017, the spatial part),
//! and multiplied back. The photograph and virtual surfaces are not touched.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Film, PixelSums, Sum3};
use crate::math::{exp_, luminance};

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
/// By distance from the middle, in taps.
const KERNEL: [f32; 2] = [1.0 / 2.0, 1.0 / 4.0];
/// Where the pixels lie whose values tell a pixel's variance: rows and columns off its own.
const NEAR: [i32; 3] = [-2, 0, 2];
/// Distance from the surface's plane, relative to its depth, at which a tap has fallen to 1/e.
const PLANE_TOLERANCE: f32 = 0.01;
const NORMAL_POWER: i32 = 32;
/// Standard deviations of brightness at which a tap has fallen to 1/e.
const DEVIATIONS: f32 = 3.0;
/// A tap that has fallen to less than exp of this counts for nothing.
const LEAST_EXPONENT: f32 = -12.0;
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
    let canvas = Canvas {
        width: film.width as i32,
        height: film.height as i32,
        surfaces: (film.pixels.par_iter().zip(surfaces))
            .map(|(sums, surface)| surface.filter(|_| sums.m < sums.n))
            .collect(),
    };
    let light: Vec<Vec3> = canvas.each(|place, surface| {
        let sums = film.sums(place.pixel);
        (sums.diff.value() / real_samples(&sums)).as_vec3() / divisor(surface)
    });
    let brightness: Vec<f32> = light.par_iter().map(|light| luminance(*light)).collect();
    let own: Vec<f32> =
        canvas.each(|place, surface| own_variance(&film.sums(place.pixel), divisor(surface)));
    let variance: Vec<f32> = canvas.each(|place, surface| {
        let by_samples = film.pixels[place.pixel].n >= ENOUGH_SAMPLES;
        canvas.variance(place, surface, by_samples, &brightness, &own)
    });
    let variance = canvas.blurred(&variance);
    let mut values: Vec<Value> =
        canvas.each(|Place { pixel, .. }, _| Value::of(light[pixel], variance[pixel]));
    for level in 0..LEVELS {
        values = canvas.each(|place, surface| canvas.level(place, surface, 1 << level, &values));
    }
    canvas.each(|place, surface| {
        let sums = &film.pixels[place.pixel];
        let sum = (values[place.pixel].light * divisor(surface)).as_dvec3() * real_samples(sums);
        Some(Sum3 {
            hi: sum.as_vec3().to_array(),
            lo: [0.0; 3],
        })
    })
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

/// A pixel of the canvas.
#[derive(Clone, Copy)]
struct Place {
    x: i32,
    y: i32,
    pixel: usize,
}

/// What a level of the wavelet makes of a pixel.
#[derive(Clone, Copy, Default)]
struct Value {
    light: Vec3,
    /// Its luminance.
    brightness: f32,
    variance: f32,
}

impl Value {
    fn of(light: Vec3, variance: f32) -> Self {
        Self {
            light,
            brightness: luminance(light),
            variance,
        }
    }
}

impl Canvas {
    /// A value for each pixel; the default where there is nothing to filter.
    fn each<T: Default + Clone + Send>(
        &self,
        f: impl Fn(Place, &RealSurface) -> T + Sync,
    ) -> Vec<T> {
        let width = self.width as usize;
        let mut values = vec![T::default(); self.surfaces.len()];
        let rows = values.par_chunks_mut(width).enumerate();
        rows.for_each(|(y, row)| {
            let surfaces = &self.surfaces[y * width..][..width];
            for (x, (value, surface)) in row.iter_mut().zip(surfaces).enumerate() {
                let place = Place {
                    x: x as i32,
                    y: y as i32,
                    pixel: y * width + x,
                };
                if let Some(surface) = surface {
                    *value = f(place, surface);
                }
            }
        });
        values
    }

    /// The pixel this far away, if it lies on the picture and is filtered too.
    fn neighbour(&self, from: Place, dx: i32, dy: i32) -> Option<(usize, &RealSurface)> {
        let (x, y) = (from.x + dx, from.y + dy);
        if x < 0 || y < 0 || x >= self.width || y >= self.height {
            return None;
        }
        let at = (y * self.width + x) as usize;
        Some((at, self.surfaces[at].as_ref()?))
    }

    /// Variance of a pixel's brightness: the neighbourhood's mean of what samples tell, or its spread where they are too few.
    fn variance(
        &self,
        place: Place,
        surface: &RealSurface,
        by_samples: bool,
        brightness: &[f32],
        own: &[f32],
    ) -> f32 {
        let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for dy in NEAR {
            for dx in NEAR {
                let Some((at, other)) = self.neighbour(place, dx, dy) else {
                    continue;
                };
                if by_samples && own[at] < 0.0 {
                    continue;
                }
                let weight = same_surface(surface, other);
                weights += weight;
                if by_samples {
                    sum += weight * own[at];
                } else {
                    sum += weight * brightness[at];
                    squares += weight * brightness[at] * brightness[at];
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
        self.each(|place, _| {
            let (mut weights, mut sum) = (0.0, 0.0);
            for dy in -1..=1_i32 {
                for dx in -1..=1_i32 {
                    if let Some((at, _)) = self.neighbour(place, dx, dy) {
                        let weight = 1.0 / (1 << (dx.abs() + dy.abs())) as f32;
                        weights += weight;
                        sum += weight * variance[at];
                    }
                }
            }
            sum / weights
        })
    }

    /// One level of the wavelet.
    fn level(&self, place: Place, surface: &RealSurface, step: i32, values: &[Value]) -> Value {
        let here = values[place.pixel];
        let per_deviation = 1.0 / (DEVIATIONS * here.variance.sqrt() + 1e-6);
        let mut weights = KERNEL[0] * KERNEL[0];
        let mut sum = here.light * weights;
        let mut spread = here.variance * weights * weights;
        for dy in -1..=1_i32 {
            for dx in -1..=1_i32 {
                let Some((at, other)) = self.neighbour(place, dx * step, dy * step) else {
                    continue;
                };
                if at == place.pixel {
                    continue;
                }
                let there = values[at];
                let exponent = plane_exponent(surface, other)
                    - (there.brightness - here.brightness).abs() * per_deviation;
                if exponent < LEAST_EXPONENT {
                    continue;
                }
                let [kx, ky] = [dx, dy].map(|d| KERNEL[d.unsigned_abs() as usize]);
                let weight = kx * ky * same_way(surface, other) * exp_(exponent);
                weights += weight;
                sum += there.light * weight;
                spread += there.variance * weight * weight;
            }
        }
        Value::of(sum / weights, spread / (weights * weights))
    }
}

/// 1 where both face the same way, towards 0 elsewhere.
fn same_way(a: &RealSurface, b: &RealSurface) -> f32 {
    a.normal.dot(b.normal).max(0.0).powi(NORMAL_POWER)
}

/// 0 where the second lies in the first one's plane, negative elsewhere.
fn plane_exponent(a: &RealSurface, b: &RealSurface) -> f32 {
    let off_plane = a.normal.dot(b.position - a.position).abs();
    -off_plane / (PLANE_TOLERANCE * a.depth_m.max(f32::MIN_POSITIVE))
}

/// 1 where both lie in one plane and face the same way, towards 0 elsewhere.
pub(super) fn same_surface(a: &RealSurface, b: &RealSurface) -> f32 {
    same_way(a, b) * plane_exponent(a, b).exp()
}

#[cfg(test)]
mod tests;
