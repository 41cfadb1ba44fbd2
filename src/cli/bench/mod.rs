//! `mixray bench`: time against error, and the other measurements, each a subcommand.

mod conclusions;
mod docs;
mod files;
mod flags;
mod gpu_code;
mod gpu_frame;
mod gpu_time;
mod growth;
mod on_gpu;
mod paper;
mod regression;
mod rows;
mod stress;

use clap::{Args, Subcommand};

use super::{Failure, Outcome};

/// Measures time against error
///
/// Renders each scene at each number of rays per pixel with every combination of backend, estimator, sampler and composite, in turns, and compares
/// with a converged reference, which is made once and kept in the output folder. Writes results.csv, results.json, plots (SVG, PNG) and
/// index.html. Ctrl-C keeps what is finished.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    measurement: Option<Measurement>,
    #[command(flatten)]
    rows: rows::Arguments,
    #[command(flatten)]
    moved: Moved,
}

#[derive(Debug, Subcommand)]
enum Measurement {
    Ablate(Box<rows::Arguments>),
    Growth(growth::Arguments),
    PaperTable(paper::Arguments),
    Stress(stress::Arguments),
    GpuTime(gpu_time::Arguments),
    GpuFrame(gpu_frame::Arguments),
    GpuCode(gpu_code::Arguments),
}

/// What subcommands were called when they were flags.
#[derive(Debug, Args)]
struct Moved {
    #[arg(long, hide = true)]
    ablate: bool,
    #[arg(long, hide = true, num_args = 0.., require_equals = true)]
    growth: Option<Vec<String>>,
    #[arg(long, hide = true)]
    paper_table: bool,
    #[arg(long, hide = true)]
    stress: bool,
    #[arg(long, hide = true)]
    gpu_time: bool,
}

impl Moved {
    fn refuse(&self) -> Result<(), Failure> {
        for (given, flag, now) in [
            (self.ablate, "--ablate", "ablate SCENE..."),
            (self.growth.is_some(), "--growth", "growth [WHAT,...]"),
            (self.paper_table, "--paper-table", "paper-table"),
            (self.stress, "--stress", "stress"),
            (self.gpu_time, "--gpu-time", "gpu-time SCENE..."),
        ] {
            if given {
                return Err(Failure(format!(
                    "{flag} is no flag of `mixray bench` any more; expected the subcommand; type `mixray bench {now}`"
                )));
            }
        }
        Ok(())
    }
}

pub(super) fn run(arguments: Arguments) -> Result<Outcome, Failure> {
    arguments.moved.refuse()?;
    match arguments.measurement {
        None => rows::run(arguments.rows),
        Some(Measurement::Ablate(rows)) => rows::run(rows.ablated()?),
        Some(Measurement::Growth(arguments)) => growth::run(&arguments),
        Some(Measurement::PaperTable(arguments)) => paper::run(&arguments),
        Some(Measurement::Stress(arguments)) => stress::run(&arguments),
        Some(Measurement::GpuTime(arguments)) => gpu_time::run(&arguments),
        Some(Measurement::GpuFrame(arguments)) => gpu_frame::run(&arguments),
        Some(Measurement::GpuCode(arguments)) => gpu_code::run(&arguments),
    }
}

/// What was typed, with the program by its name.
fn command_line() -> String {
    let quoted = std::env::args().skip(1).map(|argument| {
        if argument.chars().any(char::is_whitespace) || argument.is_empty() {
            format!("'{argument}'")
        } else {
            argument
        }
    });
    std::iter::once("mixray".to_owned())
        .chain(quoted)
        .collect::<Vec<_>>()
        .join(" ")
}
