//! The camera's noise from one photograph: what is left of its flattest blocks when a plane is taken out of each.
//!
//! By level, the blocks of least variance are those without texture: their median is taken, with those that chance alone makes larger. A plane takes some
//! of the noise with it, the more the grain is correlated; how much follows from the measured correlation. What is as random as noise in every block of a
//! level (grass, gravel, fabric) stands out where other levels have flat blocks (`textured`); where none has, it is taken for noise: a calibration from
//! several frames tells them apart, one photograph cannot.

mod textured;

use rayon::prelude::*;

use super::estimate::{Sum, fill_from_neighbours, fit_levels, squared_lags};
use super::quantisation::variance_before_rounding;
use super::{CalibrationError, note_of_grain};
use crate::scene::EncodedPhoto;
use crate::stages::settings::{
    Autocorrelation, LAGS, MAX_BINS, NoiseBin, NoiseProfile, WHITE, bin_index,
};

/// Side of a block, pixels, and from one to the next.
const SIDE: usize = 24;
const STEP: usize = 8;
const PIXELS: f64 = (SIDE * SIDE) as f64;
/// Values that a plane takes.
const PLANE: f64 = 3.0;
/// Levels that are looked at on their own, at the least: noise differs within a wide bin.
const FINE_BINS: usize = 16;
/// Fewer blocks of a level tell nothing.
const FEWEST_BLOCKS: usize = 16;
/// Share of a level's blocks that is surely flat, if any is.
const FLATTEST: f64 = 0.1;
/// How much chance makes the variance of one block larger, at the most.
const CHANCE: f64 = 1.0;
/// 97.5% point of the normal distribution.
const NORMAL_Z: f64 = 1.96;
/// How far texture that passes for noise and the choice of flat blocks put sigma off, as a share of it: as found on pairs of photographs and averages of many.
const SYSTEMATIC: f64 = 0.15;

/// A flat block's residuals about its plane.
struct Block {
    /// Mean of the channels, DN.
    level: f64,
    /// By channel, DN.
    means: [f64; 3],
    residuals: Vec<[f32; 3]>,
    /// By channel, mean square of the residuals, DN^2.
    variance: [f64; 3],
}

impl Block {
    /// None where a value is or may be clipped.
    fn at(dn: &[[f32; 3]], width: usize, (x, y): (usize, usize)) -> Option<Self> {
        let rows = (y..y + SIDE).flat_map(|row| &dn[row * width + x..row * width + x + SIDE]);
        let mut residuals: Vec<[f32; 3]> = rows.copied().collect();
        let clipped = |v: &f32| *v <= 0.0 || *v >= 255.0;
        if residuals.as_flattened().iter().any(clipped) {
            return None;
        }
        let middle = (SIDE as f64 - 1.0) / 2.0;
        let place = |i: usize| ((i % SIDE) as f64 - middle, (i / SIDE) as f64 - middle);
        let squares: f64 = (0..SIDE * SIDE).map(|i| place(i).0.powi(2)).sum();
        let (mut means, mut variance) = ([0.0; 3], [0.0; 3]);
        for c in 0..3 {
            let values = || residuals.iter().map(|v| f64::from(v[c])).enumerate();
            let mean = values().map(|(_, v)| v).sum::<f64>() / PIXELS;
            let along = values().map(|(i, v)| v * place(i).0).sum::<f64>() / squares;
            let down = values().map(|(i, v)| v * place(i).1).sum::<f64>() / squares;
            for (i, value) in residuals.iter_mut().enumerate() {
                let (x, y) = place(i);
                let rest = f64::from(value[c]) - mean - along * x - down * y;
                value[c] = rest as f32;
                variance[c] += rest * rest / PIXELS;
            }
            means[c] = mean;
        }
        Some(Self {
            level: means.iter().sum::<f64>() / 3.0,
            means,
            residuals,
            variance,
        })
    }

    fn mean_variance(&self) -> f64 {
        self.variance.iter().sum::<f64>() / 3.0
    }

    /// How much it counts where all levels are taken together: texture, which is left in levels that have no flat block, counts little.
    fn weight(&self) -> f64 {
        1.0 / self.mean_variance().max(1e-9)
    }
}

