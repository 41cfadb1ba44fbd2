//! Rendering to an error instead of a number of rays.
//!
//! The picture is the mean of [`SCRAMBLES`] or more independent renders (scrambles), whose spread states its standard error. A pilot of a few
//! more scrambles, which are not part of the picture, decides how many samples each tile's pixels take in each of them. A tile that the pilot
//! underrated takes further scrambles of the same kind. Every sample that is taken counts, whatever it brings.

mod series;

use std::rc::Rc;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::core::{Core, is_within_reach};
use super::stopwatch::Stopwatch;
use super::tiles::{MARGIN, Tiles, Trial, gain_for};
use super::{Driver, ErrorGoal, RenderError, Renderer, Skip};
use crate::film::{Film, Scrambles, composite, pooled};
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_SHARES_NEAR, PixelInfo};
use crate::work::Watcher;

use series::Series;

/// Independent scrambles that make the picture, at the least.
pub const SCRAMBLES: u32 = 16;
/// Scrambles of each of the pilot's two trials.
const TRIAL_SCRAMBLES: u32 = 4;
/// The second trial takes this share of the samples that the first calls for: it tells how fast the error really falls.
const SECOND_TRIAL_SHARE: f64 = 0.25;
/// A difference is evaluated at one sample in this many at the least: each pixel is expected to see it eight times.
const LONGEST_PERIOD: f64 = 2.0;
/// Least gain of pixels whose rays cannot meet anything virtual: they take one sample a scramble anyway. Others keep what the plan gives them:
/// a trial may miss what is rare and bright, such as the sun in a mirror.
const LEAST_GAIN: f64 = 1.0 / 16.0;
/// A tile above the goal takes this many times its scrambles at the most before it is looked at again.
const MOST_AT_ONCE: u32 = 4;
/// Numbers of the pilot's scrambles.
const FIRST_TRIAL: u32 = 1 << 30;
const SECOND_TRIAL: u32 = 2 << 30;

/// How good a picture is, from its scrambles.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// Independent scrambles that the error is taken from at the least; fewer than [`SCRAMBLES`] if the render was ended early.
    pub scrambles: u32,
    /// Variance of the composite by pixel and channel, linear; 0 where no two scrambles differ, here and in like pixels.
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
    /// Renders the film anew until every tile's stated error is as low as the goal, or its pixels have taken as many rays as the goal allows. The
    /// film is then complete: [`Renderer::advance`] adds nothing to it. The watcher hears of scrambles, the pilot's included.
    ///
    /// Ended by the watcher, it keeps the scrambles that are complete.
    ///
    /// # Errors
    /// As [`Renderer::advance`].
    pub fn render_to_error(
        &mut self,
        goal: &ErrorGoal,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        if matches!(self.driver, Driver::Moving(_)) {
            return Err(RenderError::MovingGoal);
        }
        if self.stated.is_some() {
            self.look_ahead(watcher);
        }
        if !self.plan(watcher)? {
            return Ok(());
        }
        let stopwatch = Stopwatch::start();
        let core = &mut self.core;
        let frame = core.packed.frame;
        core.packed.frame.rays_total = 1;
        core.film.first_sample = 0;
        // The groups are whole scrambles.
        let grouped = !core.film.groups.is_empty();
        core.film.set_groups(false);
        let mut driver = ToError {
            tiles: Tiles::of(core.film.width as usize, core.film.height as usize),
            goal: goal.without(core.options.without),
            watcher: *watcher,
            begin: stopwatch.begin,
            grouped,
            done: 0,
            expected: 2 * TRIAL_SCRAMBLES + SCRAMBLES,
            planned: (
                core.packed.photons_per_ray,
                evaluations(&core.packed.pixels),
            ),
            core,
        };
        let outcome = driver.pilot_and_picture();
        driver.core.packed.frame = frame;
        driver.core.backend.set_frame(&driver.core.packed);
        if !watcher.is_cancelled() {
            // No more are wanted, though more may have been expected.
            driver.expected = driver.done;
            watcher.hear(&driver.progress());
        }
        self.stated = Some(driver.state(outcome?));
        self.core.count_render(&stopwatch);
        Ok(())
    }

    /// The error that the scrambles of [`Renderer::render_to_error`] state; `None` for a render by rays per pixel.
    pub fn stated(&self) -> Option<&Stated> {
        self.stated.as_ref()
    }
}

/// The driver of a render to an error.
pub(super) struct ToError<'a> {
    pub core: &'a mut Core,
    pub tiles: Tiles,
    /// The sum of scrambles has groups.
    pub grouped: bool,
    pub watcher: Watcher<'a>,
    pub begin: Instant,
    /// Scrambles completed and expected.
    pub done: u32,
    pub expected: u32,
    goal: ErrorGoal,
    /// Photons for every ray per pixel of the pilot's plan, and that plan's evaluations, all pixels together.
    planned: (u64, f64),
}

