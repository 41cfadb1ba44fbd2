//! Rows that a sensor reads one after the other: what a frame shows is put back to where it was in the middle of the frame's time.
//!
//! A row is off by the way that the picture has gone between the row's own time and the middle, which the poses of neighbouring frames tell. Poses follow
//! from corners and corners from poses, so all is solved again, a few times.

use rayon::prelude::*;

use super::TrackError;
use super::detector::{FrameSeen, sighting};
use super::frame_pose::fit;
use super::options::{Readout, TrackOptions};
use super::pose::Pose;
use super::row_ways::{Around, RowWays};
use super::solved::{Solved, solve};

/// The readout time that poses were found with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows {
    pub readout_secs: f64,
    /// Standard deviation of one that was solved for, lens and board being known.
    pub sigma_secs: Option<f64>,
    /// Frames with a pose whose motion no neighbour tells: they stand as they came.
    pub frames_as_they_came: usize,
}

/// Times that lens, board and poses are found anew.
const ROUNDS: usize = 3;
/// Of a frame's time, the largest standard deviation of a readout time that is determined, ...
const MOST_SIGMA: f64 = 0.05;
/// ... and how far apart the costs lie that it follows from.
const STEP: f64 = 0.1;
/// Steps of the search for the least cost.
const STEPS: usize = 6;

/// Lens, board and poses as in the middle of each frame's time.
///
/// # Errors
/// There is no rate of frames, the readout is longer than a frame, or the frames do not determine it.
pub fn solve_rows(
    options: &TrackOptions,
    seen: &[FrameSeen],
    size: (usize, usize),
    frames_per_second: Option<f64>,
    readout: Readout,
) -> Result<(Solved, Rows), TrackError> {
    let period = period_of(frames_per_second)?;
    let mut share = match readout {
        Readout::Known(secs) => share_of(secs, period)?,
        Readout::Solve => 0.0,
    };
    let mut solved = solve(options, seen, size)?;
    let mut sigma = None;
    for _ in 0..ROUNDS {
        let motion = Motion::of(&solved, size.1);
        if readout == Readout::Solve {
            let found = motion.best_share(seen, share);
            let is_determined =
                |(share, sigma): &(f64, f64)| *sigma <= MOST_SIGMA && share.abs() <= 1.0;
            let Some((best, own_sigma)) = found.filter(is_determined) else {
                return Err(undetermined(found, period));
            };
            (share, sigma) = (best, Some(own_sigma));
        }
        let still: Vec<FrameSeen> = motion.all_still(seen, share);
        solved = solve(options, &still, size)?;
    }
    let motion = Motion::of(&solved, size.1);
    let posed = (0..seen.len()).filter(|frame| motion.pose(*frame, 0).is_some());
    let rows = Rows {
        readout_secs: share * period,
        sigma_secs: sigma.map(|sigma| sigma * period),
        frames_as_they_came: posed
            .filter(|frame| motion.around(*frame).is_none())
            .count(),
    };
    Ok((solved, rows))
}

/// Seconds from one frame to the next.
///
/// # Errors
/// There is no rate of frames.
pub fn period_of(frames_per_second: Option<f64>) -> Result<f64, TrackError> {
    frames_per_second.map(f64::recip).ok_or_else(|| {
        TrackError::input(
            "a readout time says nothing where the time between frames is unknown; expected a Y4M stream, which has a rate; convert the video with ffmpeg -i VIDEO -f yuv4mpegpipe, or leave out --readout-time",
        )
    })
}

/// Of the time between two frames, what rows are read in.
///
/// # Errors
/// It is more than that.
pub fn share_of(readout_secs: f64, period_secs: f64) -> Result<f64, TrackError> {
    let share = readout_secs / period_secs;
    if share.abs() <= 1.0 {
        return Ok(share);
    }
    Err(TrackError::input(format!(
        "rows are read in {:.1} ms, and a frame takes {:.1} ms; expected no more than that; see the sensor's data again",
        1e3 * readout_secs.abs(),
        1e3 * period_secs
    )))
}

