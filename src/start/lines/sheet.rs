//! The camera by equal squares in one plane: chessboards and sheets of markers. What they lie on is taken for level.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::model::{FOCAL_PRIOR, KnownFocal};
use super::plane::{Fit, fits};
use super::segments::{Grey, Segment};
use super::squares::{Patch, find_boards, find_dark_squares};
use super::told::{Basis, Lines};

/// Of a corner, pixels: no camera and no sheet of paper is better.
const LEAST_SIGMA_PX: f64 = 0.25;
/// Corners are no further off, of a square's side.
const MOST_OFF: f64 = 0.03;
const LEAST_SHARE: f64 = 0.85;
/// Squares that lie apart, and rows and columns of those that lie together.
const LEAST_SQUARES: usize = 5;
const LEAST_ROWS: usize = 3;
/// Chessboards that are tried, the largest.
const MOST_BOARDS: usize = 3;
/// A fit is no rival of the best if its cost is higher by this.
const RIVAL: f64 = 9.0;

/// What the squares of a picture say of its camera, sure or not; `None`: there are none.
pub fn read_sheet(grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    let boards = find_boards(grey).into_iter().take(MOST_BOARDS);
    let groups = boards
        .map(|board| vec![board])
        .chain([find_dark_squares(grey)]);
    groups
        .filter_map(|group| claim(&group, grey, known))
        .min_by(|a, b| a.focal_sigma.total_cmp(&b.focal_sigma))
}

fn claim(group: &[Patch], grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    if !are_enough(group) {
        return None;
    }
    let centre = 0.5 * DVec2::new(grey.width as f64, grey.height as f64);
    let unit_px = centre.length();
    let in_units = |patch: &Patch| Patch {
        points: (patch.points.iter())
            .map(|(grid, pixel)| (*grid, (*pixel - centre) / unit_px))
            .collect(),
    };
    let patches: Vec<Patch> = group.iter().map(in_units).collect();
    let focal = match known {
        Some(known) => ((known.focal_px / unit_px).ln(), known.sigma),
        None => (FOCAL_PRIOR.0.ln(), FOCAL_PRIOR.1),
    };
    let least_sigma = LEAST_SIGMA_PX / unit_px;
    let found = fits(&patches, focal, known.is_some(), least_sigma);
    let best = found.first()?;
    // x right, y down, z ahead to x right, y up, z back.
    let up = |fit: &Fit| fit.normal() * DVec3::new(1.0, -1.0, -1.0);
    let corners: usize = best.patches.iter().map(|patch| patch.points.len()).sum();
    let mut lines = Lines {
        focal_px: best.log_focal.exp() * unit_px,
        focal_sigma: best.focal_sigma(),
        up: up(best),
        up_sigma_deg: best.normal_sigma().to_degrees(),
        segments: segments(best, centre, unit_px),
        basis: Basis::Squares {
            corners,
            off_px: best.sigma * unit_px,
        },
    };
    let total_px: f64 = lines.segments.iter().map(|(side, _)| side.length()).sum();
    let side_px = total_px / lines.segments.len().max(1) as f64;
    let explains = are_enough(&best.patches)
        && best.share() >= LEAST_SHARE
        && best.sigma * unit_px <= MOST_OFF * side_px;
    if !explains {
        return None;
    }
    for rival in found.iter().filter(|fit| fit.cost < best.cost + RIVAL) {
        lines.doubted_by(rival.log_focal.exp() * unit_px, up(rival));
    }
    best.are_squares(least_sigma, focal).then_some(lines)
}

fn are_enough(patches: &[Patch]) -> bool {
    let [board] = patches else {
        return patches.len() >= LEAST_SQUARES;
    };
    let different = |along: fn(&DVec2) -> f64| {
        let mut values: Vec<i64> = board
            .points
            .iter()
            .map(|(grid, _)| along(grid) as i64)
            .collect();
        values.sort_unstable();
        values.dedup();
        values.len()
    };
    different(|grid| grid.x) >= LEAST_ROWS && different(|grid| grid.y) >= LEAST_ROWS
}

/// The sides of the squares, as pixels, with the axis of each.
fn segments(fit: &Fit, centre: DVec2, unit_px: f64) -> Vec<(Segment, Option<usize>)> {
    let mut found = Vec::new();
    for (patch, turn) in fit.patches.iter().zip(&fit.turns) {
        // In halves of a side, which are whole numbers.
        let key = |grid: DVec2| ((2.0 * grid.x).round() as i64, (2.0 * grid.y).round() as i64);
        let places: BTreeMap<(i64, i64), DVec2> = (patch.points.iter())
            .map(|(grid, pixel)| (key(*grid), centre + *pixel * unit_px))
            .collect();
        for ((x, y), from) in &places {
            for (axis, next) in [(0, (x + 2, *y)), (1, (*x, y + 2))] {
                if let Some(to) = places.get(&next) {
                    let side = Segment {
                        from: *from,
                        to: *to,
                    };
                    found.push((side, Some((axis + turn) % 2)));
                }
            }
        }
    }
    found
}
