//! `mixray track` on markers with cells of their codes around their borders.

use glam::DVec2;
use mixray::tracking::Family;

use super::commands::{LENS_OF_THE_FILM, off, pose};
use super::film::{Film, INK, PAPER, squares};
use crate::support::Folder;

/// Of a border and of the whole marker, five and nine cells.
const SIDE_M: f64 = 0.025;
const WHOLE_M: f64 = 0.045;
const BOARD: &str = "[grid]\ncolumns = 3\nrows = 2\nside_m = 0.025\ngap_m = 0.03\n";
const TRACK: &str = "track film.y4m --board board.toml --board-flatness rigid --gamma 2.2 --intrinsics lens.yaml --fix-intrinsics -o poses.json";

/// Reflectance of a marker, by shares of the whole one's sides.
fn inside(family: &Family, id: usize, place: DVec2) -> f64 {
    let [x, y] = (9.0 * place).to_array().map(|at| (at as u32).min(8));
    let ring = match (x, y) {
        (0..8, 0) => Some(x),
        (8, 0..8) => Some(8 + y),
        (1..=8, 8) => Some(24 - x),
        (0, 1..=8) => Some(32 - y),
        _ => None,
    };
    let from_edge = x.min(8 - x).min(y).min(8 - y);
    let is_white = match (ring, from_edge) {
        (Some(cell), _) => family.is_white_in_ring(id as u32, cell),
        (None, 1) => false,
        (None, 2) => true,
        _ => family.is_white(id as u32, x as usize - 3, y as usize - 3),
    };
    if is_white { PAPER } else { INK }
}

/// Found without being named. Control: another family is not what is seen.
#[test]
fn cells_around_a_border_are_read() {
    let family = Family::named("apriltag-standard-41h12").unwrap();
    let folder = Folder::new();
    let film = Film::around();
    let gap_m = SIDE_M + 0.03 - WHOLE_M;
    let print = squares((3, 2), (WHOLE_M, gap_m), |id, place| {
        inside(family, id, place)
    });
    film.save(&folder, "film.y4m", &print);
    folder.write("board.toml", BOARD);
    folder.write("lens.yaml", LENS_OF_THE_FILM);
    let said = folder.succeed(TRACK);
    assert!(
        said.contains("apriltag-standard-41h12, 6 ids") && said.contains("8 of 8 with a pose"),
        "{said}"
    );
    let poses = folder.json("poses.json");
    for (frame, view) in poses["frames"].as_array().unwrap().iter().zip(&film.views) {
        let (mm, degrees) = off(&pose(frame), view);
        assert!(mm < 1.0 && degrees < 0.15, "{mm} mm, {degrees} degrees");
    }
    folder.refuse(
        &format!("{TRACK} --family apriltag-36h11"),
        "apriltag-standard-41h12",
    );
    folder.write(
        "named.toml",
        format!("family = \"apriltag-standard-41h12\"\n{BOARD}"),
    );
    folder.refuse(
        "track --print-board named.toml -o board.svg",
        "apriltag-imgs",
    );
}
