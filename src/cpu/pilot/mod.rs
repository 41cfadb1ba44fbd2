//! A look at the picture before the first sample: which beams can meet virtual geometry, which pixels nothing virtual can reach, and how often
//! each pixel's samples are worth an evaluation.
//!
//! The two flags are proven. How often steers work, not the result: whatever is evaluated counts for what is not, and the pilot's own
//! samples are not used again.

mod allocation;
mod beam;
mod blocks;
mod highlights;
mod importance;
mod measurement;

use std::ops::Add;

use rayon::prelude::*;

use super::contribution::photons_traced;
use super::photons::guide::learn;
use super::photons::plan::{EyeMoments, photons_per_ray, unmeasured};
use allocation::{Rates, allocate};
use beam::Beam;
use blocks::{Blocks, SIDE_PX};
#[cfg(feature = "bench")]
pub(crate) use importance::MAX_LIGHTS_EXAMINED;
use importance::{PilotLights, importance};
use measurement::Moments;

use crate::cpu::sharing::BLOCK_SIDE;
use crate::packed::{
    ESTIMATOR_PAPER, FRAME_ALPHA, FRAME_AOVS, FRAME_BOTH_SHADOWS, FRAME_NO_GUIDE, FRAME_NO_SHARING,
    FRAME_SHUTTER, Frame, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PIXEL_SHARES,
    PIXEL_SHARES_NEAR, PackedScene, PixelInfo, SIDE_VIRTUAL,
};
use crate::work::Meter;

/// Fewer rays per pixel than this are not worth a measurement.
const MIN_RAYS_TO_MEASURE: u32 = 8;
/// Seed of the pilot's own samples, which no render's samples should equal.
const SEED: u32 = 0x9d2c_5681;

/// What a block that is measured takes, where the beam of a pixel is one step.
const STEPS_OF_A_BLOCK: u64 = 64;

/// What [`pilot`] counts at the most.
pub fn pilot_steps(frame: &Frame) -> u64 {
    let (width, height) = (frame.width as usize, frame.height as usize);
    (width * height) as u64 + STEPS_OF_A_BLOCK * Blocks::of(width, height).count() as u64
}

/// Fills `scene.pixels`. The same for every seed, sample range and backend. `draft`: beams are those of whole blocks, which costs a few more rays
/// beside virtual objects and saves most of the time.
pub fn pilot(scene: &mut PackedScene, draft: bool, meter: &Meter<'_>) {
    let (width, height) = (scene.frame.width as usize, scene.frame.height as usize);
    let nothing_virtual = scene.frame.sphere_count == 0
        && scene.swept_spheres.is_empty()
        && !scene.lights.iter().any(|l| l.side == SIDE_VIRTUAL);
    scene.photons_per_ray = 0;
    scene.frame.guide_cell_count = 0;
    scene.guide.clear();
    if nothing_virtual {
        scene.pixels = vec![PixelInfo::uniform(PIXEL_OUT_OF_REACH); width * height];
        return;
    }
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let blocks = Blocks::of(width, height);
    // Each row of a moving camera has beams of its own.
    let flags = if draft && scene.frame.flags & FRAME_SHUTTER == 0 {
        flags_by_block(scene, &pinhole, &blocks)
    } else {
        (0..width * height)
            .into_par_iter()
            .map(|i| {
                if i % width == 0 {
                    meter.add(width as u64);
                }
                flags_of(scene, &Beam::of_pixel(&scene.frame, &pinhole, i as u32))
            })
            .collect()
    };
    if photons_traced(&scene.frame) {
        scene.photons_per_ray = unmeasured(width * height);
    }
    if scene.frame.estimator == ESTIMATOR_PAPER {
        scene.pixels = flags.into_iter().map(PixelInfo::uniform).collect();
        return;
    }
    let lights = PilotLights::of(scene);
    let importances: Vec<f32> = (0..blocks.count())
        .into_par_iter()
        .map(|block| {
            let pixel = blocks.first_pixel(block) as u32;
            importance(
                scene,
                &Beam::of_pixel(&scene.frame, &pinhole, pixel),
                &lights,
            )
        })
        .collect();
    // A lens beam must not jump off the map at an edge.
    let importances: Vec<f32> = (0..blocks.count())
        .map(|block| blocks.gather(&importances, block, 1, 0.0, f32::max))
        .collect();
    let rates: Vec<Rates> = if scene.frame.rays_total < MIN_RAYS_TO_MEASURE {
        importances
            .iter()
            .map(|&importance| Rates::from_importance(importance))
            .collect()
    } else {
        let (measured, highlights) = measure(scene, &blocks, &flags, meter);
        allocate(&blocks, &measured, &importances, &highlights)
    };
    scene.pixels = (0..flags.len())
        .map(|pixel| rates[blocks.of_pixel(pixel)].pixel(flags[pixel]))
        .collect();
    if sharing_allowed(scene) {
        share(&mut scene.pixels, &blocks, &rates);
    }
}

