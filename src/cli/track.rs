//! `mixray track`: camera poses from the markers or the chessboard in a video.

use std::path::{Path, PathBuf};

use clap::Args;

use super::progress::Steps;
use super::terminal::summarize;
use super::threads::ThreadsFlag;
use super::track_values::{Chosen, Gamma, family, flatness, gamma, readout};
use super::values::length;
use super::{Failure, Outcome};
use crate::output::{check_writable, check_writable_as, extension_among, write_bytes, write_text};
use crate::scene::trajectory::{Focal, read_intrinsics};
use crate::tracking::{
    Code, Flatness, Lens, Readout, Target, TrackOptions, USUAL_SHARE, read_board, read_patterns,
    track,
};

/// Finds the camera's pose in every frame from markers or a chessboard
///
/// Writes a trajectory for `mixray sequence`, and beside it the calibration as OpenCV has it. Frames that show too little have a null pose.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder of pictures, .y4m file, file of JPEG pictures one after the other, or - for Y4M on standard input
    #[arg(required_unless_present = "print_board")]
    video: Option<PathBuf>,
    /// What is in the video: TOML ([grid], [[marker]], [chessboard] or [charuco]), or Kalibr's YAML
    #[arg(
        long,
        value_name = "BOARD.toml",
        required_unless_present_any = ["marker_size", "print_board"]
    )]
    board: Option<PathBuf>,
    /// Side of the markers' black squares, such as 40mm, where no file says how they lie; they are put together from the frames
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with = "board")]
    marker_size: Option<f64>,
    /// Family of the markers: auto, apriltag-36h11, aruco-4x4, square-binary-3x3, artoolkit-4x4-bch-13-9-3, ...
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = family)]
    family: Chosen,
    /// Pattern file of ARToolKit (.patt) that a marker shows, in place of a family; once for each marker, ids count from 0
    #[arg(long, value_name = "FILE.patt", conflicts_with_all = ["family", "print_board"])]
    pattern: Vec<PathBuf>,
    /// Of a marker's side, what its pattern fills
    #[arg(long, value_name = "SHARE", default_value_t = USUAL_SHARE, requires = "pattern")]
    pattern_share: f64,
    /// OpenCV calibration (YAML) to begin with
    #[arg(long, value_name = "CAL.yaml")]
    intrinsics: Option<PathBuf>,
    /// The calibration holds as it is
    #[arg(long, requires = "intrinsics")]
    fix_intrinsics: bool,
    /// How codes become light: auto, srgb, or light is the code to this power
    #[arg(long, value_name = "GAMMA", default_value = "auto", value_parser = gamma)]
    gamma: Gamma,
    /// How far the board's surface may bend out of its plane, or "rigid"
    #[arg(long, value_name = "LENGTH", default_value = "2mm", value_parser = flatness)]
    board_flatness: Flatness,
    /// From the sensor's first row to its last, such as 20ms (below 0: from the lowest row up), or "solve"; poses are then those of the middle row's time
    #[arg(long, value_name = "TIME", value_parser = readout, allow_hyphen_values = true)]
    readout_time: Option<Readout>,
    /// Smooths the poses by what their covariances leave open, and says how far they were moved
    #[arg(long)]
    smooth: bool,
    /// Poses for `mixray sequence` (.json); the calibration goes to the same name with .yaml
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Everything that was found: corners, residuals, covariances, the board as it is
    #[arg(long, value_name = "track.json")]
    report: Option<PathBuf>,
    /// The frames with what was found drawn on them
    #[arg(long, value_name = "check.y4m")]
    overlay: Option<PathBuf>,
    /// Twelve of them in one picture
    #[arg(long, value_name = "check.png")]
    sheet: Option<PathBuf>,
    /// A scene to begin with: the board's plane, and a box on it
    #[arg(long, value_name = "OUT.toml")]
    scene: Option<PathBuf>,
    /// Tracks nothing, and writes this board to --output as an SVG or a PDF to print
    #[arg(long, value_name = "BOARD.toml", conflicts_with_all = ["video", "board", "marker_size"])]
    print_board: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadsFlag,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.threads.start()?;
    match (&arguments.print_board, &arguments.video) {
        (Some(board), _) => {
            let output = &arguments.output;
            check_writable(output)?;
            let extension = extension_among(output, &["svg", "pdf"])?;
            let sheet = read_board(board)?.sheet()?;
            match extension {
                Some("pdf") => write_bytes(output, &sheet.pdf())?,
                _ => write_text(output, &sheet.svg())?,
            }
        }
        (None, Some(video)) => run_on(video, arguments)?,
        (None, None) => unreachable!("clap asks for one of them"),
    }
    Ok(Outcome::Done)
}