impl ToError<'_> {
    /// The picture's scrambles, or the pilot's where it was ended before the first of them.
    fn pilot_and_picture(&mut self) -> Result<Series, RenderError> {
        let plan = self.core.packed.pixels.clone();
        let tiles = self.tiles.clone();
        let most = (self.goal.max_rays_per_pixel / SCRAMBLES).max(1);
        let scaled = |gains: &[f64]| -> Vec<PixelInfo> {
            let each = plan.par_iter().enumerate();
            each.map(|(pixel, &info)| scale(info, gains[tiles.of_pixel(pixel)], most))
                .collect()
        };
        let all: Rc<[bool]> = vec![true; tiles.count()].into();
        if self.goal.takes_all_rays() {
            self.expected = SCRAMBLES;
            self.plan(scaled(&vec![f64::from(most); tiles.count()]))?;
            return self.series(0, SCRAMBLES, &all);
        }

        let even = vec![1.0; tiles.count()];
        self.plan(scaled(&even))?;
        let first = self.series(FIRST_TRIAL, TRIAL_SCRAMBLES, &all)?;
        if first.count() < TRIAL_SCRAMBLES {
            return Ok(first);
        }
        let first_trial = self.trial(&even, &first.sum);
        let second_trial = self.second_trial(&first_trial, &scaled)?;
        let mut gains: Vec<f64> = first_trial
            .iter()
            .zip(second_trial)
            .map(|(&first, second)| gain_for(first, second).max(LEAST_GAIN))
            .collect();
        if self.core.options.without.contains(Skip::Adaptive) {
            let greatest = gains.iter().copied().fold(LEAST_GAIN, f64::max);
            gains.fill(greatest);
        }

        self.plan(scaled(&gains))?;
        let mut series = self.series(0, SCRAMBLES, &all)?;
        if series.count() == 0 {
            return Ok(first);
        }
        if series.count() == SCRAMBLES {
            self.mend(&mut series)?;
        }
        Ok(series)
    }

    /// Tries those tiles again that need much more than the first trial took.
    fn second_trial(
        &mut self,
        first: &[Trial],
        scaled: &dyn Fn(&[f64]) -> Vec<PixelInfo>,
    ) -> Result<Vec<Option<Trial>>, RenderError> {
        let wanted = |trial: &Trial| (trial.need * trial.gain * SECOND_TRIAL_SHARE).round();
        let taking_part: Rc<[bool]> = first.iter().map(|trial| wanted(trial) >= 2.0).collect();
        if !taking_part.contains(&true) {
            return Ok(vec![None; self.tiles.count()]);
        }
        let gains: Vec<f64> = first.iter().map(|trial| wanted(trial).max(1.0)).collect();
        self.plan(scaled(&gains))?;
        let second = self.series(SECOND_TRIAL, TRIAL_SCRAMBLES, &taking_part)?;
        if second.count() < TRIAL_SCRAMBLES {
            return Ok(vec![None; self.tiles.count()]);
        }
        let measured = self.trial(&gains, &second.sum);
        let each = measured.into_iter().zip(taking_part.iter());
        Ok(each.map(|(trial, &took)| took.then_some(trial)).collect())
    }

    /// Further scrambles for the tiles that stay above the goal, as far as their pixels may take rays.
    fn mend(&mut self, series: &mut Series) -> Result<(), RenderError> {
        let mut number = SCRAMBLES;
        let mut counts = vec![SCRAMBLES; self.tiles.count()];
        let most: Vec<u32> = (self.tiles)
            .greatest_factors(&self.core.packed.pixels)
            .into_iter()
            .map(|factor| self.goal.max_rays_per_pixel / factor.max(1))
            .collect();
        loop {
            let over = self.over_goal(&series.sum);
            let more: Vec<u32> = (0..self.tiles.count())
                .map(|tile| {
                    if over[tile] <= 1.0 {
                        return 0;
                    }
                    let count = counts[tile];
                    let wanted = (f64::from(count) * MARGIN * over[tile]).ceil() as u32;
                    // What is above the goal by far may hang on a few bright samples.
                    wanted
                        .min(MOST_AT_ONCE * count)
                        .min(most[tile])
                        .saturating_sub(count)
                })
                .collect();
            let longest = more.iter().copied().max().unwrap_or(0);
            self.expected += longest;
            let numbers = (0..longest).map(|i| {
                let taking_part: Rc<[bool]> = more.iter().map(|&more| i < more).collect();
                (number + i, taking_part)
            });
            if longest == 0 || !self.extend(series, numbers)? {
                return Ok(());
            }
            number += longest;
            for (count, more) in counts.iter_mut().zip(more) {
                *count += more;
            }
        }
    }

    /// What a trial tells of each tile.
    fn trial(&self, gains: &[f64], trial: &Scrambles) -> Vec<Trial> {
        let own = trial.own_variances(self.core.scene.photo.as_ref());
        let ratios = self.ratios(trial, &own);
        let each = self.tiles.cautious_means(&ratios).into_iter().zip(gains);
        each.map(|(over, &gain)| Trial {
            gain,
            need: over / f64::from(SCRAMBLES),
        })
        .collect()
    }

    /// Variance over the variance allowed, mean over the channels, by pixel.
    fn ratios(&self, scrambles: &Scrambles, variances: &[Option<DVec3>]) -> Vec<(usize, f64)> {
        let photo = self.core.scene.photo.as_ref();
        let picture = composite(scrambles.film(), photo, self.core.scene.settings.composite);
        (variances.iter().enumerate())
            .filter_map(|(pixel, variance)| {
                let allowed = self.goal.allowed_variance(picture.linear[pixel]);
                Some((pixel, ((*variance)? / allowed).element_sum() / 3.0))
            })
            .collect()
    }

    /// Stated variance over the variance allowed, mean over each tile's pixels and channels.
    fn over_goal(&self, scrambles: &Scrambles) -> Vec<f64> {
        let stated = self.stated_variances(scrambles);
        self.tiles.means(&self.ratios(scrambles, &stated))
    }

    /// Variance of the mean of the scrambles that is stated for each pixel: the pixel's own, pooled with that of other pixels whose rays may meet
    /// something virtual, or of others whose rays may not. This is known before the first sample, as it must be: pixels that are alike by
    /// what was found, say those in which no ray has met anything virtual, have less variance by what was found than in truth.
    fn stated_variances(&self, scrambles: &Scrambles) -> Vec<Option<DVec3>> {
        let mut own = scrambles.own_variances(self.core.scene.photo.as_ref());
        for (pixel, own) in own.iter_mut().enumerate() {
            if let Some(own) = own {
                *own /= f64::from(scrambles.count(pixel));
            }
        }
        let meets = |info: &PixelInfo| u8::from(info.flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0);
        let classes: Vec<u8> = self.core.packed.pixels.iter().map(meets).collect();
        let stated = pooled(self.core.film.width as usize, &own, &classes).into_iter();
        stated
            .zip(own)
            .map(|(stated, own)| own.map(|_| stated))
            .collect()
    }

    /// Makes the scrambles' sum the film, and states its error.
    fn state(self, series: Series) -> Stated {
        let over = self.over_goal(&series.sum);
        let variances = self.stated_variances(&series.sum);
        let pixels = &self.core.packed.pixels;
        let stated = Stated {
            scrambles: series.count().min(SCRAMBLES),
            variance: variances
                .iter()
                .map(|v| v.unwrap_or_default().as_vec3().to_array())
                .collect(),
            mean_rays_per_pixel: mean_rays(series.sum.film(), pixels),
            tiles: self.tiles.reached(pixels).iter().filter(|&&r| r).count(),
            tiles_above_goal: over.iter().filter(|over| **over > 1.0).count(),
        };
        self.core.film = series.sum.into_film();
        self.core.film_is_new = false;
        stated
    }
}

