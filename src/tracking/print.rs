//! Boards to print, as SVG or PDF, with a ruler that shows whether the printer kept the scale.

use std::fmt::Write;

use glam::DVec2;

use super::TrackError;
use super::board::{Board, BoardKind, is_dark};
use super::code::Code;

mod pdf;

/// White around the outermost markers, metres.
const MARGIN_M: f64 = 0.015;
/// Of the ruler, millimetres.
const RULER_MM: f64 = 100.0;
const RULER_SPACE_MM: f64 = 12.0;
const LINE_MM: f64 = 0.1;
const LETTERS_MM: f64 = 3.5;
const ADVICE: &str = "100 mm: measure, and print at 100% if it is not";

/// What is printed, in millimetres from the upper left corner of the paper, y down.
#[derive(Clone, Debug)]
pub struct Sheet {
    size: DVec2,
    /// Black quads, their corners in order.
    squares: Vec<[DVec2; 4]>,
    /// Below them: upper left corner of each line, and how long it is downwards.
    ruler: Vec<(DVec2, f64)>,
    /// Where the ruler's advice begins.
    advice: DVec2,
}

impl Board {
    /// # Errors
    /// Markers of no family, or that do not lie in one plane.
    pub fn sheet(&self) -> Result<Sheet, TrackError> {
        let (squares, size) = match self.kind {
            BoardKind::Chessboard {
                columns,
                rows,
                square_m,
            } => chessboard(columns + 1, rows + 1, square_m, false),
            BoardKind::Charuco {
                columns,
                rows,
                square_m,
                is_legacy,
            } => {
                let (mut squares, size) = chessboard(columns, rows, square_m, is_legacy);
                let middle = 0.5 * size;
                let (markers, _) = self.markers(-1e-3 * middle)?;
                squares.extend(markers);
                (squares, size)
            }
            BoardKind::Markers | BoardKind::Found { .. } => {
                let places = self.points.iter().map(|p| DVec2::new(p.x, p.z));
                let (least, _) =
                    places.fold((DVec2::MAX, DVec2::MIN), |(a, b), p| (a.min(p), b.max(p)));
                self.markers(least - MARGIN_M)?
            }
        };
        let ruler = DVec2::new(10.0, size.y + 4.0);
        let line = |mm: u32| {
            let length = match mm {
                mm if mm.is_multiple_of(10) => 4.0,
                mm if mm.is_multiple_of(5) => 2.5,
                _ => 1.5,
            };
            let left = f64::from(mm) - 0.5 * LINE_MM;
            (ruler + DVec2::new(left, 0.0), length)
        };
        Ok(Sheet {
            size: DVec2::new(size.x.max(RULER_MM + 20.0), size.y + RULER_SPACE_MM + 8.0),
            squares,
            ruler: (0..=RULER_MM as u32).map(line).collect(),
            advice: ruler + DVec2::new(0.0, 9.0),
        })
    }

    /// Black cells, `origin` being the sheet's upper left corner, metres; and where the last of them ends.
    fn markers(&self, origin: DVec2) -> Result<(Vec<[DVec2; 4]>, DVec2), TrackError> {
        let family = match &self.code {
            Some(Code::Family(family)) if family.is_ringed => {
                return Err(TrackError::input(
                    "markers with cells around their border are not printed; expected another `family`; print the pictures that AprilTag's authors give (github.com/AprilRobotics/apriltag-imgs)",
                ));
            }
            Some(Code::Family(family)) => *family,
            Some(Code::Patterns(_)) => {
                return Err(TrackError::input(
                    "the board's markers are patterns, whose files are too coarse to print; expected a `family`; print the pictures that they were made from",
                ));
            }
            None => {
                return Err(TrackError::input(
                    "the board names no family; expected `family` at its top; add it",
                ));
            }
        };
        if self.points.iter().any(|p| p.y.abs() > 1e-9) {
            return Err(TrackError::input(
                "the board is not in the plane y = 0; expected one sheet; print its sides one by one",
            ));
        }
        let most = self
            .points
            .iter()
            .fold(DVec2::MIN, |most, p| most.max(DVec2::new(p.x, p.z)));
        let side = family.side_cells();
        // Borders of one and a half cells are cut in halves.
        let per_cell = if family.border.fract() == 0.0 { 1 } else { 2 };
        let count = (side * f64::from(per_cell)).round() as usize;
        let mut squares = Vec::new();
        for (id, first) in &self.markers {
            let corner = |k: usize| {
                let p = self.points[first + k];
                1e3 * (DVec2::new(p.x, p.z) - origin)
            };
            let (across, down) = (corner(1) - corner(0), corner(3) - corner(0));
            for y in 0..count {
                for x in 0..count {
                    let cell = |k: usize| (k as f64 + 0.5) / f64::from(per_cell) - family.border;
                    let inside = |c: f64| c >= 0.0 && c < family.cells as f64;
                    let (column, row) = (cell(x), cell(y));
                    let is_white = inside(column)
                        && inside(row)
                        && family.is_white(*id, column as usize, row as usize);
                    if !is_white {
                        let at = |x: usize, y: usize| {
                            corner(0)
                                + across * (x as f64 / count as f64)
                                + down * (y as f64 / count as f64)
                        };
                        squares.push([at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]);
                    }
                }
            }
        }
        Ok((squares, 1e3 * (most - origin + MARGIN_M)))
    }
}

