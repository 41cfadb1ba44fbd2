//! A plain chessboard's inner corners, numbered.

use glam::DVec2;

use super::frame_pose::Observation;
use super::homography::{apply, of_pairs};
use super::lattice::{Lattice, find_lattices, is_front, span};
use super::light::LightImage;
use super::saddle::{Saddle, blurred, find_saddles, refine_saddle};

/// Blur before corners are fitted: pixels, one standard deviation.
const BLUR_PX: f64 = 0.7;
/// Radius of the window in which a corner is fitted: pixels, and of the distance to the next corner.
const MOST_RADIUS: f64 = 6.0;
const RADIUS_SHARE: f64 = 0.4;
/// Share of the corners that has to be seen where the board is whole.
const LEAST_SHARE: f64 = 0.6;
/// Pixels that a corner may lie off the plane of the others, for the lens's distortion.
const MOST_OFF_PX: f64 = 6.0;

/// Corners of the board where all of its rows and columns are seen; which end is first, a board with turns that look alike does not say.
pub fn find_chessboard(
    image: &LightImage,
    columns: usize,
    rows: usize,
) -> Option<Vec<Observation>> {
    let saddles = find_saddles(image);
    let smooth = blurred(image, BLUR_PX);
    let lattices = find_lattices(&saddles);
    let mut windows: Vec<(usize, Vec<Observation>)> = lattices
        .iter()
        .flat_map(|lattice| windows(lattice, &saddles, columns, rows))
        .map(|numbered| (numbered.len(), numbered))
        .collect();
    windows.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    windows.into_iter().find_map(|(_, numbered)| {
        let corners = refined(&smooth, &numbered);
        is_plane(&corners, columns).then_some(corners)
    })
}

/// Numbers of the board for every part of a lattice that has its size; what lies around it is no part of the board.
fn windows(
    lattice: &Lattice,
    saddles: &[Saddle],
    columns: usize,
    rows: usize,
) -> Vec<Vec<Observation>> {
    let (first, size) = span(lattice);
    let mut found = Vec::new();
    for (width, height) in [(columns, rows), (rows, columns)] {
        for row in 0..=size.1.saturating_sub(height) {
            for column in 0..=size.0.saturating_sub(width) {
                let corner = (first.0 + column as i32, first.1 + row as i32);
                let inside = lattice.iter().filter(|((x, y), _)| {
                    (corner.0..corner.0 + width as i32).contains(x)
                        && (corner.1..corner.1 + height as i32).contains(y)
                });
                let part: Lattice = inside.map(|(at, index)| (*at, *index)).collect();
                found.extend(numbered(&part, saddles, columns, rows));
            }
        }
        if columns == rows {
            break;
        }
    }
    found
}

/// Numbers of the board for the saddles of a lattice of its size.
fn numbered(
    lattice: &Lattice,
    saddles: &[Saddle],
    columns: usize,
    rows: usize,
) -> Option<Vec<Observation>> {
    let (first, size) = span(lattice);
    let is_turned = match size {
        size if size == (columns, rows) => false,
        size if size == (rows, columns) => true,
        _ => return None,
    };
    if (lattice.len() as f64) < LEAST_SHARE * (columns * rows) as f64 {
        return None;
    }
    // Turning swaps columns and rows; seen from the front the picture must not be mirrored by that.
    let is_mirrored = is_front(lattice, saddles) == is_turned;
    let each = lattice.iter().map(|((column, row), saddle)| {
        let (x, y) = ((column - first.0) as usize, (row - first.1) as usize);
        let (mut x, y) = if is_turned { (y, x) } else { (x, y) };
        if is_mirrored {
            x = columns - 1 - x;
        }
        Observation {
            point: y * columns + x,
            pixel: saddles[*saddle].place,
        }
    });
    Some(each.collect())
}

fn refined(image: &LightImage, corners: &[Observation]) -> Vec<Observation> {
    let each = corners.iter().filter_map(|corner| {
        let others = corners.iter().filter(|other| other.point != corner.point);
        let nearest = others
            .map(|o| o.pixel.distance(corner.pixel))
            .fold(f64::INFINITY, f64::min);
        let radius = MOST_RADIUS.min(RADIUS_SHARE * nearest);
        let pixel = refine_saddle(image, corner.pixel, radius)?;
        Some(Observation { pixel, ..*corner })
    });
    each.collect()
}

fn is_plane(corners: &[Observation], columns: usize) -> bool {
    const SCALE: f64 = 500.0;
    let pairs: Vec<(DVec2, DVec2)> = corners
        .iter()
        .map(|c| {
            let cell = DVec2::new((c.point % columns) as f64, (c.point / columns) as f64);
            (0.1 * cell, c.pixel / SCALE)
        })
        .collect();
    of_pairs(&pairs).is_some_and(|map| {
        let off = |(from, to): &(DVec2, DVec2)| SCALE * apply(&map, *from).distance(*to);
        pairs.len() >= 4 && pairs.iter().all(|pair| off(pair) < MOST_OFF_PX)
    })
}
