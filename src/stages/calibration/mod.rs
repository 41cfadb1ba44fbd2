//! Noise calibration: from several frames of static scenes to the camera's [`NoiseProfile`].
//!
//! J. Fischer, D. Bartz: Handling Photographic Imperfections and Aliasing in Augmented Reality (WSI-2006-03), section 3.2: each
//! scene's average picture, channel variations of every frame against it, histograms, and mean and standard deviation by channel and
//! intensity bin. What the paper leaves out is done here:
//!
//! - the average contains each frame's own noise: sums of squares are divided by F - 1, not F;
//! - rounding to codes is taken out of the variance ([`quantisation`]);
//! - values that are or may be clipped are left out;
//! - a frame's own gain and offset (flicker, exposure drift) are fitted against the average and removed; what still drifts within the
//!   picture is removed by taking sigma from differences of consecutive frames, sigma^2 = sum (e[f+1] - e[f])^2 / (2 P (F - 1));
//! - frames that repeat the one before are left out;
//! - a scene that moves is refused;
//! - bins with too few pixels are filled from their neighbours and marked;
//! - correlation over space and between channels, a fit of variance against level, and confidence intervals are measured.
//!
//! Three passes over the frames, the first for those that repeat another; memory does not grow with their number. Moments come from unrounded residuals, histograms serve the report.

mod correlation;
mod estimate;
mod frames;
mod moments;
pub mod quantisation;
mod report;
mod single;
#[cfg(test)]
mod tests;

pub use frames::{SceneFrames, group_frames};
pub use report::report_html;
pub use single::{Estimate, estimate_from_one};

use std::path::PathBuf;

use crate::stages::settings::{LAGS, MAX_BINS, NoiseProfile};
use correlation::Correlations;
use estimate::{Statistics, profile_of};
use moments::SceneMoments;

/// Channel variations that a histogram has entries for: -255 to 255 DN.
pub const HISTOGRAM_ENTRIES: usize = 511;

#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    #[error(
        "no frames: expected pictures, or folders with pictures, of a scene in which nothing moves"
    )]
    NoFrames,
    #[error("{}: the folder has no pictures (PNG or JPEG); expected at least two frames of one scene", folder.display())]
    EmptyFolder { folder: PathBuf },
    #[error("{}: the scene has one frame only; expected at least two, and ten or more for a good estimate", folder.display())]
    OneFrame { folder: PathBuf },
    #[error(
        "{}: all {count} frames hold the same pixels; expected frames that the camera took one by one; record the scene again",
        folder.display()
    )]
    Copies { folder: PathBuf, count: usize },
    #[error("{}: {problem}", path.display())]
    Frame { path: PathBuf, problem: String },
    #[error(
        "{}: it has {}x{} pixels where the scene's first frame has {}x{}; expected frames of one size in a folder",
        path.display(), size.0, size.1, expected.0, expected.1
    )]
    Size {
        path: PathBuf,
        size: (u32, u32),
        expected: (u32, u32),
    },
    #[error(
        "{}: the scene or the camera moved: {share_percent:.1}% of this frame's pixels are further from the scene's average than noise explains; expected a static scene; record it again or leave such frames out",
        path.display()
    )]
    Moving { path: PathBuf, share_percent: f64 },
    #[error("its values are linear; expected a photograph as the camera stored it (PNG or JPEG)")]
    NoCodes,
    #[error(
        "it has no flat, unclipped part of 24 x 24 pixels at a level often enough; expected a photograph with sky, wall or the like; calibrate from several frames"
    )]
    NothingFlat,
    #[error("hardly a pixel is free of clipping: expected scenes neither black nor overexposed")]
    Clipped,
    #[error("{0} bins: expected a power of two, at most {MAX_BINS}")]
    Bins(usize),
}

/// What a calibration found.
#[derive(Clone, Debug)]
pub struct Calibration {
    pub profile: NoiseProfile,
    /// By bin, then channel: how often each variation occurred (index 255 is 0 DN).
    pub histograms: Vec<[Vec<u64>; 3]>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Correlation at the profile's last lag that is no chance and no trace of demosaicing.
const GRAIN: f64 = 0.1;

/// Tells the largest correlation along an axis at the profile's last lag, if the grain goes on from there.
fn note_of_grain(profile: &NoiseProfile) -> Option<String> {
    let rho = (profile.autocorrelation.iter())
        .flat_map(|lags| [lags[0][2 * LAGS], lags[LAGS][LAGS]])
        .fold(0.0, f64::max);
    (rho > GRAIN).then(|| {
        format!(
            "the noise is alike over more than the {LAGS} pixels that a profile holds (correlation {rho:.2} there): what is rendered has finer grain; expected noise as the sensor gives it; scale the frames and photographs down, or take the camera's denoising off"
        )
    })
}

/// Measures the noise of all `scenes`. `progress` hears how many frames of how many have been read; each is read twice.
///
/// # Errors
/// Frames that cannot be used, a scene that moves, or nothing that can be measured.
pub fn calibrate(
    scenes: &[SceneFrames],
    bins: usize,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Calibration, CalibrationError> {
    if !bins.is_power_of_two() || bins > MAX_BINS {
        return Err(CalibrationError::Bins(bins));
    }
    if scenes.is_empty() {
        return Err(CalibrationError::NoFrames);
    }
    for scene in scenes {
        scene.check()?;
    }
    let mut notes = Vec::new();
    let mut own = Vec::new();
    for scene in scenes {
        let (scene, note) = frames::drop_repeated(scene)?;
        own.push(scene);
        notes.extend(note);
    }
    let scenes = own;
    let total = 2 * scenes.iter().map(|s| s.paths.len() as u64).sum::<u64>();
    let mut done = 0;
    let mut statistics = Statistics::new(bins);
    let mut correlations = Correlations::default();
    let mut sources = Vec::new();
    for scene in &scenes {
        let mut step = || {
            done += 1;
            progress(done, total);
        };
        let moments = SceneMoments::measure(scene, bins, &mut correlations, &mut step)?;
        let estimator = statistics.add(&moments);
        sources.push(format!(
            "{}: {} frames of {} x {}, {}",
            scene.name,
            scene.paths.len(),
            moments.width,
            moments.height,
            estimator.description()
        ));
        notes.extend(estimator.note(&scene.name));
    }
    let profile = profile_of(&statistics, &correlations, sources)?;
    for (index, bin) in profile.bins.iter().enumerate() {
        if bin.filled.contains(&true) {
            notes.push(format!(
                "bin {index} (intensity {} to {}) has too few pixels and is filled from its neighbours",
                index * 256 / bins,
                (index + 1) * 256 / bins
            ));
        }
    }
    notes.extend(note_of_grain(&profile));
    Ok(Calibration {
        profile,
        histograms: statistics.histograms,
        notes,
    })
}
