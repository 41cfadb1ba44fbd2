//! `mixray preview`: the window; without the feature, how to get it.

#[cfg(not(feature = "preview"))]
use clap::Args;

use super::{Failure, Outcome};

/// Opens a window on a scene, in which it is composed
///
/// Edits show at once and are saved into the scene file. The window is a cargo feature: cargo build --release --features preview.
#[cfg(not(feature = "preview"))]
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML), and what the window takes
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    _words: Vec<std::ffi::OsString>,
}

#[cfg(not(feature = "preview"))]
pub(super) fn run(_: &Arguments) -> Result<Outcome, Failure> {
    Err(Failure(
        "this mixray is built without its window; build it with `cargo build --release --features preview`, or use `mixray render`"
            .to_owned(),
    ))
}

#[cfg(feature = "preview")]
pub(super) use window::{Arguments, run};

#[cfg(feature = "preview")]
mod window {
    use std::path::PathBuf;
    use std::time::Duration;

    use clap::Args;

    use super::{Failure, Outcome};
    use crate::cli::terminal::{print, say};
    use crate::cli::threads::ThreadsFlag;
    use crate::preview::frames::Frames;
    use crate::preview::session::Session;
    use crate::preview::{headless, script, window};
    use crate::scene::trajectory::FORMATS;

    /// Opens a window on a scene, in which it is composed
    ///
    /// Edits show at once and are saved into the scene file.
    #[derive(Debug, Args)]
    pub(in crate::cli) struct Arguments {
        /// Scene file (TOML)
        scene: PathBuf,
        /// Frames a second that an edit aims at; the rays of the first picture follow from it
        #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=1000))]
        fps: u32,
        /// Run the steps of this file without a display, and end (see docs/preview.md)
        #[arg(long, value_name = "FILE")]
        headless_script: Option<PathBuf>,
        /// Folder of a video's frames, for a timeline; with --trajectory
        #[arg(long, value_name = "FOLDER", requires = "trajectory")]
        frames: Option<PathBuf>,
        #[arg(long, value_name = "FILE", requires = "frames", help = format!("Poses of the frames: {FORMATS}"))]
        trajectory: Option<PathBuf>,
        #[command(flatten)]
        threads: ThreadsFlag,
    }

    pub(in crate::cli) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
        arguments.threads.start()?;
        let frame_time = Duration::from_secs(1) / arguments.fps;
        let frames = match (&arguments.frames, &arguments.trajectory) {
            (Some(folder), Some(poses)) => Some(Frames::open(folder, poses).map_err(Failure)?),
            _ => None,
        };
        let Some(path) = &arguments.headless_script else {
            window::run(&arguments.scene, frames, frame_time)?;
            return Ok(Outcome::Done);
        };
        let name = path.display();
        let text = std::fs::read_to_string(path).map_err(|error| {
            Failure(format!(
                "{name}: cannot be read ({error}); expected a script; correct the path"
            ))
        })?;
        let steps = script::parse(&text)
            .map_err(|(line, problem)| Failure(format!("{name}:{line}: {problem}")))?;
        let mut tell = |text: &str| {
            // A closed pipe ends nothing here.
            let _ = print(text);
        };
        let mut session = Session::open(&arguments.scene, frame_time, || ())
            .map_err(|error| Failure(error.to_string()))?;
        if let Some(frames) = frames {
            session.follow(frames);
        }
        match headless::run_on(session, &steps, &mut tell) {
            Ok(()) => Ok(Outcome::Done),
            Err(failed) => {
                let message = format!("{name}:{}: {}", failed.line, failed.problem);
                say("failed", &message);
                Ok(Outcome::CheckFailed)
            }
        }
    }
}
