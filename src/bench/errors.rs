//! Errors of a picture against a converged reference, over the whole picture and apart for each kind of pixel.

use serde::{Deserialize, Serialize};

use crate::film::{Picture, flip_map};

/// Keeps the relative error finite over black.
const REL_MSE_OFFSET: f64 = 0.01;

/// What a picture should be, and how well that is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    pub picture: Picture,
    /// Standard error of each value of the picture; all 0 where it is not known.
    pub standard_error: Vec<[f32; 3]>,
    /// Fraction of primary rays that meet virtual geometry first: 0 background, 1 virtual, between edge.
    pub mask: Vec<f32>,
}

impl Truth {
    /// Root mean square of the standard errors.
    pub fn rms_standard_error(&self) -> f64 {
        let values = self.standard_error.as_flattened();
        let sum: f64 = values.iter().map(|&e| f64::from(e).powi(2)).sum();
        (sum / values.len().max(1) as f64).sqrt()
    }

    /// Fraction of pixels that something virtual covers, wholly or in part.
    pub fn virtual_fraction(&self) -> f64 {
        let covered = self.mask.iter().filter(|&&m| m > 0.0).count();
        covered as f64 / self.mask.len().max(1) as f64
    }
}

/// Errors of linear values over all channels of some pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    pub pixels: u64,
    /// Mean squared error less the reference's own, so that its expectation is the picture's alone; below 0 by chance where it is tiny.
    pub mse: f64,
    /// Root of `mse`, 0 where that is negative.
    pub rmse: f64,
    /// Mean of squared error / (squared reference + 0.01), less the reference's own.
    pub rel_mse: f64,
    /// 99th percentile of the absolute error.
    pub p99: f64,
    /// Mean LDR-FLIP, 0 to 1.
    pub flip: f64,
}

/// `None` where a picture has no such pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    pub all: Figures,
    pub background: Option<Figures>,
    pub edge: Option<Figures>,
    #[serde(rename = "virtual")]
    pub virtual_: Option<Figures>,
    /// The reference's share of the mean squared error before it was taken off.
    pub reference_share: f64,
}

impl Errors {
    /// Of one picture; it must have the reference's size.
    pub fn of(test: &Picture, truth: &Truth) -> Self {
        let reference = &truth.picture;
        let flip = flip_map(
            reference.width as usize,
            reference.height as usize,
            &reference.linear,
            &test.linear,
        );
        let over = |wanted: &dyn Fn(f32) -> bool| figures(test, truth, &flip, wanted);
        let all = over(&|_| true).unwrap_or_default();
        let own = truth.rms_standard_error().powi(2);
        let raw = all.mse + own;
        Self {
            all,
            background: over(&|m| m <= 0.0),
            edge: over(&|m| m > 0.0 && m < 1.0),
            virtual_: over(&|m| m >= 1.0),
            reference_share: if raw > 0.0 { own / raw } else { 0.0 },
        }
    }

    /// Of several pictures against one reference: means of all figures, `rmse` again the root of the mean squared error.
    pub fn mean(of: &[Self]) -> Self {
        let some = |pick: &dyn Fn(&Self) -> Option<Figures>| -> Option<Figures> {
            let all: Vec<Figures> = of.iter().filter_map(pick).collect();
            (!all.is_empty()).then(|| mean_figures(&all))
        };
        Self {
            all: some(&|e| Some(e.all)).unwrap_or_default(),
            background: some(&|e| e.background),
            edge: some(&|e| e.edge),
            virtual_: some(&|e| e.virtual_),
            reference_share: of.iter().map(|e| e.reference_share).sum::<f64>()
                / of.len().max(1) as f64,
        }
    }
}

fn figures(
    test: &Picture,
    truth: &Truth,
    flip: &[f64],
    wanted: &dyn Fn(f32) -> bool,
) -> Option<Figures> {
    let mut absolute = Vec::new();
    let (mut pixels, mut squared, mut relative, mut flip_sum) = (0u64, 0.0, 0.0, 0.0);
    for (pixel, mask) in truth.mask.iter().enumerate() {
        if !wanted(*mask) {
            continue;
        }
        pixels += 1;
        flip_sum += flip[pixel];
        for c in 0..3 {
            let reference = f64::from(truth.picture.linear[pixel][c]);
            let own = f64::from(truth.standard_error[pixel][c]).powi(2);
            let error = f64::from(test.linear[pixel][c]) - reference;
            let square = error * error - own;
            squared += square;
            relative += square / (reference * reference + REL_MSE_OFFSET);
            absolute.push(error.abs());
        }
    }
    let values = absolute.len() as f64;
    (pixels > 0).then(|| Figures {
        pixels,
        mse: squared / values,
        rmse: (squared / values).max(0.0).sqrt(),
        rel_mse: relative / values,
        p99: percentile(&mut absolute, 0.99),
        flip: flip_sum / pixels as f64,
    })
}

fn mean_figures(of: &[Figures]) -> Figures {
    let mean = |pick: fn(&Figures) -> f64| of.iter().map(pick).sum::<f64>() / of.len() as f64;
    let mse = mean(|f| f.mse);
    Figures {
        pixels: of[0].pixels,
        mse,
        rmse: mse.max(0.0).sqrt(),
        rel_mse: mean(|f| f.rel_mse),
        p99: mean(|f| f.p99),
        flip: mean(|f| f.flip),
    }
}

/// The smallest value that at least this fraction of all values does not exceed; 0 of none.
fn percentile(values: &mut [f64], fraction: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = (fraction * values.len() as f64).ceil() as usize;
    let index = rank.clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

#[cfg(test)]
mod tests;
