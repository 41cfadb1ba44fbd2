//! What the first frames decide for all: the family, and how codes become light.

use super::TrackError;
use super::choice::{Choice, choose_family};
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
                Target::Board(board) => board.family,
                Target::Markers { .. } => None,
            };
            Some(choose_family(first, options.family.or(of_board))?)
        }
    };
    let families = choice.iter().map(|choice| choice.family).collect();
    let mut detector = Detector {
        chessboard,
        families,
        tone: options.tone.unwrap_or(Tone::Srgb),
    };
    // A chessboard's corners are the same in any tone.
    if options.tone.is_none() && chessboard.is_none() {
        detector.tone = estimate_tone(&detector, options, first).unwrap_or(Tone::Srgb);
    }
    Ok((detector, choice))
}
