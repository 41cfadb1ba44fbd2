//! Per-pixel moments of one scene's frames, in two passes: the average picture, then residuals against it.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::correlation::Correlations;
use super::frames::{Frame, SceneFrames};
use super::{CalibrationError, HISTOGRAM_ENTRIES};
use crate::stages::settings::bin_index;

/// Buckets of the motion test's histogram of |residual|: 0.25 DN each.
const MOTION_BUCKETS: usize = 1024;
const MOTION_BUCKET_DN: f32 = 0.25;
/// A residual beyond this many standard deviations (from the median) plus some DN is not noise.
const MOTION_SIGMAS: f64 = 8.0;
const MOTION_FLOOR_DN: f64 = 3.0;
/// Share of such residuals in one frame that means motion.
const MOTION_SHARE: f64 = 0.005;

/// What the estimates are made from. Pixels are row-major; per-pixel values are by channel.
pub(super) struct SceneMoments {
    pub width: u32,
    pub height: u32,
    pub frames: usize,
    /// DN of one code.
    pub quantum: f32,
    /// DN.
    pub average: Vec<[f32; 3]>,
    /// Some frame's code was the smallest or the largest.
    pub clipped: Vec<[bool; 3]>,
    /// Sum over frames of squared residuals, DN squared.
    pub squares: Vec<[f32; 3]>,
    /// Sum over consecutive frames of squared differences of residuals.
    pub differences: Vec<[f32; 3]>,
    /// By bin, then channel.
    pub histograms: Vec<[Vec<u64>; 3]>,
}

/// A frame as gain and offset of the average, by channel.
#[derive(Clone, Copy, Debug)]
struct Fit {
    gain: [f32; 3],
    offset: [f32; 3],
}

impl SceneMoments {
    /// Reads every frame twice. Adds the scene's correlations to `correlations`; `step` is called after each read.
    pub fn measure(
        scene: &SceneFrames,
        bins: usize,
        correlations: &mut Correlations,
        step: &mut dyn FnMut(),
    ) -> Result<Self, CalibrationError> {
        let mut moments = Self::first_pass(scene, step)?;
        moments.histograms = vec![std::array::from_fn(|_| vec![0; HISTOGRAM_ENTRIES]); bins];
        moments.second_pass(scene, bins, correlations, step)?;
        Ok(moments)
    }

    fn first_pass(scene: &SceneFrames, step: &mut dyn FnMut()) -> Result<Self, CalibrationError> {
        let mut sums: Vec<[u64; 3]> = Vec::new();
        let mut clipped: Vec<[bool; 3]> = Vec::new();
        let mut first: Option<(u32, u32, u16)> = None;
        for_each_frame(&scene.paths, |path, frame| {
            let (width, height, top) = *first.get_or_insert((frame.width, frame.height, frame.top));
            if (frame.width, frame.height) != (width, height) {
                return Err(CalibrationError::Size {
                    path: path.to_path_buf(),
                    size: (frame.width, frame.height),
                    expected: (width, height),
                });
            }
            if frame.top != top {
                return Err(CalibrationError::Frame {
                    path: path.to_path_buf(),
                    problem: "it has another number of bits than the scene's first frame; expected frames of one kind in a folder".to_owned(),
                });
            }
            sums.resize(frame.codes.len(), [0; 3]);
            clipped.resize(frame.codes.len(), [false; 3]);
            sums.par_iter_mut()
                .zip(&mut clipped)
                .zip(&frame.codes)
                .for_each(|((sum, clipped), codes)| {
                    for c in 0..3 {
                        sum[c] += u64::from(codes[c]);
                        clipped[c] |= codes[c] == 0 || codes[c] == top;
                    }
                });
            step();
            Ok(())
        })?;
        let (width, height, top) = first.ok_or(CalibrationError::NoFrames)?;
        let frames = scene.paths.len();
        let quantum = 255.0 / f32::from(top);
        let scale = f64::from(quantum) / frames as f64;
        let count = sums.len();
        Ok(Self {
            width,
            height,
            frames,
            quantum,
            average: sums
                .par_iter()
                .map(|sum| sum.map(|sum| (sum as f64 * scale) as f32))
                .collect(),
            clipped,
            squares: vec![[0.0; 3]; count],
            differences: vec![[0.0; 3]; count],
            histograms: Vec::new(),
        })
    }

