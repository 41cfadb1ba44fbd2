//! A running stream augmented as it comes.
//!
//! A thread reads the stream into one place, where the newest frame wins; this one takes it from there, finds the camera from the markers in it, renders as
//! finely and with as many rays as the frame's time allows, and writes. So the age of what goes out does not grow, however long it runs.

mod ages;
mod clock;
mod driver;
mod held_pose;
mod intake;
mod ray_budget;
mod report;
mod rest;
mod resting;
mod running;
mod slot;

use std::path::PathBuf;
use std::time::Duration;

pub use driver::run_live;
pub use report::{LiveCounts, LiveStats, LiveWindow};

use crate::output::OutputError;
use crate::renderer::RenderError;
use crate::scene::trajectory::TrajectoryError;
use crate::scene::{Overrides, SceneError};
use crate::tracking::{Code, Tone, TrackError};
use crate::video::{Matrix, VideoError};

/// What is rendered into which stream, and how fast.
#[derive(Clone, Debug)]
pub struct LiveOptions {
    /// Scene file; its photograph is not needed.
    pub scene: PathBuf,
    /// What wins over the scene file; its rays per pixel are the most that a frame gets.
    pub overrides: Overrides,
    /// Y4M file or pipe, or `-` for standard input.
    pub input: PathBuf,
    /// A `.y4m` file, or `-` for standard output; `None`: frames are only heard of.
    pub output: Option<PathBuf>,
    /// Each frame that is done is heard of.
    pub shows: bool,
    /// Board file, or the report of a tracked video.
    pub board: PathBuf,
    /// Where the board does not tell it; `None`: whichever is found.
    pub code: Option<Code>,
    /// OpenCV calibration in place of the scene's intrinsics.
    pub intrinsics: Option<PathBuf>,
    /// In place of the board's.
    pub tone: Option<Tone>,
    /// What the sensor takes from its first row to its last (below 0: from the lowest up); `None`: all rows are of one time.
    pub readout_secs: Option<f64>,
    /// The time that pictures and rays are fitted into.
    pub frame_secs: f64,
    /// What the sides of a picture may be divided by while the camera moves, so that it fits; 1: it is never coarser than the stream.
    pub coarsest: u32,
    /// How long the last pose stands for those that are not found.
    pub hold: Duration,
    /// The difference is smoothed, as few rays call for.
    pub filter: bool,
    /// The picture before is written again for each frame that was dropped, so that a recording keeps its time.
    pub keep_time: bool,
    /// Of the Y'CbCr of the stream; by its height where it is not given.
    pub matrix: Option<Matrix>,
    /// How often the caller hears of a [`LiveWindow`].
    pub summary_every: Duration,
    pub overwrite: bool,
    /// Refuses files outside the scene's folder that the scene names: for scenes of others.
    pub sandbox: bool,
}

/// What is heard on the way.
#[derive(Clone, Debug)]
pub enum LiveEvent<'a> {
    /// Something in a file is ignored or doubtful.
    Warning(&'a str),
    /// Something that the user may want to know.
    Note(&'a str),
    /// What happened since the last one.
    Summary(&'a LiveWindow),
    /// A frame is done; only where [`LiveOptions::shows`] asks for it.
    Frame(&'a LiveFrame),
}

/// A frame as it goes out.
#[derive(Clone, Debug)]
pub struct LiveFrame {
    pub width: u32,
    pub height: u32,
    /// sRGB, row-major from the top left.
    pub codes: Vec<[u8; 3]>,
}

/// Why a stream cannot be augmented, in one line. What is written stays.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    Track(#[from] TrackError),
    #[error(transparent)]
    Video(#[from] VideoError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Output(#[from] OutputError),
    /// "problem; expected ...; mend".
    #[error("{0}")]
    Unfit(String),
}
