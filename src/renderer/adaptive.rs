//! Rendering to an error instead of a number of rays.
//!
//! The picture is the mean of [`SCRAMBLES`] independent renders (scrambles), whose spread states its standard error. A pilot of a few more
//! scrambles, which are not part of the picture, decides how many samples each tile's pixels take in each of them. Every sample that is
//! taken counts, whatever it brings, so stopping does not bias the result.

use std::time::Instant;

use rayon::prelude::*;

use super::tiles::{Tiles, Trial, gain_for};
use super::{Cancel, ErrorGoal, Pass, Progress, RenderError, Renderer};
use crate::film::{Film, Scrambles, composite, stated_share};
use crate::math::hash_combine;
use crate::packed::{PIXEL_EDGE, PIXEL_OUT_OF_REACH, PixelInfo};

/// Independent scrambles that make the picture.
pub const SCRAMBLES: u32 = 16;
/// Scrambles of each of the pilot's two trials.
const TRIAL_SCRAMBLES: u32 = 4;
/// The second trial takes this share of the samples that the first calls for: it tells how fast the error really falls.
const SECOND_TRIAL_SHARE: f64 = 0.25;
/// A difference is evaluated at one sample in this many at the least: each pixel is expected to see it four times.
const LONGEST_PERIOD: f64 = 4.0;
/// Least gain: a pixel takes one sample a scramble anyway.
const LEAST_GAIN: f64 = 1.0 / 16.0;
/// Keeps the scrambles' seeds apart from those that a user gives.
const SEED_SALT: u32 = 0x7f4a_7c15;
/// Numbers of the pilot's scrambles.
const FIRST_TRIAL: u32 = 1 << 16;
const SECOND_TRIAL: u32 = 2 << 16;

/// How good a picture is, from its scrambles.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// Independent scrambles that the error is taken from; fewer than [`SCRAMBLES`] if the render was ended early.
    pub scrambles: u32,
    /// Variance of the composite by pixel and channel, linear; 0 where no two scrambles differ.
    pub variance: Vec<[f32; 3]>,
    /// Samples a pixel, mean over the pixels that something virtual may reach.
    pub mean_rays_per_pixel: f64,
    /// Tiles within reach, and those of them that stay above the goal.
    pub tiles: usize,
    pub tiles_above_goal: usize,
}

impl Stated {
    /// Root mean square over the picture, linear.
    pub fn rms(&self) -> f64 {
        let values = self.variance.as_flattened();
        let sum: f64 = values.iter().map(|&v| f64::from(v)).sum();
        (sum / values.len().max(1) as f64).sqrt()
    }
}

