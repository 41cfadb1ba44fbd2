//! Runs the estimator over the pixels of a film, on all threads of the current rayon pool.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::contribution::ESTIMATOR_PAPER;
use super::estimator::{advance, begin_sample, samples_without_turn};
use super::request::answer;
use super::state::{PathState, RayCounts, STAGE_DONE};
use crate::film::{Film, Guide, GuideSums, PixelSums, Sample, guide_add, pixel_add_real};
use crate::packed::{PIXEL_EDGE, PIXEL_OUT_OF_REACH, PackedScene};
use crate::renderer::{Cancel, Pass, RayTotals};

/// Pixels a task renders before it looks for cancellation.
const TILE_PIXELS: usize = 512;

/// Renders a pass into the film. A cancelled pass leaves whole pixels only: each has taken all of the pass's samples or none.
pub fn render_pass(scene: &PackedScene, film: &mut Film, pass: Pass, cancel: &Cancel) -> RayTotals {
    let totals = AtomicTotals::default();
    let first_ray = film.first_sample;
    let selected: Vec<bool> = match pass {
        Pass::Main { .. } | Pass::MainRows { .. } => Vec::new(),
        Pass::Real { everywhere } | Pass::RealRows { everywhere, .. } => (0..film.pixels.len())
            .map(|i| {
                let known_edge = scene.pixels[i].flags & PIXEL_EDGE != 0;
                known_edge || film.needs_real(i) || (everywhere && wants_real(&film.pixels[i]))
            })
            .collect(),
    };
    let mut no_guides: Vec<GuideSums> = Vec::new();
    let with_guides = !film.guides.is_empty();
    if !with_guides {
        no_guides.resize(
            film.pixels.len().div_ceil(TILE_PIXELS),
            GuideSums::default(),
        );
    }
    let guides: &mut [GuideSums] = if with_guides {
        &mut film.guides
    } else {
        &mut no_guides
    };
    let guide_chunk = if with_guides { TILE_PIXELS } else { 1 };
    film.pixels
        .par_chunks_mut(TILE_PIXELS)
        .zip(guides.par_chunks_mut(guide_chunk))
        .enumerate()
        .for_each(|(tile, (sums, guides))| {
            if cancel.is_cancelled() {
                return;
            }
            let mut counts = RayCounts64::default();
            for (i, sums) in sums.iter_mut().enumerate() {
                let pixel = tile * TILE_PIXELS + i;
                let factor = scene.pixels[pixel].sample_factor;
                let first_sample = first_ray * factor;
                let row = pixel / scene.frame.width as usize;
                let end = pass.end_of_row(row).saturating_mul(factor);
                match pass {
                    Pass::Main { .. } | Pass::MainRows { .. } => {
                        if scene.pixels[pixel].flags & PIXEL_OUT_OF_REACH != 0 {
                            continue;
                        }
                        while first_sample + sums.n < end {
                            let index = first_sample + sums.n;
                            let idle = samples_without_turn(scene, pixel as u32, index, end);
                            if idle > 0 {
                                sums.add_nothing(idle);
                                continue;
                            }
                            let guide = if with_guides {
                                Some(&mut guides[i])
                            } else {
                                None
                            };
                            main_sample(scene, pixel as u32, index, sums, guide, &mut counts);
                        }
                    }
                    Pass::Real { .. } | Pass::RealRows { .. } => {
                        if !selected[pixel] {
                            continue;
                        }
                        while sums.n_real < sums.n && first_sample + sums.n_real < end {
                            let index = first_sample + sums.n_real;
                            let st = run(
                                scene,
                                begin_sample(scene, pixel as u32, index, true),
                                &mut counts,
                            );
                            pixel_add_real(
                                sums,
                                index,
                                st.result.mask != 0,
                                st.result.radiance * scene.frame.exposure_scale,
                            );
                        }
                    }
                }
            }
            totals.add(&counts);
            cancel.progress(sums.len() as u64);
        });
    totals.get()
}

/// The quotient composite and the real plane want Ir wherever something real may be seen.
fn wants_real(sums: &PixelSums) -> bool {
    sums.m < sums.n && sums.n_real < sums.n
}

fn main_sample(
    scene: &PackedScene,
    pixel: u32,
    index: u32,
    sums: &mut PixelSums,
    guide: Option<&mut GuideSums>,
    counts: &mut RayCounts64,
) {
    let st = run(scene, begin_sample(scene, pixel, index, false), counts);
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
            guide: None,
        },
    );
    if let Some(sums) = guide
        && st.first_hit.depth_m.is_finite()
    {
        let guide = Guide {
            depth_m: st.first_hit.depth_m,
            normal: st.first_hit.normal,
            albedo: st.first_hit.albedo,
        };
        guide_add(sums, guide.depth_m, guide.normal, guide.albedo);
    }
}

fn run(scene: &PackedScene, mut st: PathState, counts: &mut RayCounts64) -> PathState {
    while st.path.stage != STAGE_DONE {
        answer(scene, &mut st);
        advance(scene, &mut st);
    }
    counts.add(&st.rays);
    st
}

/// Real radiance of one sample before exposure, and the albedo of its first hit (0 where nothing is hit); wants `FRAME_AOVS`.
pub fn render_first_hit(scene: &PackedScene, pixel: u32, index: u32) -> (Vec3, Vec3) {
    let st = run(
        scene,
        begin_sample(scene, pixel, index, true),
        &mut RayCounts64::default(),
    );
    (st.result.radiance, st.first_hit.albedo)
}

#[derive(Default)]
struct RayCounts64 {
    kinds: [u64; 5],
}

impl RayCounts64 {
    fn add(&mut self, c: &RayCounts) {
        for (sum, x) in
            self.kinds
                .iter_mut()
                .zip([c.primary, c.mixed, c.real, c.mixed_shadow, c.real_shadow])
        {
            *sum += u64::from(x);
        }
    }
}

#[derive(Default)]
struct AtomicTotals {
    kinds: [AtomicU64; 5],
}

impl AtomicTotals {
    fn add(&self, c: &RayCounts64) {
        for (sum, x) in self.kinds.iter().zip(c.kinds) {
            sum.fetch_add(x, Ordering::Relaxed);
        }
    }

    fn get(&self) -> RayTotals {
        let [primary, mixed, real, mixed_shadow, real_shadow] =
            [0, 1, 2, 3, 4].map(|i| self.kinds[i].load(Ordering::Relaxed));
        RayTotals {
            primary,
            mixed,
            real,
            mixed_shadow,
            real_shadow,
        }
    }
}
