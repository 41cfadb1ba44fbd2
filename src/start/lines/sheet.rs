//! The camera by equal squares in one plane: chessboards and sheets of markers. What they lie on is taken for level.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::model::{FOCAL_PRIOR, KnownFocal};
use super::plane::{Fit, fits};
use super::segments::{Grey, Segment};
use super::squares::{Patch, find_boards, find_dark_squares};
use super::told::{Basis, Lines};

/// Of a corner, pixels: of no photograph are they better.
const LEAST_SIGMA_PX: f64 = 0.1;
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
    let (cost, best) = found.first()?;
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
    for (_, rival) in found.iter().filter(|(own, _)| *own < cost + RIVAL) {
        lines.doubted_by(rival.log_focal.exp() * unit_px, up(rival));
    }
    best.are_squares(least_sigma).then_some(lines)
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

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    const FOCAL_PX: f64 = 520.0;

    /// Down on a sheet from half the side, turned.
    fn axes() -> DMat3 {
        DMat3::from_rotation_x(-0.9) * DMat3::from_rotation_y(0.3) * DMat3::from_rotation_z(0.2)
    }

    /// Four by three dark rectangles on white paper, one wide and `high`, apart by a half, through a lens that bends lines.
    fn rectangles(high: f64, bend: f64) -> Grey {
        let centre = DVec2::new(320.0, 240.0);
        let shade = |x: f64, y: f64| {
            let p = (DVec2::new(x, y) - centre) / 400.0;
            let ray = (p / (1.0 + bend * p.length_squared()) * 400.0).extend(FOCAL_PX);
            let normal = axes().col(2);
            // Its middle is eight widths ahead.
            let at = ray * (8.0 * normal.z / normal.dot(ray)) - DVec3::Z * 8.0;
            let (u, v) = (at.dot(axes().col(0)) + 3.0, at.dot(axes().col(1)) + 2.25);
            let dark = (0.0..6.0).contains(&u)
                && (0.0..3.0 * (high + 0.5)).contains(&v)
                && u.rem_euclid(1.5) < 1.0
                && v.rem_euclid(high + 0.5) < high;
            if dark { 40.0 } else { 200.0 }
        };
        let codes = (0..640 * 480).map(|i| {
            let at = |d: f64, e: f64| shade((i % 640) as f64 + d, (i / 640) as f64 + e);
            let steps = [0.125, 0.375, 0.625, 0.875];
            let sum: f64 = steps.iter().flat_map(|d| steps.map(|e| at(*d, e))).sum();
            (sum / 16.0) as f32
        });
        Grey {
            width: 640,
            height: 480,
            codes: codes.collect(),
        }
    }

    #[test]
    fn a_sheet_of_squares_tells_focal_length_and_horizon() {
        for bend in [0.0, -0.08] {
            let found = read_sheet(&rectangles(1.0, bend), None).expect("squares");
            let off = found.focal_px / FOCAL_PX - 1.0;
            assert!(off.abs() < 0.03, "{off}");
            assert!(found.focal_sigma > off.abs() && found.is_sure(false));
            let up = -axes().col(2) * DVec3::new(1.0, -1.0, -1.0);
            let off_deg = found.up.dot(up).acos().to_degrees();
            assert!(off_deg < 1.0, "{off_deg}");
            let along = axes().col(0);
            assert!(found.up.dot(along).acos().to_degrees() > 30.0, "control");
            assert!(matches!(found.basis, Basis::Squares { corners: 48, .. }));
        }
    }

    #[test]
    fn rectangles_are_no_squares() {
        assert!(read_sheet(&rectangles(0.7, 0.0), None).is_none());
        assert!(read_sheet(&rectangles(1.0, 0.0), None).is_some(), "control");
    }
}