    fn second_pass(
        &mut self,
        scene: &SceneFrames,
        bins: usize,
        correlations: &mut Correlations,
        step: &mut dyn FnMut(),
    ) -> Result<(), CalibrationError> {
        let mut previous: Vec<[f32; 3]> = Vec::new();
        let mut residuals: Vec<[f32; 3]> = vec![[0.0; 3]; self.average.len()];
        let mut worst_motion: Option<(PathBuf, f64)> = None;
        let mut pair = 0;
        let pairs = self.frames - 1;
        for_each_frame(&scene.paths, |path, frame| {
            let fit = self.fit(&frame);
            self.residuals(&frame, fit, &mut residuals);
            let share = self.motion_share(&residuals);
            if worst_motion
                .as_ref()
                .is_none_or(|(_, worst)| share > *worst)
            {
                worst_motion = Some((path.to_path_buf(), share));
            }
            self.squares
                .par_iter_mut()
                .zip(&residuals)
                .for_each(|(sum, e)| {
                    for c in 0..3 {
                        sum[c] += e[c] * e[c];
                    }
                });
            if !previous.is_empty() {
                self.differences
                    .par_iter_mut()
                    .zip(previous.par_iter_mut())
                    .zip(&residuals)
                    .for_each(|((sum, previous), e)| {
                        for c in 0..3 {
                            previous[c] = e[c] - previous[c];
                            sum[c] += previous[c] * previous[c];
                        }
                    });
                if Correlations::wants(pair, pairs, residuals.len()) {
                    correlations.add(
                        &previous,
                        &self.clipped,
                        self.width as usize,
                        f64::from(self.quantum),
                    );
                }
                pair += 1;
            }
            previous.clone_from(&residuals);
            self.count(&residuals, bins);
            step();
            Ok(())
        })?;
        match worst_motion {
            Some((path, share)) if share > MOTION_SHARE => Err(CalibrationError::Moving {
                path,
                share_percent: 100.0 * share,
            }),
            _ => Ok(()),
        }
    }

    /// Least squares of the frame against the average, over values that are never clipped.
    fn fit(&self, frame: &Frame) -> Fit {
        // n, sum a, sum r, sum a a, sum a r, about 128 DN for precision
        let sums = self
            .average
            .par_iter()
            .zip(&self.clipped)
            .zip(&frame.codes)
            .with_min_len(4096)
            .fold(
                || [[0.0f64; 5]; 3],
                |mut sums, ((average, clipped), codes)| {
                    for c in (0..3).filter(|c| !clipped[*c]) {
                        let a = f64::from(average[c]) - 128.0;
                        let r = f64::from(f32::from(codes[c]) * self.quantum) - 128.0;
                        for (sum, term) in sums[c].iter_mut().zip([1.0, a, r, a * a, a * r]) {
                            *sum += term;
                        }
                    }
                    sums
                },
            )
            .reduce(
                || [[0.0; 5]; 3],
                |mut left, right| {
                    for (left, right) in
                        left.as_flattened_mut().iter_mut().zip(right.as_flattened())
                    {
                        *left += right;
                    }
                    left
                },
            );
        let mut fit = Fit {
            gain: [1.0; 3],
            offset: [0.0; 3],
        };
        for (c, [n, a, r, aa, ar]) in sums.into_iter().enumerate() {
            if n < 3.0 {
                continue;
            }
            let variance = aa / n - (a / n) * (a / n);
            let gain = if variance > 1e-6 {
                (ar / n - (a / n) * (r / n)) / variance
            } else {
                1.0
            };
            fit.gain[c] = gain as f32;
            fit.offset[c] = (r / n - gain * (a / n) + 128.0 - gain * 128.0) as f32;
        }
        fit
    }

    fn residuals(&self, frame: &Frame, fit: Fit, out: &mut [[f32; 3]]) {
        out.par_iter_mut()
            .zip(&self.average)
            .zip(&frame.codes)
            .for_each(|((out, average), codes)| {
                for c in 0..3 {
                    let value = f32::from(codes[c]) * self.quantum;
                    out[c] = value - (fit.gain[c] * average[c] + fit.offset[c]);
                }
            });
    }