fn undetermined(found: Option<(f64, f64)>, period: f64) -> TrackError {
    let how_well = match found {
        Some((share, sigma)) => format!(
            "{:.1} ms, give or take {:.1}",
            1e3 * share * period,
            1e3 * sigma * period
        ),
        None => "any fits alike".to_owned(),
    };
    TrackError::input(format!(
        "the frames do not determine the readout time: {how_well}; expected {:.1} ms at most; film the board while the camera moves quickly to and fro, or give --readout-time as it is known",
        1e3 * MOST_SIGMA * period
    ))
}

/// Where frames, one after the other, see the board from.
struct Motion<'a> {
    solved: &'a Solved,
    poses: Vec<Option<Pose>>,
    rows: RowWays<'a>,
}

/// Frames, by how many they come after one, that tell how things move in it: the first of these sets that all have a pose.
const NODES: [&[isize]; 6] = [
    &[-2, -1, 0, 1, 2],
    &[-1, 0, 1],
    &[0, 1, 2],
    &[-2, -1, 0],
    &[0, 1],
    &[-1, 0],
];

impl<'a> Motion<'a> {
    fn of(solved: &'a Solved, height: usize) -> Self {
        let poses = solved.frames.iter();
        Self {
            solved,
            poses: poses
                .map(|frame| frame.pose.as_ref().ok().map(|pose| pose.fit.pose))
                .collect(),
            rows: RowWays::of(&solved.solution, &solved.board, height),
        }
    }

    /// Of the frame so many after this one.
    fn pose(&self, frame: usize, after: isize) -> Option<Pose> {
        let at = frame.checked_add_signed(after)?;
        self.poses.get(at).copied().flatten()
    }

    /// `None`: the frame has no pose, or no neighbour has one.
    fn around(&self, frame: usize) -> Option<Around> {
        NODES.into_iter().find_map(|nodes| {
            let poses = nodes.iter().map(|after| self.pose(frame, *after));
            Some(Around {
                nodes: nodes.iter().map(|after| *after as f64).collect(),
                poses: poses.collect::<Option<_>>()?,
            })
        })
    }

    fn all_still(&self, seen: &[FrameSeen], share: f64) -> Vec<FrameSeen> {
        let frames = seen.par_iter().enumerate();
        frames
            .map(|(frame, seen)| match self.around(frame) {
                Some(around) => self.rows.frame_still(seen, &around, share),
                None => seen.clone(),
            })
            .collect()
    }

    /// Cost with that readout of all frames that lie between others, lens and board being as they are: squared standard deviations.
    fn cost(&self, seen: &[FrameSeen], share: f64) -> f64 {
        let Solved {
            board, solution, ..
        } = self.solved;
        let each = seen.par_iter().enumerate().filter_map(|(frame, seen)| {
            let around = self.around(frame).filter(Around::is_between)?;
            let start = self.pose(frame, 0)?;
            let still = self.rows.frame_still(seen, &around, share);
            let (sighting, _) = sighting(&still, board, Some(&solution.lens));
            let observations = &sighting.observations;
            let found = fit(
                &solution.lens,
                &solution.points,
                observations,
                &start,
                solution.noise_px,
            )?;
            Some(found.cost)
        });
        each.sum()
    }

    /// Of a frame's time, the readout with which the cost is least, and its standard deviation, found from `share` on; `None`: the cost has no least.
    fn best_share(&self, seen: &[FrameSeen], mut share: f64) -> Option<(f64, f64)> {
        let cost = |share| self.cost(seen, share);
        for _ in 0..STEPS {
            let [below, here, above] = [share - STEP, share, share + STEP].map(cost);
            let curvature = (below + above - 2.0 * here) / (STEP * STEP);
            if curvature <= 0.0 {
                // Still far from the least: on towards it.
                share += if above < below { STEP } else { -STEP };
                continue;
            }
            let step = 0.5 * (below - above) / STEP / curvature;
            share += step.clamp(-2.0 * STEP, 2.0 * STEP);
            let sigma = (2.0 / curvature).sqrt();
            if step.abs() < 0.2 * sigma.min(STEP) {
                return Some((share, sigma));
            }
        }
        None
    }
}
