//! Films filled by hand, and numbers to fill them with.

use glam::Vec3;

use super::{Film, Sample, group_add, pixel_add_real};

impl Film {
    /// Adds the pixel's next sample.
    pub(crate) fn add(&mut self, pixel: usize, sample: &Sample) {
        let index = self.first_index(pixel) + self.pixels[pixel].n;
        self.pixels[pixel].add(index, sample);
    }

    /// Adds the real radiance of the pixel's sample number `first_index + n_real`.
    pub(crate) fn add_real(&mut self, pixel: usize, is_virtual: bool, real: Vec3) {
        let index = self.first_index(pixel) + self.pixels[pixel].n_real;
        pixel_add_real(&mut self.pixels[pixel], index, is_virtual, real);
    }

    /// Adds a difference, to the sums and its group.
    pub(crate) fn add_difference(&mut self, pixel: usize, index: u32, difference: Vec3) {
        let sample = Sample {
            is_virtual: false,
            contribution: difference,
            real: None,
        };
        self.pixels[pixel].add(index, &sample);
        group_add(&mut self.groups[pixel], index, difference);
    }
}

/// In [0, 1), the same on every run.
pub(crate) fn noise(i: u32) -> f32 {
    let mut x = i.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    (x >> 8) as f32 / 16_777_216.0
}
