//! How much a sample's results scatter and what it costs, measured by a few samples of the estimator itself.

use glam::Vec3;
use rayon::prelude::*;

use super::blocks::Blocks;
use crate::cpu::batch::run_alone;
use crate::cpu::estimator::begin_sample;
use crate::cpu::state::PathState;
use crate::film::is_unusable;
use crate::math::{hash_combine, hash_u32};
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PackedScene};
use crate::work::RayCounts;

/// Pixels sampled in a block through which no beam meets virtual geometry, and in others.
const PIXELS: u32 = 1;
const PIXELS_NEAR_VIRTUAL: u32 = 8;
/// What generating a sample and shading its first vertex cost, in rays.
const COST_OF_A_SAMPLE: f32 = 2.0;
/// A pixel whose two samples met different kinds of surface: share of their squared difference that counts, for the photograph behind a
/// virtual object is seldom black, and the lens is sampled in strata.
const EDGE_SHARE: f32 = 0.25;

/// Sums over the sampled pixels of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    pub pixels: f32,
    /// Squared error of one sample, mean of the channels, linear.
    pub error: f32,
    /// Of one sample, in rays.
    pub cost: f32,
}

impl std::ops::AddAssign for Moments {
    fn add_assign(&mut self, other: Self) {
        self.pixels += other.pixels;
        self.error += other.error;
        self.cost += other.cost;
    }
}

/// Apart for primary rays that missed virtual geometry and that met it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockMoments {
    pub difference: Moments,
    pub mixed: Moments,
    /// Share of the pixels whose beams may meet virtual geometry.
    pub near_share: f32,
}

/// Takes two samples in some pixels of every block; `done` hears of each. `scene.pixels` must ask for every sample's difference.
pub fn measure(scene: &PackedScene, blocks: &Blocks, done: impl Fn() + Sync) -> Vec<BlockMoments> {
    (0..blocks.count())
        .into_par_iter()
        .map(|block| {
            let is_near = |&p: &usize| scene.pixels[p].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0;
            let near = blocks.pixels(block).filter(is_near).count();
            let count = if near > 0 {
                PIXELS_NEAR_VIRTUAL
            } else {
                PIXELS
            };
            let mut moments = BlockMoments {
                near_share: near as f32 / blocks.pixels(block).count() as f32,
                ..BlockMoments::default()
            };
            for i in 0..count {
                let random = hash_u32(hash_combine(
                    hash_combine(scene.frame.seed, block as u32),
                    i,
                ));
                let pixel = blocks.pixel(block, random);
                if scene.pixels[pixel].flags & PIXEL_OUT_OF_REACH == 0 {
                    add_pixel(scene, pixel as u32, 2 * i, &mut moments);
                }
            }
            done();
            moments
        })
        .collect()
}

fn add_pixel(scene: &PackedScene, pixel: u32, index: u32, moments: &mut BlockMoments) {
    let [a, b] = [index, index + 1].map(|index| {
        let mut st = begin_sample(scene, pixel, index, false);
        run_alone(scene, &mut st);
        st
    });
    let radiance = |st: &PathState| st.result.radiance * scene.frame.exposure_scale;
    let mean_square = |x: Vec3| x.length_squared() / 3.0;
    let (x, y) = (radiance(&a), radiance(&b));
    if is_unusable(x) || is_unusable(y) {
        return;
    }
    let cost = 0.5 * (cost_of(&a) + cost_of(&b));
    let sampled = |error| Moments {
        pixels: 1.0,
        error,
        cost,
    };
    match a.result.mask + b.result.mask {
        // The square, not the variance: it is what counting one sample for several multiplies.
        0 => moments.difference += sampled(0.5 * (mean_square(x) + mean_square(y))),
        1 => moments.mixed += sampled(EDGE_SHARE * 0.5 * mean_square(x - y)),
        _ => moments.mixed += sampled(0.5 * mean_square(x - y)),
    }
}

fn cost_of(st: &PathState) -> f32 {
    RayCounts::from(st.rays).traced() as f32 + COST_OF_A_SAMPLE
}
