//! The command line: one file a subcommand. Each turns what was typed into what it means, checked, before any work begins.
//!
//! Results go to stdout, progress and messages to stderr. Exit codes: 0 done, 1 a check failed, 2 usage or input, 130 ended by
//! Ctrl-C with the picture written.

mod antialias;
#[cfg(feature = "bench")]
mod bench;
mod bundle;
mod cartoon;
mod check;
mod compare;
mod export_blender;
mod file_info;
mod forwarded;
mod frame_flags;
mod goal_flags;
mod info;
mod interrupt;
mod layers;
#[cfg(feature = "start")]
mod light;
#[cfg(feature = "track")]
mod live;
mod merge;
mod motion_blur;
#[cfg(feature = "start")]
mod new;
mod noise;
mod pick;
mod picture_flags;
mod pool;
mod preview;
mod progress;
mod render;
mod scene_flags;
mod sequence;
mod sharpness;
mod shell;
mod stage_device;
mod submit;
mod summary;
mod terminal;
mod threads;
#[cfg(feature = "track")]
mod track;
#[cfg(feature = "track")]
mod track_values;
mod values;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::files;
use crate::scene::Photo;
use terminal::{print, say, summarize};

/// Renders virtual objects into photographs as the same camera would have taken them.
#[derive(Debug, Parser)]
#[command(name = "mixray", version, arg_required_else_help = true)]
struct Arguments {
    /// Say nothing but errors: no progress, notes, warnings and summaries
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(render::Arguments),
    Preview(preview::Arguments),
    Check(check::Arguments),
    Pick(pick::Arguments),
    Sequence(Box<sequence::Arguments>),
    #[cfg(feature = "track")]
    Track(Box<track::Arguments>),
    #[cfg(feature = "start")]
    New(Box<new::Arguments>),
    #[cfg(feature = "start")]
    Light(light::Arguments),
    #[cfg(feature = "track")]
    Live(Box<live::Arguments>),
    Merge(merge::Arguments),
    Submit(Box<submit::Arguments>),
    Bundle(bundle::Arguments),
    #[cfg(feature = "bench")]
    Bench(Box<bench::Arguments>),
    Cartoon(cartoon::Arguments),
    Noise(noise::Arguments),
    Sharpness(sharpness::Arguments),
    Antialias(antialias::Arguments),
    MotionBlur(motion_blur::Arguments),
    Compare(compare::Arguments),
    ExportBlender(export_blender::Arguments),
    Info(info::Arguments),
    Completions(shell::Completions),
    Man(shell::Manual),
}

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Done,
    CheckFailed,
    Interrupted,
}

/// Usage or input that cannot be used: the one line that says so.
#[derive(Debug)]
struct Failure(String);

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// Parses the process's arguments and runs the command.
pub fn run() -> ExitCode {
    quiet_device_selection();
    crate::memory::keep_heap_small_under_limits();
    // Windows are opened by the main thread alone.
    match opens_window(std::env::args_os()) {
        true => run_command(),
        false => pool::on_large_stack(run_command),
    }
}

fn opens_window(mut words: impl Iterator<Item = OsString>) -> bool {
    match words.nth(1) {
        Some(command) if command == "live" => words.any(|word| word == "--window"),
        Some(command) => command == "preview",
        None => false,
    }
}

/// Mesa's layer that orders devices asks the desktop, and complains on the terminal where there is none.
fn quiet_device_selection() {
    let is_set = |name: &str| std::env::var_os(name).is_some();
    if !is_set("XDG_RUNTIME_DIR") && !is_set(MESA_NO_DEVICE_SELECTION) {
        // SAFETY: no other thread runs yet.
        unsafe { std::env::set_var(MESA_NO_DEVICE_SELECTION, "1") };
    }
}

const MESA_NO_DEVICE_SELECTION: &str = "NODEVICE_SELECT";

