//! The robust combination of the samples in the delivered picture's real pixels.
//!
//! A mean believes a rare bright sample as much as all others, and shows it as a speckle. How much a pixel may be believed its groups of samples
//! tell: the difference, over the photograph, is split into bands of growing width (the a-trous wavelet transform, Holschneider et al. 1989), and so
//! is each group's deviation from it; a band is kept as far as it exceeds what the groups' deviations explain (a Wiener filter with local
//! variances, Lee 1980):
//!
//! ```text
//! D' = D - sum over bands of min(1, V / P) w        P: mean square of the band w nearby, V: that of the error of its mean, by the groups
//! ```
//!
//! Groups go through the same sums as the difference, so that errors which neighbours have in common (shared second vertices) are seen as what they
//! are. A band has next to no mean: light that one pixel loses its neighbours gain. With more samples V falls to 0 and D' is the mean: it is consistent.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::groups::GROUPS;
use super::{Film, GroupSums, PixelKind, PixelSums, Sum3};
use crate::math::{hash_u32, luminance};
use crate::scene::Photo;

/// Bands: the widest reaches 32 pixels to either side.
const BANDS: u32 = 5;
const KERNEL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// Added to the photograph where it divides: the difference follows its texture, but not in black.
const LEAST_PHOTO: f32 = 0.02;

const DEVIATIONS: usize = GROUPS as usize;
/// The difference, the groups' deviations, and the weight of the pixel: 1 where it takes part.
const VALUES: usize = 3 + DEVIATIONS + 1;
type Values = [f32; VALUES];

/// A film as it is delivered.
#[derive(Clone, Debug)]
pub struct Combined {
    /// With what photons brought, and without groups.
    pub film: Film,
    /// Of the difference in real pixels, the share that went to other pixels nearby: 0 to 1.
    pub moved: f64,
}

/// Evaluations of the difference in each group, if `first` come before the film's and `end` before what follows it.
pub fn group_counts(first: u32, end: u32) -> [u32; DEVIATIONS] {
    let before = |end: u32, group: u32| (end + GROUPS - 1 - group) / GROUPS;
    std::array::from_fn(|group| before(end, group as u32) - before(first, group as u32))
}

/// The film with the difference of its real pixels combined robustly; it has groups. `counts`: evaluations of a pixel's difference, by group.
pub fn combine_robustly(
    film: &Film,
    photo: Option<&Photo>,
    counts: impl Fn(usize) -> [u32; DEVIATIONS] + Sync,
) -> Combined {
    let shrunk = Shrunk::of(film, photo, counts);
    with_difference(film, photo, |pixel| shrunk.taken[pixel])
}

/// What the photograph is divided into the difference of a pixel.
pub(super) fn divisor(photo: Option<&Photo>, pixel: usize) -> Vec3 {
    match photo {
        Some(photo) => Vec3::from(photo.linear[pixel]) + LEAST_PHOTO,
        None => Vec3::ONE,
    }
}

/// The film with what photons brought, less what is taken of each pixel's difference over the photograph.
pub(super) fn with_difference(
    film: &Film,
    photo: Option<&Photo>,
    taken: impl Fn(usize) -> Vec3 + Sync,
) -> Combined {
    let mut out = film.clone();
    out.set_photons(false);
    out.set_groups(false);
    let each = out.pixels.par_iter_mut().enumerate();
    let (moved, all) = each
        .map(|(pixel, sums)| {
            *sums = film.sums(pixel);
            let before = sums.diff.value();
            let taken = taken(pixel);
            if taken == Vec3::ZERO {
                return (0.0, magnitude(before));
            }
            let taken = (taken * divisor(photo, pixel)).as_dvec3() * f64::from(sums.n);
            sums.diff = Sum3::from(before - taken);
            (magnitude(taken), magnitude(before))
        })
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    Combined {
        film: out,
        // What one pixel loses another gains.
        moved: if all > 0.0 {
            (0.5 * moved / all).min(1.0)
        } else {
            0.0
        },
    }
}

fn magnitude(difference: DVec3) -> f64 {
    difference.abs().element_sum()
}

fn values_of(film: &Film, pixel: usize, divisor: Vec3, counts: [u32; DEVIATIONS]) -> Values {
    let samples = &film.pixels[pixel];
    let n = f64::from(samples.n);
    let mean = film.sums(pixel).diff.value() / n;
    let difference = mean.as_vec3() / divisor;
    let mut values = [0.0; VALUES];
    values[..3].copy_from_slice(&difference.to_array());
    values[VALUES - 1] = 1.0;
    let deviations = deviations(samples, &film.groups[pixel], counts);
    for (value, deviation) in values[3..].iter_mut().zip(deviations) {
        *value = luminance(deviation.as_vec3() / divisor);
    }
    // Photons have no groups. They are independent from pixel to pixel: as a deviation of random sign and group they give every sum the same
    // variance, in expectation.
    if let Some(splats) = film.splats.get(pixel) {
        let hash = hash_u32(pixel as u32);
        let sign = if hash & 1 == 0 { 1.0 } else { -1.0 };
        let deviation = splats.deviation(film.pixels.len() as f64).as_vec3();
        values[3 + (hash >> 1) as usize % DEVIATIONS] += sign * luminance(deviation / divisor);
    }
    values
}

