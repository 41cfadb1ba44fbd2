//! Runs the estimator over the pixels of a film, on all threads of the current rayon pool.

use glam::Vec3;
use rayon::prelude::*;

use super::batch::{Batch, run_alone};
use super::estimator::{begin_sample, evaluation, is_without_turn, virtual_is_nearer};
use super::in_flight::InFlight;
use super::request::answer;
use super::state::path_state;
use super::tiles::{Tile, TileWork, tiles};
use crate::film::{Film, Sample, group_add, guide_add, pixel_add_real};
use crate::packed::{ESTIMATOR_PAPER, NONE, PackedScene};
use crate::work::{Pass, PixelWork, RayCounts, Watcher, WorkList};

/// Takes the samples of `work` and adds them to the film; the rays traced. A cancelled render leaves whole pixels only: each has taken all of
/// its samples or none.
pub fn render(
    scene: &PackedScene,
    film: &mut Film,
    work: &WorkList,
    watcher: &Watcher<'_>,
) -> RayCounts {
    let fill = |batch: &mut Batch, mut tile: Tile<'_>, tile_work: &TileWork| {
        let mut rays = RayCounts::default();
        for block in tile_work.blocks() {
            rays += render_block(scene, &mut tile, work.pass, block, batch);
        }
        watcher.taken(tile_work.samples());
        rays
    };
    tiles(film, &work.pixels)
        .into_par_iter()
        .map_init(Batch::default, |batch, (tile, work)| {
            if watcher.is_cancelled() {
                RayCounts::default()
            } else {
                fill(batch, tile, &work)
            }
        })
        .sum()
}

/// The samples of a block's pixels, index by index. A pixel's samples are added in their order, whatever else is in flight.
fn render_block(
    scene: &PackedScene,
    tile: &mut Tile<'_>,
    pass: Pass,
    block: &[PixelWork],
    batch: &mut Batch,
) -> RayCounts {
    let mut rays = RayCounts::default();
    let first = block.iter().map(|work| work.first).min().unwrap_or(0);
    let end = block.iter().map(|work| work.end).max().unwrap_or(0);
    for index in first..end {
        for work in block {
            if !(work.first..work.end).contains(&index) {
                continue;
            }
            if pass == Pass::Main && is_without_turn(scene, work.pixel, index) {
                tile.sums(work.pixel).add_nothing();
            } else {
                batch.generate(scene, work.pixel, index, pass == Pass::Real);
            }
        }
        if batch.len() >= Batch::WORTH || index + 1 == end {
            batch.run(scene);
            rays += RayCounts::from(batch.take_shared_rays());
            for sample in batch.samples() {
                rays += sample.state.rays;
                add_sample(scene, tile, pass, sample);
            }
            batch.clear();
        }
    }
    rays
}

fn add_sample(scene: &PackedScene, tile: &mut Tile<'_>, pass: Pass, sample: &InFlight) {
    let InFlight { index, state: st } = sample;
    let pixel = st.path.pixel;
    let scale = scene.frame.exposure_scale;
    let is_virtual = st.result.mask != 0;
    let radiance = st.result.radiance * scale;
    if pass == Pass::Real {
        pixel_add_real(tile.sums(pixel), *index, is_virtual, radiance);
        return;
    }
    let (contribution, real) = if scene.frame.estimator != ESTIMATOR_PAPER {
        (radiance, None)
    } else if is_virtual {
        (radiance, Some(st.radiance_real * scale))
    } else {
        let difference = (st.result.radiance - st.radiance_real) * scale;
        (difference, Some(st.radiance_real * scale))
    };
    let sample = Sample {
        is_virtual,
        contribution,
        real,
    };
    tile.sums(pixel).add(*index, &sample);
    let evaluation = evaluation(scene, pixel, *index);
    if !is_virtual
        && evaluation != NONE
        && let Some(sums) = tile.groups(pixel)
    {
        group_add(sums, evaluation, contribution);
    }
    let hit = &st.first_hit;
    if hit.depth_m.is_finite()
        && let Some(sums) = tile.guide(pixel)
    {
        guide_add(sums, hit.depth_m, hit.normal, hit.albedo);
    }
}

/// Real radiance of one sample before exposure, and the albedo of its first hit (0 where nothing is hit); wants `FRAME_AOVS`.
pub fn render_first_hit(scene: &PackedScene, pixel: u32, index: u32) -> (Vec3, Vec3) {
    let mut st = path_state(pixel, index);
    begin_sample(scene, &mut st, pixel, index, true);
    run_alone(scene, &mut st);
    (st.result.radiance, st.first_hit.albedo)
}

/// The virtual triangle that a sample's camera ray shows, or NONE: one for each sample that counts in the film's M.
pub fn first_virtual_triangle(scene: &PackedScene, pixel: u32, index: u32) -> u32 {
    let mut st = path_state(pixel, index);
    begin_sample(scene, &mut st, pixel, index, true);
    answer(scene, &mut st);
    match virtual_is_nearer(&st.hits) {
        true => st.hits.in_virtual.triangle,
        false => NONE,
    }
}

#[cfg(test)]
pub(super) use tests::scene as test_scene;

#[cfg(test)]
mod tests;
