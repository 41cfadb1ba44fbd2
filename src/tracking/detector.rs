//! One frame looked at: its markers or corners, and which points of the board they are.

use super::board::Board;
use super::calibrate::Sighting;
use super::chessboard::find_chessboard;
use super::family::Family;
use super::frame_pose::Observation;
use super::lens::Lens;
use super::light::{LightImage, Luma, Tone};
use super::marker::{Seen, find_markers};

/// What a frame shows, without its picture.
#[derive(Clone, Debug)]
pub enum FrameSeen {
    Markers(Seen),
    /// Corners of a chessboard with their numbers.
    Corners(Vec<Observation>),
    /// Why there is no picture of it.
    Lost(String),
}

/// How frames are looked at.
#[derive(Clone, Debug)]
pub struct Detector {
    pub chessboard: Option<(usize, usize)>,
    pub families: Vec<&'static Family>,
    pub tone: Tone,
}

impl Detector {
    pub fn look(&self, luma: &Luma) -> FrameSeen {
        let image = LightImage::of(luma, self.tone);
        match self.chessboard {
            Some((columns, rows)) => {
                FrameSeen::Corners(find_chessboard(&image, columns, rows).unwrap_or_default())
            }
            None => FrameSeen::Markers(find_markers(&image, &self.families)),
        }
    }
}

/// Points of the board that a frame shows.
pub fn sighting(seen: &FrameSeen, board: &Board, lens: Option<&Lens>) -> (Sighting, Vec<u32>) {
    let mut sighting = Sighting::default();
    let mut ids = Vec::new();
    match seen {
        FrameSeen::Lost(_) => {}
        FrameSeen::Corners(corners) => sighting.observations.clone_from(corners),
        FrameSeen::Markers(seen) => {
            for marker in &seen.markers {
                let Some(first) = board.markers.get(&marker.id) else {
                    continue;
                };
                let straight = lens.and_then(|lens| marker.sides.corners(lens));
                let corners = straight.unwrap_or(marker.corners);
                let start = sighting.observations.len();
                let observed = (0..4).map(|k| Observation {
                    point: first + k,
                    pixel: corners[k],
                });
                sighting.observations.extend(observed);
                sighting.groups.push(start..start + 4);
                ids.push(marker.id);
            }
        }
    }
    (sighting, ids)
}
