//! The paper's noise textures: one a bin, placed anew for every frame (imperfections 2006, sections 3.3 to 3.5). The twin of
//! [`Textures::variation`] is in `shaders/stages/noise/textures.wgsl`.

use std::f32::consts::TAU;

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

use super::missing::bin_of;
use crate::math::hash_combine;
use crate::stages::settings::{NoiseBin, NoiseSettings};

/// Channel variations in DN, row-major, square.
pub type Texture = Vec<[f32; 3]>;

#[derive(Clone, Debug)]
pub struct Textures {
    /// By bin.
    pub bins: Vec<Texture>,
    /// Side, a power of two.
    pub size: u32,
    /// Pixels that one texel covers along each axis.
    pub magnification: f32,
    seed: u32,
}

/// Where the textures lie in a frame: texture coordinates = (rotation * pixel + offset) / magnification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub sin: f32,
    pub cos: f32,
    /// Texels.
    pub offset: [f32; 2],
}

impl Textures {
    /// Normal deviates with each bin's mean and sigma, in float or rounded to what 8 bits hold (-128 to 127).
    pub fn generate(settings: &NoiseSettings, seed: u32) -> Self {
        let size = settings.texture_size;
        let texture = |(index, bin): (usize, &NoiseBin)| {
            let mut rng = rng(seed, index as u32);
            (0..size * size)
                .map(|_| {
                    let deviates: [f64; 3] =
                        std::array::from_fn(|c| normal(bin, c).sample(&mut rng));
                    deviates.map(|deviate| {
                        if settings.eight_bit {
                            deviate.round().clamp(-128.0, 127.0) as f32
                        } else {
                            deviate as f32
                        }
                    })
                })
                .collect()
        };
        Self {
            bins: settings
                .profile
                .bins
                .iter()
                .enumerate()
                .map(texture)
                .collect(),
            size,
            magnification: settings.magnification,
            seed,
        }
    }

    /// The random translation and rotation of frame number `frame`.
    pub fn placement(&self, frame: u32) -> Placement {
        let mut rng = rng(hash_combine(self.seed, 0x706c_6163), frame);
        let span = self.size as f32 * self.magnification;
        let offset = [0, 1].map(|_| rng.random::<f32>() * span);
        let (sin, cos) = (rng.random::<f32>() * TAU).sin_cos();
        Placement { sin, cos, offset }
    }

    /// The variation of the pixel in column `x` and row `y`, DN: nearest texel of the texture of its own intensity's bin.
    pub fn variation(&self, placement: &Placement, encoded: [f32; 3], x: f32, y: f32) -> [f32; 3] {
        let (x, y) = (x + 0.5, y + 0.5);
        let u = (placement.cos * x - placement.sin * y + placement.offset[0]) / self.magnification;
        let v = (placement.sin * x + placement.cos * y + placement.offset[1]) / self.magnification;
        // A power of two: the low bits are the remainder, also of negative numbers.
        let mask = self.size as i32 - 1;
        let (u, v) = (u.floor() as i32 & mask, v.floor() as i32 & mask);
        self.bins[bin_of(encoded, self.bins.len())][(v * self.size as i32 + u) as usize]
    }
}

fn normal(bin: &NoiseBin, channel: usize) -> Normal<f64> {
    // A profile's sigma is finite and not negative, which is all that can be wrong here.
    Normal::new(bin.mean[channel], bin.sigma[channel])
        .unwrap_or_else(|_| unreachable!("the profile was checked when it was read"))
}

fn rng(seed: u32, stream: u32) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(
        u64::from(hash_combine(seed, stream)) << 32 | u64::from(stream),
    )
}
