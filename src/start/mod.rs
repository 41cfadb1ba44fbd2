//! A starter scene from one photograph, or from a frame of a phone's scan: `mixray new`.
//!
//! Camera, ground, light and proxy are taken from what there is (tags, straight lines, depth, a scan, what the user gives), and guessed where
//! there is nothing. Each [`Claim`] says which, and how sure it is.

mod camera;
mod claim;
mod compose;
mod depth;
mod exif;
mod light;
mod lines;
mod mesh;
mod mesh_file;
mod mirror_ball;
mod panorama;
mod place;
mod plane;
mod real;
mod scan;
mod scene_text;
mod sketch;
mod sun;
mod view;

pub use claim::Claim;
pub use compose::{Made, compose};
pub use depth::DepthUnit;
pub use exif::focal_px_of_whole;
pub use lines::{Basis, KnownFocal, Lines, Segment};
pub use mirror_ball::Ball;
pub use scan::Scan;
pub use sun::Shadow;
pub use view::lines_of;

use std::path::PathBuf;

use glam::DVec2;

/// What the user gives.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// A photograph, or a scan ([`Scan::is_one`]).
    pub photo: PathBuf,
    /// Put down as virtual objects.
    pub models: Vec<PathBuf>,
    /// Of a scan: the photograph's name or its place from 0; `None`: the first.
    pub frame: Option<String>,
    /// Across the width.
    pub fov_deg: Option<f64>,
    /// Where the horizon crosses the left and right borders, pixels from the top.
    pub horizon: Option<[f64; 2]>,
    /// Of the camera over the ground.
    pub height_m: Option<f64>,
    pub length: Option<KnownLength>,
    pub shadow: Option<Shadow>,
    /// Lat-long.
    pub environment: Option<PathBuf>,
    pub mirror_ball: Option<PathBuf>,
    /// `None`: the largest circle about the middle of its photograph.
    pub ball: Option<Ball>,
    pub depth: Option<PathBuf>,
    pub depth_unit: Option<DepthUnit>,
    /// A proxy in the axes of the scan, or of the scene.
    pub mesh: Option<PathBuf>,
}

/// Two pixels of the photograph and how far what they show is apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownLength {
    /// Pixels, corner origin.
    pub from: DVec2,
    pub to: DVec2,
    pub length_m: f64,
}
