//! `mixray live`: a scene over a running stream, its camera tracked on the way.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::scene_flags::SceneFlags;
use super::terminal::summarize_aside;
use super::threads::ThreadsFlag;
use super::track_values::{Chosen, Gamma, family, gamma, known_readout};
use super::values::{above_zero, choice, rays_per_pixel};
use super::{Failure, Outcome, interrupt, say};
use crate::live::{LiveEvent, LiveOptions, run_live};
use crate::output::{check_writable_as, write_text};
use crate::renderer::Watcher;
use crate::scene::{BackendChoice, Overrides};
use crate::tracking::Code;
use crate::video::Matrix;

/// Renders a scene's virtual objects into a running stream, its camera found from markers
///
/// The newest frame wins; those that come meanwhile are dropped and counted. Pictures and their rays are fitted into the frame's time. Ctrl-C ends it after a whole frame.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML); its photograph is not needed, nor are its intrinsics if --intrinsics brings them
    scene: PathBuf,
    /// Y4M file or pipe, or - for standard input
    #[arg(long, value_name = "PATH", default_value = "-")]
    input: PathBuf,
    /// .y4m file, or - for standard output [default: -, with --window none]
    #[arg(short, long, value_name = "PATH")]
    output: Option<PathBuf>,
    /// Shows the newest frame, and how it goes, in a window that Esc closes
    #[cfg(feature = "preview")]
    #[arg(long)]
    window: bool,
    /// What is in the stream: a board's file, or the report (track --report) of a video of it, whose bent paper and gamma are taken over
    #[arg(long, value_name = "FILE")]
    board: PathBuf,
    /// Family of the markers, where the board does not tell it
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = family)]
    family: Chosen,
    /// OpenCV calibration (YAML) in place of the scene's intrinsics
    #[arg(long, value_name = "CAL.yaml")]
    intrinsics: Option<PathBuf>,
    /// How codes become light: auto (the report's, else srgb), srgb, or light is the code to this power
    #[arg(long, value_name = "GAMMA", default_value = "auto", value_parser = gamma)]
    gamma: Gamma,
    /// From the sensor's first row to its last, such as 20ms (below 0: from the lowest row up); poses are then those of the middle row's time, by the poses before
    #[arg(long, value_name = "TIME", value_parser = known_readout, allow_hyphen_values = true)]
    readout_time: Option<f64>,
    /// Frames a second that pictures and their rays are fitted to
    #[arg(long, value_name = "RATE", default_value = "15", value_parser = above_zero)]
    fps: f64,
    /// What the sides of a picture may be divided by while the camera moves, where a ray for each pixel does not fit; 1: it is never coarser than the stream
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..=8))]
    coarsest: u32,
    /// Rays for each pixel at most [default: the scene's]
    #[arg(long, value_name = "N", value_parser = rays_per_pixel(1))]
    rpp: Option<u32>,
    /// Seconds that the last pose stands for those that are not found
    #[arg(long, value_name = "SECONDS", default_value = "0.5", value_parser = hold)]
    hold: Duration,
    /// Leaves the noise of few rays as it is
    #[arg(long)]
    no_filter: bool,
    /// Writes the picture before again for each dropped frame, so that a recording keeps its time
    #[arg(long)]
    keep_time: bool,
    /// Y'CbCr of the stream [default: 709 from 720 lines on, else 601]
    #[arg(long, value_name = "MATRIX", value_parser = super::frame_flags::matrix)]
    matrix: Option<Matrix>,
    /// Seconds between summaries on standard error
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = above_zero)]
    summary: f64,
    /// Where to render; auto: on a hardware GPU if there is one
    #[arg(long, value_parser = choice::<BackendChoice>())]
    backend: Option<BackendChoice>,
    /// Replace a film of another run
    #[arg(long)]
    overwrite: bool,
    /// Write ages, times and counts as JSON
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    scene_flags: SceneFlags,
    #[command(flatten)]
    threads: ThreadsFlag,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    arguments.threads.start()?;
    if let Some(path) = &arguments.stats {
        check_writable_as(path, "json")?;
    }
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let stats = match arguments.is_shown() {
        #[cfg(feature = "preview")]
        true => run_in_window(arguments, &cancelled)?,
        _ => run_live(
            &arguments.options(),
            &Watcher::none().cancelled_by(&cancelled),
            &tell,
        )?,
    };
    // Standard output may be the film.
    summarize_aside(&stats.text());
    if let Some(path) = &arguments.stats {
        write_text(path, &serde_json::to_string_pretty(&stats)?)?;
    }
    Ok(Outcome::Done)
}

fn tell(event: &LiveEvent<'_>) {
    match event {
        LiveEvent::Warning(message) => say("warning", message),
        LiveEvent::Note(message) => say("note", message),
        LiveEvent::Summary(window) => say("live", &window.text()),
        LiveEvent::Frame(_) => {}
    }
}

/// The window wants the program's first thread; the stream runs on another.
#[cfg(feature = "preview")]
fn run_in_window(
    arguments: &Arguments,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<crate::live::LiveStats, Failure> {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use crate::preview::window::{StreamFeed, show_stream};

    let feed = Arc::new(StreamFeed::default());
    let is_closed = AtomicBool::new(false);
    let hear = |event: &LiveEvent<'_>| {
        tell(event);
        match event {
            LiveEvent::Frame(frame) => {
                feed.show([frame.width as usize, frame.height as usize], &frame.codes);
            }
            LiveEvent::Summary(window) => feed.say(window.text()),
            LiveEvent::Warning(_) | LiveEvent::Note(_) => {}
        }
    };
    let run = || {
        let ends = || cancelled() || is_closed.load(Ordering::Relaxed);
        let watcher = Watcher::none().cancelled_by(&ends);
        let stats = run_live(&arguments.options(), &watcher, &hear);
        feed.end();
        stats
    };
    let title = format!("mixray live {}", arguments.scene.display());
    std::thread::scope(|scope| {
        let running = std::thread::Builder::new()
            .stack_size(super::pool::STACK_BYTES)
            .spawn_scoped(scope, run)?;
        let shown = show_stream(&title, &feed);
        is_closed.store(true, Ordering::Relaxed);
        let stats = running
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        shown?;
        Ok(stats?)
    })
}

impl Arguments {
    fn is_shown(&self) -> bool {
        #[cfg(feature = "preview")]
        return self.window;
        #[cfg(not(feature = "preview"))]
        false
    }

    fn options(&self) -> LiveOptions {
        LiveOptions {
            scene: self.scene.clone(),
            overrides: Overrides {
                rays_per_pixel: self.rpp,
                backend: self.backend,
                ..Overrides::default()
            },
            input: self.input.clone(),
            output: match &self.output {
                None if self.is_shown() => None,
                given => Some(given.clone().unwrap_or_else(|| PathBuf::from("-"))),
            },
            shows: self.is_shown(),
            board: self.board.clone(),
            code: self.family.0.map(Code::Family),
            intrinsics: self.intrinsics.clone(),
            tone: self.gamma.0,
            readout_secs: self.readout_time,
            frame_secs: 1.0 / self.fps,
            coarsest: self.coarsest,
            hold: self.hold,
            filter: !self.no_filter,
            keep_time: self.keep_time,
            matrix: self.matrix,
            summary_every: Duration::from_secs_f64(self.summary.clamp(0.1, 1e6)),
            overwrite: self.overwrite,
            sandbox: self.scene_flags.sandbox,
        }
    }
}

fn hold(text: &str) -> Result<Duration, &'static str> {
    let seconds = text.parse().ok();
    let held = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    held.ok_or("expected seconds, 0 or more")
}
