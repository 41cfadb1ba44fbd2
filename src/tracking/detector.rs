//! One frame looked at: its markers or corners, and which points of the board they are.

use std::sync::Arc;

use super::board::Board;
use super::calibrate::Sighting;
use super::charuco::find_between;
use super::chessboard::find_chessboard;
use super::code::Code;
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
    pub codes: Vec<Code>,
    pub tone: Tone,
    /// A ChArUco board, whose squares' corners count too.
    pub charuco: Option<Arc<Board>>,
}

impl Detector {
    pub fn look(&self, luma: &Luma) -> FrameSeen {
        let image = LightImage::of(luma, self.tone);
        match self.chessboard {
            Some((columns, rows)) => {
                FrameSeen::Corners(find_chessboard(&image, columns, rows).unwrap_or_default())
            }
            None => {
                let mut seen = find_markers(&image, &self.codes);
                if let Some(board) = &self.charuco {
                    seen.between = find_between(&image, board, &seen.markers);
                }
                FrameSeen::Markers(seen)
            }
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
            sighting.observations.extend(&seen.between);
        }
    }
    (sighting, ids)
}
