//! Where work lowers the error most: how often each block's samples are taken and their differences evaluated.
//!
//! A sample of squared error e that costs c and is taken m times a ray per pixel (m below 1: in turns) leaves the error e / m for the cost m c. For
//! a given total error the total cost is least where m is proportional to the root of e / c (Neyman 1934, with costs).

use std::ops::Add;

use super::blocks::Blocks;
use super::measurement::{BlockMoments, Moments};
use crate::cpu::photons::plan::Effort;
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PixelInfo};

/// Squared error aimed at, relative to that of one sample a ray everywhere.
const ERROR_SHARE: f32 = 0.6;
/// A difference is evaluated at one ray in this many at the least; a pixel takes this many samples a ray at the most.
const LONGEST_PERIOD: f32 = 8.0;
const LARGEST_FACTOR: f32 = 16.0;
/// Blocks to either side whose samples make one estimate, and those that an estimate leans on, with the weight of this many pixels.
const NEAR_BLOCKS: usize = 1;
const WIDE_BLOCKS: usize = 5;
const WIDE_WEIGHT: f32 = 8.0;
/// Standard error that a real pixel shall have at the most, linear: about five codes of a mid grey. For that it takes this many samples a ray at the most.
const VISIBLE_ERROR: f32 = 0.02;
const LARGEST_VISIBLE_FACTOR: f32 = 32.0;
/// What geometry tells is believed this far: at least this times the importance is evaluated.
const IMPORTANCE_SHARE: f32 = 0.25;

/// Samples for each ray per pixel in a block, 1 being one a ray: of differences, and of pixels that virtual geometry may cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    pub difference: f32,
    pub mixed: f32,
}

impl Rates {
    /// Without measurements: the importance alone decides.
    pub fn from_importance(importance: f32) -> Self {
        Self {
            difference: importance.clamp(1.0 / LONGEST_PERIOD, 1.0),
            mixed: 1.0,
        }
    }

    /// Of several blocks together; at least one.
    pub fn mean(blocks: impl Iterator<Item = Self>) -> Self {
        let (mut sum, mut count) = ((0.0, 0.0), 0.0);
        for rates in blocks {
            sum = (sum.0 + rates.difference, sum.1 + rates.mixed);
            count += 1.0;
        }
        Self {
            difference: sum.0 / count,
            mixed: sum.1 / count,
        }
    }

    /// The plan of a pixel.
    pub fn pixel(self, flags: u32) -> PixelInfo {
        let mut factor = self.difference;
        if flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0 {
            factor = factor.max(self.mixed);
        }
        let factor = factor.round().max(1.0);
        PixelInfo {
            difference_period: (factor / self.difference).round().max(1.0) as u32,
            sample_factor: factor as u32,
            flags,
        }
    }
}

/// What is known of a block once its neighbours have been asked.
struct Expected {
    /// Share of the block's samples that meet virtual geometry, and of its pixels whose beams may.
    mixed_share: f32,
    near_share: f32,
    difference: Moments,
    mixed: Moments,
    /// Squared error of a sample's light by way of smooth virtual surfaces.
    highlight: f32,
    least_difference_rate: f32,
}

impl Expected {
    fn rates(&self, gain: f32) -> Rates {
        let rate = |m: &Moments| gain * (m.error / m.cost).sqrt();
        Rates {
            difference: rate(&self.difference).clamp(self.least_difference_rate, LARGEST_FACTOR),
            mixed: rate(&self.mixed).clamp(1.0, LARGEST_FACTOR),
        }
    }

    /// Speckles show over a photograph: where the error of the difference after that many rays would, it is evaluated more often, `share` of what would
    /// end that.
    fn with_visible(&self, rates: Rates, rays: f32, share: f32) -> Rates {
        let rate = share * self.difference.error / (rays * VISIBLE_ERROR * VISIBLE_ERROR);
        Rates {
            difference: rates.difference.max(rate.min(LARGEST_VISIBLE_FACTOR)),
            ..rates
        }
    }

    fn samples(&self, rates: Rates) -> f32 {
        let near = rates.difference.max(rates.mixed);
        (1.0 - self.near_share) * rates.difference + self.near_share * near
    }

    /// Small lamps that are seen in smooth objects raise the rate where they are, and lower it nowhere: they take few pixels. `even` is the gain that
    /// takes one sample a ray, all in all.
    fn with_highlight(&self, rates: Rates, even: f32) -> Rates {
        let rate = even * ((self.mixed.error + self.highlight) / self.mixed.cost).sqrt();
        match self.highlight > 0.0 {
            true => Rates {
                mixed: rates.mixed.max(rate.min(LARGEST_FACTOR)),
                ..rates
            },
            false => rates,
        }
    }

