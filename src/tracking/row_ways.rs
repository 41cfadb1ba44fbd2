//! The ways that what is seen goes while rows are read, from poses around a frame.

use glam::{DVec2, DVec3};

use super::board::Board;
use super::bundle::Solution;
use super::detector::FrameSeen;
use super::frame_pose::Observation;
use super::lens::Lens;
use super::marker::{Marker, Seen};
use super::pose::Pose;

/// Poses around a frame's own, which is one of them.
pub struct Around {
    /// How many frames they come after it: 0 is its own.
    pub nodes: Vec<f64>,
    pub poses: Vec<Pose>,
}

impl Around {
    /// Frames before and after it tell its motion.
    pub fn is_between(&self) -> bool {
        self.nodes.iter().any(|node| *node < 0.0) && self.nodes.iter().any(|node| *node > 0.0)
    }

    /// `None`: one of the poses has the point behind it.
    fn path(&self, lens: &Lens, point: DVec3) -> Option<Path<'_>> {
        let places = self.poses.iter().map(|pose| {
            let seen = pose.of(point);
            let ideal = DVec2::new(seen.x, seen.y) / seen.z;
            (seen.z > 1e-6).then(|| lens.pixel_of(ideal))
        });
        Some(Path {
            nodes: &self.nodes,
            places: places.collect::<Option<_>>()?,
        })
    }
}

/// Where a point of the board is in the pictures around a frame.
struct Path<'a> {
    nodes: &'a [f64],
    places: Vec<DVec2>,
}

impl Path<'_> {
    /// Pixels from where it is in the frame to where it is so many frames later, on the polynomial through all places (Lagrange).
    fn way(&self, frames: f64) -> DVec2 {
        let each = self.nodes.iter().zip(&self.places).map(|(node, place)| {
            let others = self.nodes.iter().filter(|other| *other != node);
            let weight: f64 = others
                .map(|other| (frames - other) / (node - other))
                .product();
            let own = if *node == 0.0 { 1.0 } else { 0.0 };
            *place * (weight - own)
        });
        each.sum()
    }
}

/// What is needed to put back what frames show.
pub struct RowWays<'a> {
    lens: &'a Lens,
    points: &'a [DVec3],
    board: &'a Board,
    /// Its number, from 0.
    last_row: f64,
}

impl<'a> RowWays<'a> {
    /// Of frames with so many rows.
    pub fn of(solution: &'a Solution, board: &'a Board, height: usize) -> Self {
        Self {
            lens: &solution.lens,
            points: &solution.points,
            board,
            last_row: (height as f64 - 1.0).max(1.0),
        }
    }

    /// From the frame's middle to the time of a row, in frames, where readout takes that share of one.
    fn time_of(&self, place: DVec2, share: f64) -> f64 {
        share * ((place.y - 0.5) / self.last_row - 0.5)
    }

    /// All that is seen, where it was in the middle of the frame's time.
    pub fn frame_still(&self, seen: &FrameSeen, around: &Around, share: f64) -> FrameSeen {
        let observed = |all: &[Observation]| -> Vec<Observation> {
            let each = all.iter().map(|o| {
                let path = around.path(self.lens, self.points[o.point]);
                let way = path.map(|path| path.way(self.time_of(o.pixel, share)));
                Observation {
                    pixel: o.pixel - way.unwrap_or_default(),
                    ..*o
                }
            });
            each.collect()
        };
        match seen {
            FrameSeen::Lost(why) => FrameSeen::Lost(why.clone()),
            FrameSeen::Corners(corners) => FrameSeen::Corners(observed(corners)),
            FrameSeen::Markers(seen) => FrameSeen::Markers(Seen {
                markers: (seen.markers.iter())
                    .map(|marker| self.marker_still(marker, around, share))
                    .collect(),
                between: observed(&seen.between),
                ..seen.clone()
            }),
        }
    }

    /// Along a side the way goes evenly from one corner's to the next.
    fn marker_still(&self, marker: &Marker, around: &Around, share: f64) -> Marker {
        let Some(first) = self.board.markers.get(&marker.id) else {
            return marker.clone();
        };
        let paths = (0..4).map(|k| around.path(self.lens, self.points[first + k]));
        let Some(paths) = paths.collect::<Option<Vec<Path>>>() else {
            return marker.clone();
        };
        let moved = |side: usize, place: DVec2| {
            let next = (side + 1) % 4;
            let (from, to) = (marker.corners[side], marker.corners[next]);
            let along = (place - from).dot(to - from) / from.distance_squared(to);
            let frames = self.time_of(place, share);
            place - paths[side].way(frames).lerp(paths[next].way(frames), along)
        };
        Marker {
            corners: std::array::from_fn(|k| moved(k, marker.corners[k])),
            sides: marker.sides.moved(moved),
            ..marker.clone()
        }
    }
}
