//! The mean of independent scrambles, and the standard error that their spread states.
//!
//! A scramble is a whole render with random numbers of its own. The variance of its samples overstates the error of a stratified sampler; the
//! spread between scrambles states what really is left. The composite is not a sum of samples (Eq. 4 multiplies M with Ir), so the spread is that
//! of its linear part about the mean of all scrambles (the delta method).

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::composite::{Means, QUOTIENT_EPSILON};
use super::{Film, GroupSums, GuideSums, PixelSums, SplatSums, group_add};
use crate::scene::{Composite, Photo};

/// What the composite of one channel is made of, scramble by scramble.
const TERMS: usize = 4;

/// Means and sums of products of deviations from them (Welford's recurrence).
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    mean: [f64; TERMS],
    /// Upper triangle, row by row.
    products: [f64; TERMS * (TERMS + 1) / 2],
}

impl Channel {
    fn add(&mut self, terms: [f64; TERMS], count: u32) {
        let from_old_mean: [f64; TERMS] = std::array::from_fn(|i| terms[i] - self.mean[i]);
        for (mean, step) in self.mean.iter_mut().zip(from_old_mean) {
            *mean += step / f64::from(count);
        }
        let mut products = self.products.iter_mut();
        for (i, old) in from_old_mean.iter().enumerate() {
            let from_new_mean = terms.iter().zip(&self.mean).skip(i);
            for ((term, mean), product) in from_new_mean.zip(&mut products) {
                *product += old * (term - mean);
            }
        }
    }

    /// Sum of squared deviations of the linear combination.
    fn squares(&self, weights: [f64; TERMS]) -> f64 {
        let mut sum = 0.0;
        let mut at = 0;
        for i in 0..TERMS {
            for j in i..TERMS {
                let times = if i == j { 1.0 } else { 2.0 };
                sum += times * weights[i] * weights[j] * self.products[at];
                at += 1;
            }
        }
        sum.max(0.0)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    channels: [Channel; 3],
    count: u32,
}

/// The sum of scrambles, and their spread in the pixels that something virtual may reach (about 350 bytes each).
#[derive(Clone, Debug)]
pub struct Scrambles {
    film: Film,
    mode: Composite,
    /// The pixels that `moments` are of, ascending.
    active: Vec<u32>,
    moments: Vec<Moments>,
}

impl Scrambles {
    /// For films like this one, whose pixels `active` (row-major indices, ascending) alone are sampled. `grouped`: every fifth scramble of a
    /// pixel is one of its groups.
    pub fn new(like: &Film, mode: Composite, grouped: bool, active: Vec<u32>) -> Self {
        let mut film = Film::new(like.width, like.height, 0, !like.guides.is_empty());
        film.set_photons(!like.splats.is_empty());
        film.set_groups(grouped);
        film.set_sample_factors(like.pixels.iter().map(|sums| sums.sample_factor));
        let moments = vec![Moments::default(); active.len()];
        Self {
            film,
            mode,
            active,
            moments,
        }
    }

    /// Adds a scramble: every pixel that it has samples of.
    pub fn add(&mut self, scramble: &Film) {
        let mode = self.mode;
        if !self.film.groups.is_empty() {
            for (&pixel, moments) in self.active.iter().zip(&self.moments) {
                let sums = &scramble.pixels[pixel as usize];
                if sums.n > 0 {
                    let sum = sums.diff.value().as_vec3();
                    group_add(&mut self.film.groups[pixel as usize], moments.count, sum);
                }
            }
        }
        self.active
            .par_iter()
            .zip(&mut self.moments)
            .for_each(|(&pixel, moments)| {
                let sums = scramble.sums(pixel as usize);
                if sums.n == 0 {
                    return;
                }
                moments.count += 1;
                let means = Means::of(&sums);
                for (c, channel) in moments.channels.iter_mut().enumerate() {
                    channel.add(terms(&means, mode, c), moments.count);
                }
            });
        self.film
            .pixels
            .par_iter_mut()
            .zip(&scramble.pixels)
            .for_each(|(sum, scramble)| sum.merge(scramble));
        self.film
            .guides
            .par_iter_mut()
            .zip(&scramble.guides)
            .for_each(|(sum, scramble)| sum.merge(scramble));
        // Photons reach pixels that take no part as well.
        (self.film.splats.iter_mut())
            .zip(scramble.splats.iter().zip(&scramble.pixels))
            .filter(|(_, (_, sums))| sums.n > 0)
            .for_each(|(sum, (scramble, _))| sum.merge(scramble));
    }