fn run_on(video: &Path, arguments: &Arguments) -> Result<(), Failure> {
    let options = arguments.options()?;
    let calibration = arguments.output.with_extension("yaml");
    let (report, scene) = (arguments.report.as_ref(), arguments.scene.as_ref());
    let (overlay, sheet) = (arguments.overlay.as_ref(), arguments.sheet.as_ref());
    let outputs = [
        (Some(&arguments.output), "json"),
        (Some(&calibration), "yaml"),
        (report, "json"),
        (scene, "toml"),
        (overlay, "y4m"),
        (sheet, "png"),
    ];
    for (path, extension) in outputs {
        if let Some(path) = path {
            check_writable_as(path, extension)?;
        }
    }
    let steps = Steps::new(0);
    let tracked = track(video, &options, &|frames| {
        steps.say(&format!("{frames} frames looked at"));
    });
    steps.clear();
    let mut session = tracked?;
    if arguments.smooth {
        session.smooth();
    }
    write_text(
        &arguments.output,
        &serde_json::to_string(&session.trajectory())?,
    )?;
    write_text(&calibration, &session.calibration())?;
    if let Some(path) = report {
        write_text(path, &serde_json::to_string(&session.report())?)?;
    }
    if let Some(path) = scene {
        write_text(path, &session.starter_scene())?;
    }
    if let Some(path) = overlay {
        session.write_overlay(video, path)?;
    }
    if let Some(path) = sheet {
        session.write_sheet(video, path)?;
    }
    summarize(&session.summary())
}

impl Arguments {
    fn options(&self) -> Result<TrackOptions, Failure> {
        let target = match (&self.board, self.marker_size) {
            (Some(path), _) => Target::Board(read_board(path)?),
            (None, Some(side_m)) => Target::Markers { side_m },
            (None, None) => unreachable!("clap asks for one of them"),
        };
        Ok(TrackOptions {
            target,
            code: self.code()?,
            lens: self.lens()?,
            fix_lens: self.fix_intrinsics,
            tone: self.gamma.0,
            flatness: self.board_flatness,
            readout: self.readout_time,
        })
    }

    fn code(&self) -> Result<Option<Code>, Failure> {
        if self.pattern.is_empty() {
            return Ok(self.family.0.map(Code::Family));
        }
        Ok(Some(read_patterns(&self.pattern, self.pattern_share)?))
    }

    fn lens(&self) -> Result<Option<Lens>, Failure> {
        let Some(path) = &self.intrinsics else {
            return Ok(None);
        };
        let intrinsics = read_intrinsics(path)?;
        let (Focal::Pixels([fx, fy]), Some([cx, cy])) = (intrinsics.focal, intrinsics.centre)
        else {
            return Err(Failure(format!(
                "{}: it has a field of view only; expected focal length and centre in pixels; export it again",
                path.display()
            )));
        };
        if !self.fix_intrinsics && intrinsics.distortion.model != crate::distortion::LENS_RADIAL {
            return Err(Failure(format!(
                "{}: its lens has more than k1 k2 p1 p2 k3, which are all that can be solved for; expected it fixed; give --fix-intrinsics",
                path.display()
            )));
        }
        Ok(Some(Lens {
            focal: [fx, fy].into(),
            centre: [cx, cy].into(),
            distortion: intrinsics.distortion,
        }))
    }
}
