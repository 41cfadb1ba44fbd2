//! What the first frames decide for all: the markers' code, and how codes become light.

use super::TrackError;
use super::choice::{Choice, choose_code};
use super::detector::Detector;
use super::light::{Luma, Tone};
use super::options::{Target, TrackOptions};
use super::tone::estimate_tone;

/// Decides by the first frames how all are looked at.
///
/// # Errors
/// They show no marker of the family, or markers of several sizes of evidence too weak to tell.
pub fn prepare(
    options: &TrackOptions,
    first: &[Luma],
) -> Result<(Detector, Option<Choice>), TrackError> {
    let chessboard = options.target.chessboard();
    let choice = match chessboard {
        Some(_) => None,
        None => {
            let of_board = match &options.target {
                Target::Board(board) => board.code.as_ref(),
                Target::Markers { .. } => None,
            };
            Some(choose_code(first, options.code.as_ref().or(of_board))?)
        }
    };
    let codes = choice.iter().map(|choice| choice.code.clone()).collect();
    let mut detector = Detector {
        chessboard,
        codes,
        charuco: options.target.charuco(),
        tone: options.tone.unwrap_or(Tone::Srgb),
    };
    // A chessboard's corners are the same in any tone.
    if options.tone.is_none() && chessboard.is_none() {
        detector.tone = estimate_tone(&detector, options, first).unwrap_or(Tone::Srgb);
    }
    Ok((detector, choice))
}
