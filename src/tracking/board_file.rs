//! Boards as files describe them: TOML of this program, and Kalibr's YAML of AprilTag grids and checkerboards.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::TrackError;
use super::board::{Board, BoardKind, square};
use super::code::Code;
use super::families::FAMILIES;
use super::family::Family;
use super::pattern::Pattern;
use super::patterns::{Patterns, USUAL_SHARE};
use crate::decode::{MAX_TEXT_BYTES, read_text};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    family: Option<String>,
    /// Pattern files of ARToolKit, by id, from the folder of the board's file.
    patterns: Option<Vec<PathBuf>>,
    /// Of the marker's side, what the pattern fills.
    pattern_share: Option<f64>,
    grid: Option<Grid>,
    chessboard: Option<Chessboard>,
    charuco: Option<Charuco>,
    #[serde(default)]
    marker: Vec<Single>,
}

/// Markers row by row.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Grid {
    columns: usize,
    rows: usize,
    side_m: f64,
    gap_m: f64,
    ids: Option<Vec<u32>>,
    #[serde(default)]
    first_id: u32,
    /// Quarter turns, clockwise.
    #[serde(default)]
    turn: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Chessboard {
    /// Inner corners.
    columns: usize,
    rows: usize,
    square_m: f64,
}

/// Of so many squares.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Charuco {
    columns: usize,
    rows: usize,
    square_m: f64,
    marker_m: f64,
    /// The layout of OpenCV before 4.6.
    #[serde(default)]
    legacy: bool,
}

/// A marker by its upper left corner on the page, or by all of its corners.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Single {
    id: u32,
    side_m: Option<f64>,
    corner_m: Option<[f64; 2]>,
    #[serde(default)]
    turn: usize,
    corners_m: Option<[[f64; 3]; 4]>,
}

/// Reads a board.
///
/// # Errors
/// What cannot be used, with its line where the file is TOML.
pub fn read_board(path: &Path) -> Result<Board, TrackError> {
    let at = |message: String| TrackError::input(format!("{}: {message}", path.display()));
    let text = read_text(path, MAX_TEXT_BYTES).map_err(|error| {
        at(format!(
            "it cannot be read ({error}); expected a board's description; correct the path"
        ))
    })?;
    if text.contains("target_type") {
        return read_kalibr(&text).map_err(at);
    }
    let file: File = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        TrackError::input(format!(
            "{}:{line}: {}; expected [grid], [[marker]], [chessboard] or [charuco] as docs/tracking.md has them; correct it",
            path.display(),
            error.message().replace('\n', ", ")
        ))
    })?;
    let mut board = board_of(&file).map_err(at)?;
    board.code = code_of(&file, path.parent().unwrap_or(Path::new("")), &at)?;
    check_ids(&board).map_err(at)?;
    Ok(board)
}

fn board_of(file: &File) -> Result<Board, String> {
    let kinds = [
        file.grid.is_some(),
        file.chessboard.is_some(),
        file.charuco.is_some(),
        !file.marker.is_empty(),
    ];
    if kinds.into_iter().filter(|is_there| *is_there).count() != 1 {
        return Err("it describes no board, or several; expected one of [grid], [[marker]], [chessboard], [charuco]; keep one".to_owned());
    }
    let board = if let Some(grid) = &file.grid {
        grid_of(grid)?
    } else if let Some(chessboard) = &file.chessboard {
        chessboard_of(chessboard.columns, chessboard.rows, chessboard.square_m)?
    } else if let Some(charuco) = &file.charuco {
        charuco_of(charuco)?
    } else {
        markers_of(&file.marker)?
    };
    Ok(board)
}

/// The family or the patterns that the file names, if it names any.
fn code_of(
    file: &File,
    folder: &Path,
    at: &dyn Fn(String) -> TrackError,
) -> Result<Option<Code>, TrackError> {
    match (&file.family, &file.patterns) {
        (Some(_), Some(_)) => Err(at(
            "it has `family` and `patterns`; expected one of them; remove the other".to_owned(),
        )),
        (Some(name), None) => Ok(Some(Code::Family(family_named(name).map_err(at)?))),
        (None, Some(names)) => {
            let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
            read_patterns(&paths, file.pattern_share.unwrap_or(USUAL_SHARE)).map(Some)
        }
        (None, None) => Ok(None),
    }
}

