//! Lamps that smooth virtual surfaces show: small and bright, so that the few samples of the measurement miss them.
//!
//! Paths from the camera are followed through mirrors and smooth interfaces alone, and what they meet of lights is the only thing that counts. That
//! takes a ray or two a sample, so that every pixel can have several.

use glam::Vec3;
use rayon::prelude::*;

use super::blocks::Blocks;
use crate::cpu::estimator::{advance, begin_sample};
use crate::cpu::request::answer;
use crate::cpu::state::{
    DELTA_DENSITY, MODE_MIXED, PathState, STAGE_DONE, STAGE_PATH, STAGE_PRIMARY_REAL,
    STAGE_PRIMARY_VIRTUAL,
};
use crate::film::is_unusable;
use crate::packed::{NONE, PIXEL_BEAM_MAY_MEET_VIRTUAL, PackedScene};

/// Paths of a pixel.
const PATHS: u32 = 8;

/// Squared error that one sample has of the light that it meets by way of smooth virtual surfaces: mean of the channels and of those pixels
/// of each block that show such a surface.
pub fn highlights(scene: &PackedScene, blocks: &Blocks) -> Vec<f32> {
    (0..blocks.count())
        .into_par_iter()
        .map(|block| {
            let (mut sum, mut count) = (0.0, 0);
            for error in blocks.pixels(block).filter_map(|p| squared_error(scene, p)) {
                sum += error;
                count += 1;
            }
            sum / count.max(1) as f32
        })
        .collect()
}

/// None where hardly a path begins at a smooth virtual surface.
fn squared_error(scene: &PackedScene, pixel: usize) -> Option<f32> {
    if scene.pixels[pixel].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL == 0 {
        return None;
    }
    let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
    let mut seen = 0;
    for index in 0..PATHS {
        if index == PATHS / 4 && seen == 0 {
            return None;
        }
        let Some(state) = follow_smooth(scene, pixel as u32, index) else {
            continue;
        };
        let light = state.result.radiance * scene.frame.exposure_scale;
        if !is_unusable(light) {
            seen += 1;
            sum += light;
            squares += light.length_squared();
        }
    }
    if seen < 2 {
        return None;
    }
    let scatter = squares - sum.length_squared() / seen as f32;
    Some(scatter.max(0.0) / (3 * (seen - 1)) as f32)
}

/// A sample of a pixel, until it scatters otherwise; none where the first surface is not a smooth virtual one.
fn follow_smooth(scene: &PackedScene, pixel: u32, index: u32) -> Option<PathState> {
    let mut state = begin_sample(scene, pixel, index, false);
    while state.path.stage != STAGE_DONE {
        answer(scene, &mut state);
        if state.path.stage == STAGE_PRIMARY_VIRTUAL && state.hits.in_virtual.triangle == NONE {
            return None;
        }
        advance(scene, &mut state);
        let goes_on = match state.path.stage {
            STAGE_PRIMARY_REAL => true,
            STAGE_PATH => state.path.mode == MODE_MIXED && state.path.density == DELTA_DENSITY,
            _ => false,
        };
        if !goes_on {
            break;
        }
    }
    (state.result.mask == 1 && state.ray.depth > 1).then_some(state)
}
