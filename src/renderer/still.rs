//! The driver of a scene in which nothing moves but the camera: every pixel goes up by a few samples at a time.

use std::time::Instant;

use super::RenderError;
use super::core::{Core, Way};
use crate::work::Watcher;

/// The longest a pass runs before the film is shown, in rays per pixel ...
const MAX_PASS_SAMPLES: u32 = 8;
/// ... or as many more as take no longer than this, by the last pass.
const PASS_SECS: f64 = 0.5;

/// Takes the samples before `end` of those before `end_of_all`, both in rays per pixel, and what edge pixels then lack. Where nobody watches, in one
/// pass: more of them only let the film be shown, or left as it is, in between.
pub(super) fn advance(
    core: &mut Core,
    end: u32,
    end_of_all: u32,
    watcher: &Watcher<'_>,
) -> Result<(), RenderError> {
    let first = core.film.first_sample;
    let mut way = Way::to(end_of_all, core, watcher);
    while first + way.samples < end {
        let count = match watcher.is_nobody() {
            true => u32::MAX,
            false => pass_samples(way.samples, core.secs_per_ray, watcher.secs_left()),
        };
        let next = end.min((first + way.samples).saturating_add(count));
        let begin = Instant::now();
        core.take_photons(next, watcher)?;
        let work = core.main_work(|_| next);
        if !way.take(core, &work)? {
            break;
        }
        let taken = next - first - way.samples;
        core.secs_per_ray = Some(begin.elapsed().as_secs_f64() / f64::from(taken));
        way.samples = next - first;
        way.tell(core);
    }
    replay_real(core)
}

/// Rays per pixel of the pass that follows so many, where a ray in every pixel took so long the last time.
fn pass_samples(taken: u32, secs_per_ray: Option<f64>, secs_left: f64) -> u32 {
    let quick = secs_per_ray.map_or(0.0, |secs| {
        secs_left.min(PASS_SECS) / secs.max(f64::MIN_POSITIVE)
    });
    taken.clamp(1, MAX_PASS_SAMPLES).max(quick as u32)
}

/// Short beside the main passes, and without it edge pixels would not be Eq. 4: not cancelled.
pub(super) fn replay_real(core: &mut Core) -> Result<(), RenderError> {
    let end = core.scene.settings.rays_per_pixel;
    let work = core.real_work(|_| end);
    core.take(&work, &Watcher::none())
}

#[cfg(test)]
mod tests {
    use super::pass_samples;

    #[test]
    fn passes_double_and_take_more_where_that_is_quick() {
        let forever = f64::INFINITY;
        let unknown = [0, 1, 3, 40].map(|taken| pass_samples(taken, None, forever));
        assert_eq!(unknown, [1, 1, 3, 8]);
        assert_eq!(pass_samples(40, Some(10.0), forever), 8, "slow");
        assert_eq!(pass_samples(0, Some(0.0625), forever), 8, "quick");
        assert_eq!(pass_samples(1, Some(1.0 / 1024.0), forever), 512);
        assert_eq!(pass_samples(1, Some(1.0 / 1024.0), 0.125), 128, "deadline");
        assert_eq!(pass_samples(1, Some(0.0), forever), u32::MAX);
    }
}
