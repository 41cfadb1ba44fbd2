//! A row of scrambles: whole renders, each with random numbers of its own, summed.

use std::rc::Rc;
use std::time::Instant;

use super::tiles::Tiles;
use super::{Backend, Cancel, ErrorGoal, Pass, Progress, RayTotals, RenderError, Renderer};
use crate::film::Scrambles;
use crate::math::hash_combine;
use crate::packed::{PIXEL_EDGE, PIXEL_OUT_OF_REACH, PixelInfo};

/// Keeps the scrambles' seeds apart from those that a user gives.
const SEED_SALT: u32 = 0x7f4a_7c15;

/// What a render to an error is told, and where it stands.
pub(super) struct Run<'a> {
    pub goal: &'a ErrorGoal,
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
    pub progress: &'a mut dyn FnMut(Progress),
    pub start: Instant,
    /// Scrambles completed and expected.
    pub done: u32,
    pub expected: u32,
}

impl Run<'_> {
    fn report(&mut self, rays: RayTotals) {
        self.done += 1;
        (self.progress)(Progress {
            samples: self.done,
            samples_total: self.expected.max(self.done),
            rays,
            elapsed: self.start.elapsed(),
        });
    }
}

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

impl Renderer {
    /// Takes up another plan of samples; known edges stay known.
    pub(super) fn plan(&mut self, mut infos: Vec<PixelInfo>) -> Result<(), RenderError> {
        for (info, known) in infos.iter_mut().zip(&self.packed.pixels) {
            info.flags |= known.flags & PIXEL_EDGE;
        }
        self.packed.pixels = infos;
        let factors = self.packed.pixels.iter().map(|info| info.sample_factor);
        self.film.set_sample_factors(factors);
        if let Backend::Gpu(gpu) = &mut self.backend {
            gpu.set_scene(&self.packed)?;
        }
        Ok(())
    }

    /// The first `count` scrambles of the present plan, numbered from `first`, of the tiles in `taking_part`. Fewer if `run` is cancelled.
    pub(super) fn series(
        &mut self,
        first: u32,
        count: u32,
        taking_part: &Rc<[bool]>,
        tiles: &Tiles,
        run: &mut Run<'_>,
    ) -> Result<Series, RenderError> {
        let within_reach =
            |pixel: &u32| self.packed.pixels[*pixel as usize].flags & PIXEL_OUT_OF_REACH == 0;
        let active = (0..self.packed.pixels.len() as u32).filter(within_reach);
        let mode = self.scene.settings.composite;
        let mut series = Series {
            sum: Scrambles::new(&self.film, mode, active.collect()),
            taken: Vec::new(),
        };
        if !self.nothing_to_trace() {
            let numbers = (first..first + count).map(|number| (number, taking_part.clone()));
            self.extend(&mut series, numbers, tiles, run)?;
        }
        Ok(series)
    }

    /// Adds scrambles to a series. False if `run` was cancelled before all were complete.
    pub(super) fn extend(
        &mut self,
        series: &mut Series,
        numbers: impl Iterator<Item = (u32, Rc<[bool]>)>,
        tiles: &Tiles,
        run: &mut Run<'_>,
    ) -> Result<bool, RenderError> {
        let mut complete = true;
        for (number, taking_part) in numbers {
            let takes_part = |pixel: usize| taking_part[tiles.of_pixel(pixel)];
            if !self.scramble(number, &takes_part, run.cancelled)? {
                complete = false;
                break;
            }
            series.sum.add(&self.film);
            series.taken.push((number, taking_part));
            run.report(self.rays);
        }
        self.replay_late_edges(series, tiles)?;
        Ok(complete)
    }

    /// One render with random numbers of its own, left in `self.film`, of the pixels that take part; false if it was cancelled.
    fn scramble(
        &mut self,
        number: u32,
        takes_part: &dyn Fn(usize) -> bool,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool, RenderError> {
        let before: Vec<u32> = self.packed.pixels.iter().map(|info| info.flags).collect();
        for (pixel, info) in self.packed.pixels.iter_mut().enumerate() {
            if !takes_part(pixel) {
                info.flags |= PIXEL_OUT_OF_REACH;
                info.flags &= !PIXEL_EDGE;
            }
        }
        let complete = self.render_scramble(number, cancelled);
        for (info, flags) in self.packed.pixels.iter_mut().zip(before) {
            info.flags = flags;
        }
        complete
    }

    fn render_scramble(
        &mut self,
        number: u32,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool, RenderError> {
        self.packed.frame.seed = hash_combine(self.scene.settings.seed ^ SEED_SALT, number);
        self.send_frame();
        self.film.clear();
        let cancel = Cancel::new(cancelled, None);
        self.run_pass(Pass::Main { end: 1 }, &cancel)?;
        if cancel.is_cancelled() {
            return Ok(false);
        }
        self.replay_real()?;
        Ok(true)
    }

    pub(super) fn send_frame(&mut self) {
        if let Backend::Gpu(gpu) = &mut self.backend {
            gpu.set_frame(&self.packed);
        }
    }

    /// Pixels that turned out to be edges after a scramble in which they were not lack that scramble's real radiance. They are few: all their
    /// scrambles are rendered again, with it.
    fn replay_late_edges(&mut self, series: &mut Series, tiles: &Tiles) -> Result<(), RenderError> {
        let film = series.sum.film();
        let is_late: Vec<bool> = (0..film.pixels.len()).map(|i| film.needs_real(i)).collect();
        if !is_late.contains(&true) {
            return Ok(());
        }
        for (pixel, _) in is_late.iter().enumerate().filter(|(_, late)| **late) {
            self.packed.pixels[pixel].flags |= PIXEL_EDGE;
            series.sum.clear_pixel(pixel);
        }
        for (number, taking_part) in &series.taken {
            let takes_part = |pixel: usize| is_late[pixel] && taking_part[tiles.of_pixel(pixel)];
            self.scramble(*number, &takes_part, &|| false)?;
            series.sum.add(&self.film);
        }
        Ok(())
    }
}
