//! The final-quality filter of the difference, for stills and videos. Biased, and consistent: with more samples it comes to the mean.
//!
//! The robust combination is blurred where noise hides an edge. The means themselves are therefore averaged once more, over the pixels nearby whose
//! robust combination is alike (the cross-bilateral filter, Eisemann and Durand 2004), as far as they lie on the same real surface.

use glam::Vec3;
use rayon::prelude::*;

use super::Film;
use super::combine::{Shrunk, with_difference};
use super::filter::{RealSurface, same_surface};
use super::groups::GROUPS;
use crate::math::luminance;
use crate::scene::Photo;

/// Pixels to either side.
const REACH: i32 = 5;
/// Standard deviation of the weights over distance, pixels.
const SPREAD_PX: f32 = 2.5;
/// Brightness that differs by this many of the mean's standard deviations is alike with weight 1/sqrt(e).
const DEVIATIONS: f32 = 1.0;

/// The film with its difference filtered in real pixels; it has groups, whose evaluations `counts` tells. `surfaces`: one a pixel, where it is
/// diffuse.
pub fn filter_finally(
    film: &Film,
    photo: Option<&Photo>,
    surfaces: &[Option<RealSurface>],
    counts: impl Fn(usize) -> [u32; GROUPS as usize] + Sync,
) -> Film {
    let shrunk = Shrunk::of(film, photo, counts);
    let guide: Vec<Vec3> = (shrunk.difference.iter().zip(&shrunk.taken))
        .map(|(difference, taken)| difference - taken)
        .collect();
    let canvas = Canvas {
        width: film.width as i32,
        height: film.height as i32,
        shrunk: &shrunk,
        guide: &guide,
        surfaces,
    };
    let taken: Vec<Vec3> = (0..film.pixels.len())
        .into_par_iter()
        .map(|pixel| match shrunk.takes_part[pixel] {
            true => shrunk.difference[pixel] - canvas.filtered(pixel),
            false => Vec3::ZERO,
        })
        .collect();
    with_difference(film, photo, |pixel| taken[pixel]).film
}

struct Canvas<'a> {
    width: i32,
    height: i32,
    shrunk: &'a Shrunk,
    guide: &'a [Vec3],
    surfaces: &'a [Option<RealSurface>],
}

impl Canvas<'_> {
    fn filtered(&self, pixel: usize) -> Vec3 {
        let variance = DEVIATIONS * DEVIATIONS * self.shrunk.variance[pixel];
        if variance <= 0.0 {
            return self.shrunk.difference[pixel];
        }
        let here = luminance(self.guide[pixel]);
        let (x, y) = (pixel as i32 % self.width, pixel as i32 / self.width);
        let (mut weights, mut sum) = (0.0, Vec3::ZERO);
        for dy in (-y).max(-REACH)..=(self.height - 1 - y).min(REACH) {
            for dx in (-x).max(-REACH)..=(self.width - 1 - x).min(REACH) {
                let at = ((y + dy) * self.width + x + dx) as usize;
                if !self.shrunk.takes_part[at] {
                    continue;
                }
                let off = luminance(self.guide[at]) - here;
                let away = (dx * dx + dy * dy) as f32 / (SPREAD_PX * SPREAD_PX);
                let alike = (-0.5 * (off * off / variance + away)).exp();
                let weight = alike * self.one_surface(pixel, at);
                weights += weight;
                sum += self.shrunk.difference[at] * weight;
            }
        }
        sum / weights
    }

    fn one_surface(&self, a: usize, b: usize) -> f32 {
        match (&self.surfaces[a], &self.surfaces[b]) {
            (Some(a), Some(b)) => same_surface(a, b),
            (None, None) => 1.0,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::group_counts;
    use crate::film::test_support::noise;

    const WIDTH: usize = 96;

    /// A step of the difference across the middle under noise of `samples` samples.
    fn film(samples: u32) -> Film {
        let mut film = Film::new(WIDTH as u32, WIDTH as u32, 0, false);
        film.set_groups(true);
        for pixel in 0..film.pixels.len() {
            for sample in 0..samples {
                let noise = noise(pixel as u32 * 1024 + sample) - 0.5;
                film.add_difference(pixel, sample, Vec3::splat(step(pixel) + noise));
            }
        }
        film
    }

    fn step(pixel: usize) -> f32 {
        if pixel % WIDTH < WIDTH / 2 { 0.0 } else { -0.4 }
    }

    /// RMS error, all over and beside the step.
    fn errors(film: &Film) -> [f64; 2] {
        let beside = |x: usize| x.abs_diff(WIDTH / 2) < 3;
        [
            (0..WIDTH).collect::<Vec<_>>(),
            (0..WIDTH).filter(|&x| beside(x)).collect(),
        ]
        .map(|columns| {
            let pixels = (0..WIDTH).flat_map(|y| columns.iter().map(move |x| y * WIDTH + x));
            let squares = pixels.clone().map(|pixel| {
                let mean = film.pixels[pixel].diff.value().x / f64::from(film.pixels[pixel].n);
                (mean - f64::from(step(pixel))).powi(2)
            });
            (squares.sum::<f64>() / pixels.count() as f64).sqrt()
        })
    }

    /// Noise falls to less than half, which is what flickers from frame to frame, and the step stays sharper than the robust combination leaves it.
    #[test]
    fn noise_goes_and_a_step_stays() {
        let film = film(25);
        let counts = |_| group_counts(0, 25);
        let none = vec![None; film.pixels.len()];
        let [noise, _] = errors(&film);
        let [robust, robust_beside] =
            errors(&super::super::combine_robustly(&film, None, counts).film);
        let [left, beside] = errors(&filter_finally(&film, None, &none, counts));
        assert!(left < 0.5 * noise, "{left} {noise}");
        assert!(
            left < robust && beside < robust_beside,
            "{left} {robust} {beside} {robust_beside}"
        );
    }

    /// Across the border of two surfaces nothing is averaged.
    #[test]
    fn surfaces_are_kept_apart() {
        let film = film(25);
        let counts = |_| group_counts(0, 25);
        let surface = |pixel: usize| RealSurface {
            position: Vec3::ZERO,
            depth_m: 1.0,
            normal: if step(pixel) < 0.0 { Vec3::X } else { Vec3::Y },
            albedo: Vec3::ONE,
        };
        let surfaces: Vec<_> = (0..film.pixels.len())
            .map(|pixel| Some(surface(pixel)))
            .collect();
        let none = vec![None; film.pixels.len()];
        let beside = |surfaces: &[Option<RealSurface>]| {
            errors(&filter_finally(&film, None, surfaces, counts))[1]
        };
        assert!(beside(&surfaces) < beside(&none));
    }

    #[test]
    fn with_more_samples_it_comes_to_the_mean() {
        let distance = |samples: u32| {
            let film = film(samples);
            let none = vec![None; film.pixels.len()];
            let out = filter_finally(&film, None, &none, |_| group_counts(0, samples));
            let mean = |film: &Film, pixel: usize| film.pixels[pixel].diff.value().x;
            let apart = |pixel| (mean(&film, pixel) - mean(&out, pixel)) / f64::from(samples);
            let squares = (0..film.pixels.len()).map(|pixel| apart(pixel).powi(2));
            (squares.sum::<f64>() / film.pixels.len() as f64).sqrt()
        };
        let [few, many] = [10, 250].map(distance);
        assert!(many < 0.5 * few, "{few} {many}");
    }
}
