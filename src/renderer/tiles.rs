//! The tiles of an adaptive render, and how many samples each needs.

use crate::packed::{PIXEL_OUT_OF_REACH, PixelInfo};

/// Pixels along a tile's side.
const SIDE: usize = 16;
/// The squared error falls at least as the samples, and for the best of stratified integrands as their square.
const LEAST_EXPONENT: f64 = 1.0;
const GREATEST_EXPONENT: f64 = 2.0;
/// Room for what a trial of a few scrambles underrates.
pub const MARGIN: f64 = 1.1;

/// Squares of [`SIDE`] pixels that cover the picture.
#[derive(Clone)]
pub struct Tiles {
    width: usize,
    height: usize,
    across: usize,
}

impl Tiles {
    pub fn of(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            across: width.div_ceil(SIDE),
        }
    }

    pub fn count(&self) -> usize {
        self.across * self.height.div_ceil(SIDE)
    }

    pub fn of_pixel(&self, pixel: usize) -> usize {
        let (x, y) = (pixel % self.width, pixel / self.width);
        y / SIDE * self.across + x / SIDE
    }

    /// Mean of the values over all pixels of each tile; a pixel without one counts as 0.
    pub fn means(&self, values: &[(usize, f64)]) -> Vec<f64> {
        let mut sums = vec![0.0; self.count()];
        for &(pixel, value) in values {
            sums[self.of_pixel(pixel)] += value;
        }
        let pixels = self.pixels();
        sums.iter().zip(pixels).map(|(sum, n)| sum / n).collect()
    }

    /// [`Tiles::means`], each raised by its own standard error: a tile whose mean hangs on a few pixels may well have a higher one.
    pub fn cautious_means(&self, values: &[(usize, f64)]) -> Vec<f64> {
        let means = self.means(values);
        let squared: Vec<_> = values
            .iter()
            .map(|&(p, value)| (p, value * value))
            .collect();
        let squares = self.means(&squared);
        let each = means.iter().zip(squares).zip(self.pixels());
        each.map(|((mean, square), n)| mean + ((square - mean * mean).max(0.0) / n).sqrt())
            .collect()
    }

    /// Pixels of each tile: those at the right and lower border may have fewer.
    fn pixels(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.count()).map(|tile| {
            let side = |at: usize, length: usize| (length - at * SIDE).min(SIDE);
            let wide = side(tile % self.across, self.width);
            (wide * side(tile / self.across, self.height)) as f64
        })
    }

    /// The most samples that a pixel of each tile takes in one pass.
    pub fn greatest_factors(&self, pixels: &[PixelInfo]) -> Vec<u32> {
        let mut greatest = vec![0; self.count()];
        for (pixel, info) in pixels.iter().enumerate() {
            let greatest: &mut u32 = &mut greatest[self.of_pixel(pixel)];
            *greatest = info.sample_factor.max(*greatest);
        }
        greatest
    }

    /// The tiles that have a pixel within reach of something virtual.
    pub fn reached(&self, pixels: &[PixelInfo]) -> Vec<bool> {
        let mut reached = vec![false; self.count()];
        for (pixel, info) in pixels.iter().enumerate() {
            if info.flags & PIXEL_OUT_OF_REACH == 0 {
                reached[self.of_pixel(pixel)] = true;
            }
        }
        reached
    }
}

/// What a trial found in a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Samples a pixel took, as a multiple of its plan.
    pub gain: f64,
    /// Squared error over the squared error allowed, had the picture's scrambles been like the trial's.
    pub need: f64,
}

/// The multiple of the plan at which the need is 1. From one trial alone the squared error is taken to fall as the samples; two tell how it does.
pub fn gain_for(first: Trial, second: Option<Trial>) -> f64 {
    let (from, exponent) = match second {
        Some(second) if second.gain > first.gain && second.need > 0.0 => {
            let fall = (first.need / second.need).ln() / (second.gain / first.gain).ln();
            (second, fall.clamp(LEAST_EXPONENT, GREATEST_EXPONENT))
        }
        _ => (first, LEAST_EXPONENT),
    };
    from.gain * (MARGIN * from.need).powf(1.0 / exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_over_whole_tiles() {
        let tiles = Tiles::of(40, 20);
        assert_eq!(tiles.count(), 6);
        // All of the last tile's 8 x 4 pixels, and one pixel of the first's 256.
        let mut values: Vec<(usize, f64)> = (0..800)
            .filter(|&pixel| tiles.of_pixel(pixel) == 5)
            .map(|pixel| (pixel, 3.0))
            .collect();
        assert_eq!(values.len(), 32);
        values.push((0, 256.0));
        let means = tiles.means(&values);
        assert_eq!((means[0], means[1], means[5]), (1.0, 0.0, 3.0));
        // One pixel of 256 carries the first tile's mean: variance 255 of a value, about 1 of the mean.
        let cautious = tiles.cautious_means(&values);
        assert!((cautious[0] - 1.0 - f64::sqrt(255.0 / 256.0)).abs() < 1e-12);
        assert_eq!((cautious[1], cautious[5]), (0.0, 3.0));
    }

    /// The squared error is c / samples^k: the gain found brings it to the goal, less the margin.
    #[test]
    fn the_gain_meets_the_goal_of_a_power_law() {
        for k in [1.0, 1.5, 2.0] {
            let law = |gain: f64| 40.0 / gain.powf(k);
            let trial = |gain| Trial {
                gain,
                need: law(gain),
            };
            let gain = gain_for(trial(1.0), Some(trial(4.0)));
            assert!((law(gain) * MARGIN - 1.0).abs() < 1e-9, "{k} {gain}");
            let blind = law(gain_for(trial(1.0), None));
            assert!(
                k == 1.0 || blind < 0.3,
                "control: one trial overshoots, {blind}"
            );
        }
    }
}