    /// Takes back what a pixel was given.
    pub fn clear_pixel(&mut self, pixel: usize) {
        let sums = &mut self.film.pixels[pixel];
        *sums = PixelSums {
            sample_factor: sums.sample_factor,
            ..PixelSums::default()
        };
        if let Some(guide) = self.film.guides.get_mut(pixel) {
            *guide = GuideSums::default();
        }
        if let Some(splats) = self.film.splats.get_mut(pixel) {
            *splats = SplatSums::default();
        }
        if let Some(groups) = self.film.groups.get_mut(pixel) {
            *groups = GroupSums::default();
        }
        if let Ok(slot) = self.active.binary_search(&(pixel as u32)) {
            self.moments[slot] = Moments::default();
        }
    }

    /// The sum of all scrambles.
    pub fn film(&self) -> &Film {
        &self.film
    }

    pub fn into_film(self) -> Film {
        self.film
    }

    /// Variance of the composite of one scramble, linear, by channel, as the pixel's own scrambles tell it; `None` where there are no two.
    ///
    /// Right on average, but not pixel by pixel: light may be faint in most samples and bright in a few, and where the scrambles met none of
    /// the few their spread states next to no error. See [`pooled`](super::pooled).
    pub fn own_variances(&self, photo: Option<&Photo>) -> Vec<Option<DVec3>> {
        let mut own = vec![None; self.film.pixels.len()];
        for (&pixel, moments) in self.active.iter().zip(&self.moments) {
            let pixel = pixel as usize;
            let ic = photo.map_or([0.0; 3], |photo| photo.linear[pixel]);
            own[pixel] = (moments.count > 1).then(|| self.variance_of_one(moments, ic));
        }
        own
    }

    /// Scrambles that have samples of this pixel.
    pub fn count(&self, pixel: usize) -> u32 {
        (self.active.binary_search(&(pixel as u32))).map_or(0, |slot| self.moments[slot].count)
    }

    fn variance_of_one(&self, moments: &Moments, ic: [f32; 3]) -> DVec3 {
        let ic = Vec3::from(ic).as_dvec3();
        let squares: [f64; 3] = std::array::from_fn(|c| {
            let channel = &moments.channels[c];
            channel.squares(gradient(&channel.mean, self.mode, ic[c]))
        });
        DVec3::from(squares) / f64::from(moments.count - 1)
    }
}

/// Additive: a, mean(m im) + mean((1-m)(im-ir)) - mean(m ir), mean(ir). Quotient: a, mean(m im), mean((1-m)(im-ir)), mean((1-m) ir).
fn terms(means: &Means, mode: Composite, c: usize) -> [f64; TERMS] {
    let (im, diff) = (means.m_im[c], means.diff[c]);
    let (m_ir, r_ir) = (means.m_ir[c], means.r_ir[c]);
    match mode {
        Composite::Additive => [means.mask, im + diff - m_ir, m_ir + r_ir, 0.0],
        Composite::Quotient => [means.mask, im, diff, r_ir],
    }
}

/// Derivative of the composite by each term.
fn gradient(mean: &[f64; TERMS], mode: Composite, ic: f64) -> [f64; TERMS] {
    match mode {
        Composite::Additive => [mean[2] - ic, 1.0, mean[0], 0.0],
        Composite::Quotient => {
            let [a, _, diff, r_ir] = *mean;
            let real = r_ir.max(QUOTIENT_EPSILON);
            let by_real = if r_ir > QUOTIENT_EPSILON {
                -(1.0 - a) * ic * diff / (real * real)
            } else {
                0.0
            };
            [
                -ic * (1.0 + diff / real),
                1.0,
                (1.0 - a) * ic / real,
                by_real,
            ]
        }
    }
}

#[cfg(test)]
mod tests;
