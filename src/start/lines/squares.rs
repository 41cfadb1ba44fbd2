//! Squares of one size in one plane, as of chessboards and of sheets of markers: where they lie in the picture.

use glam::DVec2;

use super::segments::Grey;
use crate::tracking::{
    LightImage, blurred, find_lattices, find_quads, find_saddles, refine_quad, refine_saddle,
};

/// Blur before a chessboard's corners are fitted: pixels, one standard deviation.
const BLUR_PX: f64 = 0.7;
/// Radius of the window in which a corner is fitted: pixels, and of the distance to the next corner.
const MOST_RADIUS: f64 = 6.0;
const RADIUS_SHARE: f64 = 0.4;
/// Corners of the smallest part of a chessboard.
const LEAST_CORNERS: usize = 12;
/// Sides of the smallest dark square, pixels.
const LEAST_SIDE_PX: f64 = 10.0;
/// Squares that are looked at, the largest.
const MOST_QUADS: usize = 80;

/// What lies rigidly together: points on a square grid whose step is the side of a square, and their pixels (corner origin).
#[derive(Clone, Debug)]
pub struct Patch {
    pub points: Vec<(DVec2, DVec2)>,
}

/// The inner corners of each chessboard, the largest first.
pub fn find_boards(grey: &Grey) -> Vec<Patch> {
    let image = light(grey);
    let saddles = find_saddles(&image);
    let smooth = blurred(&image, BLUR_PX);
    let mut boards = Vec::new();
    for lattice in find_lattices(&saddles) {
        let place = |at: (i32, i32)| lattice.get(&at).map(|index| saddles[*index].place);
        let points: Vec<(DVec2, DVec2)> = (lattice.iter())
            .filter_map(|((column, row), index)| {
                let own = saddles[*index].place;
                let ways = [(1, 0), (-1, 0), (0, 1), (0, -1)];
                let nearest = (ways.iter())
                    .filter_map(|(x, y)| place((column + x, row + y)))
                    .map(|other| other.distance(own))
                    .fold(f64::INFINITY, f64::min);
                let radius = MOST_RADIUS.min(RADIUS_SHARE * nearest);
                let pixel = refine_saddle(&smooth, own, radius)?;
                Some((DVec2::new(f64::from(*column), f64::from(*row)), pixel))
            })
            .collect();
        if points.len() >= LEAST_CORNERS {
            boards.push(Patch { points });
        }
    }
    boards
}

/// Dark quadrilaterals, the largest first, each as if it were a square.
pub fn find_dark_squares(grey: &Grey) -> Vec<Patch> {
    let image = light(grey);
    let mut quads: Vec<[DVec2; 4]> = (find_quads(&image).iter())
        .filter_map(|rough| refine_quad(&image, rough, 3))
        .map(|(quad, _)| quad)
        .filter(|quad| (0..4).all(|k| quad[k].distance(quad[(k + 1) % 4]) >= LEAST_SIDE_PX))
        .collect();
    let size = |quad: &[DVec2; 4]| (quad[2] - quad[0]).perp_dot(quad[3] - quad[1]);
    quads.sort_by(|a, b| size(b).total_cmp(&size(a)));
    quads.truncate(MOST_QUADS);
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(DVec2::from);
    (quads.into_iter())
        .map(|quad| Patch {
            points: corners.into_iter().zip(quad).collect(),
        })
        .collect()
}

/// Codes as sRGB's, in linear light.
fn light(grey: &Grey) -> LightImage {
    let linear = |code: f32| {
        let x = code / 255.0;
        match x <= 0.040_45 {
            true => x / 12.92,
            false => ((x + 0.055) / 1.055).powf(2.4),
        }
    };
    LightImage {
        width: grey.width,
        height: grey.height,
        values: grey.codes.iter().map(|code| linear(*code)).collect(),
    }
}
