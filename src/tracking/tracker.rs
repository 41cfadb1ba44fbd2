//! Every frame's pose, lens and board being known.

use std::collections::BTreeMap;

use nalgebra::Matrix6;
use rayon::prelude::*;

use super::board::Board;
use super::bundle::{Solution, View};
use super::calibrate::Sighting;
use super::choice::Choice;
use super::detector::{FrameSeen, sighting};
use super::frame_pose::{COVARIANCE_SHARE, Fit, Minima, find_pose, project};
use super::light::Tone;
use super::settle::settle;

/// A frame's pose and how well it is known.
#[derive(Clone, Debug)]
pub struct FramePose {
    pub fit: Fit,
    /// Of the step [`super::pose::Pose::moved`] takes (radians, metres): from the frame's own corners, ...
    pub own_covariance: Matrix6<f64>,
    /// ... and from lens and board, which all frames share.
    pub shared_covariance: Matrix6<f64>,
    /// Pixels, root mean square of the errors' lengths.
    pub rms_px: f64,
    /// Frames around it said which of two poses is meant.
    pub by_neighbours: bool,
}

/// A frame after tracking.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    pub sighting: Sighting,
    /// Ids, in the order of the sighting's groups; none of a chessboard.
    pub ids: Vec<u32>,
    /// Or why there is none.
    pub pose: Result<FramePose, String>,
}

/// All that a run found.
#[derive(Clone, Debug)]
pub struct Tracked {
    pub width: usize,
    pub height: usize,
    pub board: Board,
    /// Lens, board and noise as learnt.
    pub solution: Solution,
    pub choice: Option<Choice>,
    pub tone: Tone,
    pub frames: Vec<TrackedFrame>,
    /// Frames that lens and board were learnt from.
    pub learnt_from: usize,
}

/// Root mean square error in pixels beyond which a frame's pose is none.
pub const WORST_RMS_PX: f64 = 3.0;

/// The pose of every frame.
pub fn pose_all(frames: &[FrameSeen], board: &Board, solution: &Solution) -> Vec<TrackedFrame> {
    let each: Vec<(Sighting, Vec<u32>, Result<Minima, String>)> = frames
        .par_iter()
        .map(|frame| {
            let (sighting, ids) = sighting(frame, board, Some(&solution.lens));
            let minima = minima_of(frame, &sighting, solution);
            (sighting, ids, minima)
        })
        .collect();
    let minima: Vec<Option<&Minima>> = each.iter().map(|(_, _, m)| m.as_ref().ok()).collect();
    let settled = settle(&minima);
    let done = each.into_iter().zip(settled);
    done.map(|((sighting, ids, minima), settled)| {
        let pose = minima.and_then(|_| {
            let (fit, by_neighbours) = settled?;
            finished(fit, by_neighbours, &sighting, solution)
        });
        TrackedFrame {
            sighting,
            ids,
            pose,
        }
    })
    .collect()
}

/// Both poses that fit what a frame shows.
pub fn minima_of(
    frame: &FrameSeen,
    sighting: &Sighting,
    solution: &Solution,
) -> Result<Minima, String> {
    if let FrameSeen::Lost(why) = frame {
        return Err(why.clone());
    }
    if sighting.observations.is_empty() {
        return Err("nothing of the board is seen".to_owned());
    }
    find_pose(
        &solution.lens,
        &solution.points,
        &sighting.observations,
        &sighting.groups,
        solution.noise_px,
    )
    .ok_or_else(|| "no pose fits what is seen".to_owned())
}

fn finished(
    fit: Fit,
    by_neighbours: bool,
    sighting: &Sighting,
    solution: &Solution,
) -> Result<FramePose, String> {
    let rms_px = rms_px(&fit, sighting, solution);
    if rms_px > WORST_RMS_PX {
        return Err(format!("the best pose leaves {rms_px:.1} px"));
    }
    let singular = || "what is seen determines no pose".to_owned();
    let inverse = fit.information.try_inverse().ok_or_else(singular)?;
    let own_covariance = COVARIANCE_SHARE * inverse;
    let view = View {
        pose: fit.pose,
        observations: sighting.observations.clone(),
    };
    let shared_covariance = solution
        .shared_covariance(&view, &fit.information)
        .ok_or_else(singular)?;
    Ok(FramePose {
        fit,
        own_covariance,
        shared_covariance,
        rms_px,
        by_neighbours,
    })
}

/// Root mean square of the errors' lengths, pixels.
pub fn rms_px(fit: &Fit, sighting: &Sighting, solution: &Solution) -> f64 {
    let squares = sighting.observations.iter().map(|o| {
        let point = solution.points[o.point];
        project(&solution.lens, &fit.pose, point, o.pixel).map_or(1e6, |p| p.error.length_squared())
    });
    (squares.sum::<f64>() / sighting.observations.len().max(1) as f64).sqrt()
}

impl Tracked {
    /// Times each marker was seen.
    pub fn counts(&self) -> BTreeMap<u32, usize> {
        let mut counts = BTreeMap::new();
        for id in self.frames.iter().flat_map(|frame| &frame.ids) {
            *counts.entry(*id).or_default() += 1;
        }
        counts
    }

    pub fn posed(&self) -> usize {
        self.frames
            .iter()
            .filter(|frame| frame.pose.is_ok())
            .count()
    }
}