    /// Error and cost of a pixel for every ray per pixel.
    fn of_a_ray(&self, rates: Rates) -> (f32, f32) {
        let (d, m) = (&self.difference, &self.mixed);
        (
            self.mean(d.error / rates.difference, m.error / rates.mixed),
            self.mean(d.cost * rates.difference, m.cost * rates.mixed),
        )
    }

    fn mean(&self, difference: f32, mixed: f32) -> f32 {
        (1.0 - self.mixed_share) * difference + self.mixed_share * mixed
    }
}

/// The rates of each block for `rays` per pixel: the wanted error at least cost, and no error of a difference that shows, but not more samples in all than
/// one a ray, highlights apart. With them, what a ray per pixel then does.
pub fn allocate(
    blocks: &Blocks,
    measured: &[BlockMoments],
    importance: &[f32],
    highlights: &[f32],
    rays: u32,
) -> (Vec<Rates>, Effort) {
    let difference: Vec<Moments> = measured.iter().map(|m| m.difference).collect();
    let mixed: Vec<Moments> = measured.iter().map(|m| m.mixed).collect();
    let difference = smooth(blocks, &difference);
    let mixed = smooth(blocks, &mixed);
    let expected: Vec<Expected> = measured
        .iter()
        .zip(difference.into_iter().zip(mixed))
        .zip(importance.iter().zip(highlights))
        .map(
            |((m, (difference, mixed)), (importance, &highlight))| Expected {
                mixed_share: m.mixed.pixels / (m.mixed.pixels + m.difference.pixels).max(1.0),
                near_share: m.near_share,
                difference,
                mixed,
                highlight,
                least_difference_rate: (IMPORTANCE_SHARE * importance)
                    .clamp(1.0 / LONGEST_PERIOD, 1.0),
            },
        )
        .collect();
    let error_of_one: f32 = expected
        .iter()
        .map(|e| e.mean(e.difference.error, e.mixed.error))
        .sum();
    let is_enough = |gain: f32| {
        let mut error = 0.0;
        let mut samples = 0.0;
        for e in &expected {
            let rates = e.rates(gain);
            error += e.of_a_ray(rates).0;
            samples += e.samples(rates);
        }
        error <= ERROR_SHARE * error_of_one || samples >= expected.len() as f32
    };
    let gain = least(1e-6, 1e9, is_enough);
    let root = |e: &Expected| {
        let error = e.mean(e.difference.error, e.mixed.error);
        (error / e.mean(e.difference.cost, e.mixed.cost)).sqrt()
    };
    let roots: f32 = expected.iter().map(root).sum();
    let even = gain.max(expected.len() as f32 / roots.max(f32::MIN_POSITIVE));
    let visible = |e: &Expected, share| e.with_visible(e.rates(gain), rays as f32, share);
    let too_many = |share| {
        let samples: f32 = expected.iter().map(|e| e.samples(visible(e, share))).sum();
        samples >= expected.len() as f32
    };
    let share = if too_many(1.0) {
        least(1e-6, 1.0, too_many)
    } else {
        1.0
    };
    let rates: Vec<Rates> = (expected.iter())
        .map(|e| e.with_highlight(visible(e, share), even))
        .collect();
    let mut eye = Effort::default();
    for (block, (e, &rates)) in expected.iter().zip(&rates).enumerate() {
        let (error, cost) = e.of_a_ray(rates);
        let pixels = blocks.pixels(block).count() as f64;
        eye.error += pixels * f64::from(error);
        eye.cost += pixels * f64::from(cost);
    }
    (rates, eye)
}

/// Smallest number between two that is enough, within a thousandth: rates and their effect rise with it.
fn least(low: f32, high: f32, is_enough: impl Fn(f32) -> bool) -> f32 {
    let (mut low, mut high) = (low, high);
    while high > low * 1.001 {
        let middle = (low * high).sqrt();
        if is_enough(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Means over each block's neighbourhood; where nothing was sampled, no error at a cost of 1.
fn smooth(blocks: &Blocks, moments: &[Moments]) -> Vec<Moments> {
    let sum =
        |block, radius| blocks.gather(moments, block, radius, Moments::default(), Moments::add);
    (0..blocks.count())
        .map(|block| {
            let near = sum(block, NEAR_BLOCKS);
            let wide = sum(block, WIDE_BLOCKS);
            if wide.pixels == 0.0 {
                return Moments {
                    pixels: 0.0,
                    error: 0.0,
                    cost: 1.0,
                };
            }
            let lean = WIDE_WEIGHT / wide.pixels;
            let weight = 1.0 / (near.pixels + WIDE_WEIGHT);
            let mean = |near: f32, wide: f32| (near + lean * wide) * weight;
            Moments {
                pixels: 1.0,
                error: mean(near.error, wide.error),
                cost: mean(near.cost, wide.cost),
            }
        })
        .collect()
}
