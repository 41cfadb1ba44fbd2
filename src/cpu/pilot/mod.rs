//! A look at the picture before the first sample: which beams can meet virtual geometry, which pixels nothing virtual can reach, and how often
//! each pixel's samples are worth an evaluation.
//!
//! The two flags are proven. How often steers work, not the result: whatever is evaluated counts for what is not, and the pilot's own
//! samples are not used again.

mod allocation;
mod beam;
mod blocks;
mod blur;
mod highlights;
mod importance;
mod measurement;
mod patch;
mod reach;

use super::contribution::photons_traced;
use super::photons;
use super::photons::guide::learn;
use super::photons::plan::{Effort, photons_per_ray, unmeasured};
use allocation::{Rates, allocate};
use beam::Beam;
use blocks::Blocks;
#[cfg(feature = "bench")]
pub(crate) use importance::MAX_LIGHTS_EXAMINED;
use importance::{PilotLights, importance};
pub use patch::LensGrid;
pub(super) use patch::{Certainty, each_patch, in_world};
use reach::WorldSpheres;
pub(super) use reach::real_sphere;

use crate::cpu::sharing_tile::BLOCK_SIDE;
use crate::packed::{
    ESTIMATOR_PAPER, FRAME_ALPHA, FRAME_AOVS, FRAME_BOTH_SHADOWS, FRAME_NO_GUIDE, FRAME_NO_SHARING,
    Frame, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PIXEL_SHARES, PIXEL_SHARES_NEAR,
    PackedScene, PixelInfo, SIDE_VIRTUAL,
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

/// Fills `scene.pixels`. The same for every seed, sample range and backend; ended by the meter's watcher, it is no plan to render by. `grid`: the lens's, where there is one, which spares undistorting.
pub fn pilot(scene: &mut PackedScene, grid: Option<&LensGrid>, meter: &Meter<'_>) {
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
    let blocks = Blocks::of(width, height);
    let (flags, importances) = look(scene, grid, &blocks, meter);
    if photons_traced(&scene.frame) {
        scene.photons_per_ray = unmeasured(width * height);
    }
    if scene.frame.estimator == ESTIMATOR_PAPER {
        scene.pixels = flags.into_iter().map(PixelInfo::uniform).collect();
        return;
    }
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
        let found = measure(scene, &blocks, &flags, meter);
        let (rates, eye) = allocate(
            &blocks,
            &found.samples,
            &importances,
            &found.highlights,
            scene.frame.rays_total,
        );
        if let Some(photon) = found.photon {
            scene.photons_per_ray = photons_per_ray(width * height, photon, eye);
        }
        rates
    };
    let plans: Vec<[PixelInfo; 2]> = (rates.iter())
        .map(|rates| [0, PIXEL_BEAM_MAY_MEET_VIRTUAL].map(|near| rates.pixel(near)))
        .collect();
    scene.pixels = (blocks.of_pixels().zip(flags))
        .map(|(block, flags)| PixelInfo {
            flags,
            ..plans[block][usize::from(flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0)]
        })
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

/// What a patch's pixels and its blocks are found to be.
struct PatchFindings {
    flags: Vec<(usize, u32)>,
    importances: Vec<(usize, f32)>,
}

/// Each pixel's flags, and each block's importance.
fn look(
    scene: &PackedScene,
    grid: Option<&LensGrid>,
    blocks: &Blocks,
    meter: &Meter<'_>,
) -> (Vec<u32>, Vec<f32>) {
    let frame = &scene.frame;
    let spheres = WorldSpheres::of(scene);
    let weighs = frame.estimator != ESTIMATOR_PAPER;
    let lights = weighs.then(|| PilotLights::of(scene));
    let findings = each_patch(frame, grid, |patch| {
        let flags = spheres.flags(frame, patch);
        meter.add(flags.len() as u64);
        let importances = lights.iter().flat_map(|lights| {
            let firsts = patch.firsts(frame, blocks::SIDE_PX);
            firsts.map(|(at, pixel)| {
                let found = match flags[at].1 {
                    // Nor does its ray meet anything real.
                    PIXEL_OUT_OF_REACH => 0.0,
                    _ => importance(scene, &Beam::of_pixel(frame, patch, at), lights),
                };
                (blocks.of_pixel(pixel), found)
            })
        });
        PatchFindings {
            importances: importances.collect(),
            flags,
        }
    });
    let mut flags = vec![0; scene.frame.width as usize * scene.frame.height as usize];
    let mut importances = vec![0.0; blocks.count()];
    for patch in findings {
        for (pixel, found) in patch.flags {
            flags[pixel] = found;
        }
        for (block, found) in patch.importances {
            importances[block] = found;
        }
    }
    (flags, importances)
}

/// What the plan follows from.
struct Measured {
    /// What samples scatter and cost, by blocks.
    samples: Vec<measurement::BlockMoments>,
    /// Squared errors of highlights, by blocks.
    highlights: Vec<f32>,
    /// Where photons are traced.
    photon: Option<Effort>,
}

/// A few samples and photons, of a seed of their own.
fn measure(scene: &mut PackedScene, blocks: &Blocks, flags: &[u32], meter: &Meter<'_>) -> Measured {
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
    let is_cancelled = || meter.is_cancelled();
    let samples = measurement::measure(scene, blocks, is_cancelled, || meter.add(STEPS_OF_A_BLOCK));
    if is_cancelled() {
        scene.frame = frame;
        return Measured {
            samples,
            highlights: vec![0.0; blocks.count()],
            photon: None,
        };
    }
    let photon = photons_traced(&scene.frame).then(|| photons::plan::measure(scene));
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
    Measured {
        samples,
        highlights: highlights.iter().map(|h| h.unwrap_or(0.0)).collect(),
        photon,
    }
}

#[cfg(test)]
mod tests;
