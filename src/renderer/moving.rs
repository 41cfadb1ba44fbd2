//! The driver of a scene whose objects move while the shutter is open.
//!
//! Moving objects stand still from one instant to the next: what moves is packed anew for each, and every row takes at an instant the
//! samples that fall into it, so that a pixel's samples follow one another in time. (A moving camera is part of each camera ray.)

use super::RenderError;
use super::core::{Core, Way};
use crate::gpu::Changed;
use crate::pack::{Instant, row_ends};
use crate::work::{Watcher, WorkList};

pub(super) struct Moving {
    /// Where the objects stand, one after the other; never empty.
    pub instants: Vec<Instant>,
}

impl Moving {
    /// Takes the samples before `end` of those before `end_of_all`, both in rays per pixel, and what edge pixels then lack. With a readout time
    /// an instant has samples of other numbers in every row, so that every instant is asked, whatever was taken before.
    pub fn advance(
        &self,
        core: &mut Core,
        end: u32,
        end_of_all: u32,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let mut way = Way::to(end_of_all, core, watcher);
        let mut opened = 0.0;
        for instant in &self.instants {
            if watcher.is_cancelled() {
                break;
            }
            let ends = ends_of(core, instant);
            let work = core.main_work(|row| ends[row].min(end));
            let photons = photons_end(core, instant, end);
            let window = [opened as f32, (instant.end_share - opened) as f32];
            opened = instant.end_share;
            if work.is_empty() && !core.lacks_photons(photons) {
                continue;
            }
            stand_at(core, instant)?;
            core.take_photons_of(photons, window, watcher)?;
            if !way.take(core, &work)? {
                break;
            }
            way.samples = core.samples().unwrap_or(end_of_all);
            way.tell(core);
        }
        self.replay_real(core)
    }

    /// Looks at the objects at each instant, with the ends of its samples by row, in rays per pixel. The backend is not told where they stand.
    pub fn each_instant(
        &self,
        core: &mut Core,
        mut look: impl FnMut(&Core, &[u32]),
    ) -> Result<(), RenderError> {
        for instant in &self.instants {
            core.scene.set_time(instant.time_secs);
            core.packed.rebuild_moving(&core.scene)?;
            look(core, &ends_of(core, instant));
        }
        core.scene.set_time(core.time_secs);
        Ok(())
    }

    /// What edge pixels lack, each sample at its own instant; not cancelled.
    pub fn replay_real(&self, core: &mut Core) -> Result<(), RenderError> {
        let end = core.scene.settings.rays_per_pixel;
        let mut lacking = core.real_work(|_| end).samples();
        for instant in &self.instants {
            if lacking == 0 {
                break;
            }
            let ends = ends_of(core, instant);
            let work: WorkList = core.real_work(|row| ends[row]);
            if work.is_empty() {
                continue;
            }
            stand_at(core, instant)?;
            core.take(&work, &Watcher::none())?;
            lacking -= work.samples();
        }
        core.scene.set_time(core.time_secs);
        Ok(())
    }
}

/// The photons before the end of an instant, of those that belong to the rays per pixel before `end`: their numbers follow one another in time.
fn photons_end(core: &Core, instant: &Instant, end: u32) -> u64 {
    let each = core.packed.photons_per_ray;
    let all = u64::from(core.scene.settings.rays_per_pixel) * each;
    let before = (instant.end_share.min(1.0) * all as f64 + 0.5).floor() as u64;
    before.min(u64::from(end) * each)
}

/// By row, the samples before the end of an instant, in rays per pixel.
fn ends_of(core: &Core, instant: &Instant) -> Vec<u32> {
    let Core { scene, packed, .. } = core;
    let total = scene.settings.rays_per_pixel;
    row_ends(scene, packed.frame.height, instant, total)
}

/// Moves the objects to where they are at an instant.
fn stand_at(core: &mut Core, instant: &Instant) -> Result<(), RenderError> {
    core.scene.set_time(instant.time_secs);
    core.packed.rebuild_moving(&core.scene)?;
    core.backend.update(&core.packed, Changed::Moving)?;
    Ok(())
}