/// Pattern files by id; `share`: of the marker's side, what the picture fills.
///
/// # Errors
/// What cannot be used, or told apart.
pub fn read_patterns(paths: &[PathBuf], share: f64) -> Result<Code, TrackError> {
    let list: Result<Vec<Pattern>, TrackError> =
        paths.iter().map(|path| Pattern::read(path)).collect();
    let patterns = Patterns::new(list?, share).map_err(TrackError::input)?;
    Ok(Code::Patterns(Arc::new(patterns)))
}

fn check_ids(board: &Board) -> Result<(), String> {
    let Some(code) = &board.code else {
        return Ok(());
    };
    let beyond = board
        .markers
        .keys()
        .find(|id| **id as usize >= code.count());
    match beyond {
        Some(id) => Err(format!(
            "{} has no marker {id}; expected ids below {}; correct it",
            code.name(),
            code.count()
        )),
        None => Ok(()),
    }
}

/// A family by its name.
///
/// # Errors
/// There is none of this name.
pub fn family_named(name: &str) -> Result<&'static Family, String> {
    Family::named(name).ok_or_else(|| {
        let names: Vec<&str> = FAMILIES.iter().map(|family| family.name).collect();
        format!(
            "there is no family {name}; expected one of {}; correct it",
            names.join(", ")
        )
    })
}

fn length(metres: f64, what: &str) -> Result<f64, String> {
    match metres > 0.0 && metres < 1e4 {
        true => Ok(metres),
        false => Err(format!(
            "`{what}` is {metres}; expected metres above 0; correct it"
        )),
    }
}

fn cells(columns: usize, rows: usize, least: usize) -> Result<(), String> {
    let fits = |side: usize| (least..=100).contains(&side);
    match fits(columns) && fits(rows) {
        true => Ok(()),
        false => Err(format!(
            "it has {columns} columns and {rows} rows; expected {least} to 100 of each; correct it"
        )),
    }
}

fn grid_of(grid: &Grid) -> Result<Board, String> {
    cells(grid.columns, grid.rows, 1)?;
    let side_m = length(grid.side_m, "side_m")?;
    let gap_m = length(grid.gap_m, "gap_m")?;
    let count = grid.columns * grid.rows;
    let ids = match &grid.ids {
        Some(ids) => ids.clone(),
        None => (grid.first_id..).take(count).collect(),
    };
    let mut sorted = ids.clone();
    sorted.sort_unstable();
    sorted.dedup();
    if ids.len() != count || sorted.len() != count {
        return Err(format!(
            "{} different ids stand in `ids`; expected {count}, row by row; complete them",
            sorted.len()
        ));
    }
    Ok(Board::grid(
        (grid.columns, grid.rows),
        &ids,
        (side_m, gap_m),
        grid.turn,
    ))
}

fn chessboard_of(columns: usize, rows: usize, square_m: f64) -> Result<Board, String> {
    cells(columns, rows, 2)?;
    Ok(Board::chessboard(
        columns,
        rows,
        length(square_m, "square_m")?,
    ))
}

fn charuco_of(charuco: &Charuco) -> Result<Board, String> {
    cells(charuco.columns, charuco.rows, 2)?;
    let square_m = length(charuco.square_m, "square_m")?;
    let marker_m = length(charuco.marker_m, "marker_m")?;
    if marker_m > 0.95 * square_m {
        return Err(format!(
            "`marker_m` is {marker_m} in squares of {square_m}; expected a light margin around the markers; correct it"
        ));
    }
    let size = (charuco.columns, charuco.rows);
    Ok(Board::charuco(size, (square_m, marker_m), charuco.legacy))
}

fn markers_of(markers: &[Single]) -> Result<Board, String> {
    let mut board = Board::empty(BoardKind::Markers);
    for marker in markers {
        let corners = match (marker.corners_m, marker.corner_m, marker.side_m) {
            (Some(corners), None, None) => corners.map(DVec3::from),
            (None, Some(corner), Some(side)) => {
                square(DVec2::from(corner), length(side, "side_m")?, marker.turn)
            }
            _ => {
                return Err(format!(
                    "marker {} is not placed; expected `corners_m`, or `corner_m` and `side_m`; correct it",
                    marker.id
                ));
            }
        };
        if board.markers.contains_key(&marker.id) {
            return Err(format!(
                "marker {} is there twice; expected each id once; remove one",
                marker.id
            ));
        }
        board.add(marker.id, corners);
    }
    Ok(board)
}

