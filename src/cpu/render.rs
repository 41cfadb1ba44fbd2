//! Runs the estimator over the pixels of a film, on all threads of the current rayon pool.

use glam::Vec3;
use rayon::prelude::*;

use super::estimator::{advance, begin_sample, samples_without_turn};
use super::request::answer;
use super::state::{PathState, STAGE_DONE};
use crate::film::{Film, GuideSums, PixelSums, Sample, guide_add, pixel_add_real};
use crate::packed::{ESTIMATOR_PAPER, PackedScene};
use crate::work::{Pass, PixelWork, RayCounts, Watcher, WorkList};

/// Pixels a task renders before it looks for cancellation.
const TILE_PIXELS: usize = 512;

/// Takes the samples of `work` and adds them to the film; the rays traced. A cancelled render leaves whole pixels only: each has taken all of
/// its samples or none.
pub fn render(
    scene: &PackedScene,
    film: &mut Film,
    work: &WorkList,
    watcher: &Watcher<'_>,
) -> RayCounts {
    tiles(film, &work.pixels)
        .into_par_iter()
        .map(|mut tile| {
            let mut rays = RayCounts::default();
            if watcher.is_cancelled() {
                return rays;
            }
            for pixel in tile.work {
                match work.pass {
                    Pass::Main => tile.main_samples(scene, pixel, &mut rays),
                    Pass::Real => tile.real_samples(scene, pixel, &mut rays),
                }
            }
            let samples = tile.work.iter().map(|pixel| u64::from(pixel.samples()));
            watcher.taken(samples.sum());
            rays
        })
        .sum()
}

/// Neighbouring pixels of a film, with their work.
struct Tile<'a> {
    first_pixel: usize,
    sums: &'a mut [PixelSums],
    /// Empty where the film has none.
    guides: &'a mut [GuideSums],
    work: &'a [PixelWork],
}

/// The tiles that have work.
fn tiles<'a>(film: &'a mut Film, mut work: &'a [PixelWork]) -> Vec<Tile<'a>> {
    let mut tiles = Vec::new();
    let mut guides = film.guides.chunks_mut(TILE_PIXELS);
    for (tile, sums) in film.pixels.chunks_mut(TILE_PIXELS).enumerate() {
        let first_pixel = tile * TILE_PIXELS;
        let end = first_pixel + sums.len();
        let guides = guides.next().unwrap_or_default();
        let (now, later) = work.split_at(work.partition_point(|w| (w.pixel as usize) < end));
        work = later;
        if !now.is_empty() {
            tiles.push(Tile {
                first_pixel,
                sums,
                guides,
                work: now,
            });
        }
    }
    tiles
}

impl Tile<'_> {
    fn main_samples(&mut self, scene: &PackedScene, work: &PixelWork, rays: &mut RayCounts) {
        let at = work.pixel as usize - self.first_pixel;
        let sums = &mut self.sums[at];
        let mut index = work.first;
        while index < work.end {
            let idle = samples_without_turn(scene, work.pixel, index, work.end);
            if idle > 0 {
                sums.add_nothing(idle);
                index += idle;
                continue;
            }
            main_sample(
                scene,
                work.pixel,
                index,
                sums,
                self.guides.get_mut(at),
                rays,
            );
            index += 1;
        }
    }

    fn real_samples(&mut self, scene: &PackedScene, work: &PixelWork, rays: &mut RayCounts) {
        let sums = &mut self.sums[work.pixel as usize - self.first_pixel];
        for index in work.first..work.end {
            let mut st = begin_sample(scene, work.pixel, index, true);
            run(scene, &mut st, rays);
            let real = st.result.radiance * scene.frame.exposure_scale;
            pixel_add_real(sums, index, st.result.mask != 0, real);
        }
    }
}

fn main_sample(
    scene: &PackedScene,
    pixel: u32,
    index: u32,
    sums: &mut PixelSums,
    guide: Option<&mut GuideSums>,
    rays: &mut RayCounts,
) {
    let mut st = begin_sample(scene, pixel, index, false);
    run(scene, &mut st, rays);
    let scale = scene.frame.exposure_scale;
    let is_virtual = st.result.mask != 0;
    let (contribution, real) = if scene.frame.estimator == ESTIMATOR_PAPER {
        let real = st.radiance_real * scale;
        (
            if is_virtual {
                st.result.radiance * scale
            } else {
                (st.result.radiance - st.radiance_real) * scale
            },
            Some(real),
        )
    } else {
        (st.result.radiance * scale, None)
    };
    sums.add(
        index,
        &Sample {
            is_virtual,
            contribution,
            real,
        },
    );
    let hit = &st.first_hit;
    if let Some(sums) = guide
        && hit.depth_m.is_finite()
    {
        guide_add(sums, hit.depth_m, hit.normal, hit.albedo);
    }
}

/// Takes a sample to its end, where it stands: its state is too large to be moved for nothing.
fn run(scene: &PackedScene, st: &mut PathState, rays: &mut RayCounts) {
    while st.path.stage != STAGE_DONE {
        answer(scene, st);
        advance(scene, st);
    }
    *rays += st.rays;
}

/// Real radiance of one sample before exposure, and the albedo of its first hit (0 where nothing is hit); wants `FRAME_AOVS`.
pub fn render_first_hit(scene: &PackedScene, pixel: u32, index: u32) -> (Vec3, Vec3) {
    let mut st = begin_sample(scene, pixel, index, true);
    run(scene, &mut st, &mut RayCounts::default());
    (st.result.radiance, st.first_hit.albedo)
}

#[cfg(test)]
mod tests;
