//! Focal length and horizon from the straight lines of a photograph: of rooms, streets, tables, whatever has right angles.

mod guesses;
mod plane;
mod segments;
mod sheet;
mod squares;
mod told;
mod vanishing;

pub use segments::{Grey, Segment, segments};
pub use told::{Basis, Lines};
pub use vanishing::KnownFocal;

use glam::DVec3;
use sheet::read_sheet;
use vanishing::{Axes, MOST_LINES, find_axes};

/// Gradients from which on edges are looked for, codes per pixel: what is sharp and noisy wants other ones than what is soft.
const EDGES: [f32; 3] = [2.0, 3.5, 5.0];
/// Fits that explain less are chance: of two axes, bits; of the lines' length, a share; of the lines that fit, an rms of three standard deviations'
/// uniform spread (1.7) or so.
const LEAST_BITS: f64 = 55.0;
const LEAST_SHARE: f64 = 0.5;
const MOST_RMS: f64 = 0.9;
/// An axis that leans by less from the picture's vertical, as a cosine, is that of walls, if the surface that the lines lie in faces the camera like
/// one.
const WALL_VERTICAL: f64 = 0.94;
const WALL_FACES: f64 = 0.25;

/// What the lines of a picture say of its camera; `None`: not enough to be sure.
pub fn read_lines(grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    read_sheet(grey, known).or_else(|| read_axes(grey, known))
}

/// By lines along axes at right angles.
fn read_axes(grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    let size = (grey.width as f64, grey.height as f64);
    let fits: Vec<Lines> = (EDGES.iter())
        .filter_map(|edge| {
            let segments = segments(grey, *edge);
            let axes = find_axes(&segments, size, known)?;
            claim(&axes, segments, known.is_some())
        })
        .collect();
    let best = (fits.iter()).min_by(|a, b| a.focal_sigma.total_cmp(&b.focal_sigma))?;
    // Where other edges say something else, neither is sure.
    let mut sure = best.clone();
    for other in &fits {
        sure.doubted_by(other.focal_px, other.up);
    }
    sure.is_sure(known.is_some()).then_some(sure)
}

fn claim(axes: &Axes, segments: Vec<Segment>, focal_is_known: bool) -> Option<Lines> {
    let up = upright(axes);
    // x right, y down, z ahead to x right, y up, z back.
    let axis = axes.axes.col(up) * DVec3::new(1.0, -1.0, -1.0);
    let total: f64 = segments.iter().take(MOST_LINES).map(|s| s.length()).sum();
    let segments: Vec<(Segment, Option<usize>)> = (segments.into_iter())
        .zip(axes.runs_along.iter().copied())
        .collect();
    let explained: f64 = (segments.iter())
        .filter(|(_, along)| along.is_some())
        .map(|(segment, _)| segment.length())
        .sum();
    let mut bits = axes.bits;
    bits.sort_by(f64::total_cmp);
    let lines = Lines {
        focal_px: axes.focal_px,
        focal_sigma: axes.focal_sigma,
        up: axis * axis.y.signum(),
        up_sigma_deg: axes.axis_sigma[up].to_degrees(),
        segments,
        basis: Basis::Lines { rms: axes.rms },
    };
    let explains =
        bits[1] >= LEAST_BITS && explained >= LEAST_SHARE * total && axes.rms <= MOST_RMS;
    (explains && lines.is_sure(focal_is_known)).then_some(lines)
}

/// Which axis is up. Lines along two axes alone lie in one surface, which carries things, unless it faces the camera like a wall with upright lines;
/// of three axes it is the one that leans least in the picture.
fn upright(axes: &Axes) -> usize {
    let lean = |i: usize| axes.axes.col(i).y.abs();
    let least = (0..3)
        .max_by(|a, b| lean(*a).total_cmp(&lean(*b)))
        .unwrap_or(0);
    match (0..3).find(|i| axes.bits[*i] == 0.0) {
        Some(normal) if lean(least) < WALL_VERTICAL || lean(normal) > WALL_FACES => normal,
        _ => least,
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    /// A tiled floor seen by a camera, dark and bright tiles.
    fn floor(focal_px: f64, axes: DMat3) -> Grey {
        const WIDTH: usize = 480;
        const HEIGHT: usize = 360;
        let shade = |x: f64, y: f64| {
            let ray = DVec3::new(x - 240.0, y - 180.0, focal_px);
            // Columns: along, across, up; the floor is 1 below.
            let [u, v, w] = [0, 1, 2].map(|i| ray.dot(axes.col(i)));
            let (u, v) = (-u / w, -v / w);
            let inside = w < 0.0 && u.abs() < 1.8 && v.abs() < 1.8;
            let dark = ((u / 0.3).floor() + (v / 0.3).floor()).rem_euclid(2.0) == 0.0;
            if inside && dark { 40.0 } else { 180.0 }
        };
        let codes = (0..WIDTH * HEIGHT).map(|i| {
            let at = |d: f64, e: f64| shade((i % WIDTH) as f64 + d, (i / WIDTH) as f64 + e);
            let steps = [0.125, 0.375, 0.625, 0.875];
            let sum: f64 = steps.iter().flat_map(|d| steps.map(|e| at(*d, e))).sum();
            (sum / 16.0) as f32
        });
        Grey {
            width: WIDTH,
            height: HEIGHT,
            codes: codes.collect(),
        }
    }

    /// Axes in the camera's space (y down, z ahead) of a floor that is turned by `turn` and looked down on by `down`.
    fn axes(turn: f64, down: f64, roll: f64) -> DMat3 {
        let level = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
        DMat3::from_rotation_z(roll)
            * DMat3::from_rotation_x(down)
            * level
            * DMat3::from_rotation_z(turn)
    }

    #[test]
    fn a_tiled_floor_tells_focal_length_and_horizon() {
        for (focal, turn, down, roll) in [(420.0, 0.6, 0.7, 0.0), (300.0, 0.9, 0.6, 0.15)] {
            let truth = axes(turn, down, roll);
            let found = read_lines(&floor(focal, truth), None).expect("lines enough");
            assert!(
                (found.focal_px / focal - 1.0).abs() < 0.05,
                "{}",
                found.focal_px
            );
            let up = truth.col(2) * DVec3::new(1.0, -1.0, -1.0);
            let off_deg = found.up.dot(up).acos().to_degrees();
            assert!(off_deg < 1.0, "{off_deg}");
            let control = axes(turn, down + 0.1, roll).col(2) * DVec3::new(1.0, -1.0, -1.0);
            assert!(found.up.dot(control).acos().to_degrees() > 3.0);
        }
    }

    #[test]
    fn what_is_seen_straight_on_tells_nothing() {
        let level = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::NEG_Z);
        assert!(read_lines(&floor(420.0, level), None).is_none());
        let flat = Grey {
            width: 200,
            height: 100,
            codes: vec![7.0; 20000],
        };
        assert!(read_lines(&flat, None).is_none());
    }
}
