//! `mixray bench --stress`: numerical stability, case by case.

use std::path::Path;
use std::sync::Arc;

use crate::bench::Machine;
use crate::bench::stress::{Backend, Effort, Report, cases, csv, markdown, text};
use crate::cli::{Failure, Outcome, interrupt, print, progress, say};
use crate::gpu::{AdapterChoice, GpuDevice};
use crate::output::quick::write_text;

/// On the CPU, and on the machine's graphics adapter if it names one. Gives the table as Markdown too.
pub(super) fn run(
    folder: &Path,
    machine: &Machine,
    command: &str,
) -> Result<(Outcome, String), Failure> {
    let mut backends = vec![Backend::Cpu];
    if machine.gpu.is_some() {
        backends.push(Backend::gpu(Arc::new(GpuDevice::open(AdapterChoice::Any)?)));
    } else {
        say("note", "no graphics device: only the CPU is tested");
    }
    let interrupted = interrupt::watch()?;
    let cases = cases();
    let mut report = Report {
        mixray: env!("CARGO_PKG_VERSION").to_owned(),
        command: command.to_owned(),
        machine: machine.clone(),
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
    if interrupted.is_set() {
        return Ok((Outcome::Interrupted, table));
    }
    if report.passed() {
        return Ok((Outcome::Done, table));
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
    Ok((Outcome::CheckFailed, table))
}