impl Renderer {
    /// Renders the film anew until every tile's stated error is as low as the goal, as far as the pilot can foresee it. The film is then
    /// complete: [`Renderer::advance`] adds nothing to it. `progress` counts scrambles, the pilot's included.
    ///
    /// Ended by `cancelled`, it keeps the scrambles that are complete.
    ///
    /// # Errors
    /// As [`Renderer::advance`].
    pub fn render_to_error(
        &mut self,
        goal: &ErrorGoal,
        cancelled: &(dyn Fn() -> bool + Sync),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(), RenderError> {
        let start = Instant::now();
        if self.stated.is_some() {
            self.look_ahead();
        }
        let frame = self.packed.frame;
        self.packed.frame.rays_total = 1;
        self.film.first_sample = 0;
        let mut run = Run {
            goal,
            cancelled,
            progress,
            start,
            done: 0,
        };
        let outcome = self.pilot_and_picture(&mut run);
        self.packed.frame = frame;
        self.set_frame();
        let (scrambles, count) = outcome?;
        self.state(goal, scrambles, count);
        self.seconds.render += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// The picture's scrambles, or the pilot's where it was ended before the first of them.
    fn pilot_and_picture(&mut self, run: &mut Run<'_>) -> Result<(Scrambles, u32), RenderError> {
        let plan = self.packed.pixels.clone();
        let tiles = Tiles::of(self.film.width as usize, self.film.height as usize);
        let most = (run.goal.max_rays_per_pixel / SCRAMBLES).max(1);
        let scaled = |gains: &[f64], tiles: &Tiles| -> Vec<PixelInfo> {
            let each = plan.par_iter().enumerate();
            each.map(|(pixel, &info)| scale(info, gains[tiles.of_pixel(pixel)], most))
                .collect()
        };

        let mut gains = vec![1.0; tiles.count()];
        self.plan(scaled(&gains, &tiles))?;
        let (trial, count) = self.scrambles(FIRST_TRIAL, TRIAL_SCRAMBLES, run)?;
        if count < TRIAL_SCRAMBLES {
            return Ok((trial, count));
        }
        let first = self.trial(&tiles, &gains, &trial, run.goal);

        let second_gain: Vec<f64> = first
            .iter()
            .map(|t| (t.need * t.gain * SECOND_TRIAL_SHARE).round())
            .collect();
        let mut second: Vec<Option<Trial>> = vec![None; tiles.count()];
        if second_gain.iter().any(|&gain| gain >= 2.0) {
            for (gain, &second) in gains.iter_mut().zip(&second_gain) {
                *gain = second.max(1.0);
            }
            let mut infos = scaled(&gains, &tiles);
            let rest = |pixel: usize| second_gain[tiles.of_pixel(pixel)] < 2.0;
            let reach: Vec<u32> = infos.iter().map(|info| info.flags).collect();
            for (pixel, info) in infos.iter_mut().enumerate() {
                if rest(pixel) {
                    info.flags |= PIXEL_OUT_OF_REACH;
                }
            }
            self.plan(infos)?;
            let (longer, count) = self.scrambles(SECOND_TRIAL, TRIAL_SCRAMBLES, run)?;
            for (info, flags) in self.packed.pixels.iter_mut().zip(reach) {
                info.flags = flags | (info.flags & PIXEL_EDGE);
            }
            if count < TRIAL_SCRAMBLES {
                return Ok((trial, TRIAL_SCRAMBLES));
            }
            let measured = self.trial(&tiles, &gains, &longer, run.goal);
            for (tile, trial) in measured.into_iter().enumerate() {
                second[tile] = (second_gain[tile] >= 2.0).then_some(trial);
            }
        }

        let gains: Vec<f64> = first
            .iter()
            .zip(second)
            .map(|(&first, second)| gain_for(first, second).max(LEAST_GAIN))
            .collect();
        self.plan(scaled(&gains, &tiles))?;
        let (picture, count) = self.scrambles(0, SCRAMBLES, run)?;
        if count == 0 {
            return Ok((trial, TRIAL_SCRAMBLES));
        }
        Ok((picture, count))
    }

    /// Takes up another plan of samples; known edges stay known.
    fn plan(&mut self, mut infos: Vec<PixelInfo>) -> Result<(), RenderError> {
        for (info, known) in infos.iter_mut().zip(&self.packed.pixels) {
            info.flags |= known.flags & PIXEL_EDGE;
        }
        self.packed.pixels = infos;
        let factors = self.packed.pixels.iter().map(|info| info.sample_factor);
        self.film.set_sample_factors(factors);
        if let super::Backend::Gpu(gpu) = &mut self.backend {
            gpu.set_scene(&self.packed)?;
        }
        Ok(())
    }

    fn set_frame(&mut self) {
        if let super::Backend::Gpu(gpu) = &mut self.backend {
            gpu.set_frame(&self.packed);
        }
    }

    /// The scrambles from this number on, and how many were completed before `run` was cancelled.
    fn scrambles(
        &mut self,
        first: u32,
        count: u32,
        run: &mut Run<'_>,
    ) -> Result<(Scrambles, u32), RenderError> {
        let within_reach =
            |pixel: &u32| self.packed.pixels[*pixel as usize].flags & PIXEL_OUT_OF_REACH == 0;
        let active = (0..self.packed.pixels.len() as u32).filter(within_reach);
        let mode = self.scene.settings.composite;
        let mut sum = Scrambles::new(&self.film, mode, active.collect());
        let mut complete = 0;
        if !self.nothing_to_trace() {
            for number in 0..count {
                if !self.scramble(first + number, run.cancelled)? {
                    break;
                }
                sum.add(&self.film);
                complete += 1;
                run.report(self.rays);
            }
        }
        self.replay_late_edges(&mut sum, first, complete)?;
        Ok((sum, complete))
    }

    /// One whole render with random numbers of its own, left in `self.film`; false if it was cancelled.
    fn scramble(
        &mut self,
        number: u32,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool, RenderError> {
        let seed = hash_combine(self.scene.settings.seed ^ SEED_SALT, number);
        self.packed.frame.seed = seed;
        self.set_frame();
        self.film.clear();
        let cancel = Cancel::new(cancelled, None);
        self.run_pass(Pass::Main { end: 1 }, &cancel)?;
        if cancel.is_cancelled() {
            return Ok(false);
        }
        self.replay_real()?;
        Ok(true)
    }

    /// Pixels that turned out to be edges after a scramble in which they were not lack that scramble's real radiance. They are few: all their
    /// scrambles are rendered again, with it.
    fn replay_late_edges(
        &mut self,
        sum: &mut Scrambles,
        first: u32,
        count: u32,
    ) -> Result<(), RenderError> {
        let pixels = 0..sum.film().pixels.len();
        let late: Vec<usize> = pixels.filter(|&i| sum.film().needs_real(i)).collect();
        if late.is_empty() {
            return Ok(());
        }
        let before: Vec<u32> = self.packed.pixels.iter().map(|info| info.flags).collect();
        for info in &mut self.packed.pixels {
            info.flags |= PIXEL_OUT_OF_REACH;
            info.flags &= !PIXEL_EDGE;
        }
        for &pixel in &late {
            self.packed.pixels[pixel].flags = before[pixel] | PIXEL_EDGE;
            sum.clear_pixel(pixel);
        }
        for number in first..first + count {
            self.scramble(number, &|| false)?;
            sum.add(&self.film);
        }
        for (info, flags) in self.packed.pixels.iter_mut().zip(before) {
            info.flags = flags | (info.flags & PIXEL_EDGE);
        }
        Ok(())
    }

    /// What a trial tells of each tile.
    fn trial(
        &self,
        tiles: &Tiles,
        gains: &[f64],
        trial: &Scrambles,
        goal: &ErrorGoal,
    ) -> Vec<Trial> {
        let needs = self.over_goal(tiles, trial, goal);
        let each = needs.into_iter().zip(gains);
        each.map(|(over, &gain)| Trial {
            gain,
            need: over * stated_share(SCRAMBLES),
        })
        .collect()
    }

    /// Variance of one scramble over the variance allowed, mean over each tile's pixels and channels.
    fn over_goal(&self, tiles: &Tiles, scrambles: &Scrambles, goal: &ErrorGoal) -> Vec<f64> {
        let photo = self.scene.photo.as_ref();
        let picture = composite(scrambles.film(), photo, self.scene.settings.composite);
        let ratios: Vec<(usize, f64)> = scrambles
            .variances_of_one(photo)
            .map(|(pixel, variance)| {
                let allowed = goal.allowed_variance(picture.linear[pixel]);
                (pixel, (variance / allowed).element_sum() / 3.0)
            })
            .collect();
        tiles.means(&ratios)
    }

    /// Makes the scrambles' sum the film.
    fn state(&mut self, goal: &ErrorGoal, scrambles: Scrambles, count: u32) {
        let tiles = Tiles::of(self.film.width as usize, self.film.height as usize);
        let over = self.over_goal(&tiles, &scrambles, goal);
        let reached = tiles.reached(&self.packed.pixels);
        let is_above =
            |&(tile, over): &(usize, &f64)| reached[tile] && *over * stated_share(count) > 1.0;
        let film = scrambles.film();
        self.stated = Some(Stated {
            scrambles: count,
            variance: scrambles.stated_variances(self.scene.photo.as_ref()),
            mean_rays_per_pixel: mean_rays(film, &self.packed.pixels),
            tiles: reached.iter().filter(|&&r| r).count(),
            tiles_above_goal: over.iter().enumerate().filter(is_above).count(),
        });
        self.film = scrambles.into_film();
    }

    /// The error that the scrambles of [`Renderer::render_to_error`] state; `None` for a render by rays per pixel.
    pub fn stated(&self) -> Option<&Stated> {
        self.stated.as_ref()
    }
}

/// What a render to an error is told, and where it stands.
struct Run<'a> {
    goal: &'a ErrorGoal,
    cancelled: &'a (dyn Fn() -> bool + Sync),
    progress: &'a mut dyn FnMut(Progress),
    start: Instant,
    done: u32,
}

impl Run<'_> {
    /// Scrambles of both trials and the picture.
    const TOTAL: u32 = 2 * TRIAL_SCRAMBLES + SCRAMBLES;

    fn report(&mut self, rays: super::RayTotals) {
        self.done += 1;
        (self.progress)(Progress {
            samples: self.done,
            samples_total: Self::TOTAL,
            rays,
            elapsed: self.start.elapsed(),
        });
    }
}

/// Samples of a pixel within reach, on average.
fn mean_rays(film: &Film, pixels: &[PixelInfo]) -> f64 {
    let (mut samples, mut reached) = (0, 0);
    for (sums, info) in film.pixels.iter().zip(pixels) {
        if info.flags & PIXEL_OUT_OF_REACH == 0 {
            samples += u64::from(sums.n);
            reached += 1;
        }
    }
    samples as f64 / f64::from(reached.max(1))
}

/// A pixel's plan with `gain` times the evaluations, at most `most` samples a scramble.
fn scale(plan: PixelInfo, gain: f64, most: u32) -> PixelInfo {
    let factor = f64::from(plan.sample_factor);
    let rate = factor / f64::from(plan.difference_period.max(1)) * gain;
    let samples = (factor * gain).ceil().clamp(1.0, f64::from(most));
    let period = samples / rate.max(1.0 / LONGEST_PERIOD);
    PixelInfo {
        sample_factor: samples as u32,
        difference_period: period.round().max(1.0) as u32,
        flags: plan.flags,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_multiplies_samples_and_keeps_a_chance() {
        let plan = |sample_factor, difference_period| PixelInfo {
            difference_period,
            sample_factor,
            flags: 1,
        };
        assert_eq!(scale(plan(3, 6), 1.0, 99), plan(3, 6));
        assert_eq!(scale(plan(3, 6), 5.0, 99), plan(15, 6));
        assert_eq!(scale(plan(1, 1), 0.25, 99), plan(1, 4));
        assert_eq!(scale(plan(1, 16), 0.1, 99), plan(1, 4), "never seldomer");
        assert_eq!(scale(plan(4, 1), 100.0, 64).sample_factor, 64);
    }
}
