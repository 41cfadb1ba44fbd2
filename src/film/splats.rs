//! Light that photons bring to a pixel, in fixed point: sums do not depend on the order in which they are added, and so not on threads, tiles,
//! passes, or the device that traces them.
//!
//! A splat's value is what the pixel would receive if one photon a pixel were traced. The mean over the photons is then the sum times the
//! number of pixels over the number of photons.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::sums::{PixelSums, Sum3, sum_add};

/// A larger value is left out and counted: a sum of ten thousand of them would overflow.
const LARGEST_SPLAT: f32 = 1.677_721_6e7;
/// Squares above it count as it: they only tell how far the mean may be trusted.
const LARGEST_SQUARE: f32 = 1.073_741_8e9;
/// Steps of the sums' fixed point in 1, and of their squares'.
const SPLAT_STEPS: f32 = 268_435_456.0;
const SQUARE_STEPS: f32 = 16_777_216.0;

/// Sums over the photons that reached one pixel; all zeros before the first.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SplatSums {
    /// On real surfaces, which belongs to the difference, in steps of 1 / `SPLAT_STEPS`.
    pub diff: [u64; 3],
    /// On virtual surfaces.
    pub m_im: [u64; 3],
    /// Squares of both, in steps of 1 / `SQUARE_STEPS`.
    pub sq: [u64; 3],
    /// Photons traced while the pixel took part, whether or not they reached it.
    pub photons: u64,
}

/// What one photon brings to a pixel, not negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Row-major index.
    pub pixel: u32,
    /// The photon comes from a virtual surface.
    pub is_virtual: bool,
    /// Exposure applied.
    pub value: Vec3,
}

/// NaN, infinite, negative or so large that sums would overflow.
pub fn is_unusable_splat(value: Vec3) -> bool {
    let largest = LARGEST_SPLAT.to_bits();
    value.to_array().iter().any(|c| c.to_bits() > largest)
}

/// In steps of 1 / `steps`, rounded down.
fn fixed(x: f32, steps: f32) -> u64 {
    (f64::from(x) * f64::from(steps)) as u64
}

fn value_of(sums: [u64; 3], steps: f32) -> DVec3 {
    DVec3::from_array(sums.map(|sum| sum as f64 / f64::from(steps)))
}

impl SplatSums {
    /// Adds a splat that is not [unusable](is_unusable_splat).
    pub fn add(&mut self, splat: &Splat) {
        let sums = if splat.is_virtual {
            &mut self.m_im
        } else {
            &mut self.diff
        };
        for (c, x) in splat.value.to_array().into_iter().enumerate() {
            sums[c] += fixed(x, SPLAT_STEPS);
            self.sq[c] += fixed((x * x).min(LARGEST_SQUARE), SQUARE_STEPS);
        }
    }

    /// Adds the sums of other photons of the same render.
    pub(super) fn merge(&mut self, other: &Self) {
        for c in 0..3 {
            self.diff[c] += other.diff[c];
            self.m_im[c] += other.m_im[c];
            self.sq[c] += other.sq[c];
        }
        self.photons += other.photons;
    }

    /// Standard deviation of what the photons bring to the pixel's difference, an upper estimate. `pixels`: of the picture.
    pub(super) fn deviation(&self, pixels: f64) -> DVec3 {
        if self.photons == 0 {
            return DVec3::ZERO;
        }
        let sum = value_of(self.sq, SQUARE_STEPS);
        DVec3::from(sum.to_array().map(f64::sqrt)) * (pixels / self.photons as f64)
    }

    /// The pixel's sums with what the photons bring, as if its samples had found it: each real one its share of what they brought to real
    /// surfaces, each virtual one its share of the rest. The variance of the mean grows by the photons' own, an upper estimate as theirs are
    /// stratified. `pixels`: of the picture.
    pub(super) fn folded_into(&self, mut sums: PixelSums, pixels: f64) -> PixelSums {
        if self.photons == 0 || sums.n == 0 || (self.sq, self.diff, self.m_im) == Default::default()
        {
            return sums;
        }
        let scale = pixels / self.photons as f64;
        let n = f64::from(sums.n);
        let mut squares =
            value_of(self.sq, SQUARE_STEPS) * (scale * scale * n * (n - 1.0).max(1.0));
        let by_real = (f64::from(sums.n - sums.m), self.diff, &mut sums.diff);
        let by_virtual = (f64::from(sums.m), self.m_im, &mut sums.m_im);
        for (count, splats, sum) in [by_real, by_virtual] {
            let brought = value_of(splats, SPLAT_STEPS) * (scale * n);
            let share = brought / if count > 0.0 { count } else { n };
            squares += share * (sum.value() * 2.0 + brought);
            add(sum, brought);
        }
        add(&mut sums.sq, squares);
        sums
    }
}

/// Adds x to the double-floats, both its parts.
fn add(sum: &mut Sum3, x: DVec3) {
    for (c, x) in x.to_array().into_iter().enumerate() {
        let high = x as f32;
        let low = (x - f64::from(high)) as f32;
        (sum.hi[c], sum.lo[c]) = sum_add(sum.hi[c], sum.lo[c], high);
        (sum.hi[c], sum.lo[c]) = sum_add(sum.hi[c], sum.lo[c], low);
    }
}

#[cfg(test)]
mod tests;
