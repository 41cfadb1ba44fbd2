//! How much a sample's results scatter and what it costs, measured by a few samples of the estimator itself.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use super::blocks::Blocks;
use crate::cpu::batch::Batch;
use crate::cpu::sharing_tile::{BLOCK_SIDE, TILE_STRIDE, tile_of};
use crate::cpu::state::{FIRST_NONE, PathState};
use crate::film::is_unusable;
use crate::math::{hash_combine, hash_u32};
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PackedScene};
use crate::work::RayCounts;

/// What generating a sample and shading its first vertex cost, in rays.
const COST_OF_A_SAMPLE: f32 = 2.0;
/// What a ray between a first vertex and another's point costs, in rays: nothing is shaded.
const COST_OF_A_SHARED_RAY: f32 = 0.4;
/// Sharing tiles of a square.
const TILES: u32 = TILE_STRIDE * TILE_STRIDE;
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

impl std::ops::Add for Moments {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            error: self.error + other.error,
            cost: self.cost + other.cost,
        }
    }
}

impl std::ops::AddAssign for Moments {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
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

/// Takes samples in some pixels of every square, with what they share; far from virtual geometry in every second square, as on a chessboard.
/// `done` hears of each block. `scene.pixels` must ask for every sample's difference.
pub fn measure(
    scene: &PackedScene,
    blocks: &Blocks,
    is_cancelled: impl Fn() -> bool + Sync,
    done: impl Fn() + Sync,
) -> Vec<BlockMoments> {
    let parts: Vec<_> = (blocks.squares(BLOCK_SIDE as usize))
        .into_par_iter()
        .map_init(Batch::default, |batch, square| {
            let mut moments = BTreeMap::new();
            if is_cancelled() {
                return moments;
            }
            measure_square(scene, blocks, &square, batch, &mut moments);
            moments.iter().for_each(|_| done());
            moments
        })
        .collect();
    let mut all = vec![BlockMoments::default(); blocks.count()];
    for (block, moments) in parts.into_iter().flatten() {
        all[block] = moments;
    }
    all
}

/// One sample in each pixel of one sharing tile of the square; where a beam may meet virtual geometry, two in those of two tiles.
fn measure_square(
    scene: &PackedScene,
    blocks: &Blocks,
    square: &[usize],
    batch: &mut Batch,
    moments: &mut BTreeMap<usize, BlockMoments>,
) {
    let is_near = |pixel: usize| scene.pixels[pixel].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0;
    let any_near = square.iter().any(|&pixel| is_near(pixel));
    for &pixel in square {
        let block = blocks.of_pixel(pixel);
        let share = 1.0 / blocks.pixels(block).count() as f32;
        let near = if is_near(pixel) { share } else { 0.0 };
        moments.entry(block).or_default().near_share += near;
    }
    let corner = square[0] as u32;
    let width = scene.frame.width;
    let (column, row) = (corner % width / BLOCK_SIDE, corner / width / BLOCK_SIDE);
    if !any_near && (column + row) % 2 == 1 {
        // Its neighbours' samples speak for it.
        return;
    }
    let first = hash_u32(hash_combine(scene.frame.seed, corner)) % TILES;
    // Diagonally opposite.
    let second = if any_near { TILES - 1 - first } else { first };
    let taken = |pixel: u32| {
        let tile = tile_of(width, pixel) % TILES;
        scene.pixels[pixel as usize].flags & PIXEL_OUT_OF_REACH == 0
            && (tile == first || tile == second)
    };
    let pixels: Vec<u32> = (square
        .iter()
        .map(|&pixel| pixel as u32)
        .filter(|&p| taken(p)))
    .collect();
    for index in 0..if any_near { 2 } else { 1 } {
        for &pixel in &pixels {
            batch.generate(scene, pixel, index, false);
        }
    }
    batch.run(scene);
    let shared = RayCounts::from(batch.take_shared_rays()).traced();
    let samples = batch.samples();
    let sharing = samples
        .iter()
        .filter(|sample| sample.state.first.kept != FIRST_NONE);
    let shared_cost = COST_OF_A_SHARED_RAY * shared as f32 / sharing.count().max(1) as f32;
    for (at, &pixel) in pixels.iter().enumerate() {
        let moments = moments.entry(blocks.of_pixel(pixel as usize)).or_default();
        let a = &samples[at].state;
        let b = samples.get(at + pixels.len()).map(|sample| &sample.state);
        add_pixel(scene, a, b, shared_cost, moments);
    }
    batch.clear();
}

/// `shared_cost`: of what is traced in common, for each sample that shares.
fn add_pixel(
    scene: &PackedScene,
    a: &PathState,
    b: Option<&PathState>,
    shared_cost: f32,
    moments: &mut BlockMoments,
) {
    let radiance = |st: &PathState| st.result.radiance * scene.frame.exposure_scale;
    let mean_square = |x: Vec3| x.length_squared() / 3.0;
    let cost = |st: &PathState| {
        let shares = st.first.kept != FIRST_NONE;
        cost_of(st) + if shares { shared_cost } else { 0.0 }
    };
    let (x, y) = (radiance(a), b.map_or(radiance(a), radiance));
    if is_unusable(x) || is_unusable(y) {
        return;
    }
    let sampled = |error, cost| Moments {
        pixels: 1.0,
        error,
        cost,
    };
    let Some(b) = b else {
        moments.difference += sampled(mean_square(x), cost(a));
        return;
    };
    let cost = 0.5 * (cost(a) + cost(b));
    match a.result.mask + b.result.mask {
        // The square, not the variance: it is what counting one sample for several multiplies.
        0 => moments.difference += sampled(0.5 * (mean_square(x) + mean_square(y)), cost),
        1 => moments.mixed += sampled(EDGE_SHARE * 0.5 * mean_square(x - y), cost),
        _ => moments.mixed += sampled(0.5 * mean_square(x - y), cost),
    }
}

fn cost_of(st: &PathState) -> f32 {
    RayCounts::from(st.rays).traced() as f32 + COST_OF_A_SAMPLE
}
