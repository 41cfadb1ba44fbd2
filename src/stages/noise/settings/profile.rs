//! A camera's noise as `mixray noise calibrate` measures it: a documented TOML file.
//!
//! All values are in DN: 8-bit codes of the encoded (sRGB) picture, 0 to 255, with fractions for 16-bit pictures. Quantisation to
//! codes is not part of them.

use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;

use crate::decode::{MAX_TEXT_BYTES, read_text};
use crate::refusal::Refusal;
use crate::scene::fingerprint::content;

/// Version of the file format that this program reads and writes.
pub const NOISE_PROFILE_VERSION: i64 = 1;
const FORMAT: &str = "mixray noise profile";

/// Lags of the autocorrelation along x, -3 to 3, and along y, 0 to 3.
pub const LAGS: usize = 3;
const LAG_COLUMNS: usize = 2 * LAGS + 1;
const LAG_ROWS: usize = LAGS + 1;

/// Most intensity bins.
pub const MAX_BINS: usize = 256;

/// Autocorrelation of one channel: row dy (0 to 3), column dx + 3; 1 at lag (0, 0). Lag (-dx, -dy) equals lag (dx, dy).
pub type Autocorrelation = [[f64; LAG_COLUMNS]; LAG_ROWS];

/// White noise.
pub const WHITE: Autocorrelation = {
    let mut white = [[0.0; LAG_COLUMNS]; LAG_ROWS];
    white[0][LAGS] = 1.0;
    white
};

#[derive(Clone, Debug, PartialEq)]
pub struct NoiseProfile {
    /// Intensity bins, a power of two; bin j holds pixels with floor(mean of their channels * N / 256) = j.
    pub bins: Vec<NoiseBin>,
    pub autocorrelation: [Autocorrelation; 3],
    /// Correlation of red and green, red and blue, green and blue in one pixel.
    pub channel_correlation: [f64; 3],
    /// sigma^2 = a y + b for the channel's own level y, DN.
    pub fit: [NoiseFit; 3],
    /// What it was measured on; free text, one line each.
    pub sources: Vec<String>,
}

/// Red, green and blue of one bin, DN.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseBin {
    pub mean: [f64; 3],
    pub sigma: [f64; 3],
    /// 95% confidence interval of sigma. The ends are equal to sigma where it was not measured.
    pub low: [f64; 3],
    pub high: [f64; 3],
    /// Pixel values that were measured.
    pub samples: [u64; 3],
    /// Too few pixels: taken from the neighbouring bins.
    pub filled: [bool; 3],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseFit {
    pub a: f64,
    pub b: f64,
}

impl NoiseFit {
    /// Variance at level `y`, DN squared, never below 0.
    pub fn variance(&self, y: f64) -> f64 {
        (self.a * y + self.b).max(0.0)
    }
}

content! {
    NoiseProfile { bins, autocorrelation, channel_correlation, fit; sources }
    NoiseBin { mean, sigma, low, high, samples, filled }
    NoiseFit { a, b }
}

impl NoiseProfile {
    /// White noise of variance a y + b in every channel, y being the middle of each of `bins` bins.
    pub fn from_fit(fit: NoiseFit, bins: usize) -> Self {
        let bin = |index: usize| {
            let sigma = fit
                .variance((index as f64 + 0.5) * 256.0 / bins as f64)
                .sqrt();
            NoiseBin {
                sigma: [sigma; 3],
                low: [sigma; 3],
                high: [sigma; 3],
                ..NoiseBin::default()
            }
        };
        Self {
            bins: (0..bins).map(bin).collect(),
            autocorrelation: [WHITE; 3],
            channel_correlation: [0.0; 3],
            fit: [fit; 3],
            sources: vec![format!("given by hand: {} y + {}", fit.a, fit.b)],
        }
    }

    /// Bin of a pixel whose channels average to `intensity` DN (imperfections 2006, section 3.1).
    pub fn bin(&self, intensity: f64) -> usize {
        bin_index(intensity, self.bins.len())
    }

