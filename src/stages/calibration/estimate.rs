//! From the scenes' moments to sigma by bin and channel, its confidence, and the fit against level.

use super::correlation::Correlations;
use super::moments::SceneMoments;
use super::quantisation::variance_before_rounding;
use super::{CalibrationError, HISTOGRAM_ENTRIES};
use crate::stages::settings::{Autocorrelation, NoiseBin, NoiseFit, NoiseProfile, bin_index};

/// Parts of the picture whose estimates are compared for the confidence interval.
const GROUPS: usize = 16;
/// 97.5% point of Student's t for 15 degrees of freedom.
const STUDENT_T: f64 = 2.131;
/// 97.5% point of the normal distribution.
const NORMAL_Z: f64 = 1.96;
/// A bin needs that many independent values.
const FEWEST_VALUES: f64 = 200.0;
/// Levels of the fit.
const LEVELS: usize = 256;
/// Pixels of a level, below which it does not count for the fit or for the limits of clipping.
const FEWEST_LEVEL_PIXELS: f64 = 50.0;
/// Values nearer to black or white than that many standard deviations may be clipped in other frames.
const CLIP_SIGMAS: f64 = 3.5;
/// A residual variance that exceeds the one of differences by this much shows drift.
const DRIFT: f64 = 1.01;

/// How a scene's sigma was taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimator {
    by_differences: bool,
    /// Standard deviation of what drifts within the picture, DN.
    drift_dn: f64,
}

impl Estimator {
    pub fn description(self) -> &'static str {
        if self.by_differences {
            "from differences of consecutive frames"
        } else {
            "from residuals against the average"
        }
    }

    pub fn note(self, scene: &str) -> Option<String> {
        self.by_differences.then(|| {
            format!(
                "{scene}: the light drifts by {:.2} DN RMS beside the noise; sigma is taken from differences of consecutive frames",
                self.drift_dn
            )
        })
    }
}

/// Weighted sums of one bin, channel and group.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    /// Pixels.
    pub pixels: f64,
    /// Sum over pixels of the variance, DN^2.
    pub variance: f64,
    /// Sum over pixels of (frames - 1): independent values.
    pub values: f64,
    /// Sum over pixels of quantum^2.
    pub quantum2: f64,
    /// Sum over pixels of frames.
    pub samples: u64,
}

impl Sum {
    pub(super) fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.variance += other.variance;
        self.values += other.values;
        self.quantum2 += other.quantum2;
        self.samples += other.samples;
    }

    /// DN^2, without the rounding's part.
    fn true_variance(&self) -> f64 {
        let quantum2 = (self.quantum2 / self.pixels).max(1e-12);
        quantum2 * variance_before_rounding(self.variance / self.pixels / quantum2)
    }
}

pub(super) struct Statistics {
    /// By bin, channel, group.
    bins: Vec<[[Sum; GROUPS]; 3]>,
    /// By channel, level of the channel itself.
    levels: [Vec<Sum>; 3],
    pub histograms: Vec<[Vec<u64>; 3]>,
    by_differences: bool,
}

impl Statistics {
    pub fn new(bins: usize) -> Self {
        Self {
            bins: vec![[[Sum::default(); GROUPS]; 3]; bins],
            levels: std::array::from_fn(|_| vec![Sum::default(); LEVELS]),
            histograms: vec![std::array::from_fn(|_| vec![0; HISTOGRAM_ENTRIES]); bins],
            by_differences: false,
        }
    }

    /// Takes up a scene; says how its sigma was estimated.
    pub fn add(&mut self, scene: &SceneMoments) -> Estimator {
        let estimator = choose_estimator(scene);
        self.by_differences |= estimator.by_differences;
        let limits = [0, 1, 2].map(|c| clip_limits(scene, c, estimator));
        let width = scene.width as usize;
        let tile = ((scene.average.len() as f64).sqrt() / 8.0).clamp(4.0, 32.0) as usize;
        for (pixel, average) in scene.average.iter().enumerate() {
            let bin = bin_index(
                f64::from(average.iter().sum::<f32>() / 3.0),
                self.bins.len(),
            );
            let group = group_of(pixel % width / tile, pixel / width / tile);
            for c in 0..3 {
                let level = f64::from(average[c]);
                if scene.clipped[pixel][c] || !(limits[c].0..=limits[c].1).contains(&level) {
                    continue;
                }
                let quantum = f64::from(scene.quantum);
                let sum = Sum {
                    pixels: 1.0,
                    variance: pixel_variance(scene, pixel, c, estimator),
                    values: (scene.frames - 1) as f64,
                    quantum2: quantum * quantum,
                    samples: scene.frames as u64,
                };
                self.bins[bin][c][group].add(&sum);
                self.levels[c][(level as usize).min(LEVELS - 1)].add(&sum);
            }
        }
        let all = self.histograms.iter_mut().flatten().flatten();
        for (sum, count) in all.zip(scene.histograms.iter().flatten().flatten()) {
            *sum += count;
        }
        estimator
    }
}