/// Evaluations for every ray per pixel, all pixels together.
fn evaluations(infos: &[PixelInfo]) -> f64 {
    let reached = infos.iter().filter(|info| is_within_reach(info));
    reached
        .map(|info| f64::from(info.sample_factor) / f64::from(info.difference_period))
        .sum()
}

/// Samples of a pixel within reach, on average.
fn mean_rays(film: &Film, pixels: &[PixelInfo]) -> f64 {
    let (mut samples, mut reached) = (0, 0);
    for (sums, info) in film.pixels.iter().zip(pixels) {
        if is_within_reach(info) {
            samples += u64::from(sums.n);
            reached += 1;
        }
    }
    samples as f64 / f64::from(reached.max(1))
}

/// A pixel's plan with `gain` times the evaluations, at most `most` samples a scramble.
fn scale(plan: PixelInfo, gain: f64, most: u32) -> PixelInfo {
    let near = PIXEL_BEAM_MAY_MEET_VIRTUAL | PIXEL_SHARES_NEAR;
    let gain = if plan.flags & near != 0 {
        gain.max(1.0)
    } else {
        gain
    };
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
            flags: 0,
        };
        assert_eq!(scale(plan(3, 6), 1.0, 99), plan(3, 6));
        assert_eq!(scale(plan(3, 6), 5.0, 99), plan(15, 6));
        assert_eq!(scale(plan(1, 1), 0.5, 99), plan(1, 2));
        assert_eq!(scale(plan(1, 16), 0.1, 99), plan(1, 2), "never seldomer");
        assert_eq!(scale(plan(4, 1), 100.0, 64).sample_factor, 64);
        let near = PixelInfo {
            flags: PIXEL_BEAM_MAY_MEET_VIRTUAL,
            ..plan(3, 2)
        };
        assert_eq!(scale(near, 0.1, 64), near);
    }
}