    /// Reads a profile file. An error reads "problem; expected ...; how to mend" and leaves out the path.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let text = read_text(path, MAX_TEXT_BYTES).map_err(|reason| {
            format!("it cannot be read ({reason}); expected a noise profile; correct the path")
        })?;
        Self::from_toml(&text)
    }

    /// The profile of a file's text; errors as [`NoiseProfile::read`].
    pub fn from_toml(text: &str) -> Result<Self, Refusal> {
        let broken = |error: toml::de::Error| {
            format!(
                "it is no noise profile ({}); expected a file of `mixray noise calibrate`; calibrate again",
                error.message()
            )
        };
        let head: Head = toml::from_str(text).map_err(broken)?;
        if head.format != FORMAT {
            return Err(format!(
                "its format is {:?}; expected \"{FORMAT}\"; calibrate again",
                head.format
            )
            .into());
        }
        if head.version != NOISE_PROFILE_VERSION {
            return Err(format!(
                "it is a noise profile of version {}; expected version {NOISE_PROFILE_VERSION}; calibrate again with this program",
                head.version
            ).into());
        }
        let file: File = toml::from_str(text).map_err(broken)?;
        let profile = Self {
            bins: file.bin.into_iter().map(Into::into).collect(),
            autocorrelation: [
                file.correlation.red,
                file.correlation.green,
                file.correlation.blue,
            ],
            channel_correlation: file.correlation.channels,
            fit: [0, 1, 2].map(|c| NoiseFit {
                a: file.fit.a[c],
                b: file.fit.b[c],
            }),
            sources: file.sources,
        };
        profile.check()?;
        Ok(profile)
    }

    /// # Errors
    /// What no camera measures, in one line.
    pub fn check(&self) -> Result<(), Refusal> {
        let count = self.bins.len();
        if !count.is_power_of_two() || count > MAX_BINS {
            return Err(format!(
                "it has {count} bins; expected a power of two, at most {MAX_BINS}; calibrate again"
            )
            .into());
        }
        let sigmas = self.bins.iter().flat_map(|bin| bin.sigma);
        let means = self.bins.iter().flat_map(|bin| bin.mean);
        if sigmas.clone().any(|sigma| !(0.0..=255.0).contains(&sigma))
            || means.clone().any(|mean| !(mean.abs() <= 255.0))
        {
            return Err(
                "a mean or sigma is no number from 0 to 255 DN; expected measured values; calibrate again, or give other numbers".into(),
            );
        }
        let lags = self.autocorrelation.as_flattened().as_flattened();
        let correlations = lags.iter().chain(&self.channel_correlation);
        // A little above 1 can be measured where the noise is hardly above the quantisation.
        if correlations.clone().any(|rho| !(rho.abs() <= 1.5)) {
            return Err(
                "a correlation is not within -1 and 1; expected measured values; calibrate again"
                    .into(),
            );
        }
        Ok(())
    }

    /// The file's text.
    pub fn to_toml(&self) -> String {
        let mut out = String::new();
        let count = self.bins.len();
        // Writing to a string cannot fail.
        let _ = write!(
            out,
            "# A camera's noise, made by `mixray noise`. Unit: DN, 8-bit codes of the encoded picture (0 to 255; 16-bit\n\
             # pictures bring fractions). Lists are red, green, blue. The variance of rounding to codes is not included.\n\
             format = \"{FORMAT}\"\nversion = {NOISE_PROFILE_VERSION}\n\n\
             # Folder, frames, size, how sigma was estimated.\nsources = [\n"
        );
        for source in &self.sources {
            let _ = writeln!(out, "    {},", toml::Value::String(source.clone()));
        }
        out += "]\n\n# sigma^2 = a y + b, y being the channel's own level.\n[fit]\n";
        let _ = writeln!(out, "a = {}", list(self.fit.map(|fit| fit.a)));
        let _ = writeln!(out, "b = {}", list(self.fit.map(|fit| fit.b)));
        out += "\n# Rows: dy = 0 to 3; columns: dx = -3 to 3. channels: red-green, red-blue, green-blue in one pixel.\n[correlation]\n";
        for (name, lags) in ["red", "green", "blue"].iter().zip(&self.autocorrelation) {
            let _ = writeln!(out, "{name} = [");
            for row in lags {
                let _ = writeln!(out, "    {},", list(*row));
            }
            out += "]\n";
        }
        let _ = writeln!(out, "channels = {}", list(self.channel_correlation));
        for (index, bin) in self.bins.iter().enumerate() {
            let from = index * 256 / count;
            let to = (index + 1) * 256 / count;
            let _ = write!(
                out,
                "\n[[bin]]                             # intensity {from} to {to}\n\
                 mean = {}\nsigma = {}\nsigma_low = {}      # 95% confidence\nsigma_high = {}\n\
                 samples = {:?}\nfilled = {:?}          # true: too few pixels, taken from the neighbouring bins\n",
                list(bin.mean),
                list(bin.sigma),
                list(bin.low),
                list(bin.high),
                bin.samples,
                bin.filled
            );
        }
        out
    }
}

/// floor(intensity * bins / 256), within the bins.
pub fn bin_index(intensity: f64, bins: usize) -> usize {
    ((intensity * bins as f64 / 256.0).max(0.0) as usize).min(bins - 1)
}

fn list<const N: usize>(values: [f64; N]) -> String {
    let values = values.map(|value| format!("{value:.6}"));
    format!("[{}]", values.join(", "))
}

#[derive(Deserialize)]
struct Head {
    format: String,
    version: i64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: i64,
    #[serde(default)]
    sources: Vec<String>,
    fit: FitTable,
    correlation: CorrelationTable,
    bin: Vec<BinTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FitTable {
    a: [f64; 3],
    b: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CorrelationTable {
    red: Autocorrelation,
    green: Autocorrelation,
    blue: Autocorrelation,
    channels: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BinTable {
    mean: [f64; 3],
    sigma: [f64; 3],
    sigma_low: [f64; 3],
    sigma_high: [f64; 3],
    samples: [u64; 3],
    filled: [bool; 3],
}

impl From<BinTable> for NoiseBin {
    fn from(table: BinTable) -> Self {
        Self {
            mean: table.mean,
            sigma: table.sigma,
            low: table.sigma_low,
            high: table.sigma_high,
            samples: table.samples,
            filled: table.filled,
        }
    }
}

#[cfg(test)]
mod tests;
