//! A board and what was learnt of it: the report of a tracked video, or a board's file as it is.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde::Deserialize;

use super::TrackError;
use super::board::{Board, BoardKind};
use super::board_file::{family_named, read_board};
use super::code::Code;
use super::light::Tone;
use super::pattern::Pattern;
use super::patterns::Patterns;
use crate::decode::{MAX_POSES_BYTES, read_text};

/// Standard deviation of a corner along an axis where paper is taken for flat, pixels.
const NOISE_OF_FLAT_PX: f64 = 0.3;

/// Where the points of a board are, and how well they are seen.
#[derive(Clone, Debug)]
pub struct KnownBoard {
    pub board: Board,
    /// Standard deviation of a corner along an axis, pixels.
    pub noise_px: f64,
    /// How codes become light, where it was learnt.
    pub tone: Option<Tone>,
}

/// What `mixray track --report` has written, as far as it is needed.
#[derive(Deserialize)]
struct Report {
    gamma: String,
    corner_sigma_px: f64,
    family: Option<Named>,
    board: Surface,
}

#[derive(Deserialize)]
struct Named {
    name: String,
    patterns: Option<Shown>,
}

/// Patterns in place of a family.
#[derive(Deserialize)]
struct Shown {
    list: Vec<Pattern>,
    share: f64,
}

#[derive(Deserialize)]
struct Surface {
    #[serde(default)]
    chessboard: Option<Squares>,
    #[serde(default)]
    charuco: Option<Squares>,
    first_point_of_marker: BTreeMap<u32, usize>,
    points_m: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Squares {
    columns: usize,
    rows: usize,
    square_m: f64,
    #[serde(default)]
    legacy: bool,
}

/// Reads a report of a tracked video (JSON), whose board is as it was found, bent paper and all; or what [`read_board`] reads.
///
/// # Errors
/// What cannot be used.
pub fn read_known_board(path: &Path) -> Result<KnownBoard, TrackError> {
    let is_report = read_text(path, MAX_POSES_BYTES)
        .ok()
        .filter(|text| text.trim_start().starts_with('{'));
    let Some(text) = is_report else {
        return Ok(KnownBoard {
            board: read_board(path)?,
            noise_px: NOISE_OF_FLAT_PX,
            tone: None,
        });
    };
    let known = serde_json::from_str(&text)
        .map_err(|error| error.to_string())
        .and_then(of_report);
    known.map_err(|problem| {
        TrackError::input(format!(
            "{}: {problem}; expected the report of a tracked video; write it with mixray track --report",
            path.display()
        ))
    })
}

fn of_report(report: Report) -> Result<KnownBoard, String> {
    let points: Vec<DVec3> = report
        .board
        .points_m
        .iter()
        .copied()
        .map(DVec3::from)
        .collect();
    let is_inside = |first: &usize| first.checked_add(4).is_some_and(|end| end <= points.len());
    if !report.board.first_point_of_marker.values().all(is_inside) {
        return Err("a marker's points are not there".to_owned());
    }
    let kind = kind_of(&report.board)?;
    let tone = match report.gamma.as_str() {
        "srgb" => Tone::Srgb,
        power => Tone::Power(power.parse().map_err(|_| format!("gamma is {power}"))?),
    };
    Ok(KnownBoard {
        board: Board {
            points,
            markers: report.board.first_point_of_marker,
            code: report.family.map(code_of).transpose()?,
            kind,
        },
        noise_px: report.corner_sigma_px,
        tone: Some(tone),
    })
}

fn kind_of(surface: &Surface) -> Result<BoardKind, String> {
    let markers = surface.first_point_of_marker.len();
    let has = |count: Option<usize>| count == Some(surface.points_m.len());
    match (&surface.chessboard, &surface.charuco) {
        (Some(squares), _) => {
            let (columns, rows) = (squares.columns, squares.rows);
            if !has(columns.checked_mul(rows)) {
                return Err(format!("{columns} x {rows} corners are not there"));
            }
            Ok(BoardKind::Chessboard {
                columns,
                rows,
                square_m: squares.square_m,
            })
        }
        (None, Some(squares)) => {
            let (columns, rows) = (squares.columns, squares.rows);
            let inner = columns
                .saturating_sub(1)
                .checked_mul(rows.saturating_sub(1));
            if !has(inner.and_then(|inner| inner.checked_add(4 * markers))) {
                return Err(format!(
                    "the corners of {columns} x {rows} squares and {markers} markers are not there"
                ));
            }
            Ok(BoardKind::Charuco {
                columns,
                rows,
                square_m: squares.square_m,
                is_legacy: squares.legacy,
            })
        }
        (None, None) => Ok(BoardKind::Markers),
    }
}

fn code_of(named: Named) -> Result<Code, String> {
    let Some(shown) = named.patterns else {
        return family_named(&named.name).map(Code::Family);
    };
    let patterns = Patterns::new(shown.list, shown.share)?;
    Ok(Code::Patterns(Arc::new(patterns)))
}
