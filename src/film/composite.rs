//! The composite over the photograph (Kan & Kaufmann 2012, Eq. 4, after Debevec 1998) and the other output planes.
//!
//! With a = M the fraction of virtual samples, Eq. 4 written so that nothing large is subtracted is
//!
//! ```text
//! If = (1-a) Ic + mean(m im) + mean((1-m)(im - ir)) - cov(m, ir)
//! cov(m, ir) = (1-a) mean(m ir) - a mean((1-m) ir)          normalised by 1/N: exactly Eq. 4
//! ```
//!
//! where the covariance is 0 unless 0 < a < 1.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Film, PixelSums, Sum3};
use crate::scene::{Composite, Photo};

/// The quotient composite divides by no less than this (linear photograph values; under half an 8-bit code at black).
pub const QUOTIENT_EPSILON: f64 = 1e-4;

/// A linear Rec.709 picture, row-major from the top left. Values may be negative or above 1: encoding clamps.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    pub linear: Vec<[f32; 3]>,
}

/// The output planes beside the composite, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    /// Im. Where no real ray was traced (`real` is 0) it is what the composite needs of it: `real + difference` always holds.
    pub mixed: Vec<[f32; 3]>,
    /// Ir; 0 where it was not traced.
    pub real: Vec<[f32; 3]>,
    /// Im - Ir, from the direct difference.
    pub difference: Vec<[f32; 3]>,
    /// Sample variance of the mean, channel by channel, of the additive composite: right for independent samples, an upper
    /// estimate for stratified ones; the second moment where there is only one sample.
    pub variance: Vec<[f32; 3]>,
    /// M, the fraction of rays that met virtual geometry first.
    pub mask: Vec<f32>,
    /// Rays that were traced.
    pub samples: Vec<f32>,
    /// Metres along the view axis, mean over the rays that met something; infinity if none did. Empty unless asked for.
    pub depth: Vec<f32>,
    /// World space, unit, or 0 if nothing was met. Empty unless asked for.
    pub normal: Vec<[f32; 3]>,
    /// Mean over the rays that met something. Empty unless asked for.
    pub albedo: Vec<[f32; 3]>,
}

/// The composited picture. Without a photograph Ic is 0.
pub fn composite(film: &Film, photo: Option<&Photo>, mode: Composite) -> Picture {
    let linear = (0..film.pixels.len())
        .into_par_iter()
        .map(|pixel| composite_pixel(&film.sums(pixel), photo_at(photo, pixel), mode))
        .collect();
    Picture {
        width: film.width,
        height: film.height,
        linear,
    }
}

/// The same with other differences where there are any, by pixel.
pub fn composite_smoothed(
    film: &Film,
    differences: &[Option<Sum3>],
    photo: Option<&Photo>,
    mode: Composite,
) -> Picture {
    let pixels = differences.par_iter().enumerate();
    let linear = pixels.map(|(pixel, smoothed)| {
        let mut sums = film.sums(pixel);
        sums.diff = smoothed.unwrap_or(sums.diff);
        composite_pixel(&sums, photo_at(photo, pixel), mode)
    });
    Picture {
        width: film.width,
        height: film.height,
        linear: linear.collect(),
    }
}

/// Ic of a pixel.
fn photo_at(photo: Option<&Photo>, pixel: usize) -> [f32; 3] {
    photo.map_or([0.0; 3], |photo| photo.linear[pixel])
}

/// Composite of one pixel over the photograph's `ic`, which a pixel that nothing virtual changed returns bit for bit. While an
/// edge pixel's real samples are still missing its covariance is left out, and `Quotient` without any real sample is additive.
pub fn composite_pixel(sums: &PixelSums, ic: [f32; 3], mode: Composite) -> [f32; 3] {
    let diff_sum = sums.diff.value();
    if sums.n == 0 || (sums.m == 0 && diff_sum == DVec3::ZERO) {
        return ic;
    }
    let means = Means::of(sums);
    let photo = Vec3::from(ic).as_dvec3() * (1.0 - means.mask);
    let value = match mode {
        Composite::Quotient if sums.n_real > 0 => photo * means.quotient() + means.m_im,
        _ => {
            let covariance = means.m_ir * (1.0 - means.mask) - means.r_ir * means.mask;
            photo + means.m_im + means.diff - covariance
        }
    };
    value.as_vec3().to_array()
}

/// What the pixel shows where nothing virtual covers it: the photograph with the shadows and reflections that its real samples found.
pub fn background_pixel(sums: &PixelSums, ic: [f32; 3], mode: Composite) -> [f32; 3] {
    let real = sums.n - sums.m;
    let diff_sum = sums.diff.value();
    if real == 0 || diff_sum == DVec3::ZERO {
        return ic;
    }
    let photo = Vec3::from(ic).as_dvec3();
    let value = match mode {
        Composite::Quotient if sums.n_real > 0 => photo * Means::of(sums).quotient(),
        _ => photo + diff_sum / f64::from(real),
    };
    value.as_vec3().to_array()
}

