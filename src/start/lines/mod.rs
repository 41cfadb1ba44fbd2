//! Focal length and horizon from the straight lines of a photograph: of rooms, streets, tables, whatever has right angles; or from equal squares in one
//! plane, which tell more.

mod edges;
mod guesses;
mod model;
mod plane;
mod refine;
mod segments;
mod sheet;
mod squares;
mod told;
mod upright;
mod vanishing;

pub use model::KnownFocal;
pub use segments::{Grey, Segment, segments};
pub use told::{Basis, Lines};

use edges::{Edge, edges};
use glam::DVec3;
use sheet::read_sheet;
use upright::away_from_ground;
use vanishing::{Axes, find_axes};

/// Gradients from which on edges are looked for, codes per pixel: what is sharp and noisy wants other ones than what is soft.
const EDGES: [f32; 4] = [1.0, 2.0, 3.5, 5.0];
/// Fits that explain less are chance: of many lines that are taken to be as straight as things are, two axes' bits, and a share of their length; of
/// few exact ones, bits of all, and a share.
const LEAST_BITS: f64 = 55.0;
const LEAST_SHARE: f64 = 0.5;
const LEAST_EVIDENCE: f64 = 12.0;
const LEAST_EXACT_SHARE: f64 = 0.75;
/// Fits of other edges with less than this share of the best one's evidence do not count.
const RIVAL: f64 = 0.7;

/// What the lines of a picture say of its camera; `None`: not enough to be sure.
pub fn read_lines(grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    // Where squares leave something open, lines know it no better: most of them are those of the squares.
    let lines = read_sheet(grey, known).or_else(|| read_axes(grey, known))?;
    lines.is_sure(known.is_some()).then_some(lines)
}

/// By lines along axes at right angles.
fn read_axes(grey: &Grey, known: Option<KnownFocal>) -> Option<Lines> {
    let size = (grey.width as f64, grey.height as f64);
    let fits: Vec<(f64, Lines)> = (EDGES.iter())
        .filter_map(|edge| {
            let edges = edges(grey, &segments(grey, *edge));
            let axes = find_axes(&edges, size, known)?;
            Some((axes.evidence, claim(&axes, edges, known.is_some())?))
        })
        .collect();
    let (evidence, best) = fits.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    // Where other edges say something else, neither is sure.
    let mut sure = best.clone();
    for (own, other) in &fits {
        if *own >= RIVAL * evidence {
            sure.doubted_by(other.focal_px, other.up);
        }
    }
    Some(sure)
}

fn claim(axes: &Axes, edges: Vec<Edge>, focal_is_known: bool) -> Option<Lines> {
    let segments: Vec<(Segment, Option<usize>)> = (edges.into_iter())
        .map(|edge| edge.segment)
        .zip(axes.runs_along.iter().copied())
        .collect();
    let mut bits = axes.rough_bits.clone();
    bits.sort_by(|a, b| b.total_cmp(a));
    let lines = Lines {
        focal_px: axes.focal_px,
        focal_sigma: axes.focal_sigma,
        // x right, y down, z ahead to x right, y up, z back.
        up: away_from_ground(axes.up * DVec3::new(1.0, -1.0, -1.0)),
        up_sigma_deg: axes.up_sigma.to_degrees(),
        segments,
        basis: Basis::Lines { rms: axes.rms },
    };
    let many = bits[1] >= LEAST_BITS && axes.rough_share >= LEAST_SHARE;
    let few = axes.evidence >= LEAST_EVIDENCE && axes.share >= LEAST_EXACT_SHARE;
    let explains = many || few;
    (explains && lines.is_sure(focal_is_known)).then_some(lines)
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
