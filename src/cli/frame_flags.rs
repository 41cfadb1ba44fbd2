//! What `sequence` and `submit` both take: which frames, and how they are read.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::Failure;
use super::picture_flags::PictureFlags;
use super::values::{length, whole_range};
use crate::output::{ExrLayer, Format};
use crate::scene::Overrides;
use crate::sequence::{ScaleFrom, SequenceOptions, Sighting, read_clicks};
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
    /// Layers of EXR frames, as those of `mixray render`, and motion
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
    /// Frames that the trajectory does not have: end with an error, or let them pass through
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = Missing::Refuse)]
    missing_poses: Missing,
    /// Two points and the distance between them, where the poses know no metres: ids of markers in the frames, or points of --clicks
    #[arg(long, value_name = "A,B,0.30m", value_parser = scale_from)]
    scale_from: Option<([String; 2], f64)>,
    /// Where the points of --scale-from were seen (CSV: point,frame,x_px,y_px), two frames or more each
    #[arg(long, value_name = "CLICKS.csv", requires = "scale_from")]
    clicks: Option<PathBuf>,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Missing {
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
            scale_from: self.scale()?,
            pass_missing_poses: self.missing_poses == Missing::Pass,
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

    fn scale(&self) -> Result<Option<ScaleFrom>, Failure> {
        let Some((ends, metres)) = self.scale_from.clone() else {
            return Ok(None);
        };
        let sightings = match &self.clicks {
            Some(path) => read_clicks(path)?,
            None => marker_sightings(self.frames.as_deref(), &ends)?,
        };
        Ok(Some(ScaleFrom {
            ends,
            metres,
            sightings,
        }))
    }
}

/// Middles of the markers with these ids.
#[cfg(feature = "track")]
fn marker_sightings(frames: Option<&Path>, ends: &[String; 2]) -> Result<Vec<Sighting>, Failure> {
    let frames = frames.filter(|path| *path != Path::new("-"));
    let frames = frames.ok_or_else(|| {
        Failure("--scale-from by markers: it needs the frames twice; expected a folder or a file as --frames; name it, or give --clicks".to_owned())
    })?;
    let ids = ends.clone().map(|end| end.parse::<u32>());
    let [Ok(a), Ok(b)] = ids else {
        return Err(Failure(format!(
            "--scale-from {},{}: no ids of markers; expected two numbers, or --clicks CLICKS.csv that has these points; correct them",
            ends[0], ends[1]
        )));
    };
    Ok(crate::tracking::sight_markers(frames, [a, b])?)
}

#[cfg(not(feature = "track"))]
fn marker_sightings(_: Option<&Path>, _: &[String; 2]) -> Result<Vec<Sighting>, Failure> {
    Err(Failure("--scale-from: this program was built without markers; expected --clicks CLICKS.csv; give it".to_owned()))
}

/// "3,7,0.30m".
fn scale_from(text: &str) -> Result<([String; 2], f64), &'static str> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    match parts.as_slice() {
        [a, b, far] if a != b && !a.is_empty() && !b.is_empty() => {
            length(far).map(|metres| ([(*a).to_owned(), (*b).to_owned()], metres))
        }
        _ => Err("expected two different points and their distance, such as 3,7,0.30m"),
    }
}

fn format(text: &str) -> Result<Format, &'static str> {
    match text {
        "png" => Ok(Format::Png),
        "exr" => Ok(Format::Exr),
        _ => Err("expected png or exr"),
    }
}

pub(super) fn matrix(text: &str) -> Result<Matrix, &'static str> {
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