/// Means over the samples of a pixel.
pub(crate) struct Means {
    pub mask: f64,
    pub m_im: DVec3,
    pub diff: DVec3,
    /// 0 where no real sample was taken.
    pub m_ir: DVec3,
    pub r_ir: DVec3,
}

impl Means {
    pub fn of(sums: &PixelSums) -> Self {
        let n = f64::from(sums.n.max(1));
        let n_real = f64::from(sums.n_real.max(1));
        Self {
            mask: f64::from(sums.m) / n,
            m_im: sums.m_im.value() / n,
            diff: sums.diff.value() / n,
            m_ir: sums.m_ir.value() / n_real,
            r_ir: sums.r_ir.value() / n_real,
        }
    }

    /// What virtual things add to the real light that shows, and take from it, in the additive composite.
    pub fn change(&self) -> DVec3 {
        self.diff - (self.m_ir * (1.0 - self.mask) - self.r_ir * self.mask)
    }

    /// What the quotient composite multiplies the photograph with; right only where a real sample was taken.
    pub fn quotient(&self) -> DVec3 {
        DVec3::ONE + self.diff / self.r_ir.max(DVec3::splat(QUOTIENT_EPSILON))
    }
}

/// Variance of the mean of the per-sample composite m*im + (1-m)*(im - ir + Ic), from the sum of squares of its first two
/// terms; the share of the covariance term, which is of second order, is left out.
pub(super) fn variance_pixel(sums: &PixelSums, ic: [f32; 3]) -> DVec3 {
    if sums.n == 0 {
        return DVec3::ZERO;
    }
    let n = f64::from(sums.n);
    let second_moment = sums.sq.value() / n;
    if sums.n == 1 {
        return second_moment;
    }
    let Means {
        mask, m_im, diff, ..
    } = Means::of(sums);
    let ic = Vec3::from(ic).as_dvec3();
    let mean = m_im + diff;
    let with_photo = 2.0 * ic * (diff - mean * (1.0 - mask)) + ic * ic * (mask * (1.0 - mask));
    let spread = (second_moment - mean * mean + with_photo).max(DVec3::ZERO);
    spread / (n - 1.0)
}

/// Estimated root-mean-square error of the picture (linear), from the variance plane: an upper estimate for stratified samplers.
pub fn estimated_error(film: &Film, photo: Option<&Photo>) -> f64 {
    let sum: f64 = (0..film.pixels.len())
        .map(|pixel| variance_pixel(&film.sums(pixel), photo_at(photo, pixel)).element_sum() / 3.0)
        .sum();
    (sum / film.pixels.len().max(1) as f64).sqrt()
}

/// The `variance` plane alone.
pub fn variance(film: &Film, photo: Option<&Photo>) -> Vec<[f32; 3]> {
    (0..film.pixels.len())
        .into_par_iter()
        .map(|pixel| {
            variance_pixel(&film.sums(pixel), photo_at(photo, pixel))
                .as_vec3()
                .to_array()
        })
        .collect()
}

/// All planes but the composite.
pub fn planes(film: &Film, photo: Option<&Photo>) -> Planes {
    let rgb = |value: DVec3| value.as_vec3().to_array();
    let each = |f: &(dyn Fn(&PixelSums) -> [f32; 3] + Sync)| -> Vec<[f32; 3]> {
        (0..film.pixels.len())
            .into_par_iter()
            .map(|pixel| f(&film.sums(pixel)))
            .collect()
    };
    Planes {
        mixed: each(&|sums| {
            let m = Means::of(sums);
            rgb(m.m_im + m.diff + m.r_ir)
        }),
        real: each(&|sums| {
            let m = Means::of(sums);
            rgb(m.m_ir + m.r_ir)
        }),
        difference: each(&|sums| {
            let m = Means::of(sums);
            rgb(m.m_im - m.m_ir + m.diff)
        }),
        variance: variance(film, photo),
        mask: film
            .pixels
            .iter()
            .map(|s| Means::of(s).mask as f32)
            .collect(),
        samples: film.pixels.iter().map(|s| s.n as f32).collect(),
        depth: film
            .guides
            .iter()
            .map(|g| match g.hits {
                0 => f32::INFINITY,
                hits => (g.depth() / f64::from(hits)) as f32,
            })
            .collect(),
        normal: film
            .guides
            .iter()
            .map(|g| rgb(g.normal.value().normalize_or_zero()))
            .collect(),
        albedo: film
            .guides
            .iter()
            .map(|g| rgb(g.albedo.value() / f64::from(g.hits.max(1))))
            .collect(),
    }
}

#[cfg(test)]
mod tests;