/// Tiles are dealt out so that neighbours fall into different groups.
fn group_of(tile_x: usize, tile_y: usize) -> usize {
    (tile_x % 4) + 4 * (tile_y % 4)
}

/// Unbiased variance over the frames, rounding included, DN^2. The fit of each frame took two values of all its pixels.
fn pixel_variance(scene: &SceneMoments, pixel: usize, channel: usize, estimator: Estimator) -> f64 {
    let pairs = (scene.frames - 1) as f64;
    let fitted = 1.0 - 2.0 / (scene.average.len() as f64).max(4.0);
    let sum = if estimator.by_differences {
        0.5 * f64::from(scene.differences[pixel][channel])
    } else {
        f64::from(scene.squares[pixel][channel])
    };
    sum / (pairs * fitted)
}

fn choose_estimator(scene: &SceneMoments) -> Estimator {
    let mut worst = 1.0f64;
    let mut drift2 = 0.0f64;
    for c in 0..3 {
        let (mut squares, mut differences, mut count) = (0.0, 0.0, 0.0);
        for (pixel, clipped) in scene.clipped.iter().enumerate() {
            if !clipped[c] {
                squares += f64::from(scene.squares[pixel][c]);
                differences += 0.5 * f64::from(scene.differences[pixel][c]);
                count += (scene.frames - 1) as f64;
            }
        }
        if differences > 0.0 {
            worst = worst.max(squares / differences);
            drift2 = drift2.max((squares - differences) / count);
        }
    }
    Estimator {
        by_differences: worst > DRIFT,
        drift_dn: drift2.max(0.0).sqrt(),
    }
}

/// The levels of one channel between which nothing is clipped: far enough from black and white for the noise found on the way there.
fn clip_limits(scene: &SceneMoments, channel: usize, estimator: Estimator) -> (f64, f64) {
    let mut levels = vec![Sum::default(); LEVELS];
    for (pixel, average) in scene.average.iter().enumerate() {
        if !scene.clipped[pixel][channel] {
            let level = &mut levels[(average[channel] as usize).min(LEVELS - 1)];
            level.pixels += 1.0;
            level.variance += pixel_variance(scene, pixel, channel, estimator);
        }
    }
    // From the middle outwards; the noise of a level is that of the 16 levels on its inner side.
    let limit = |outwards: &dyn Fn(usize) -> usize| {
        let mut sigma = 0.0;
        for distance in 0..128 {
            let mut window = Sum::default();
            for back in 0..16.min(distance + 1) {
                window.add(&levels[outwards(distance - back)]);
            }
            if window.pixels >= FEWEST_LEVEL_PIXELS {
                sigma = (window.variance / window.pixels).sqrt();
            }
            let room = 127.0 - distance as f64;
            if room < CLIP_SIGMAS * sigma {
                return room + 1.0;
            }
        }
        0.0
    };
    let low = limit(&|distance| 127 - distance);
    let high = limit(&|distance| 128 + distance);
    (low, 255.0 - high)
}

/// Everything together.
pub(super) fn profile_of(
    statistics: &Statistics,
    correlations: &Correlations,
    sources: Vec<String>,
) -> Result<NoiseProfile, CalibrationError> {
    let autocorrelation = [0, 1, 2].map(|c| correlations.autocorrelation(c));
    let mut bins: Vec<NoiseBin> = statistics
        .bins
        .iter()
        .map(|channels| bin_of(channels, &autocorrelation, statistics.by_differences))
        .collect();
    for (bin, histograms) in bins.iter_mut().zip(&statistics.histograms) {
        bin.mean = [0, 1, 2].map(|c| histogram_mean(&histograms[c]));
    }
    for c in 0..3 {
        if bins.iter().all(|bin| bin.filled[c]) {
            return Err(CalibrationError::Clipped);
        }
        fill_from_neighbours(&mut bins, c);
    }
    Ok(NoiseProfile {
        bins,
        autocorrelation,
        channel_correlation: correlations.channels(),
        fit: [0, 1, 2].map(|c| fit_levels(&statistics.levels[c])),
        sources,
    })
}

/// Equation 8, DN.
fn histogram_mean(histogram: &[u64]) -> f64 {
    let count: u64 = histogram.iter().sum();
    let sum: f64 = histogram
        .iter()
        .enumerate()
        .map(|(entry, n)| (entry as f64 - 255.0) * *n as f64)
        .sum();
    sum / count.max(1) as f64
}

