//! `mixray sequence`: a scene over the frames of a video, each with its own camera pose.

use std::path::{Path, PathBuf};

use clap::Args;

use super::frame_flags::{FrameFlags, positive};
use super::picture_flags::PictureFlags;
use super::progress::Steps;
use super::render::say_idle;
use super::terminal::summarize_aside;
use super::values::part;
use super::{Failure, Outcome, interrupt, print, say, summarize};
use crate::output::{check_writable_as, write_text};
use crate::renderer::Watcher;
use crate::scene::trajectory::FORMATS;
use crate::sequence::{Event, RenderedSequence, SequenceOptions, check_poses, render_sequence};

/// Renders a scene's virtual objects into the frames of a video
///
/// Flags win over the scene file. Frames that an earlier run of the same command finished are kept. Ctrl-C ends after what is finished.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML); its photograph is not needed, nor are its intrinsics if the trajectory brings them
    scene: PathBuf,
    #[arg(long, value_name = "FILE", help = format!("Poses: {FORMATS}"))]
    trajectory: PathBuf,
    /// Folder for pictures, pattern of their names with # for the digits of a frame's number (out.####.exr), .y4m file, or - for Y4M on
    /// standard output
    #[arg(short, long, value_name = "PATH", required_unless_present = "check")]
    output: Option<PathBuf>,
    /// Of the range render only these, each as the whole range has it: FROM..TO (to TO - 1), or FROM-LAST
    #[arg(long, value_name = "FROM..TO", value_parser = part)]
    part: Option<(u32, u32)>,
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
    frames: FrameFlags,
    #[command(flatten)]
    flags: PictureFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.flags.start_threads()?;
    if let Some(path) = &arguments.flags.stats {
        check_writable_as(path, "json")?;
    }
    match &arguments.check {
        Some(points) => check(arguments, points.as_deref()),
        None => render(arguments),
    }
}

impl Arguments {
    fn options(&self) -> Result<SequenceOptions, Failure> {
        let output = self.output.clone().unwrap_or_else(|| "-".into());
        let files = (self.scene.clone(), self.trajectory.clone());
        Ok(SequenceOptions {
            part: self.part,
            overwrite: self.overwrite,
            ..self.frames.options(files, output, &self.flags)?
        })
    }
}

fn check(arguments: &Arguments, points: Option<&Path>) -> Result<Outcome, Failure> {
    let reprojection = check_poses(&arguments.options()?, points, &tell)?;
    if let Some(path) = &arguments.flags.stats {
        write_text(path, &serde_json::to_string_pretty(&reprojection)?)?;
    }
    print(&reprojection.text())?;
    let worst_px = reprojection.largest_px.unwrap_or(0.0);
    Ok(match worst_px <= arguments.max_error {
        true => Outcome::Done,
        false => Outcome::CheckFailed,
    })
}

fn render(arguments: &Arguments) -> Result<Outcome, Failure> {
    let options = arguments.options()?;
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let to_engine = arguments.flags.progress;
    if to_engine.is_some() && options.output == Path::new("-") {
        let message =
            "--progress and -o - both want standard output; expected one of them; write a file";
        return Err(Failure(message.to_owned()));
    }
    let steps = Steps::new(0).told_to(to_engine);
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
        true => summarize_aside(&text),
        false => summarize(&text)?,
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

pub(super) fn tell(event: &Event<'_>) {
    match event {
        Event::Warning(text) => say("warning", text),
        Event::Note(text) => say("note", text),
        Event::Idle { saving, reason } => say_idle(saving, reason),
        Event::Plan { .. } | Event::Begins { .. } | Event::Ends { .. } => {}
    }
}
