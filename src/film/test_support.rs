//! Films filled by hand.

use glam::Vec3;

use super::{Film, Sample, pixel_add_real};

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
}