fn run_command() -> ExitCode {
    interrupt::survive_file_limits();
    let (arguments, matches) = Arguments::command()
        .try_get_matches_from(words(std::env::args_os()))
        .and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches)))
        .unwrap_or_else(|error| end_with_usage(error));
    if arguments.quiet {
        terminal::be_quiet();
    }
    // The window writes the scene that it reads.
    if !matches!(arguments.command, Command::Preview(_)) {
        files::guard_run();
    }
    let result = match arguments.command {
        Command::Render(arguments) => arguments.check().and_then(render::run),
        Command::Preview(arguments) => preview::run(&arguments),
        Command::Check(arguments) => all_threads().and_then(|()| check::run(&arguments)),
        Command::Pick(arguments) => all_threads().and_then(|()| pick::run(&arguments)),
        Command::Sequence(arguments) => sequence::run(&arguments),
        #[cfg(feature = "track")]
        Command::Track(arguments) => track::run(&arguments),
        #[cfg(feature = "start")]
        Command::New(arguments) => new::run(&arguments),
        #[cfg(feature = "start")]
        Command::Light(arguments) => all_threads().and_then(|()| light::run(&arguments)),
        #[cfg(feature = "track")]
        Command::Live(arguments) => live::run(&arguments),
        Command::Merge(arguments) => all_threads().and_then(|()| merge::run(&arguments)),
        Command::Submit(arguments) => {
            let typed = matches.subcommand_matches("submit").unwrap_or(&matches);
            all_threads().and_then(|()| submit::run(&arguments, typed))
        }
        Command::Bundle(arguments) => all_threads().and_then(|()| bundle::run(&arguments)),
        #[cfg(feature = "bench")]
        Command::Bench(arguments) => bench::run(*arguments),
        Command::Cartoon(arguments) => all_threads().and_then(|()| cartoon::run(&arguments)),
        Command::Noise(arguments) => all_threads().and_then(|()| noise::run(&arguments)),
        Command::Sharpness(arguments) => all_threads().and_then(|()| sharpness::run(&arguments)),
        Command::Antialias(arguments) => all_threads().and_then(|()| antialias::run(&arguments)),
        Command::MotionBlur(arguments) => all_threads().and_then(|()| motion_blur::run(&arguments)),
        Command::Compare(arguments) => all_threads().and_then(|()| compare::run(&arguments)),
        Command::ExportBlender(arguments) => {
            all_threads().and_then(|()| export_blender::run(&arguments))
        }
        Command::Info(arguments) => all_threads().and_then(|()| info::run(&arguments)),
        Command::Completions(arguments) => shell::completions(&arguments),
        Command::Man(arguments) => shell::manual(&arguments),
    };
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(1),
        Ok(Outcome::Interrupted) => ExitCode::from(130),
        Err(Failure(message)) => {
            // What met a conflict of files may have wrapped it in its own words.
            let message = files::conflict().map_or(message, |conflict| conflict.to_string());
            say("error", &message);
            ExitCode::from(2)
        }
    }
}

/// The words of a command line. What follows `--filter` is its value only if it is `final`, so that a scene may follow as well.
fn words(given: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = Vec::new();
    for word in given {
        match words.last_mut() {
            Some(last) if last == "--filter" && word == "final" => last.push("=final"),
            _ => words.push(word),
        }
    }
    words
}

/// For commands without a flag for it.
fn all_threads() -> Result<(), Failure> {
    pool::start(None)
}

/// Reads an image of any program, warnings said.
fn read_photo(path: &Path) -> Result<Photo, Failure> {
    let (photo, warnings) =
        Photo::read(path).map_err(|problem| Failure(format!("{}: {problem}", path.display())))?;
    for warning in warnings {
        say("warning", &format!("{}: {warning}", path.display()));
    }
    Ok(photo)
}

/// Help, or why the command line cannot be used. Names of files stand in it too: clap takes control sequences out of what it quotes, so
/// that it is given them escaped.
fn end_with_usage(error: clap::Error) -> ! {
    let words = words(std::env::args_os()).into_iter();
    Arguments::try_parse_from(words.map(|word| terminal::escaped(&word.to_string_lossy())))
        .err()
        .unwrap_or(error)
        .exit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_takes_its_name_and_no_scene() {
        let filter = |line: &str| {
            let line = words(line.split(' ').map(OsString::from));
            match Arguments::try_parse_from(line).map(|arguments| arguments.command) {
                Ok(Command::Render(arguments)) => Some(arguments.filter()),
                _ => None,
            }
        };
        use crate::renderer::Filter::{Final, Preview};
        assert_eq!(filter("mixray render a.toml"), Some(None));
        assert_eq!(filter("mixray render --filter a.toml"), Some(Some(Preview)));
        assert_eq!(
            filter("mixray render a.toml --filter final"),
            Some(Some(Final))
        );
        assert_eq!(
            filter("mixray render --filter=final a.toml"),
            Some(Some(Final))
        );
        assert_eq!(filter("mixray render --filter=none a.toml"), None);
        assert_eq!(filter("mixray render --filter --range 0..2 a.toml"), None);
    }
}