impl Sheet {
    pub fn svg(&self) -> String {
        let DVec2 {
            x: width,
            y: height,
        } = self.size;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" viewBox=\"0 0 {width:.3} {height:.3}\">\n<rect width=\"{width:.3}\" height=\"{height:.3}\" fill=\"white\"/>\n"
        );
        for square in &self.squares {
            let points = square.map(|p| format!("{:.4},{:.4}", p.x, p.y)).join(" ");
            let _ = writeln!(text, "<polygon points=\"{points}\"/>");
        }
        for (corner, length) in &self.ruler {
            let _ = writeln!(
                text,
                "<rect x=\"{:.3}\" y=\"{:.3}\" width=\"{LINE_MM}\" height=\"{length}\"/>",
                corner.x, corner.y
            );
        }
        let _ = writeln!(
            text,
            "<text x=\"{}\" y=\"{:.3}\" font-size=\"{LETTERS_MM}\" font-family=\"sans-serif\">{ADVICE}</text>\n</svg>",
            self.advice.x, self.advice.y
        );
        text
    }
}

fn chessboard(
    columns: usize,
    rows: usize,
    square_m: f64,
    is_legacy: bool,
) -> (Vec<[DVec2; 4]>, DVec2) {
    let (side, margin) = (1e3 * square_m, 1e3 * MARGIN_M);
    let cells = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    let dark = cells.filter(|(x, y)| is_dark((*x, *y), rows, is_legacy));
    let square = |(x, y): (usize, usize)| {
        let at = |x: usize, y: usize| margin + side * DVec2::new(x as f64, y as f64);
        [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
    };
    let size = side * DVec2::new(columns as f64, rows as f64) + 2.0 * margin;
    (dark.map(square).collect(), size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::Family;

    #[test]
    fn a_marker_is_its_black_cells_and_the_ruler_has_its_length() {
        let mut board = Board::grid((1, 1), &[5], (0.04, 0.01), 0);
        assert!(board.sheet().unwrap_err().to_string().contains("family"));
        let family = Family::named("aruco-4x4").unwrap();
        board.code = Some(Code::Family(family));
        let sheet = board.sheet().unwrap();
        let svg = sheet.svg();
        let white = family.codes[5].count_ones() as usize;
        assert_eq!(svg.matches("<polygon").count(), 36 - white);
        assert_eq!(svg.matches("width=\"0.1\"").count(), 101);
        let pdf = String::from_utf8_lossy(&sheet.pdf()).into_owned();
        let lines = |end: &str| pdf.lines().filter(|line| line.ends_with(end)).count();
        assert_eq!((lines(" m"), lines(" re")), (36 - white, 101));
        // Points, of which 72 are an inch: the sheet of 70 mm and a ruler's space, and its ruler's 20 mm beside.
        let size = [120.0, 90.0].map(|mm| mm / 25.4 * 72.0);
        let numbers = pdf.split("/MediaBox [0 0 ").nth(1).unwrap();
        let numbers = numbers.split(']').next().unwrap().split(' ');
        for (found, expected) in numbers.zip(size) {
            let found: f64 = found.parse().unwrap();
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
        let chess = Board::chessboard(6, 4, 0.03).sheet().unwrap().svg();
        let charuco = Board {
            code: Some(Code::Family(family)),
            ..Board::charuco((5, 4), (0.04, 0.03), true)
        };
        let black: usize = (0..10)
            .map(|id| 36 - family.codes[id].count_ones() as usize)
            .sum();
        assert_eq!(
            charuco.sheet().unwrap().svg().matches("<polygon").count(),
            10 + black
        );
        assert_eq!(chess.matches("<polygon").count(), 18);
    }
}
