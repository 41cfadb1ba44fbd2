//! Pattern files of ARToolKit (`.patt`): a picture in a black frame, as `mk_patt` of ARToolKit and the generators for AR.js write it.
//!
//! Text: the picture in four turns, each a quarter further counter-clockwise; of each its blue, green and red codes, row by row from the top left.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::TrackError;
use crate::decode::{MAX_TEXT_BYTES, read_text};

/// A picture that a marker is known by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pattern {
    /// Of its file, without folder and ending.
    pub name: String,
    /// Cells on a side.
    pub side: usize,
    /// Brightness of its cells as the file encodes it, row by row from the top left.
    pub codes: Vec<u8>,
}

/// Cells on a side that a pattern may have.
pub const SIDES: std::ops::RangeInclusive<usize> = 8..=64;
const TURNS: usize = 4;
const COLOURS: usize = 3;
/// Mean difference of codes that two turns of one picture may have: a camera has taken each of them by itself.
const MOST_UNLIKE: f64 = 24.0;

impl Pattern {
    /// Reads a pattern file.
    ///
    /// # Errors
    /// What cannot be used, with its line.
    pub fn read(path: &Path) -> Result<Self, TrackError> {
        let text = read_text(path, MAX_TEXT_BYTES).map_err(|error| {
            TrackError::input(format!(
                "{}: it cannot be read ({error}); expected a pattern file of ARToolKit; correct the path",
                path.display()
            ))
        })?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(&name, &text)
            .map_err(|problem| TrackError::input(format!("{}{problem}", path.display())))
    }

    /// Errors begin with `:` and a line, or with `: `.
    fn parse(name: &str, text: &str) -> Result<Self, String> {
        let mut codes = Vec::new();
        for (line, row) in (1..).zip(text.lines()) {
            for word in row.split_whitespace() {
                let code: u8 = word.parse().map_err(|_| {
                    format!(
                        ":{line}: \"{word}\" is no code; expected whole numbers from 0 to 255; make the pattern file again"
                    )
                })?;
                codes.push(code);
            }
        }
        let side = (codes.len() as f64 / (TURNS * COLOURS) as f64).sqrt() as usize;
        if !SIDES.contains(&side) || side * side * TURNS * COLOURS != codes.len() {
            return Err(format!(
                ": it has {} numbers; expected four turns of three colours of N x N cells, 3072 for 16 x 16, N from {} to {}; make the pattern file again",
                codes.len(),
                SIDES.start(),
                SIDES.end()
            ));
        }
        let mut upright = Self {
            name: name.to_owned(),
            side,
            codes: Vec::new(),
        };
        for (turn, colours) in codes.chunks_exact(COLOURS * side * side).enumerate() {
            let luma = luma(colours);
            if turn == 0 {
                upright.codes = luma;
                continue;
            }
            let expected = upright.turned(TURNS - turn);
            let off = expected.iter().zip(&luma);
            let off: f64 = off.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
            if off > MOST_UNLIKE * luma.len() as f64 {
                return Err(format!(
                    ": its picture {} is not the first one, turned counter-clockwise {turn} times; expected four turns of one picture; make the pattern file again",
                    turn + 1
                ));
            }
        }
        Ok(upright)
    }

    /// Its codes after quarter turns, clockwise in the picture.
    fn turned(&self, turns: usize) -> Vec<u8> {
        (0..turns % TURNS).fold(self.codes.clone(), |codes, _| turned(&codes, self.side))
    }
}

/// Blue, green and red, one after the other, to brightness (BT.601), as of a frame.
fn luma(colours: &[u8]) -> Vec<u8> {
    let count = colours.len() / COLOURS;
    let of = |cell: usize| {
        let colour = |index: usize| f32::from(colours[index * count + cell]);
        (0.114 * colour(0) + 0.587 * colour(1) + 0.299 * colour(2) + 0.5) as u8
    };
    (0..count).map(of).collect()
}

/// Cells row by row after a quarter turn, clockwise in the picture.
pub fn turned<T: Copy>(cells: &[T], side: usize) -> Vec<T> {
    let places = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    places
        .map(|(x, y)| cells[(side - 1 - x) * side + y])
        .collect()
}

/// Cells row by row as a mirror shows them.
pub fn reflected<T: Copy>(cells: &[T], side: usize) -> Vec<T> {
    let rows = cells.chunks_exact(side);
    rows.flat_map(|row| row.iter().rev().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a file: `of` tells the picture's codes (column, row), blue, green and red.
    fn file(side: usize, of: impl Fn(usize, usize) -> [u8; 3]) -> String {
        let mut text = String::new();
        for turn in 0..4 {
            for colour in 0..3 {
                for y in 0..side {
                    for x in 0..side {
                        // Counter-clockwise: the right column becomes the top row.
                        let last = side - 1;
                        let (x, y) = match turn {
                            0 => (x, y),
                            1 => (last - y, x),
                            2 => (last - x, last - y),
                            _ => (y, last - x),
                        };
                        text += &format!("{:4}", of(x, y)[colour]);
                    }
                    text.push('\n');
                }
            }
            text.push('\n');
        }
        text
    }

    #[test]
    fn the_first_turn_is_upright_and_colours_are_brightness() {
        let text = file(9, |x, y| [10 * x as u8, 20 * y as u8, 100]);
        let pattern = Pattern::parse("mine", &text).unwrap();
        assert_eq!((pattern.side, pattern.codes.len()), (9, 81));
        let expected = |x: f32, y: f32| 0.114 * 10.0 * x + 0.587 * 20.0 * y + 29.9;
        for (x, y) in [(0, 0), (8, 0), (3, 5)] {
            let off = f32::from(pattern.codes[y * 9 + x]) - expected(x as f32, y as f32);
            assert!(off.abs() <= 0.5, "{x} {y}: {off}");
        }
        let thrice = pattern.turned(3);
        assert_eq!(thrice[0], pattern.codes[8], "the right column is on top");
        assert_eq!(pattern.turned(4), pattern.codes);
    }

    #[test]
    fn what_is_no_pattern_says_so() {
        let whole = file(16, |x, y| [if x > y { 255 } else { 0 }; 3]);
        assert!(Pattern::parse("mine", &whole).is_ok());
        let refused = |text: &str, part: &str| {
            let problem = Pattern::parse("mine", text).unwrap_err();
            assert!(problem.contains(part), "{problem}");
        };
        refused("", "it has 0 numbers");
        refused(&whole[..whole.len() - 40], "expected four turns");
        refused(&whole.replacen(" 255", " 256", 1), ":1: \"256\" is no code");
        // The first turn four times.
        let turn = whole.find("\n\n").unwrap() + 2;
        refused(&whole[..turn].repeat(4), "picture 2 is not the first one");
    }
}
