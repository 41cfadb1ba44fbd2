//! Traces photons on all threads of the current rayon pool.

use rayon::prelude::*;

use super::path::{PhotonNumber, SEQUENCE_BITS, trace_photon};
use crate::film::{Film, Splat};
use crate::packed::PackedScene;
use crate::work::{PhotonWork, RayCounts, Watcher};

/// Photons of one task, and of all tasks between two looks for cancellation.
const TASK_PHOTONS: u64 = 1 << 10;
const BATCH_PHOTONS: u64 = 1 << 16;

/// Traces the photons of `work` and adds what they bring to the film; the rays traced. A cancelled render leaves out the last of them.
pub fn render(
    scene: &PackedScene,
    film: &mut Film,
    work: &PhotonWork,
    watcher: &Watcher<'_>,
) -> RayCounts {
    let mut rays = RayCounts::default();
    let mut first = work.first;
    while first < work.end && !watcher.is_cancelled() {
        let end = work.end.min(first + BATCH_PHOTONS);
        let tasks: Vec<(Vec<Splat>, RayCounts)> = (0..(end - first).div_ceil(TASK_PHOTONS))
            .into_par_iter()
            .map(|task| {
                let begin = first + task * TASK_PHOTONS;
                trace(scene, begin, end.min(begin + TASK_PHOTONS), work)
            })
            .collect();
        for (_, traced) in &tasks {
            rays += *traced;
        }
        film.add_splats(0, tasks.into_iter().flat_map(|(splats, _)| splats));
        first = end;
    }
    film.add_splats(first - work.first, std::iter::empty());
    rays
}

fn trace(scene: &PackedScene, begin: u64, end: u64, work: &PhotonWork) -> (Vec<Splat>, RayCounts) {
    let mut splats = Vec::new();
    let mut rays = RayCounts::default();
    for number in begin..end {
        let number = PhotonNumber {
            sequence: (number >> SEQUENCE_BITS) as u32,
            place: (number & ((1 << SEQUENCE_BITS) - 1)) as u32,
            window: work.window,
        };
        rays += trace_photon(scene, number, |splat| splats.push(splat)).rays;
    }
    (splats, rays)
}
