//! Corners of the chessboard between the markers of a ChArUco board: the markers beside a corner say where it is, to a pixel, and what it is a corner of.

use glam::{DMat3, DVec2};

use super::board::{Board, BoardKind, is_dark};
use super::frame_pose::Observation;
use super::homography::{apply, of_pairs};
use super::light::LightImage;
use super::marker::Marker;
use super::saddle::{blurred, refine_saddle};

/// Blur before corners are fitted: pixels, one standard deviation.
const BLUR_PX: f64 = 0.7;
/// Radius of the window in which a corner is fitted, pixels; and of the way to the nearest marker.
const RADII_PX: std::ops::RangeInclusive<f64> = 2.5..=6.0;
const RADIUS_SHARE: f64 = 0.75;
/// How far a corner may lie from where the markers say, of the way to the nearest of them.
const MOST_OFF_SHARE: f64 = 0.3;
/// Light and dark squares differ at least by this much light.
const LEAST_CONTRAST: f32 = 0.02;
/// Pixels that are about 1 where a plane is fitted.
const SCALE_PX: f64 = 100.0;

/// Squares around a corner, clockwise from its upper left.
const AROUND: [(usize, usize); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

/// Corners with a marker beside them, as points of the board; none of other boards.
pub fn find_between(image: &LightImage, board: &Board, markers: &[Marker]) -> Vec<Observation> {
    let BoardKind::Charuco {
        columns,
        rows,
        square_m,
        is_legacy,
    } = board.kind
    else {
        return Vec::new();
    };
    if markers.is_empty() {
        return Vec::new();
    }
    let smooth = blurred(image, BLUR_PX);
    let dark = |x: usize, y: usize| is_dark((x, y), rows, is_legacy);
    let corners = (1..rows).flat_map(|y| (1..columns).map(move |x| (x, y)));
    let found = corners.filter_map(|(x, y)| {
        let point = board.between(x, y)?;
        let near = Near::of(board, point, square_m, markers)?;
        let are_dark = AROUND.map(|(right, down)| dark(x + right - 1, y + down - 1));
        let pixel = near.corner(&smooth, are_dark)?;
        Some(Observation { point, pixel })
    });
    found.collect()
}

/// A corner's surroundings as the markers beside it show them.
struct Near {
    /// From the board, in squares from the corner, to pixels from `start` by [`SCALE_PX`].
    map: DMat3,
    start: DVec2,
    /// From the corner to the nearest marker, squares along each axis.
    inset: f64,
}

impl Near {
    fn of(board: &Board, point: usize, square_m: f64, markers: &[Marker]) -> Option<Self> {
        let place = |index: usize| {
            let off = board.points[index] - board.points[point];
            DVec2::new(off.x, off.z) / square_m
        };
        let mut pairs: Vec<(DVec2, DVec2)> = Vec::new();
        for marker in markers {
            let Some(first) = board.markers.get(&marker.id) else {
                continue;
            };
            let middle = (0..4).map(|k| place(first + k)).sum::<DVec2>() / 4.0;
            if middle.abs().max_element() < 1.0 {
                pairs.extend((0..4).map(|k| (place(first + k), marker.corners[k])));
            }
        }
        if pairs.is_empty() {
            return None;
        }
        let start = pairs.iter().map(|(_, pixel)| *pixel).sum::<DVec2>() / pairs.len() as f64;
        let inset = (pairs.iter().map(|(place, _)| place.abs().min_element()))
            .fold(f64::INFINITY, f64::min);
        for (_, pixel) in &mut pairs {
            *pixel = (*pixel - start) / SCALE_PX;
        }
        Some(Self {
            map: of_pairs(&pairs)?,
            start,
            inset,
        })
    }

    fn pixel(&self, place: DVec2) -> DVec2 {
        self.start + SCALE_PX * apply(&self.map, place)
    }

    /// `are_dark`: the squares in the order of [`AROUND`].
    fn corner(&self, image: &LightImage, are_dark: [bool; 4]) -> Option<DVec2> {
        let expected = self.pixel(DVec2::ZERO);
        let aside = AROUND.map(|(right, down)| {
            let off = DVec2::new(right as f64, down as f64) * 2.0 - 1.0;
            self.pixel(off * self.inset)
        });
        let margin = (aside.iter().map(|at| at.distance(expected))).fold(f64::INFINITY, f64::min);
        let is_inside = |at: &DVec2| {
            at.cmpge(DVec2::ZERO).all() && at.x < image.width as f64 && at.y < image.height as f64
        };
        let radius = (RADIUS_SHARE * margin).min(*RADII_PX.end());
        if radius < *RADII_PX.start() || !aside.iter().all(is_inside) {
            return None;
        }
        let found = refine_saddle(image, expected, radius)?;
        if found.distance(expected) > MOST_OFF_SHARE * margin {
            return None;
        }
        // Of light squares the darkest place in the margin around the marker, of dark ones the lightest.
        let lights = aside.map(|at| image.at(found + 0.6 * (at - expected)));
        let (mut lightest, mut darkest) = (f32::NEG_INFINITY, f32::INFINITY);
        for (light, is_dark) in lights.into_iter().zip(are_dark) {
            match is_dark {
                true => lightest = lightest.max(light),
                false => darkest = darkest.min(light),
            }
        }
        (darkest - lightest > LEAST_CONTRAST).then_some(found)
    }
}
