//! `mixray sequence`: a scene over the frames of a video, each with its own camera pose.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::picture_flags::PictureFlags;
use super::progress::Steps;
use super::render::say_idle;
use super::terminal::print_aside;
use super::values::{length, whole_range};
use super::{Failure, Outcome, interrupt, print, say};
use crate::output::{check_writable, write_text};
use crate::renderer::Watcher;
use crate::scene::Overrides;
use crate::scene::trajectory::FORMATS;
use crate::sequence::{
    Event, RenderedSequence, ScaleFrom, SequenceOptions, Sighting, check_poses, read_clicks,
    render_sequence,
};
use crate::video::Matrix;

/// Renders a scene's virtual objects into the frames of a video
///
/// Flags win over the scene file. Frames that an earlier run of the same command finished are kept. Ctrl-C ends after what is finished.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML); its photograph is not needed, nor are its intrinsics if the trajectory brings them
    scene: PathBuf,
    /// Folder of pictures, .y4m file, file of JPEG pictures one after the other, or - for Y4M on standard input
    #[arg(long, value_name = "PATH")]
    frames: Option<PathBuf>,
    #[arg(long, value_name = "FILE", help = format!("Poses: {FORMATS}"))]
    trajectory: PathBuf,
    /// OpenCV calibration (YAML) in place of the intrinsics of trajectory and scene
    #[arg(long, value_name = "FILE")]
    intrinsics: Option<PathBuf>,
    /// Folder for PNG files, .y4m file, or - for Y4M on standard output
    #[arg(short, long, value_name = "PATH", required_unless_present = "check")]
    output: Option<PathBuf>,
    /// Only the frames with these numbers, FROM to TO - 1
    #[arg(long, value_name = "FROM..TO", value_parser = whole_range)]
    range: Option<(u32, u32)>,
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
    /// Replace frames of another render
    #[arg(long)]
    overwrite: bool,
    /// Check the poses against points (CSV: frame,x_px,y_px,x_m,y_m,z_m; for COLMAP its own) and render nothing
    #[arg(long, value_name = "POINTS.csv", num_args = 0..=1)]
    check: Option<Option<PathBuf>>,
    /// Largest reprojection error that passes, pixels
    #[arg(long, value_name = "PX", default_value_t = 2.0, value_parser = positive)]
    max_error: f64,
    #[command(flatten)]
    flags: PictureFlags,
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

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.flags.start_threads()?;
    match &arguments.check {
        Some(points) => check(arguments, points.as_deref()),
        None => render(arguments),
    }
}

impl Arguments {
    fn options(&self) -> Result<SequenceOptions, Failure> {
        let goal = self.flags.goal.goal(self.flags.rpp)?;
        Ok(SequenceOptions {
            scene: self.scene.clone(),
            overrides: Overrides {
                // With a goal it is a limit, and not what the pilot plans for.
                rays_per_pixel: self.flags.rpp.filter(|_| goal.is_none()),
                ..self.flags.overrides()
            },
            goal,
            filter: self.flags.goal.filter,
            without: self.flags.without(),
            frames: self.frames.clone(),
            trajectory: self.trajectory.clone(),
            intrinsics: self.intrinsics.clone(),
            scale_from: self.scale()?,
            pass_missing_poses: self.missing_poses == Missing::Pass,
            output: self.output.clone().unwrap_or_else(|| "-".into()),
            range: self.range,
            allow_gaps: self.allow_gaps,
            pass_damaged_frames: self.damaged_frames == Damaged::Pass,
            matrix: self.matrix,
            frames_per_second: self.fps,
            focus_pull_m: self.focus_pull,
            overwrite: self.overwrite,
            png_bits: self.flags.png_bits,
            sandbox: self.flags.scene.sandbox,
        })
    }
}

impl Arguments {
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

fn check(arguments: &Arguments, points: Option<&Path>) -> Result<Outcome, Failure> {
    let reprojection = check_poses(&arguments.options()?, points, &tell)?;
    print(&reprojection.text)?;
    Ok(match reprojection.worst_px <= arguments.max_error {
        true => Outcome::Done,
        false => Outcome::CheckFailed,
    })
}

fn render(arguments: &Arguments) -> Result<Outcome, Failure> {
    let options = arguments.options()?;
    if let Some(path) = &arguments.flags.stats {
        check_writable(path)?;
    }
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let steps = Steps::new(0);
    let hear = |event: &Event<'_>| match event {
        Event::Plan { frames } => steps.expect(frames.unwrap_or(0) as u64),
        Event::Begins { label, .. } => steps.say(label),
        Event::Ends { .. } => steps.step(),
        told => steps.aside(|| tell(told)),
    };
    let watcher = Watcher::none().cancelled_by(&cancelled);
    let rendered = render_sequence(&options, &watcher, &hear);
    steps.clear();
    let RenderedSequence { stats, complete } = rendered?;
    if let Some(path) = &arguments.flags.stats {
        write_text(path, &serde_json::to_string_pretty(&stats)?)?;
    }
    let text = stats.text(&options.output.display().to_string());
    match options.output == Path::new("-") {
        // Standard output is the film.
        true => print_aside(&text),
        false => print(&text)?,
    }
    if stats.non_finite_samples > 0 {
        let message = format!(
            "{} samples were not finite and are left out",
            stats.non_finite_samples
        );
        say("warning", &message);
    }
    Ok(match complete {
        true => Outcome::Done,
        false => Outcome::Interrupted,
    })
}

fn tell(event: &Event<'_>) {
    match event {
        Event::Warning(text) => say("warning", text),
        Event::Note(text) => say("note", text),
        Event::Idle { saving, reason } => say_idle(saving, reason),
        Event::Plan { .. } | Event::Begins { .. } | Event::Ends { .. } => {}
    }
}

pub(super) fn matrix(text: &str) -> Result<Matrix, &'static str> {
    match text {
        "601" => Ok(Matrix::Bt601),
        "709" => Ok(Matrix::Bt709),
        _ => Err("expected 601 or 709"),
    }
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

fn positive(text: &str) -> Result<f64, &'static str> {
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
