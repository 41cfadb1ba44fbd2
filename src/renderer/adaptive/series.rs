//! A row of scrambles: whole renders, each with random numbers of its own, summed.

use std::rc::Rc;

use super::{ToError, evaluations};
use crate::film::Scrambles;
use crate::gpu::Changed;
use crate::math::hash_combine;
use crate::packed::{PIXEL_EDGE, PIXEL_OUT_OF_REACH, PixelInfo};
use crate::renderer::core::is_within_reach;
use crate::renderer::{RenderError, still};
use crate::work::{Meter, Phase, Progress, Watcher};

/// Keeps the scrambles' seeds apart from those that a user gives. The same number salts the turns in `cpu/estimator.rs`, which does no harm: that
/// hashes a pixel with the scramble's own seed, this a scramble's number with the user's.
const SEED_SALT: u32 = 0x7f4a_7c15;

/// Scrambles of one plan of samples.
pub(super) struct Series {
    pub sum: Scrambles,
    /// The number of each scramble, and the tiles that took part.
    taken: Vec<(u32, Rc<[bool]>)>,
}

impl Series {
    /// Scrambles completed, of the tiles that took part in all of them.
    pub fn count(&self) -> u32 {
        self.taken.len() as u32
    }
}

impl ToError<'_> {
    /// Takes up another plan of samples; known edges stay known.
    pub(super) fn plan(&mut self, mut infos: Vec<PixelInfo>) -> Result<(), RenderError> {
        let core = &mut *self.core;
        for (info, known) in infos.iter_mut().zip(&core.packed.pixels) {
            info.flags |= known.flags & PIXEL_EDGE;
        }
        // As many times the photons as the evaluations.
        let (photons, planned) = self.planned;
        let gain = evaluations(&infos) / planned.max(1e-30);
        core.packed.photons_per_ray = (photons as f64 * gain).ceil() as u64;
        core.packed.pixels = infos;
        let factors = core.packed.pixels.iter().map(|info| info.sample_factor);
        core.film.set_sample_factors(factors);
        core.backend.update(&core.packed, Changed::All)?;
        Ok(())
    }

    /// The first `count` scrambles of the present plan, numbered from `first`, of the tiles in `taking_part`. Fewer if the watcher ends it.
    pub(super) fn series(
        &mut self,
        first: u32,
        count: u32,
        taking_part: &Rc<[bool]>,
    ) -> Result<Series, RenderError> {
        let core = &*self.core;
        let pixels = &core.packed.pixels;
        let active = (0..pixels.len()).filter(|&pixel| is_within_reach(&pixels[pixel]));
        let active = active.map(|pixel| pixel as u32).collect();
        let mut series = Series {
            sum: Scrambles::new(
                &core.film,
                core.scene.settings.composite,
                self.grouped,
                active,
            ),
            taken: Vec::new(),
        };
        if !core.nothing_to_trace() {
            let numbers = (first..first + count).map(|number| (number, taking_part.clone()));
            self.extend(&mut series, numbers)?;
        }
        Ok(series)
    }

    /// Adds scrambles to a series. False if the watcher ended it before all were complete.
    pub(super) fn extend(
        &mut self,
        series: &mut Series,
        numbers: impl Iterator<Item = (u32, Rc<[bool]>)>,
    ) -> Result<bool, RenderError> {
        let mut complete = true;
        let watcher = self.watcher;
        for (number, taking_part) in numbers {
            let takes_part = |pixel: usize| taking_part[self.tiles.of_pixel(pixel)];
            let takes_part: Vec<bool> = (0..self.core.film.pixels.len()).map(takes_part).collect();
            if !self.scramble(number, &takes_part, &watcher)? {
                complete = false;
                break;
            }
            series.sum.add(&self.core.film);
            series.taken.push((number, taking_part));
            self.done += 1;
        }
        self.replay_late_edges(series)?;
        Ok(complete)
    }

    pub(super) fn progress(&self) -> Progress {
        let expected = self.expected.max(self.done);
        Progress {
            phase: Phase::Rendering,
            share_done: f64::from(self.done) / f64::from(expected.max(1)),
            elapsed: self.begin.elapsed(),
            samples: self.done,
            samples_total: expected,
            rays: self.core.rays,
        }
    }

    /// One render with random numbers of its own, left in the film, of the pixels that take part; false if the watcher ended it.
    fn scramble(
        &mut self,
        number: u32,
        takes_part: &[bool],
        watcher: &Watcher<'_>,
    ) -> Result<bool, RenderError> {
        let pixels = &mut self.core.packed.pixels;
        let before: Vec<u32> = pixels.iter().map(|info| info.flags).collect();
        for (info, takes_part) in pixels.iter_mut().zip(takes_part) {
            if !takes_part {
                info.flags |= PIXEL_OUT_OF_REACH;
                info.flags &= !PIXEL_EDGE;
            }
        }
        let complete = self.render_scramble(number, watcher);
        for (info, flags) in self.core.packed.pixels.iter_mut().zip(before) {
            info.flags = flags;
        }
        complete
    }

    fn render_scramble(&mut self, number: u32, watcher: &Watcher<'_>) -> Result<bool, RenderError> {
        let from = self.progress();
        let core = &mut *self.core;
        core.packed.frame.seed = hash_combine(core.scene.settings.seed ^ SEED_SALT, number);
        core.backend.set_frame(&core.packed);
        core.film.clear();
        core.take_photons(1, watcher)?;
        let work = core.main_work(|_| 1);
        let share_at_end = f64::from(self.done + 1) / f64::from(self.expected.max(self.done + 1));
        let meter = Meter::part(watcher, from, share_at_end, work.samples());
        core.take(&work, &watcher.metered(&meter))?;
        if watcher.is_cancelled() {
            return Ok(false);
        }
        still::replay_real(core)?;
        Ok(true)
    }

    /// Pixels that turned out to be edges after a scramble in which they were not lack that scramble's real radiance. They are few: all their
    /// scrambles are rendered again, with it.
    fn replay_late_edges(&mut self, series: &mut Series) -> Result<(), RenderError> {
        let film = series.sum.film();
        let is_late: Vec<bool> = (0..film.pixels.len()).map(|i| film.needs_real(i)).collect();
        if !is_late.contains(&true) {
            return Ok(());
        }
        for (pixel, _) in is_late.iter().enumerate().filter(|(_, late)| **late) {
            self.core.packed.pixels[pixel].flags |= PIXEL_EDGE;
            series.sum.clear_pixel(pixel);
        }
        for (number, taking_part) in &series.taken {
            let takes_part: Vec<bool> = (is_late.iter().enumerate())
                .map(|(pixel, late)| *late && taking_part[self.tiles.of_pixel(pixel)])
                .collect();
            self.scramble(*number, &takes_part, &Watcher::none())?;
            series.sum.add(&self.core.film);
        }
        Ok(())
    }
}
