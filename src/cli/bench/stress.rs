//! `mixray bench stress`: numerical stability, case by case.

use std::sync::Arc;

use clap::Args;

use super::command_line;
use super::flags::{OutputFlags, finish};
use crate::bench::Machine;
use crate::bench::stress::{Backend, Effort, Report, cases, csv, markdown, text};
use crate::cli::values::choice;
use crate::cli::{Failure, Outcome, interrupt, print, progress, say};
use crate::gpu::{AdapterChoice, GpuDevice};
use crate::output::quick::write_text;
use crate::scene::BackendChoice;

/// Numerical stability: a table of hard cases, each with the figure that it must hold against closed forms and f64 brute force; minutes
///
/// Writes stress.json, stress.csv and stress.md; exits with 1 if a case fails.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Where to render [default: cpu, and gpu where there is a graphics device of any kind]
    #[arg(long, value_delimiter = ',', value_parser = choice::<BackendChoice>())]
    backends: Vec<BackendChoice>,
    #[command(flatten)]
    output: OutputFlags,
}

impl Arguments {
    fn backends(&self, machine: &Machine) -> Result<Vec<Backend>, Failure> {
        let any = self.backends.is_empty() || self.backends.contains(&BackendChoice::Auto);
        let mut backends = Vec::new();
        if any || self.backends.contains(&BackendChoice::Cpu) {
            backends.push(Backend::Cpu);
        }
        if self.backends.contains(&BackendChoice::Gpu) || (any && machine.gpu.is_some()) {
            backends.push(Backend::gpu(Arc::new(GpuDevice::open(AdapterChoice::Any)?)));
        } else if any {
            say("note", "no graphics device: only the CPU is tested");
        }
        Ok(backends)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let docs = arguments.output.start("stress")?;
    let machine = Machine::this(arguments.backends.as_slice() != [BackendChoice::Cpu]);
    let mut backends = arguments.backends(&machine)?;
    let folder = arguments
        .output
        .make_folder(&["stress.json", "stress.csv", "stress.md"])?;
    let interrupted = interrupt::watch()?;
    let cases = cases();
    let mut report = Report {
        mixray: env!("CARGO_PKG_VERSION").to_owned(),
        command: command_line(),
        machine,
        figures: Vec::new(),
        controls: Vec::new(),
    };
    let settings = |backend: &Backend| -> usize {
        let of = cases
            .iter()
            .map(|c| c.settings(backend, Effort::Full).len());
        of.sum()
    };
    let total = cases.len() + backends.iter().map(settings).sum::<usize>();
    let steps = progress::Steps::new(total as u64);
    'cases: for case in &cases {
        for backend in &mut backends {
            for &setting in case.settings(backend, Effort::Full) {
                if interrupted.is_set() {
                    break 'cases;
                }
                steps.say(&format!("{} at {setting:e}", case.name));
                let figure = case.measure(backend, Effort::Full, setting)?;
                report.figures.push(figure);
                steps.step();
            }
        }
        report.controls.push(case.control(&mut Backend::Cpu)?);
        steps.step();
    }
    steps.clear();
    let mut json = serde_json::to_string_pretty(&report)?;
    json.push('\n');
    write_text(&folder.join("stress.json"), &json)?;
    write_text(&folder.join("stress.csv"), &csv(&report))?;
    let table = markdown(&report, &cases);
    write_text(&folder.join("stress.md"), &table)?;
    print(&text(&report))?;
    let outcome = finish(docs, &table, interrupted.is_set())?;
    if outcome == Outcome::Interrupted || report.passed() {
        return Ok(outcome);
    }
    let failed = report.figures.iter().filter(|figure| !figure.passed);
    let names: Vec<String> = failed
        .map(|f| format!("{} at {} on {}", f.case, f.setting, f.backend))
        .chain(
            report
                .controls
                .iter()
                .filter(|control| !control.noticed)
                .map(|control| format!("the control of {}", control.case)),
        )
        .collect();
    say("check failed", &names.join("; "));
    Ok(Outcome::CheckFailed)
}
