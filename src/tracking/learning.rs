//! Lens and board from what the frames of a video show.

use super::TrackError;
use super::board::{Board, BoardKind};
use super::bundle::Solution;
use super::calibrate::{
    LensKnowledge, MOST_FOCAL_SIGMA, Sighting, learn, learn_on, lens_of_squares,
};
use super::detector::{FrameSeen, sighting};
use super::layout::{Corners, find_layout};
use super::options::{Target, TrackOptions};

/// Frames that lens and board are learnt from at most.
const MOST_KEYFRAMES: usize = 120;
/// Beyond this a board cannot be what the frames show.
const WORST_BOARD_RMS_PX: f64 = 2.5;

/// Frames that show the most, spread over the video.
fn keyframes(sightings: &[Sighting]) -> Vec<&Sighting> {
    let useful: Vec<&Sighting> = sightings
        .iter()
        .filter(|s| s.observations.len() >= 4)
        .collect();
    let bin = useful.len().div_ceil(MOST_KEYFRAMES).max(1);
    let best = useful
        .chunks(bin)
        .filter_map(|chunk| chunk.iter().max_by_key(|s| s.observations.len()));
    best.copied().collect()
}

/// Lens and board from what the frames show.
///
/// # Errors
/// Too little is seen, the board does not fit, or the frames do not determine the lens.
pub fn learn_from(
    options: &TrackOptions,
    frames: &[FrameSeen],
    (width, height): (usize, usize),
) -> Result<(Board, Solution, usize), TrackError> {
    let knowledge = match options.lens {
        Some(lens) if options.fix_lens => LensKnowledge::Fixed(lens),
        Some(lens) => LensKnowledge::Start(lens),
        None => LensKnowledge::Unknown { width, height },
    };
    let board = match &options.target {
        Target::Board(board) => board.clone(),
        Target::Markers { side_m } => layout_of(frames, *side_m, &knowledge)?,
    };
    let sightings: Vec<Sighting> = frames.iter().map(|f| sighting(f, &board, None).0).collect();
    let chosen = keyframes(&sightings);
    let count = chosen.len();
    let Some(mut solution) = learn(&chosen, &board, options.flatness, knowledge) else {
        return Err(TrackError::input(format!(
            "{count} frames show enough of the board, and no camera fits them; expected several frames with four corners or more; film the board so that it fills more of the picture"
        )));
    };
    // Corners of straight sides need the lens, and the lens needs corners.
    for _ in 0..2 {
        let lens = solution.lens;
        let straight: Vec<Sighting> = (frames.iter())
            .map(|frame| sighting(frame, &board, Some(&lens)).0)
            .collect();
        let chosen = keyframes(&straight);
        if let Some(better) = learn_on(
            &solution,
            &chosen,
            &board,
            options.flatness,
            options.fix_lens,
        ) {
            solution = better;
        }
    }
    check_fit(&board, &solution)?;
    if !options.fix_lens {
        check_focal(&solution)?;
    }
    Ok((board, solution, count))
}

fn layout_of(
    frames: &[FrameSeen],
    side_m: f64,
    knowledge: &LensKnowledge,
) -> Result<Board, TrackError> {
    let corners: Vec<Corners> = frames
        .iter()
        .filter_map(|frame| match frame {
            FrameSeen::Markers(seen) => {
                Some(seen.markers.iter().map(|m| (m.id, m.corners)).collect())
            }
            _ => None,
        })
        .collect();
    let mut useful: Vec<&Corners> = corners.iter().filter(|c| !c.is_empty()).collect();
    let step = useful.len().div_ceil(MOST_KEYFRAMES).max(1);
    useful = useful.into_iter().step_by(step).collect();
    let lens = match knowledge {
        LensKnowledge::Start(lens) | LensKnowledge::Fixed(lens) => *lens,
        LensKnowledge::Unknown { width, height } => lens_of_squares(&useful, *width, *height),
    };
    find_layout(&useful, &lens, side_m).ok_or_else(|| {
        TrackError::input(
            "no frame shows a marker; expected markers in some; film them so that they fill more of the picture",
        )
    })
}

fn check_fit(board: &Board, solution: &Solution) -> Result<(), TrackError> {
    if solution.noise_px < WORST_BOARD_RMS_PX {
        return Ok(());
    }
    let hint = match board.kind {
        BoardKind::Found { .. } => {
            "markers that move against one another are no board; film those that rest"
        }
        BoardKind::Chessboard { .. } => "count the inner corners again",
        BoardKind::Markers | BoardKind::Charuco { .. } => {
            "measure sides and gaps again, look at the order of the ids and their turns, or leave the board out and give --marker-size"
        }
    };
    Err(TrackError::input(format!(
        "the board does not fit what the frames show: {:.1} px are left; expected less than {WORST_BOARD_RMS_PX}; {hint}",
        solution.noise_px
    )))
}

fn check_focal(solution: &Solution) -> Result<(), TrackError> {
    let share = solution.covariance[(0, 0)].sqrt() / solution.lens.focal.x;
    if share <= MOST_FOCAL_SIGMA {
        return Ok(());
    }
    Err(TrackError::input(format!(
        "the frames do not determine the lens: its focal length is {:.0} px, give or take {:.0}%; expected {:.0}% at most; move the camera sideways and tilt it, or give --intrinsics",
        solution.lens.focal.x,
        100.0 * share,
        100.0 * MOST_FOCAL_SIGMA
    )))
}
