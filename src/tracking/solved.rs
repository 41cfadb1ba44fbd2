//! Lens, board and all poses from what the frames show.

use super::TrackError;
use super::board::Board;
use super::bundle::Solution;
use super::detector::FrameSeen;
use super::learning::learn_from;
use super::options::TrackOptions;
use super::tracker::{TrackedFrame, pose_all};

/// What frames come to.
#[derive(Clone, Debug)]
pub struct Solved {
    pub board: Board,
    pub solution: Solution,
    /// Frames that lens and board were learnt from.
    pub learnt_from: usize,
    pub frames: Vec<TrackedFrame>,
}

/// Learns lens and board, then finds every pose.
///
/// # Errors
/// As [`learn_from`].
pub fn solve(
    options: &TrackOptions,
    seen: &[FrameSeen],
    size: (usize, usize),
) -> Result<Solved, TrackError> {
    let (board, solution, learnt_from) = learn_from(options, seen, size)?;
    let frames = pose_all(seen, &board, &solution);
    Ok(Solved {
        board,
        solution,
        learnt_from,
        frames,
    })
}
