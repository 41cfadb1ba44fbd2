//! A coarser picture's film enlarged to the size of the whole one.
//!
//! What the virtual world adds and hides is that of the nine coarse pixels around, weighted by quadratic B-splines: few rays leave noise, which would show as
//! squares else. The photograph has no part in it: where nothing around was changed the enlarged pixel has no change either, and the composite shows the
//! photograph bit for bit.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::composite::variance_pixel;
use super::{Film, Means, PixelSums, Sum3};
use crate::scene::Composite;

/// Samples that an enlarged pixel is said to have: shares of its mask are told in steps of one of them.
const SAMPLES: u32 = 1 << 12;

/// What a pixel shows, in means.
#[derive(Clone, Copy, Default)]
struct Layer {
    /// Samples were taken.
    is_touched: bool,
    /// Virtual light, and how much of the real it hides; change of the real light; the real light; variance.
    values: [Vec4; 4],
}

impl Layer {
    fn of(sums: &PixelSums, mode: Composite) -> Self {
        if sums.n == 0 {
            return Self::default();
        }
        let means = Means::of(sums);
        // The quotient has no covariance, and wants the real light.
        let (change, real) = match mode {
            Composite::Additive => (means.change(), Vec3::ZERO),
            Composite::Quotient => (means.diff, means.r_ir.as_vec3()),
        };
        let variance = variance_pixel(sums, [0.0; 3]).as_vec3();
        Self {
            is_touched: true,
            values: [
                means.m_im.as_vec3().extend(means.mask as f32),
                change.as_vec3().extend(0.0),
                real.extend(0.0),
                variance.extend(0.0),
            ],
        }
    }

    fn mixed(parts: [&Self; 3], weights: [f32; 3]) -> Self {
        let [a, b, c] = parts;
        let [u, v, w] = weights;
        Self {
            is_touched: a.is_touched || b.is_touched || c.is_touched,
            values: std::array::from_fn(|k| a.values[k] * u + b.values[k] * v + c.values[k] * w),
        }
    }

    fn sums(&self) -> PixelSums {
        if !self.is_touched {
            return PixelSums::default();
        }
        let n = SAMPLES as f32;
        let [virtual_light, change, real, variance] = self.values;
        let sum = |mean: Vec4| Sum3 {
            hi: (mean.truncate() * n).to_array(),
            lo: [0.0; 3],
        };
        let light = virtual_light + change;
        let is_real = real.truncate() != Vec3::ZERO;
        PixelSums {
            m_im: sum(virtual_light),
            diff: sum(change),
            r_ir: sum(real),
            // As far from their mean as the coarse samples' mean is uncertain.
            sq: sum(light * light + variance * (n - 1.0)),
            n: SAMPLES,
            m: (virtual_light.w * n).round() as u32,
            n_real: if is_real { SAMPLES } else { 0 },
            ..PixelSums::default()
        }
    }
}

/// The film of a picture of this size, no smaller than the film's. Guides and groups are left out.
pub fn enlarged(film: &Film, width: u32, height: u32, mode: Composite) -> Film {
    let mut whole = Film::new(width, height, 0, false);
    enlarge(film, mode, &mut whole);
    whole
}

/// The same in place of what `whole` held, which has the size.
pub fn enlarge(film: &Film, mode: Composite, whole: &mut Film) {
    // What photons brought is in the sums.
    whole.set_photons(false);
    whole.set_groups(false);
    let (width, height) = (whole.width, whole.height);
    let small_width = film.width as usize;
    let pixels = (0..film.pixels.len()).into_par_iter();
    let layers: Vec<Layer> = pixels
        .map(|pixel| Layer::of(&film.sums(pixel), mode))
        .collect();
    let columns: Vec<_> = (0..width).map(|x| taps(x, width, film.width)).collect();
    let rows = whole.pixels.par_chunks_mut(width as usize).enumerate();
    rows.for_each(|(y, row)| {
        let (taps_y, weights_y) = taps(y as u32, height, film.height);
        let rows = taps_y.map(|y| &layers[y * small_width..][..small_width]);
        let mixed: Vec<Layer> = (0..small_width)
            .map(|x| Layer::mixed(rows.map(|row| &row[x]), weights_y))
            .collect();
        for (sums, &(taps_x, weights_x)) in row.iter_mut().zip(&columns) {
            let parts = taps_x.map(|x| &mixed[x]);
            if parts.iter().any(|part| part.is_touched) {
                *sums = Layer::mixed(parts, weights_x).sums();
            } else if (sums.n, sums.sample_factor, sums.non_finite) != (0, 0, 0) {
                *sums = PixelSums::default();
            }
        }
    });
}

/// Along one axis, the three coarse pixels about the middle of a pixel of `whole`, and their weights; the edge's stand for those beyond.
fn taps(at: u32, whole: u32, coarse: u32) -> ([usize; 3], [f32; 3]) {
    let place = (at as f32 + 0.5) * coarse as f32 / whole as f32;
    let nearest = (place as usize).min(coarse as usize - 1);
    let off = place - nearest as f32 - 0.5;
    let square = |x: f32| x * x;
    let weights = [
        0.5 * square(0.5 - off),
        0.75 - square(off),
        0.5 * square(0.5 + off),
    ];
    let last = coarse as usize - 1;
    (
        [nearest.saturating_sub(1), nearest, (nearest + 1).min(last)],
        weights,
    )
}

/// Values of a picture, row-major, in another size: those of the nearest pixels.
pub fn nearest(
    values: &[u32],
    [from_width, from_height]: [u32; 2],
    [width, height]: [u32; 2],
) -> Vec<u32> {
    let scaled = |at: u32, whole: u32, coarse: u32| {
        (u64::from(at) * u64::from(coarse) / u64::from(whole)) as usize
    };
    let row = |y: u32| scaled(y, height, from_height) * from_width as usize;
    let columns: Vec<usize> = (0..width).map(|x| scaled(x, width, from_width)).collect();
    (0..height)
        .flat_map(|y| columns.iter().map(move |x| row(y) + x))
        .map(|pixel| values[pixel])
        .collect()
}

#[cfg(test)]
mod tests;
