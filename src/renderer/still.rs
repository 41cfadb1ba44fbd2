//! The driver of a scene in which nothing moves but the camera: every pixel goes up by a few samples at a time.

use super::RenderError;
use super::core::{Core, Way};
use crate::work::Watcher;

/// The longest a pass runs before the film is shown, in rays per pixel.
const MAX_PASS_SAMPLES: u32 = 8;

/// Takes the samples before `end` of those before `end_of_all`, both in rays per pixel, and what edge pixels then lack.
pub(super) fn advance(
    core: &mut Core,
    end: u32,
    end_of_all: u32,
    watcher: &Watcher<'_>,
) -> Result<(), RenderError> {
    let first = core.film.first_sample;
    let mut way = Way::to(end_of_all, core, watcher);
    while first + way.samples < end {
        let next = end.min(first + way.samples + way.samples.clamp(1, MAX_PASS_SAMPLES));
        core.take_photons(next, watcher)?;
        let work = core.main_work(|_| next);
        if !way.take(core, &work)? {
            break;
        }
        way.samples = next - first;
        way.tell(core);
    }
    replay_real(core)
}

/// Short beside the main passes, and without it edge pixels would not be Eq. 4: not cancelled.
pub(super) fn replay_real(core: &mut Core) -> Result<(), RenderError> {
    let end = core.scene.settings.rays_per_pixel;
    let work = core.real_work(|_| end);
    core.take(&work, &Watcher::none())
}
