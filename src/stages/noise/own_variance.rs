//! How much a film's composite varies by itself, because it is an estimate.
//!
//! The samples' variance over their number would be it for independent samples; stratified ones err far less, how far depends on what
//! they integrate. Two upper estimates are at hand, and the smaller one is taken: the samples' variance times what stratification gains
//! on defocused edges, the hardest case; and the variance within 5 x 5 pixels about their plane, which texture enlarges.

use std::ops::Range;

use rayon::prelude::*;

use crate::film::{Film, Means, Picture, QUOTIENT_EPSILON, variance};
use crate::scene::{Photo, SamplerKind};

/// Half of the window.
const REACH: usize = 2;
const SIDE: usize = 2 * REACH + 1;
const COUNT: f32 = (SIDE * SIDE) as f32;
/// Sum of squared offsets from the centre, over the window.
const SPREAD: f32 = 50.0;

/// A variance below this share of the camera's is not worth a closer look.
const NEGLIGIBLE: f32 = 0.02;

/// Variance of `picture`, linear, that stems from the rendering; 0 where a single sample says nothing about it. `ratio` is what the quotient
/// composite multiplied the photograph with, None for the additive one; `gain` what stages have multiplied the variance with since. `camera_sigma_dn` is the camera's smallest sigma: what is far below it is
/// only roughly estimated.
pub fn own_variance(
    film: &Film,
    picture: &Picture,
    photo: Option<&Photo>,
    ratio: Option<&[[f32; 3]]>,
    sampler: SamplerKind,
    gain: f32,
    camera_sigma_dn: f32,
) -> Vec<[f32; 3]> {
    let mut plane = variance(film, photo);
    if let (Some(_), Some(photo)) = (ratio, photo) {
        scale_to_quotient(&mut plane, film, photo);
    }
    let (width, height) = (film.width as usize, film.height as usize);
    // By row, the columns that deserve a closer look.
    let ranges: Vec<Range<usize>> = plane
        .par_chunks_mut(width)
        .enumerate()
        .map(|(y, row)| {
            let mut range = width..0;
            for (x, variance) in row.iter_mut().enumerate() {
                let index = y * width + x;
                let gain = match film.pixels[index].n {
                    0 | 1 => 0.0,
                    n => gain * stratification_gain(sampler, n),
                };
                *variance = variance.map(|v| v * gain);
                if !is_negligible(variance, &picture.linear[index], camera_sigma_dn) {
                    range = range.start.min(x)..x + 1;
                }
            }
            range
        })
        .collect();
    let estimate = without_photo(film, picture, photo, ratio, &|y| {
        let rows = &ranges[y.saturating_sub(REACH)..(y + REACH + 1).min(height)];
        let start = rows.iter().map(|range| range.start).min().unwrap_or(0);
        let end = rows.iter().map(|range| range.end).max().unwrap_or(0);
        start.saturating_sub(REACH)..(end + REACH).min(width)
    });
    plane
        .par_chunks_mut(width)
        .zip(&ranges)
        .enumerate()
        .for_each(|(y, (row, range))| {
            for x in range.clone() {
                let index = y * width + x;
                if is_negligible(&row[x], &picture.linear[index], camera_sigma_dn) {
                    continue;
                }
                let spread = spread_about_plane(&estimate, width, height, x, y);
                for c in 0..3 {
                    row[x][c] = row[x][c].min(spread[c]);
                }
            }
        });
    plane
}

/// The quotient composite multiplies what the difference brings by the photograph over the real radiance.
fn scale_to_quotient(plane: &mut [[f32; 3]], film: &Film, photo: &Photo) {
    for ((variance, sums), ic) in plane.iter_mut().zip(&film.pixels).zip(&photo.linear) {
        if sums.n_real == 0 || sums.m == sums.n {
            continue;
        }
        let means = Means::of(sums);
        let share = 1.0 - means.mask as f32;
        let real = means.r_ir.as_vec3();
        for c in 0..3 {
            let gain = share * ic[c] / real[c].max(QUOTIENT_EPSILON as f32);
            // What virtual surfaces bring is not multiplied.
            let gain = if sums.m > 0 { gain.max(1.0) } else { gain };
            variance[c] *= gain * gain;
        }
    }
}

/// Far below the camera's own variance at these linear values. The curve's slope is bounded from below by its straight end and by twice
/// the value.
fn is_negligible(variance: &[f32; 3], linear: &[f32; 3], camera_sigma_dn: f32) -> bool {
    (0..3).all(|c| {
        let slope = (2.0 * linear[c].min(1.0)).max(1.0 / 12.92);
        let sigma = camera_sigma_dn * (1.0 / 255.0) * slope;
        variance[c] <= NEGLIGIBLE * sigma * sigma
    })
}