/// Gives the pixels of each sharing block one plan, that of its nearest pixel; samples of the others that have no turn cost nothing.
fn share(pixels: &mut [PixelInfo], blocks: &Blocks, rates: &[Rates]) {
    let side = BLOCK_SIDE as usize;
    for square in blocks.squares(side) {
        let flags = square
            .iter()
            .fold(0, |all, &pixel| all | pixels[pixel].flags);
        let near = flags & PIXEL_BEAM_MAY_MEET_VIRTUAL;
        let shares = PIXEL_SHARES | if near == 0 { 0 } else { PIXEL_SHARES_NEAR };
        let rates = blocks.of_square(square[0], side).map(|block| rates[block]);
        let plan = Rates::mean(rates).pixel(near);
        for pixel in square {
            let flags = pixels[pixel].flags;
            if flags & PIXEL_OUT_OF_REACH == 0 {
                pixels[pixel] = PixelInfo {
                    flags: flags | shares,
                    ..plan
                };
            }
        }
    }
}

/// Whether pixels may share second vertices: what is between a vertex and a point must be certain, and equal for all rows.
fn sharing_allowed(scene: &PackedScene) -> bool {
    scene.frame.flags & (FRAME_ALPHA | FRAME_NO_SHARING) == 0 && scene.swept_spheres.is_empty()
}

/// By pixel.
fn flags_by_block(scene: &PackedScene, pinhole: &Frame, blocks: &Blocks) -> Vec<u32> {
    let flags: Vec<u32> = (0..blocks.count())
        .into_par_iter()
        .map(|block| {
            let corner = blocks.first_pixel(block) as u32;
            let beam = Beam::of_square(&scene.frame, pinhole, corner, SIDE_PX as u32);
            flags_of(scene, &beam)
        })
        .collect();
    let pixels = 0..scene.pixels.len();
    pixels.map(|pixel| flags[blocks.of_pixel(pixel)]).collect()
}

fn flags_of(scene: &PackedScene, beam: &Beam) -> u32 {
    if beam.may_meet_virtual(scene) {
        PIXEL_BEAM_MAY_MEET_VIRTUAL
    } else if beam.may_meet_real(scene) {
        0
    } else {
        PIXEL_OUT_OF_REACH
    }
}

/// What samples scatter and cost, and the squared errors of highlights, by blocks.
fn measure(
    scene: &mut PackedScene,
    blocks: &Blocks,
    flags: &[u32],
    meter: &Meter<'_>,
) -> (Vec<measurement::BlockMoments>, Vec<f32>) {
    let frame = scene.frame;
    scene.frame.seed = if scene.frame.seed == SEED {
        !SEED
    } else {
        SEED
    };
    // Neither planes nor needless rays shall show in the plan.
    scene.frame.flags &= !(FRAME_AOVS | FRAME_BOTH_SHADOWS);
    let shares = if sharing_allowed(scene) {
        PIXEL_SHARES
    } else {
        0
    };
    scene.pixels = flags
        .iter()
        .map(|flags| PixelInfo::uniform(flags | shares))
        .collect();
    let measured = measurement::measure(scene, blocks, || meter.add(STEPS_OF_A_BLOCK));
    if photons_traced(&scene.frame) {
        scene.photons_per_ray = photons_per_ray(scene, eye_moments(blocks, &measured));
    }
    let highlights = if scene.frame.photon_sphere_count > 0 {
        highlights::highlights(scene, blocks)
    } else {
        vec![None; blocks.count()]
    };
    let (mut guide_cell_count, mut guide_cells_per_m) = (0, 0.0);
    if photons_traced(&scene.frame)
        && scene.frame.flags & FRAME_NO_GUIDE == 0
        && highlights.iter().any(Option::is_some)
    {
        learn(scene);
        (guide_cell_count, guide_cells_per_m) =
            (scene.frame.guide_cell_count, scene.frame.guide_cells_per_m);
    }
    scene.frame = Frame {
        guide_cell_count,
        guide_cells_per_m,
        ..frame
    };
    let highlights = highlights.iter().map(|h| h.unwrap_or(0.0)).collect();
    (measured, highlights)
}

/// What a sample in every pixel does.
fn eye_moments(blocks: &Blocks, measured: &[measurement::BlockMoments]) -> EyeMoments {
    let mut sum = EyeMoments::default();
    let samples: Vec<Moments> = (measured.iter())
        .map(|block| block.difference + block.mixed)
        .collect();
    for (block, &own) in samples.iter().enumerate() {
        let moments = if own.pixels > 0.0 {
            own
        } else {
            blocks.gather(&samples, block, 1, Moments::default(), Moments::add)
        };
        if moments.pixels > 0.0 {
            let share = blocks.pixels(block).count() as f64 / f64::from(moments.pixels);
            sum.error += share * f64::from(moments.error);
            sum.cost += share * f64::from(moments.cost);
        }
    }
    sum
}

#[cfg(test)]
mod tests;
