//! Rows that a sensor reads one after the other: what a frame shows is put back to where it was in the middle of the frame's time.
//!
//! A row is off by the way that the picture has gone between the row's own time and the middle: the picture's velocity there, which the poses of
//! neighbouring frames tell, times what lies between. Poses follow from corners and corners from poses, so all is solved again, a few times.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::TrackError;
use super::detector::{FrameSeen, sighting};
use super::edge::Sides;
use super::frame_pose::{Observation, fit};
use super::lens::Lens;
use super::marker::{Marker, Seen};
use super::options::{Readout, TrackOptions};
use super::pose::Pose;
use super::quad::Quad;
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
    let Some(rate) = frames_per_second else {
        return Err(TrackError::input(
            "a readout time says nothing where the time between frames is unknown; expected a Y4M stream, which has a rate; convert the video with ffmpeg -i VIDEO -f yuv4mpegpipe, or leave out --readout-time",
        ));
    };
    let period = 1.0 / rate;
    let mut share = match readout {
        Readout::Known(secs) => secs / period,
        Readout::Solve => 0.0,
    };
    if share.abs() > 1.0 {
        return Err(TrackError::input(format!(
            "rows are read in {:.1} ms, and a frame takes {:.1} ms; expected no more than that; see the sensor's data again",
            1e3 * share.abs() * period,
            1e3 * period
        )));
    }
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
        frames_as_they_came: posed.filter(|frame| motion.ways(*frame).is_none()).count(),
    };
    Ok((solved, rows))
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
    /// Its number, from 0.
    last_row: f64,
}

/// Poses nearby and the share of each in the velocity: pixels a frame are their places, weighted.
type Ways = Vec<(Pose, f64)>;

impl<'a> Motion<'a> {
    fn of(solved: &'a Solved, height: usize) -> Self {
        let poses = solved.frames.iter();
        Self {
            solved,
            poses: poses
                .map(|frame| frame.pose.as_ref().ok().map(|pose| pose.fit.pose))
                .collect(),
            last_row: (height as f64 - 1.0).max(1.0),
        }
    }

    /// Of the frame so many after this one.
    fn pose(&self, frame: usize, after: isize) -> Option<Pose> {
        let at = frame.checked_add_signed(after)?;
        self.poses.get(at).copied().flatten()
    }

    /// The best difference that the neighbours allow; `None`: none has a pose.
    fn ways(&self, frame: usize) -> Option<Ways> {
        const DIFFERENCES: [&[(isize, f64)]; 4] = [
            &[
                (-2, 1.0 / 12.0),
                (-1, -8.0 / 12.0),
                (1, 8.0 / 12.0),
                (2, -1.0 / 12.0),
            ],
            &[(-1, -0.5), (1, 0.5)],
            &[(0, -1.0), (1, 1.0)],
            &[(-1, -1.0), (0, 1.0)],
        ];
        DIFFERENCES.into_iter().find_map(|difference| {
            let each = difference.iter();
            each.map(|(after, weight)| Some((self.pose(frame, *after)?, *weight)))
                .collect()
        })
    }

    fn lens(&self) -> &Lens {
        &self.solved.solution.lens
    }

    /// Pixels a frame; `None`: one of the poses has the point behind it.
    fn velocity(&self, ways: &Ways, point: DVec3) -> Option<DVec2> {
        let each = ways.iter().map(|(pose, weight)| {
            let seen = pose.of(point);
            let ideal = DVec2::new(seen.x, seen.y) / seen.z;
            (seen.z > 1e-6).then(|| self.lens().pixel_of(ideal) * *weight)
        });
        each.sum()
    }

    /// Where what is seen at a place was in the middle of the frame's time; the share of a frame that readout takes.
    fn still(&self, place: DVec2, velocity: DVec2, share: f64) -> DVec2 {
        place - velocity * (share * ((place.y - 0.5) / self.last_row - 0.5))
    }

    fn all_still(&self, seen: &[FrameSeen], share: f64) -> Vec<FrameSeen> {
        let frames = seen.par_iter().enumerate();
        frames
            .map(|(frame, seen)| match self.ways(frame) {
                Some(ways) => self.frame_still(seen, &ways, share),
                None => seen.clone(),
            })
            .collect()
    }

    fn frame_still(&self, seen: &FrameSeen, ways: &Ways, share: f64) -> FrameSeen {
        let observed = |all: &[Observation]| -> Vec<Observation> {
            let each = all.iter().map(|o| {
                let velocity = self.velocity(ways, self.solved.solution.points[o.point]);
                Observation {
                    pixel: velocity.map_or(o.pixel, |v| self.still(o.pixel, v, share)),
                    ..*o
                }
            });
            each.collect()
        };
        match seen {
            FrameSeen::Lost(why) => FrameSeen::Lost(why.clone()),
            FrameSeen::Corners(corners) => FrameSeen::Corners(observed(corners)),
            FrameSeen::Markers(seen) => FrameSeen::Markers(Seen {
                markers: (seen.markers.iter())
                    .map(|marker| self.marker_still(marker, ways, share))
                    .collect(),
                between: observed(&seen.between),
                ..seen.clone()
            }),
        }
    }

    /// Along a side the velocity goes evenly from one corner's to the next.
    fn marker_still(&self, marker: &Marker, ways: &Ways, share: f64) -> Marker {
        let Some(first) = self.solved.board.markers.get(&marker.id) else {
            return marker.clone();
        };
        let mut velocities: Quad = Default::default();
        for (k, velocity) in velocities.iter_mut().enumerate() {
            let point = self.solved.solution.points[first + k];
            let Some(own) = self.velocity(ways, point) else {
                return marker.clone();
            };
            *velocity = own;
        }
        let moved = |side: usize, place: DVec2| {
            let (from, to) = (marker.corners[side], marker.corners[(side + 1) % 4]);
            let along = (place - from).dot(to - from) / from.distance_squared(to);
            let velocity = velocities[side].lerp(velocities[(side + 1) % 4], along);
            self.still(place, velocity, share)
        };
        let sides: Sides = marker.sides.moved(moved);
        Marker {
            corners: std::array::from_fn(|k| moved(k, marker.corners[k])),
            sides,
            ..marker.clone()
        }
    }

    /// Cost of all frames with that readout, lens and board being as they are: squared standard deviations.
    fn cost(&self, seen: &[FrameSeen], share: f64) -> f64 {
        let Solved {
            board, solution, ..
        } = self.solved;
        let each = seen.par_iter().enumerate().filter_map(|(frame, seen)| {
            let (start, ways) = (self.pose(frame, 0)?, self.ways(frame)?);
            let still = self.frame_still(seen, &ways, share);
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