/// Variance of a stratified mean over that of independent samples, at the most. Whole pixels of defocused edges gain n^-0.4 (Sobol and cmj) and
/// n^-0.25 (jittered) and more; samples that the plan spreads over turns gain less, and too low a bound would cut the closer estimate short.
fn stratification_gain(sampler: SamplerKind, samples: u32) -> f32 {
    let exponent = match sampler {
        SamplerKind::Sobol | SamplerKind::Cmj => -0.2,
        SamplerKind::Jittered => -0.125,
    };
    (samples as f32).powf(exponent)
}

/// The picture with the photograph's part smoothed, so that its noise and texture do not count as the estimate's; only the columns that
/// `wanted` gives for each row.
fn without_photo(
    film: &Film,
    picture: &Picture,
    photo: Option<&Photo>,
    ratio: Option<&[[f32; 3]]>,
    wanted: &(dyn Fn(usize) -> Range<usize> + Sync),
) -> Vec<[f32; 3]> {
    let (width, height) = (film.width as usize, film.height as usize);
    let mut out = picture.linear.clone();
    let Some(photo) = photo else { return out };
    out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for x in wanted(y) {
            let value = &mut row[x];
            let sums = &film.pixels[y * width + x];
            let share = 1.0 - Means::of(sums).mask as f32;
            if share == 0.0 {
                continue;
            }
            let mut mean = [0.0f32; 3];
            for_window(width, height, x, y, |index, _, _| {
                for (mean, own) in mean.iter_mut().zip(photo.linear[index]) {
                    *mean += own;
                }
            });
            let own = photo.linear[y * width + x];
            let ratio = ratio.map_or([1.0; 3], |ratio| ratio[y * width + x]);
            for c in 0..3 {
                value[c] -= share * ratio[c] * (own[c] - mean[c] / COUNT);
            }
        }
    });
    out
}

/// Calls `visit` with the index and offset of each pixel of the window; beyond the border the last one stands in.
fn for_window(
    width: usize,
    height: usize,
    x: usize,
    y: usize,
    mut visit: impl FnMut(usize, f32, f32),
) {
    for dy in 0..SIDE {
        let row = (y + dy).saturating_sub(REACH).min(height - 1);
        for dx in 0..SIDE {
            let column = (x + dx).saturating_sub(REACH).min(width - 1);
            let offset = |d: usize| d as f32 - REACH as f32;
            visit(row * width + column, offset(dx), offset(dy));
        }
    }
}

fn spread_about_plane(
    values: &[[f32; 3]],
    width: usize,
    height: usize,
    x: usize,
    y: usize,
) -> [f32; 3] {
    let center = values[y * width + x];
    // Sum, sum times dx, sum times dy, sum of squares, of the difference to the centre.
    let mut sums = [[0.0f32; 4]; 3];
    for_window(width, height, x, y, |index, dx, dy| {
        for c in 0..3 {
            let d = values[index][c] - center[c];
            let sums = &mut sums[c];
            sums[0] += d;
            sums[1] += d * dx;
            sums[2] += d * dy;
            sums[3] += d * d;
        }
    });
    sums.map(|[sum, slope_x, slope_y, squares]| {
        let plane = sum * sum / COUNT + (slope_x * slope_x + slope_y * slope_y) / SPREAD;
        (squares - plane).max(0.0) / (COUNT - 3.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_no_spread_and_noise_has_its_own() {
        let (width, height) = (64, 64);
        let noise = |i: usize| {
            let u = |k| crate::math::uniform_from_bits(crate::math::hash_combine(i as u32, k));
            // Variance 1/12 each
            u(1) + u(2) + u(3) - 1.5
        };
        let values = |amount: f32| -> Vec<[f32; 3]> {
            (0..width * height)
                .map(|i| {
                    [0.3 * (i % width) as f32 - 0.2 * (i / width) as f32 + amount * noise(i); 3]
                })
                .collect()
        };
        let mean = |values: &[[f32; 3]]| {
            let inner = (4..60).flat_map(|y| (4..60).map(move |x| (x, y)));
            let spreads: Vec<f32> = inner
                .map(|(x, y)| spread_about_plane(values, width, height, x, y)[0])
                .collect();
            spreads.iter().sum::<f32>() / spreads.len() as f32
        };
        assert!(mean(&values(0.0)) < 1e-6);
        let spread = mean(&values(2.0));
        assert!((spread - 1.0).abs() < 0.03, "{spread}");
    }
}
