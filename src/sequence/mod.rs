//! A scene over the frames of a video, each with its own camera pose.
//!
//! ```no_run
//! use mixray::renderer::Watcher;
//! use mixray::sequence::{Event, SequenceOptions, render_sequence};
//!
//! # fn main() -> Result<(), mixray::sequence::SequenceError> {
//! let options = SequenceOptions::new("scene.toml", "frames/", "poses.json", "out/");
//! let rendered = render_sequence(&options, &Watcher::none(), &|event: &Event<'_>| {
//!     if let Event::Ends { number, .. } = event {
//!         eprintln!("frame {number} is there");
//!     }
//! })?;
//! println!("{} frames", rendered.stats.frames.rendered);
//! # Ok(())
//! # }
//! ```

mod check;
mod driver;
mod plan;
mod report;
mod scale;
mod survey;
mod table;
mod whole;

use std::path::PathBuf;

pub use check::{FrameReprojection, Reprojection, check_poses};
pub use driver::{RenderedSequence, render_sequence};
pub use report::{FrameCounts, SequenceSeconds, SequenceStats};
pub use scale::{ScaleFrom, Sighting, read_clicks};
pub use survey::{Survey, survey};

use crate::output::{ExrLayer, Format, OutputError, PngBits};
use crate::renderer::{Filter, Goal, RenderError, Without};
use crate::scene::trajectory::TrajectoryError;
use crate::scene::{Overrides, SceneError};
use crate::video::{Matrix, VideoError};

/// What is rendered, over which frames, to where.
#[derive(Clone, Debug)]
pub struct SequenceOptions {
    /// Scene file; its photograph is not needed, nor are its intrinsics if the trajectory brings them.
    pub scene: PathBuf,
    /// What wins over the scene file; frame n has the seed plus n.
    pub overrides: Overrides,
    /// Savings to do without.
    pub without: Without,
    /// Every frame is rendered to an error; nothing may move while the shutter is open.
    pub goal: Option<Goal>,
    pub filter: Option<Filter>,
    /// Folder of pictures, .y4m file, file of JPEG pictures one after the other, or `-` for Y4M on standard input. Only
    /// [`check_poses`] does without.
    pub frames: Option<PathBuf>,
    /// Poses, in any format that [`Trajectory::read`](crate::scene::trajectory::Trajectory::read) knows.
    pub trajectory: PathBuf,
    /// OpenCV calibration in place of the intrinsics of trajectory and scene.
    pub intrinsics: Option<PathBuf>,
    /// A known distance, where the poses know no metres.
    pub scale_from: Option<ScaleFrom>,
    /// Frames without an entry among the poses pass through; else they are errors.
    pub pass_missing_poses: bool,
    /// Folder for pictures, pattern of their names (`out.####.exr`), .y4m file, or `-` for Y4M on standard output.
    pub output: PathBuf,
    /// Of pictures in a folder; PNG where it is not given.
    pub format: Option<Format>,
    /// Of EXR files; none: those that are usual.
    pub layers: Vec<ExrLayer>,
    /// Numbers of the frames to render, the end not included.
    pub range: Option<(u32, u32)>,
    /// Of the range only these are rendered and written, the end not included, each equal to the same frame of the whole range.
    pub part: Option<(u32, u32)>,
    /// Numbers may be missing among the frames of a folder.
    pub allow_gaps: bool,
    /// Frames of which a part is lost are named and go on as they are; else they are errors.
    pub pass_damaged_frames: bool,
    /// Of the Y'CbCr of films; by their height where it is not given.
    pub matrix: Option<Matrix>,
    /// Where neither the frames nor the trajectory tell.
    pub frames_per_second: Option<f64>,
    /// Focus distance over the range, from the first to the last frame, at a constant rate in 1/m.
    pub focus_pull_m: Option<(f64, f64)>,
    /// Frames of another render are replaced; files that are read never are.
    pub overwrite: bool,
    /// 16 where a frame has 16, else 8.
    pub png_bits: Option<PngBits>,
    /// Refuses files outside the scene's folder that the scene names: for scenes of others.
    pub sandbox: bool,
}

impl SequenceOptions {
    /// All frames, everything else as the scene file says.
    pub fn new(
        scene: impl Into<PathBuf>,
        frames: impl Into<PathBuf>,
        trajectory: impl Into<PathBuf>,
        output: impl Into<PathBuf>,
    ) -> Self {
        Self {
            scene: scene.into(),
            overrides: Overrides::default(),
            without: Without::default(),
            goal: None,
            filter: None,
            frames: Some(frames.into()),
            trajectory: trajectory.into(),
            intrinsics: None,
            scale_from: None,
            pass_missing_poses: false,
            output: output.into(),
            format: None,
            layers: Vec::new(),
            range: None,
            part: None,
            allow_gaps: false,
            pass_damaged_frames: false,
            matrix: None,
            frames_per_second: None,
            focus_pull_m: None,
            overwrite: false,
            png_bits: None,
            sandbox: false,
        }
    }
}

/// What is heard while a sequence is rendered.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<'a> {
    /// Before the first frame: how many there are, where that is known.
    Plan { frames: Option<usize> },
    /// A frame is taken up.
    Begins { label: &'a str, number: u32 },
    /// It is there: rendered, passed through, or kept from an earlier run.
    Ends { label: &'a str, number: u32 },
    /// Something in a file is ignored or doubtful.
    Warning(String),
    /// Something that the user may want to know.
    Note(String),
    /// A saving was left out in vain.
    Idle {
        saving: &'static str,
        reason: &'static str,
    },
}

/// Why a sequence cannot be rendered, in one line. Hints name the flags of `mixray sequence`, which the fields of [`SequenceOptions`] are
/// called after.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    Video(#[from] VideoError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Output(#[from] OutputError),
    /// What was asked for does not fit together: "problem; expected ...; mend".
    #[error("{0}")]
    Unfit(String),
}
