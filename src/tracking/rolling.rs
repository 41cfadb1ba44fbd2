//! Rows that a sensor reads one after the other: what a frame shows is put back to where it was in the middle of the frame's time.
//!
//! A row is off by the way that the picture has gone between the row's own time and the middle, which the poses of neighbouring frames tell. Poses follow
//! from corners and corners from poses, so all is solved again, a few times.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::TrackError;
use super::bundle::Solution;
use super::detector::{FrameSeen, sighting};
use super::frame_pose::{Observation, fit};
use super::lens::Lens;
use super::marker::{Marker, Seen};
use super::options::{Readout, TrackOptions};
use super::pose::Pose;
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
        frames_as_they_came: posed
            .filter(|frame| motion.around(*frame).is_none())
            .count(),
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

/// Frames, by how many they come after one, that tell how things move in it: the first of these sets that all have a pose.
const NODES: [&[isize]; 6] = [
    &[-2, -1, 0, 1, 2],
    &[-1, 0, 1],
    &[0, 1, 2],
    &[-2, -1, 0],
    &[0, 1],
    &[-1, 0],
];

/// Poses around a frame's own.
struct Around {
    nodes: &'static [isize],
    poses: Vec<Pose>,
}

impl Around {
    /// Frames before and after it tell its motion.
    fn is_between(&self) -> bool {
        self.nodes.first() < Some(&0) && self.nodes.last() > Some(&0)
    }

    /// `None`: one of the poses has the point behind it.
    fn path(&self, lens: &Lens, point: DVec3) -> Option<Path> {
        let places = self.poses.iter().map(|pose| {
            let seen = pose.of(point);
            let ideal = DVec2::new(seen.x, seen.y) / seen.z;
            (seen.z > 1e-6).then(|| lens.pixel_of(ideal))
        });
        Some(Path {
            nodes: self.nodes,
            places: places.collect::<Option<_>>()?,
        })
    }
}

/// Where a point of the board is in the pictures around a frame.
struct Path {
    nodes: &'static [isize],
    places: Vec<DVec2>,
}

impl Path {
    /// Pixels from where it is in the frame to where it is so many frames later, on the polynomial through all places (Lagrange).
    fn way(&self, frames: f64) -> DVec2 {
        let each = self.nodes.iter().zip(&self.places).map(|(node, place)| {
            let others = self.nodes.iter().filter(|other| *other != node);
            let weight: f64 = others
                .map(|other| (frames - *other as f64) / (node - other) as f64)
                .product();
            let own = if *node == 0 { 1.0 } else { 0.0 };
            *place * (weight - own)
        });
        each.sum()
    }
}

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

    /// `None`: the frame has no pose, or no neighbour has one.
    fn around(&self, frame: usize) -> Option<Around> {
        NODES.into_iter().find_map(|nodes| {
            let poses = nodes.iter().map(|after| self.pose(frame, *after));
            Some(Around {
                nodes,
                poses: poses.collect::<Option<_>>()?,
            })
        })
    }

    /// From the frame's middle to the time of a row, in frames, where readout takes that share of one.
    fn time_of(&self, place: DVec2, share: f64) -> f64 {
        share * ((place.y - 0.5) / self.last_row - 0.5)
    }

    fn all_still(&self, seen: &[FrameSeen], share: f64) -> Vec<FrameSeen> {
        let frames = seen.par_iter().enumerate();
        frames
            .map(|(frame, seen)| match self.around(frame) {
                Some(around) => self.frame_still(seen, &around, share),
                None => seen.clone(),
            })
            .collect()
    }

    /// All that is seen, where it was in the middle of the frame's time.
    fn frame_still(&self, seen: &FrameSeen, around: &Around, share: f64) -> FrameSeen {
        let Solution { lens, points, .. } = &self.solved.solution;
        let observed = |all: &[Observation]| -> Vec<Observation> {
            let each = all.iter().map(|o| {
                let path = around.path(lens, points[o.point]);
                let way = path.map(|path| path.way(self.time_of(o.pixel, share)));
                Observation {
                    pixel: o.pixel - way.unwrap_or_default(),
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
                    .map(|marker| self.marker_still(marker, around, share))
                    .collect(),
                between: observed(&seen.between),
                ..seen.clone()
            }),
        }
    }

    /// Along a side the way goes evenly from one corner's to the next.
    fn marker_still(&self, marker: &Marker, around: &Around, share: f64) -> Marker {
        let Solution { lens, points, .. } = &self.solved.solution;
        let Some(first) = self.solved.board.markers.get(&marker.id) else {
            return marker.clone();
        };
        let paths = (0..4).map(|k| around.path(lens, points[first + k]));
        let Some(paths) = paths.collect::<Option<Vec<Path>>>() else {
            return marker.clone();
        };
        let moved = |side: usize, place: DVec2| {
            let next = (side + 1) % 4;
            let (from, to) = (marker.corners[side], marker.corners[next]);
            let along = (place - from).dot(to - from) / from.distance_squared(to);
            let frames = self.time_of(place, share);
            place - paths[side].way(frames).lerp(paths[next].way(frames), along)
        };
        Marker {
            corners: std::array::from_fn(|k| moved(k, marker.corners[k])),
            sides: marker.sides.moved(moved),
            ..marker.clone()
        }
    }

    /// Cost with that readout of all frames that lie between others, lens and board being as they are: squared standard deviations.
    fn cost(&self, seen: &[FrameSeen], share: f64) -> f64 {
        let Solved {
            board, solution, ..
        } = self.solved;
        let each = seen.par_iter().enumerate().filter_map(|(frame, seen)| {
            let around = self.around(frame).filter(Around::is_between)?;
            let start = self.pose(frame, 0)?;
            let still = self.frame_still(seen, &around, share);
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