/// Its rows count from the bottom; the spacing is a share of the tag's side.
fn read_kalibr(text: &str) -> Result<Board, String> {
    let value = |key: &str| {
        let mut lines = text
            .lines()
            .filter_map(|line| line.split('#').next()?.split_once(':'));
        let found = lines.find(|(name, _)| name.trim() == key)?;
        Some(found.1.trim().trim_matches(['\'', '"']).to_owned())
    };
    let number = |key: &str| {
        let parsed = value(key).and_then(|text| text.parse::<f64>().ok());
        parsed.ok_or_else(|| {
            format!("it lacks `{key}`; expected Kalibr's description of its target; add it")
        })
    };
    let count = |key: &str| number(key).map(|n| n as usize);
    match value("target_type").as_deref() {
        Some("aprilgrid") => {
            let (columns, rows) = (count("tagCols")?, count("tagRows")?);
            cells(columns, rows, 1)?;
            let side_m = length(number("tagSize")?, "tagSize")?;
            let gap_m = length(number("tagSpacing")?, "tagSpacing")? * side_m;
            let ids: Vec<u32> = (0..rows)
                .rev()
                .flat_map(|row| (0..columns).map(move |column| (row * columns + column) as u32))
                .collect();
            let mut board = Board::grid((columns, rows), &ids, (side_m, gap_m), 0);
            board.code = Some(Code::Family(family_named("apriltag-36h11")?));
            Ok(board)
        }
        Some("checkerboard") => chessboard_of(
            count("targetCols")?,
            count("targetRows")?,
            number("rowSpacingMeters")?,
        ),
        other => Err(format!(
            "its target is {}; expected aprilgrid or checkerboard; describe it in TOML",
            other.unwrap_or("not named")
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Board, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("board");
        std::fs::write(&path, text).unwrap();
        read_board(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn a_grid_has_its_middle_at_the_origin_and_its_rows_down_the_page() {
        let board = read(
            "family = \"aruco-4x4\"\n[grid]\ncolumns = 4\nrows = 3\nside_m = 0.04\ngap_m = 0.02\n",
        )
        .unwrap();
        assert_eq!(board.points.len(), 48);
        assert!((board.points[0] - DVec3::new(-0.11, 0.0, -0.08)).length() < 1e-12);
        assert!((board.points[47] - DVec3::new(0.07, 0.0, 0.08)).length() < 1e-12);
        assert!(board.middle().length() < 1e-12);
    }

    #[test]
    fn kalibrs_rows_count_from_the_bottom() {
        let board = read(
            "target_type: 'aprilgrid'\ntagCols: 3\ntagRows: 2\ntagSize: 0.06\ntagSpacing: 0.25\n",
        )
        .unwrap();
        let corner = |id: u32| board.points[board.markers[&id]];
        assert!(corner(0).z > corner(3).z && corner(2).x > corner(0).x);
        assert_eq!(board.code.unwrap().name(), "apriltag-36h11");
    }

    #[test]
    fn what_cannot_be_used_says_how_to_mend_it() {
        let cases = [
            ("", "keep one"),
            ("[grid]\ncolumns = 4\nrow = 3\n", ":3: unknown field `row`"),
            (
                "[grid]\ncolumns = 4\nrows = 3\nside_m = -1\ngap_m = 0.02\n",
                "expected metres above 0",
            ),
            (
                "[grid]\ncolumns = 2\nrows = 1\nside_m = 1\ngap_m = 0.02\nids = [1, 1]\n",
                "expected 2, row by row",
            ),
            (
                "[[marker]]\nid = 3\nside_m = 0.1\n",
                "marker 3 is not placed",
            ),
            (
                "family = \"apriltag-16h5\"\n[[marker]]\nid = 30\nside_m = 0.1\ncorner_m = [0, 0]\n",
                "expected ids below 30",
            ),
            (
                "target_type: 'circlegrid'\n",
                "expected aprilgrid or checkerboard",
            ),
        ];
        for (text, expected) in cases {
            let problem = read(text).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }
}
