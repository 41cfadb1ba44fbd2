//! What `sequence` and `submit` both take: which frames, and how they are read.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Failure;
use super::picture_flags::PictureFlags;
use super::values::whole_range;
use crate::output::{ExrLayer, Format};
use crate::scene::Overrides;
use crate::sequence::SequenceOptions;
use crate::video::Matrix;

#[derive(Debug, Args)]
pub(super) struct FrameFlags {
    /// Folder of pictures, .y4m file, file of JPEG pictures one after the other, or - for Y4M on standard input
    #[arg(long, value_name = "PATH")]
    pub frames: Option<PathBuf>,
    /// Calibration of OpenCV, ROS or Kalibr (YAML) in place of the intrinsics of trajectory and scene
    #[arg(long, value_name = "FILE")]
    pub intrinsics: Option<PathBuf>,
    /// Pictures of a folder [default: png; in a pattern its own]
    #[arg(long, value_name = "FORMAT", value_parser = format)]
    format: Option<Format>,
    /// Layers of EXR frames, as those of `mixray render`
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Vec<ExrLayer>,
    /// Only the frames with these numbers, FROM to TO - 1
    #[arg(long, value_name = "FROM..TO", value_parser = whole_range)]
    pub range: Option<(u32, u32)>,
    /// Numbers may be missing among the frames of a folder
    #[arg(long)]
    allow_gaps: bool,
    /// Frames of which a part is lost: end with an error, or name them and let what is there of them pass
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = Damaged::Refuse)]
    damaged_frames: Damaged,
    /// Y'CbCr of films [default: 709 from 720 lines on, else 601]
    #[arg(long, value_name = "MATRIX", value_parser = matrix)]
    matrix: Option<Matrix>,
    /// Frames a second, where neither the frames nor the trajectory tell
    #[arg(long, value_name = "RATE", value_parser = positive)]
    fps: Option<f64>,
    /// Focus distance in metres over the range, from the first to the last frame, at a constant rate in 1/m
    #[arg(long, value_name = "FROM..TO", value_parser = focus_pull)]
    focus_pull: Option<(f64, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Damaged {
    Refuse,
    Pass,
}

impl FrameFlags {
    /// `files`: scene and trajectory.
    pub(super) fn options(
        &self,
        files: (PathBuf, PathBuf),
        output: PathBuf,
        flags: &PictureFlags,
    ) -> Result<SequenceOptions, Failure> {
        let goal = flags.goal.goal(flags.rpp)?;
        let (scene, trajectory) = files;
        Ok(SequenceOptions {
            scene,
            overrides: Overrides {
                // With a goal it is a limit, and not what the pilot plans for.
                rays_per_pixel: flags.rpp.filter(|_| goal.is_none()),
                ..flags.overrides()
            },
            goal,
            filter: flags.goal.filter,
            without: flags.without(),
            frames: self.frames.clone(),
            trajectory,
            intrinsics: self.intrinsics.clone(),
            output,
            format: self.format,
            layers: self.layers.clone(),
            range: self.range,
            part: None,
            allow_gaps: self.allow_gaps,
            pass_damaged_frames: self.damaged_frames == Damaged::Pass,
            matrix: self.matrix,
            frames_per_second: self.fps,
            focus_pull_m: self.focus_pull,
            overwrite: false,
            png_bits: flags.png_bits,
            sandbox: flags.scene.sandbox,
        })
    }
}

fn format(text: &str) -> Result<Format, &'static str> {
    match text {
        "png" => Ok(Format::Png),
        "exr" => Ok(Format::Exr),
        _ => Err("expected png or exr"),
    }
}

fn matrix(text: &str) -> Result<Matrix, &'static str> {
    match text {
        "601" => Ok(Matrix::Bt601),
        "709" => Ok(Matrix::Bt709),
        _ => Err("expected 601 or 709"),
    }
}

pub(super) fn positive(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 1e6 => Ok(x),
        _ => Err("expected a number above 0, at most 1000000"),
    }
}

fn focus_pull(text: &str) -> Result<(f64, f64), &'static str> {
    let ends = text.split_once("..");
    let metres = |text: &str| text.parse::<f64>().ok().filter(|x| *x > 0.0);
    match ends.and_then(|(from, to)| Some((metres(from)?, metres(to)?))) {
        Some(ends) => Ok(ends),
        None => Err("expected FROM..TO, two distances above 0 in metres, such as 0.4..2.5"),
    }
}