    /// The largest share, among the channels, of residuals that no noise of this frame's level explains.
    fn motion_share(&self, residuals: &[[f32; 3]]) -> f64 {
        const LEVELS: usize = 4;
        type Counts = Vec<[u32; MOTION_BUCKETS]>;
        let empty = || -> Counts { vec![[0; MOTION_BUCKETS]; 3 * LEVELS] };
        let counts = residuals
            .par_iter()
            .zip(&self.average)
            .zip(&self.clipped)
            .with_min_len(16384)
            .fold(empty, |mut counts, ((e, average), clipped)| {
                for c in (0..3).filter(|c| !clipped[*c]) {
                    let level = bin_index(f64::from(average[c]), LEVELS);
                    let bucket = (e[c].abs() / MOTION_BUCKET_DN) as usize;
                    counts[c * LEVELS + level][bucket.min(MOTION_BUCKETS - 1)] += 1;
                }
                counts
            })
            .reduce(empty, |mut left, right| {
                for (left, right) in left.iter_mut().flatten().zip(right.iter().flatten()) {
                    *left += right;
                }
                left
            });
        let mut worst = 0.0f64;
        for channel in counts.chunks(LEVELS) {
            let (mut beyond, mut all) = (0u64, 0u64);
            for counts in channel {
                let total: u64 = counts.iter().map(|n| u64::from(*n)).sum();
                let median = bucket_median(counts, total);
                let limit = MOTION_SIGMAS * median / 0.6745 + MOTION_FLOOR_DN;
                let first = (limit / f64::from(MOTION_BUCKET_DN)).ceil() as usize;
                beyond += counts
                    .iter()
                    .skip(first)
                    .map(|n| u64::from(*n))
                    .sum::<u64>();
                all += total;
            }
            if all > 0 {
                worst = worst.max(beyond as f64 / all as f64);
            }
        }
        worst
    }

    fn count(&mut self, residuals: &[[f32; 3]], bins: usize) {
        let (average, clipped) = (&self.average, &self.clipped);
        let rows = residuals.len().div_ceil(rayon::current_num_threads());
        let partial: Vec<Vec<u64>> = residuals
            .par_chunks(rows)
            .enumerate()
            .map(|(chunk, residuals)| {
                let mut counts = vec![0u64; bins * 3 * HISTOGRAM_ENTRIES];
                let at = chunk * rows;
                for ((e, average), clipped) in
                    residuals.iter().zip(&average[at..]).zip(&clipped[at..])
                {
                    let bin = bin_index(f64::from(average.iter().sum::<f32>() / 3.0), bins);
                    for c in (0..3).filter(|c| !clipped[*c]) {
                        let entry = (e[c].clamp(-255.0, 255.0) + 255.5) as usize;
                        counts[(bin * 3 + c) * HISTOGRAM_ENTRIES + entry] += 1;
                    }
                }
                counts
            })
            .collect();
        for counts in partial {
            let all = self.histograms.iter_mut().flatten().flatten();
            for (sum, count) in all.zip(counts) {
                *sum += count;
            }
        }
    }
}

/// DN.
fn bucket_median(counts: &[u32], total: u64) -> f64 {
    let mut below = 0;
    for (bucket, count) in counts.iter().enumerate() {
        let count = u64::from(*count);
        if 2 * (below + count) >= total && count > 0 {
            let inside = (0.5 * total as f64 - below as f64) / count as f64;
            return (bucket as f64 + inside) * f64::from(MOTION_BUCKET_DN);
        }
        below += count;
    }
    0.0
}

/// Reads as many frames at a time as there are threads, and hands them over in order.
fn for_each_frame(
    paths: &[PathBuf],
    mut use_frame: impl FnMut(&Path, Frame) -> Result<(), CalibrationError>,
) -> Result<(), CalibrationError> {
    for batch in paths.chunks(rayon::current_num_threads()) {
        let frames: Vec<Result<Frame, CalibrationError>> =
            batch.par_iter().map(|path| Frame::read(path)).collect();
        for (path, frame) in batch.iter().zip(frames) {
            use_frame(path, frame?)?;
        }
    }
    Ok(())
}
