//! Correlation of the noise over space and between channels, from differences of consecutive frames.

use rayon::prelude::*;

use super::quantisation::variance_before_rounding;
use crate::stages::settings::{Autocorrelation, LAGS, WHITE};

/// Pixels of all frame pairs that are looked at: more would only cost time.
const ENOUGH_PIXELS: usize = 48_000_000;
/// Products of at least this many pairs make an estimate.
const FEWEST: f64 = 200.0;

const COLUMNS: usize = 2 * LAGS + 1;
const ROWS: usize = LAGS + 1;

/// Sum of products and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn value(self) -> f64 {
        self.sum / self.count.max(1.0)
    }
}

#[derive(Clone, Debug, Default)]
struct Sums {
    lags: [[[Mean; COLUMNS]; ROWS]; 3],
    /// Red-green, red-blue, green-blue.
    channels: [Mean; 3],
}

/// Sums over the frame pairs of all scenes.
#[derive(Clone, Debug, Default)]
pub(super) struct Correlations {
    sums: Sums,
    /// Sum of quantum^2 times pixels, and pixels.
    quantum: Mean,
}

const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

impl Correlations {
    /// Whether pair number `pair` of `pairs` is among those looked at.
    pub fn wants(pair: usize, pairs: usize, pixels: usize) -> bool {
        let enough = (ENOUGH_PIXELS / pixels.max(1)).clamp(1, pairs);
        // Evenly spread over the sequence.
        pair * enough / pairs != (pair + 1) * enough / pairs
    }

    /// Adds the differences of two frames; `clipped` values are left out.
    pub fn add(
        &mut self,
        differences: &[[f32; 3]],
        clipped: &[[bool; 3]],
        width: usize,
        quantum: f64,
    ) {
        let height = differences.len() / width;
        // A clipped value is 0 with weight 0.
        let plane = |c: usize| -> (Vec<f32>, Vec<f32>) {
            differences
                .iter()
                .zip(clipped)
                .map(|(d, clipped)| if clipped[c] { (0.0, 0.0) } else { (d[c], 1.0) })
                .unzip()
        };
        let planes = [plane(0), plane(1), plane(2)];
        let sums = (0..height)
            .into_par_iter()
            .fold(Sums::default, |mut sums, y| {
                add_row(&mut sums, &planes, width, height, y);
                sums
            })
            .reduce(Sums::default, |mut left, right| {
                left.add(&right);
                left
            });
        self.sums.add(&sums);
        self.quantum.sum += quantum * quantum * differences.len() as f64;
        self.quantum.count += differences.len() as f64;
    }

    fn variance(&self, channel: usize) -> f64 {
        // A difference of two frames has twice the variance.
        let measured = 0.5 * self.sums.lags[channel][0][LAGS].value();
        let quantum2 = self.quantum.value();
        quantum2 * variance_before_rounding(measured / quantum2.max(1e-12))
    }

    /// By channel, 1 at lag 0; white where there is no noise.
    pub fn autocorrelation(&self, channel: usize) -> Autocorrelation {
        let variance = self.variance(channel);
        let mut out = WHITE;
        if variance < 1e-6 {
            return out;
        }
        let lags = &self.sums.lags[channel];
        for (dy, row) in out.iter_mut().enumerate() {
            for (column, rho) in row.iter_mut().enumerate() {
                // The left half of the first row mirrors the right one.
                let from = if dy == 0 {
                    LAGS + column.abs_diff(LAGS)
                } else {
                    column
                };
                let mean = lags[dy][from];
                if (dy, from) != (0, LAGS) && mean.count >= FEWEST {
                    *rho = (0.5 * mean.value() / variance).clamp(-1.0, 1.0);
                }
            }
        }
        out
    }

    /// Red-green, red-blue, green-blue.
    pub fn channels(&self) -> [f64; 3] {
        let mut out = [0.0; 3];
        for ((out, (a, b)), mean) in out.iter_mut().zip(PAIRS).zip(self.sums.channels) {
            let scale = (self.variance(a) * self.variance(b)).sqrt();
            // The channels of a grey picture are one: its rounding is shared as well.
            if scale > 1e-6 && mean.count >= FEWEST {
                *out = (0.5 * mean.value() / scale).clamp(-1.0, 1.0);
            }
        }
        out
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        let add = |left: &mut Mean, right: &Mean| {
            left.sum += right.sum;
            left.count += right.count;
        };
        for (left, right) in self
            .lags
            .as_flattened_mut()
            .as_flattened_mut()
            .iter_mut()
            .zip(other.lags.as_flattened().as_flattened())
        {
            add(left, right);
        }
        for (left, right) in self.channels.iter_mut().zip(&other.channels) {
            add(left, right);
        }
    }
}

fn add_row(
    sums: &mut Sums,
    planes: &[(Vec<f32>, Vec<f32>); 3],
    width: usize,
    height: usize,
    y: usize,
) {
    let row = |plane: &[f32], y: usize| -> std::ops::Range<usize> {
        debug_assert!(plane.len() >= (y + 1) * width);
        y * width..(y + 1) * width
    };
    for ((values, weights), lags) in planes.iter().zip(&mut sums.lags) {
        let here = &values[row(values, y)];
        let here_weights = &weights[row(weights, y)];
        for (dy, lags) in lags.iter_mut().enumerate().take(height - y) {
            let there = &values[row(values, y + dy)];
            let there_weights = &weights[row(weights, y + dy)];
            for (column, mean) in lags.iter_mut().enumerate() {
                if dy == 0 && column < LAGS {
                    continue;
                }
                // here at x, there at x + column - LAGS
                let (skip_here, skip_there) = if column >= LAGS {
                    (0, column - LAGS)
                } else {
                    (LAGS - column, 0)
                };
                if skip_here.max(skip_there) >= width {
                    continue;
                }
                let length = width - skip_here.max(skip_there);
                let products = dot(&here[skip_here..][..length], &there[skip_there..][..length]);
                let count = dot(
                    &here_weights[skip_here..][..length],
                    &there_weights[skip_there..][..length],
                );
                mean.sum += products;
                mean.count += count;
            }
        }
    }
    for ((a, b), mean) in PAIRS.into_iter().zip(&mut sums.channels) {
        let range = row(&planes[0].0, y);
        mean.sum += dot(&planes[a].0[range.clone()], &planes[b].0[range.clone()]);
        mean.count += dot(&planes[a].1[range.clone()], &planes[b].1[range]);
    }
}

/// In eight partial sums, so that it becomes vector code.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (a, b) in a8.iter().zip(b8) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().map(|sum| f64::from(*sum)).sum::<f64>() + f64::from(rest)
}