fn bin_of(
    channels: &[[Sum; GROUPS]; 3],
    autocorrelation: &[Autocorrelation; 3],
    by_differences: bool,
) -> NoiseBin {
    let mut bin = NoiseBin::default();
    for (c, groups) in channels.iter().enumerate() {
        let mut all = Sum::default();
        for group in groups {
            all.add(group);
        }
        // Correlated values tell less: each counts for 1 / (sum over all lags of rho^2); differences share frames.
        let shared = if by_differences { 1.5 } else { 1.0 };
        let independent = all.values / (squared_lags(&autocorrelation[c]) * shared);
        bin.samples[c] = all.samples;
        if independent < FEWEST_VALUES {
            bin.filled[c] = true;
            continue;
        }
        let variance = all.true_variance();
        let raw = all.variance / all.pixels;
        let error = jackknife_error(groups, &all).max(NORMAL_Z * raw * (2.0 / independent).sqrt());
        bin.sigma[c] = variance.sqrt();
        bin.low[c] = (variance - error).max(0.0).sqrt();
        bin.high[c] = (variance + error).sqrt();
    }
    bin
}

/// Half of the 95% interval of the variance, from leaving out one part of the picture at a time. 0 if there are too few parts.
fn jackknife_error(groups: &[Sum; GROUPS], all: &Sum) -> f64 {
    let without: Vec<f64> = groups
        .iter()
        .filter(|group| group.pixels > 0.0 && group.pixels < all.pixels)
        .map(|group| (all.variance - group.variance) / (all.pixels - group.pixels))
        .collect();
    let count = without.len() as f64;
    if count < 8.0 {
        return 0.0;
    }
    let mean = without.iter().sum::<f64>() / count;
    let spread: f64 = without.iter().map(|v| (v - mean) * (v - mean)).sum();
    STUDENT_T * (spread * (count - 1.0) / count).sqrt()
}

/// Sum of squared correlations over the whole plane, from the half that is measured.
pub(super) fn squared_lags(lags: &Autocorrelation) -> f64 {
    let first: f64 = lags[0].iter().map(|rho| rho * rho).sum();
    let others: f64 = lags[1..].as_flattened().iter().map(|rho| rho * rho).sum();
    first + 2.0 * others
}

/// Variance linear between the nearest measured bins on both sides, or that of the only neighbour.
pub(super) fn fill_from_neighbours(bins: &mut [NoiseBin], c: usize) {
    let measured: Vec<(usize, f64)> = bins
        .iter()
        .enumerate()
        .filter(|(_, bin)| !bin.filled[c])
        .map(|(index, bin)| (index, bin.sigma[c] * bin.sigma[c]))
        .collect();
    for (index, bin) in bins.iter_mut().enumerate().filter(|(_, b)| b.filled[c]) {
        let below = measured.iter().rev().find(|(at, _)| *at < index);
        let above = measured.iter().find(|(at, _)| *at > index);
        let variance = match (below, above) {
            (Some((i, low)), Some((j, high))) => {
                low + (high - low) * (index - i) as f64 / (j - i) as f64
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => 0.0,
        };
        bin.sigma[c] = variance.sqrt();
        (bin.low[c], bin.high[c]) = (bin.sigma[c], bin.sigma[c]);
    }
}

/// sigma^2 = a y + b by least squares, each level weighted by what is known of its variance. A single level fixes b alone.
pub(super) fn fit_levels(levels: &[Sum]) -> NoiseFit {
    let points: Vec<(f64, f64, f64)> = levels
        .iter()
        .enumerate()
        .filter(|(_, sum)| sum.pixels >= FEWEST_LEVEL_PIXELS)
        .map(|(level, sum)| (level as f64 + 0.5, sum.true_variance(), sum.values))
        .collect();
    let values: f64 = points.iter().map(|p| p.2).sum();
    if values == 0.0 {
        return NoiseFit::default();
    }
    let mean = points.iter().map(|p| p.1 * p.2).sum::<f64>() / values;
    let mut fit = NoiseFit { a: 0.0, b: mean };
    for _ in 0..10 {
        let (mut w, mut wy, mut wv, mut wyy, mut wyv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (y, v, values) in &points {
            // The variance of a variance estimate is 2 sigma^4 / values; the rounding's part keeps it from 0.
            let expected = fit.variance(*y) + 1.0 / 12.0;
            let weight = values / (expected * expected);
            w += weight;
            wy += weight * y;
            wv += weight * v;
            wyy += weight * y * y;
            wyv += weight * y * v;
        }
        let spread = wyy / w - (wy / w) * (wy / w);
        // Within a few levels the slope is all noise.
        if spread < 4.0 {
            break;
        }
        fit.a = (wyv / w - (wy / w) * (wv / w)) / spread;
        fit.b = wv / w - fit.a * wy / w;
    }
    fit
}
