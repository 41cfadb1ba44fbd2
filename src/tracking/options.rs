//! What is asked of a run.

use std::sync::Arc;

use super::board::{Board, BoardKind, Flatness};
use super::code::Code;
use super::lens::Lens;
use super::light::Tone;

/// What is asked of a run.
#[derive(Clone, Debug)]
pub struct TrackOptions {
    pub target: Target,
    /// `None`: whichever family is found.
    pub code: Option<Code>,
    pub lens: Option<Lens>,
    /// The lens given holds as it is.
    pub fix_lens: bool,
    /// `None`: estimated.
    pub tone: Option<Tone>,
    pub flatness: Flatness,
    /// `None`: all rows are of one time.
    pub readout: Option<Readout>,
}

/// What is known of the time that a sensor takes from its first row to its last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readout {
    /// Seconds; below 0: from the lowest row up.
    Known(f64),
    /// The one with which corners fit best.
    Solve,
}

/// What the camera's poses refer to.
#[derive(Clone, Debug)]
pub enum Target {
    Board(Board),
    /// Markers of this side in metres, wherever they are.
    Markers {
        side_m: f64,
    },
}

impl Target {
    /// Columns and rows of inner corners, if it is one.
    pub fn chessboard(&self) -> Option<(usize, usize)> {
        match self {
            Self::Board(board) => match board.kind {
                BoardKind::Chessboard { columns, rows, .. } => Some((columns, rows)),
                _ => None,
            },
            Self::Markers { .. } => None,
        }
    }

    /// The board, if it is a ChArUco board.
    pub fn charuco(&self) -> Option<Arc<Board>> {
        match self {
            Self::Board(board) if matches!(board.kind, BoardKind::Charuco { .. }) => {
                Some(Arc::new(board.clone()))
            }
            _ => None,
        }
    }
}