/// Of each group, so that their squares add up to the variance of the pixel's mean.
fn deviations(
    sums: &PixelSums,
    groups: &GroupSums,
    counts: [u32; DEVIATIONS],
) -> [DVec3; DEVIATIONS] {
    let n = f64::from(sums.n);
    let all = sums.diff.value();
    let present = counts.iter().filter(|&&count| count > 0).count() as f64;
    if present < 2.0 {
        // One group tells nothing: the mean may be all error.
        let mut deviations = [DVec3::ZERO; DEVIATIONS];
        deviations[0] = all / n;
        return deviations;
    }
    let evaluations = f64::from(counts.iter().sum::<u32>());
    let unbiased = (present / (present - 1.0)).sqrt();
    let values = groups.values(all);
    std::array::from_fn(|group| {
        let share = f64::from(counts[group]) / evaluations;
        (values[group] - all * share) * (unbiased / n)
    })
}

/// The differences of a film's pixels over the photograph, and what the robust combination makes of them. All 0 where a pixel takes no part.
pub(super) struct Shrunk {
    pub difference: Vec<Vec3>,
    /// To be lost; negative where a pixel gains.
    pub taken: Vec<Vec3>,
    /// Variance of the difference's brightness, by the groups of the pixels around; 0 also where a pixel takes no part.
    pub variance: Vec<f32>,
    pub takes_part: Vec<bool>,
}

impl Shrunk {
    /// As [`combine_robustly`].
    pub fn of(
        film: &Film,
        photo: Option<&Photo>,
        counts: impl Fn(usize) -> [u32; DEVIATIONS] + Sync,
    ) -> Self {
        let values: Vec<Values> = (0..film.pixels.len())
            .into_par_iter()
            .map(|pixel| match film.kind(pixel) {
                PixelKind::Background => {
                    values_of(film, pixel, divisor(photo, pixel), counts(pixel))
                }
                PixelKind::Edge | PixelKind::Virtual | PixelKind::Skipped => [0.0; VALUES],
            })
            .collect();
        let mut shrunk = Self {
            difference: values.iter().map(|v| Vec3::from_slice(v)).collect(),
            taken: vec![Vec3::ZERO; values.len()],
            variance: Vec::new(),
            takes_part: values.iter().map(|v| v[VALUES - 1] > 0.0).collect(),
        };
        shrunk.shrink(film.width as usize, values);
        shrunk
    }

    fn shrink(&mut self, width: usize, values: Vec<Values>) {
        let mut fine = values;
        for band in 0..BANDS {
            let step = 1 << band;
            let coarse = smoothed(&fine, width, step);
            // Band, squared error of its mean, weight.
            let powers: Vec<[f32; 3]> = (fine.par_iter().zip(&coarse))
                .map(|(fine, coarse)| powers(fine, coarse))
                .collect();
            let powers = smoothed(&powers, width, step);
            (self.taken.par_iter_mut().zip(&powers))
                .zip(fine.par_iter().zip(&coarse))
                .for_each(|((taken, &[power, error, weight]), (fine, coarse))| {
                    if weight > 0.0 && error > 0.0 {
                        *taken += (error / power).min(1.0) * difference(fine, coarse);
                    }
                });
            if band == 0 {
                self.variance = smoothed(&powers, width, 1).iter().map(|p| p[1]).collect();
            }
            fine = coarse;
        }
    }
}

fn difference(fine: &Values, coarse: &Values) -> Vec3 {
    Vec3::from_slice(fine) - Vec3::from_slice(coarse)
}

fn powers(fine: &Values, coarse: &Values) -> [f32; 3] {
    let band = luminance(difference(fine, coarse));
    let deviations = fine[3..3 + DEVIATIONS].iter().zip(&coarse[3..]);
    let error = deviations.map(|(fine, coarse)| (fine - coarse) * (fine - coarse));
    [band * band, error.sum(), fine[VALUES - 1]]
}

/// Mean over the pixels that take part around each of them, `step` pixels from tap to tap; the last value is the weight, and stays.
fn smoothed<const N: usize>(values: &[[f32; N]], width: usize, step: usize) -> Vec<[f32; N]> {
    let height = values.len() / width.max(1);
    let tapped = |at: usize, along: usize, length: usize, source: &[[f32; N]], stride: usize| {
        let mut sum = [0.0; N];
        for (tap, weight) in KERNEL.into_iter().enumerate() {
            let place = (along + tap * step).wrapping_sub(2 * step);
            if place < length {
                let value = &source[at + place * stride - along * stride];
                for (sum, value) in sum.iter_mut().zip(value) {
                    *sum += weight * value;
                }
            }
        }
        sum
    };
    let rows: Vec<[f32; N]> = (0..values.len())
        .into_par_iter()
        .map(|at| tapped(at, at % width, width, values, 1))
        .collect();
    (0..values.len())
        .into_par_iter()
        .map(|at| {
            let member = values[at][N - 1];
            if member == 0.0 {
                return [0.0; N];
            }
            let mut mean = tapped(at, at / width, height, &rows, width);
            let weight = mean[N - 1];
            for value in &mut mean {
                *value /= weight;
            }
            mean[N - 1] = member;
            mean
        })
        .collect()
}

#[cfg(test)]
mod tests;