/// What one photograph shows.
#[derive(Clone, Debug)]
pub struct Estimate {
    pub profile: NoiseProfile,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Measures the noise of one photograph, as stored, in a profile of `bins` bins. `source` names the photograph.
///
/// # Errors
/// A number of bins that is no power of two, a picture without codes, or one without a flat, unclipped part.
pub fn estimate_from_one(
    codes: &EncodedPhoto,
    (width, height): (u32, u32),
    bins: usize,
    source: &str,
) -> Result<Estimate, CalibrationError> {
    if !bins.is_power_of_two() || bins > MAX_BINS {
        return Err(CalibrationError::Bins(bins));
    }
    let (dn, quantum): (Vec<[f32; 3]>, f64) = match codes {
        EncodedPhoto::Codes8(codes) => (codes.iter().map(|p| p.map(f32::from)).collect(), 1.0),
        EncodedPhoto::Codes16(codes) => {
            let scale = 255.0 / 65535.0;
            let dn = codes.iter().map(|p| p.map(|code| f32::from(code) * scale));
            (dn.collect(), f64::from(scale))
        }
        EncodedPhoto::Linear => return Err(CalibrationError::NoCodes),
    };
    let fine = bins.max(FINE_BINS);
    let mut blocks = flat_blocks(&dn, (width as usize, height as usize), fine);
    let textured = textured::levels(&(blocks.iter().map(|b| typical(b))).collect::<Vec<_>>());
    for bin in &textured {
        blocks[*bin].clear();
    }
    let all: Vec<&Block> = blocks.iter().flatten().collect();
    if all.is_empty() {
        return Err(CalibrationError::NothingFlat);
    }
    let raw = [0, 1, 2].map(|c| autocorrelation(&all, c));
    let taken = [0, 1, 2].map(|c| share_of_plane(&raw[c]));
    let true_variance = |variance: f64, c: usize| {
        let whole = variance / (1.0 - taken[c]) / (quantum * quantum);
        quantum * quantum * variance_before_rounding(whole)
    };
    let correlation = [0, 1, 2].map(|c| {
        let measured = weighted_mean(&all, |block| block.variance[c]);
        let whole = measured / (1.0 - taken[c]);
        let rounded = whole / true_variance(measured, c).max(1e-6);
        unbiased(&raw[c], taken[c], rounded)
    });
    let mut levels: [Vec<Sum>; 3] = std::array::from_fn(|_| vec![Sum::default(); 256]);
    for block in &all {
        // Blocks overlap: each brings so many pixels of its own.
        let pixels = (STEP * STEP) as f64;
        for c in 0..3 {
            levels[c][(block.means[c] as usize).min(255)].add(&Sum {
                pixels,
                variance: pixels * block.variance[c] / (1.0 - taken[c]),
                values: pixels / squared_lags(&correlation[c]),
                quantum2: pixels * quantum * quantum,
                samples: pixels as u64,
            });
        }
    }
    let mut fine_bins: Vec<NoiseBin> = (blocks.iter())
        .map(|blocks| bin_of(blocks, &correlation, &true_variance))
        .collect();
    for c in 0..3 {
        fill_from_neighbours(&mut fine_bins, c);
    }
    let own: Vec<NoiseBin> = (fine_bins.chunks(fine / bins)).map(together).collect();
    let profile = NoiseProfile {
        bins: own,
        autocorrelation: correlation,
        channel_correlation: [(0, 1), (0, 2), (1, 2)].map(|(a, b)| between(&all, a, b)),
        fit: [0, 1, 2].map(|c| fit_levels(&levels[c])),
        sources: vec![format!(
            "{source}: one photograph of {width} x {height}, from {} flat blocks of {SIDE} x {SIDE} pixels",
            all.len()
        )],
    };
    let mut notes: Vec<String> = textured::note(&textured, fine).into_iter().collect();
    notes.extend(note_of_grain(&profile));
    Ok(Estimate { profile, notes })
}

/// By bin, the blocks that show noise alone.
fn flat_blocks(dn: &[[f32; 3]], (width, height): (usize, usize), bins: usize) -> Vec<Vec<Block>> {
    let rows = (0..(height + 1).saturating_sub(SIDE)).into_par_iter();
    let blocks: Vec<Block> = rows
        .filter(|y| y % STEP == 0)
        .flat_map_iter(|y| {
            let columns = (0..(width + 1).saturating_sub(SIDE)).step_by(STEP);
            columns.filter_map(move |x| Block::at(dn, width, (x, y)))
        })
        .collect();
    let mut sorted: Vec<Vec<Block>> = (0..bins).map(|_| Vec::new()).collect();
    for block in blocks {
        sorted[bin_index(block.level, bins)].push(block);
    }
    sorted.into_iter().map(flattest).collect()
}

/// Those of one level whose variance differs from the flattest's by no more than chance.
fn flattest(mut blocks: Vec<Block>) -> Vec<Block> {
    if blocks.len() < FEWEST_BLOCKS {
        return Vec::new();
    }
    blocks.sort_by(|a, b| a.mean_variance().total_cmp(&b.mean_variance()));
    let mut count = (FLATTEST * blocks.len() as f64).ceil() as usize;
    // The count only grows, and so it ends.
    loop {
        let limit = blocks[count / 2].mean_variance() * (1.0 + CHANCE);
        let within = blocks.partition_point(|block| block.mean_variance() <= limit);
        if within <= count {
            break;
        }
        count = within;
    }
    blocks.truncate(count);
    blocks
}

/// Sigma of a level's blocks, DN, the median; None where there is none.
fn typical(blocks: &[Block]) -> Option<f64> {
    (blocks.get(blocks.len() / 2)).map(|block| block.mean_variance().sqrt())
}

/// Mean of `value` by the blocks' weights.
fn weighted_mean(blocks: &[&Block], value: impl Fn(&Block) -> f64 + Sync) -> f64 {
    let terms: Vec<f64> = (blocks.par_iter())
        .map(|block| block.weight() * value(block))
        .collect();
    terms.iter().sum::<f64>() / blocks.iter().map(|block| block.weight()).sum::<f64>()
}

/// Autocorrelation of the residuals, each block's in units of its own variance, 1 at lag 0.
fn autocorrelation(blocks: &[&Block], c: usize) -> Autocorrelation {
    let mut out = WHITE;
    for (dy, row) in out.iter_mut().enumerate() {
        for (column, rho) in row.iter_mut().enumerate() {
            // The left half of the first row mirrors the right one.
            let dx = if dy == 0 {
                column.abs_diff(LAGS) as isize
            } else {
                column as isize - LAGS as isize
            };
            *rho = weighted_mean(blocks, |block| lag(block, c, dx, dy));
        }
    }
    out
}

/// Mean product of values that far apart, in the block's variance.
fn lag(block: &Block, c: usize, dx: isize, dy: usize) -> f64 {
    let first = dx.min(0).unsigned_abs();
    let last = SIDE - dx.max(0) as usize;
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 0..SIDE - dy {
        for x in first..last {
            let here = block.residuals[y * SIDE + x][c];
            let there = block.residuals[(y + dy) * SIDE + x.wrapping_add_signed(dx)][c];
            sum += f64::from(here) * f64::from(there);
            count += 1.0;
        }
    }
    sum / count / block.variance[c].max(1e-9)
}

/// Lags of the whole window.
const WINDOW: f64 = ((2 * LAGS + 1) * (2 * LAGS + 1)) as f64;

/// Share of the noise's variance that the plane took: its values' share of the pixels times the power of the noise at low frequencies, which is the sum
/// of the true correlations, rho = L + (1 - L) measured.
fn share_of_plane(measured: &Autocorrelation) -> f64 {
    let share = PLANE / PIXELS;
    let first: f64 = measured[0].iter().sum();
    let sum = first + 2.0 * measured[1..].as_flattened().iter().sum::<f64>();
    let taken = share * sum / (1.0 + share * (sum - WINDOW));
    taken.clamp(share, 0.5)
}

/// Correlation of the noise before a plane was taken and before rounding, which adds white noise.
fn unbiased(measured: &Autocorrelation, taken: f64, rounded: f64) -> Autocorrelation {
    let mut out = WHITE;
    for (row, measured) in out.iter_mut().zip(measured) {
        for (rho, measured) in row.iter_mut().zip(measured) {
            if *rho == 0.0 {
                *rho = ((measured * (1.0 - taken) + taken) * rounded).clamp(-1.0, 1.0);
            }
        }
    }
    out
}

/// Correlation of two channels in one pixel.
fn between(blocks: &[&Block], a: usize, b: usize) -> f64 {
    let of = |block: &Block| {
        let products = block
            .residuals
            .iter()
            .map(|v| f64::from(v[a]) * f64::from(v[b]));
        let scale = (block.variance[a] * block.variance[b]).sqrt().max(1e-9);
        products.sum::<f64>() / PIXELS / scale
    };
    weighted_mean(blocks, of).clamp(-1.0, 1.0)
}

fn bin_of(
    blocks: &[Block],
    correlation: &[Autocorrelation; 3],
    true_variance: &dyn Fn(f64, usize) -> f64,
) -> NoiseBin {
    let mut bin = NoiseBin::default();
    for (c, lags) in correlation.iter().enumerate() {
        if blocks.is_empty() {
            bin.filled[c] = true;
            continue;
        }
        let mut variances: Vec<f64> = blocks.iter().map(|block| block.variance[c]).collect();
        variances.sort_by(f64::total_cmp);
        let pixels = blocks.len() as f64 * (STEP * STEP) as f64;
        let sigma = true_variance(variances[variances.len() / 2], c).sqrt();
        // Of a standard deviation, 1 / sqrt(2 n); and what no number of blocks makes smaller.
        let chance = NORMAL_Z / (2.0 * pixels / squared_lags(lags)).sqrt();
        let error = sigma * chance.hypot(SYSTEMATIC);
        bin.sigma[c] = sigma;
        bin.low[c] = (sigma - error).max(0.0);
        bin.high[c] = sigma + error;
        bin.samples[c] = pixels as u64;
    }
    bin
}

/// One bin of several, by their pixels; by all alike where none was measured.
fn together(bins: &[NoiseBin]) -> NoiseBin {
    let mut bin = NoiseBin::default();
    for c in 0..3 {
        bin.filled[c] = bins.iter().all(|bin| bin.filled[c]);
        bin.samples[c] = bins.iter().map(|bin| bin.samples[c]).sum();
        let weight = |part: &NoiseBin| match bin.samples[c] {
            0 => 1.0 / bins.len() as f64,
            all => part.samples[c] as f64 / all as f64,
        };
        let mean = |of: &dyn Fn(&NoiseBin) -> f64| {
            let squares = bins.iter().map(|part| weight(part) * of(part).powi(2));
            squares.sum::<f64>().sqrt()
        };
        bin.sigma[c] = mean(&|part| part.sigma[c]);
        bin.low[c] = mean(&|part| part.low[c]);
        bin.high[c] = mean(&|part| part.high[c]);
    }
    bin
}

#[cfg(test)]
mod tests;
