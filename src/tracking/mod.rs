//! Camera poses from markers and chessboards in a video.
//!
//! Frames in linear light -> dark quadrilaterals -> sides as sub-pixel edge points -> codes -> lens and board by bundle adjustment over some frames ->
//! lines fitted where sides are straight, in undistorted space -> every frame's pose from all that it shows, with its covariance.
//!
//! Inside, pixels have the corner origin, cameras OpenCV's axes.

mod board;
mod board_file;
mod bundle;
mod calibrate;
mod canvas;
mod cells;
mod charuco;
mod chessboard;
mod choice;
mod code;
mod detector;
mod edge;
mod families;
mod family;
mod follow;
mod frame_pose;
mod half_turn;
mod homography;
mod known_board;
mod lattice;
mod layout;
mod learning;
mod lens;
mod light;
mod line;
mod marker;
mod matrix;
mod options;
mod outline;
mod overlay;
mod pattern;
mod patterns;
mod pose;
mod prepare;
mod print;
mod quad;
mod report;
mod rolling;
mod row_ways;
mod saddle;
mod session;
mod settle;
mod sight;
mod smooth;
mod solved;
mod starter;
mod tone;
mod tracker;

pub use board::{Board, BoardKind, Flatness};
pub use board_file::{family_named, read_board, read_patterns};
#[cfg(feature = "start")]
pub(crate) use canvas::Canvas;
pub use choice::Choice;
pub use code::Code;
pub use detector::{Detector, FrameSeen};
#[cfg(feature = "start")]
pub(crate) use edge::refine as refine_quad;
pub use families::FAMILIES;
pub use family::Family;
pub use follow::Follower;
pub use known_board::{KnownBoard, read_known_board};
#[cfg(feature = "start")]
pub(crate) use lattice::find_lattices;
pub use learning::learn_from;
pub use lens::Lens;
#[cfg(feature = "start")]
pub(crate) use light::LightImage;
pub use light::{Luma, Tone};
pub use marker::{Evidence, Marker, Seen, find_markers};
pub use options::{Readout, Target, TrackOptions};
pub use pattern::Pattern;
pub use patterns::{Patterns, USUAL_SHARE};
pub use pose::{Moved, Pose};
pub use prepare::prepare;
#[cfg(feature = "start")]
pub(crate) use quad::find_quads;
pub use rolling::Rows;
#[cfg(feature = "start")]
pub(crate) use saddle::{blurred, find_saddles, refine_saddle};
pub use session::{Session, track};
pub use sight::sight_markers;
pub use tracker::{Tracked, TrackedFrame, pose_all};

/// Why no poses are found. Displays as one line: "problem; expected ...; how to mend".
#[derive(Debug, thiserror::Error)]
pub enum TrackError {
    #[error(transparent)]
    Video(#[from] crate::video::VideoError),
    #[error("{0}")]
    Input(String),
}

impl TrackError {
    fn input(message: impl Into<String>) -> Self {
        Self::Input(message.into())
    }
}
