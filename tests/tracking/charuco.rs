//! ChArUco boards: the corners of the squares count besides those of the markers.

use glam::{DVec2, DVec3};
use mixray::tracking::Family;
use serde_json::Value;

use super::commands::LENS_OF_THE_FILM;
use super::film::{Film, INK, PAPER, View};
use crate::support::Folder;

const COLUMNS: usize = 5;
const ROWS: usize = 4;
const SQUARE_M: f64 = 0.05;
const MARKER_M: f64 = 0.036;

/// Whether the squares are printed, or the markers alone; the upper left square is light in the old layout of a board with an even number of rows.
fn print(are_squares: bool, is_legacy: bool) -> impl Fn(DVec2) -> f64 {
    let family = Family::named("aruco-4x4").unwrap();
    move |at| {
        let place = at / SQUARE_M + 0.5 * DVec2::new(COLUMNS as f64, ROWS as f64);
        let square = place.floor();
        let is_there =
            square.cmpge(DVec2::ZERO).all() && square.x < COLUMNS as f64 && square.y < ROWS as f64;
        if !is_there {
            return PAPER;
        }
        let (x, y) = (square.x as usize, square.y as usize);
        let is_light = |x: usize, y: usize| (x + y) % 2 == usize::from(!is_legacy);
        if !is_light(x, y) {
            return if are_squares { INK } else { PAPER };
        }
        let before = (0..y * COLUMNS + x).filter(|k| is_light(k % COLUMNS, k / COLUMNS));
        let inside = ((place - square - 0.5) * SQUARE_M / MARKER_M + 0.5) * family.side_cells();
        let cell = inside.floor() - family.border;
        if inside.cmplt(DVec2::ZERO).any() || inside.cmpge(DVec2::splat(family.side_cells())).any()
        {
            return PAPER;
        }
        let is_code = cell.cmpge(DVec2::ZERO).all() && cell.max_element() < family.cells as f64;
        let id = before.count() as u32;
        match is_code && family.is_white(id, cell.x as usize, cell.y as usize) {
            true => PAPER,
            false => INK,
        }
    }
}

fn prepared(is_legacy: bool) -> Folder {
    let folder = Folder::new();
    folder.write("lens.yaml", LENS_OF_THE_FILM);
    folder.write(
        "board.toml",
        format!(
            "family = \"aruco-4x4\"\n[charuco]\ncolumns = {COLUMNS}\nrows = {ROWS}\nsquare_m = {SQUARE_M}\nmarker_m = {MARKER_M}\nlegacy = {is_legacy}\n"
        ),
    );
    folder
}

const LINE: &str = "track film.y4m --board board.toml --intrinsics lens.yaml --fix-intrinsics --gamma 2.2 -o poses.json --report track.json";
const MARKERS: usize = COLUMNS * ROWS / 2;

/// Of the squares' corners of a frame: how many there are, and squares of their errors.
fn between(frame: &Value, film: &Film, view: &View) -> (usize, f64) {
    let corners = frame["corners_px"].as_array().unwrap();
    let (mut count, mut squares) = (0, 0.0);
    for corner in corners {
        let number = |k: usize| corner[k].as_f64().unwrap();
        let Some(index) = (number(0) as usize).checked_sub(4 * MARKERS) else {
            continue;
        };
        let (x, y) = (index % (COLUMNS - 1) + 1, index / (COLUMNS - 1) + 1);
        let off = DVec2::new(
            x as f64 - 0.5 * COLUMNS as f64,
            y as f64 - 0.5 * ROWS as f64,
        );
        let at =
            view.rotation * DVec3::new(off.x * SQUARE_M, 0.0, off.y * SQUARE_M) + view.translation;
        let expected = film.lens.pixel_of(DVec2::new(at.x, at.y) / at.z);
        count += 1;
        squares += expected.distance_squared(DVec2::new(number(1), number(2)));
    }
    (count, squares)
}

#[test]
fn corners_of_the_squares_are_where_they_are_in_both_layouts() {
    for is_legacy in [false, true] {
        let folder = prepared(is_legacy);
        let film = Film::around();
        film.save(&folder, "film.y4m", &print(true, is_legacy));
        folder.succeed(LINE);
        let report = folder.json("track.json");
        let frames = report["frames"].as_array().unwrap();
        assert_eq!(frames.len(), film.views.len());
        let (mut count, mut squares) = (0, 0.0);
        for (frame, view) in frames.iter().zip(&film.views) {
            let (own, error) = between(frame, &film, view);
            (count, squares) = (count + own, squares + error);
        }
        let rms = (squares / count as f64).sqrt();
        let all = (COLUMNS - 1) * (ROWS - 1) * film.views.len();
        assert!(
            count * 10 > 9 * all && rms < 0.06,
            "{count} of {all}, {rms} px"
        );
        // The report's board is one for a running stream, corners and all.
        assert_eq!(report["board"]["charuco"]["legacy"], is_legacy);
    }
}

#[test]
fn another_layout_does_not_fit_and_markers_alone_have_no_corners_between() {
    let folder = prepared(true);
    let film = Film::around();
    film.save(&folder, "film.y4m", &print(true, false));
    folder.refuse(LINE, "no frame has a pose");
    let folder = prepared(false);
    film.save(&folder, "film.y4m", &print(false, false));
    folder.succeed(LINE);
    let report = folder.json("track.json");
    for (frame, view) in report["frames"].as_array().unwrap().iter().zip(&film.views) {
        assert_eq!(between(frame, &film, view).0, 0);
    }
}
