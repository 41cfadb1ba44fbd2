//! What was measured, for people and programs.

use std::fmt::Write as _;

use serde::Serialize;

use super::Case;
use crate::bench::Machine;
use crate::bench::columns::{aligned, csv_text};

/// One case at one setting on one backend.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    pub case: String,
    pub setting: String,
    pub backend: String,
    pub quantity: String,
    pub measured: f64,
    /// The largest figure that passes.
    pub bound: f64,
    pub passed: bool,
    /// Samples left out because they were not finite: none in a figure that passes, but where that is the case's point.
    pub non_finite_samples: u64,
    /// What makes the first of them again, with the case and its setting.
    pub first_non_finite: Option<String>,
    pub seconds: f64,
}

/// A case with one thing wrong, on the CPU.
#[derive(Clone, Debug, Serialize)]
pub struct Control {
    pub case: String,
    pub setting: String,
    pub measured: f64,
    pub bound: f64,
    /// It did not hold the bound, as it must not.
    pub noticed: bool,
}

#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub mixray: String,
    pub command: String,
    pub machine: Machine,
    pub figures: Vec<Figure>,
    pub controls: Vec<Control>,
}

impl Report {
    pub fn passed(&self) -> bool {
        self.figures.iter().all(|figure| figure.passed)
            && self.controls.iter().all(|control| control.noticed)
    }
}

const HEADS: [&str; 7] = [
    "case", "setting", "backend", "measured", "bound", "control", "",
];

fn number(x: f64) -> String {
    if x == 0.0 || (x.fract() == 0.0 && x < 1e6) {
        format!("{x}")
    } else {
        format!("{x:.1e}")
    }
}

fn rows(report: &Report) -> Vec<Vec<String>> {
    let row = |figure: &Figure| {
        let control = report.controls.iter().find(|c| c.case == figure.case);
        let verdict = if figure.passed { "pass" } else { "FAIL" };
        vec![
            figure.case.clone(),
            figure.setting.clone(),
            figure.backend.clone(),
            number(figure.measured),
            number(figure.bound),
            control.map_or(String::new(), |c| number(c.measured)),
            verdict.to_owned(),
        ]
    };
    report.figures.iter().map(row).collect()
}

fn summary(report: &Report) -> String {
    let failed = report.figures.iter().filter(|f| !f.passed).count();
    let blind = report.controls.iter().filter(|c| !c.noticed).count();
    let non_finite: u64 = report.figures.iter().map(|f| f.non_finite_samples).sum();
    let mut out = format!(
        "{} figures, {failed} beyond their bound; {} controls (the same comparison with one thing wrong), {blind} unnoticed\n",
        report.figures.len(),
        report.controls.len()
    );
    if non_finite > 0 {
        for figure in report.figures.iter().filter(|f| f.non_finite_samples > 0) {
            let _ = writeln!(
                out,
                "- {} at {} on {}: {} samples not finite, the first at {}",
                figure.case,
                figure.setting,
                figure.backend,
                figure.non_finite_samples,
                figure.first_non_finite.as_deref().unwrap_or("?")
            );
        }
    } else {
        out += "no sample was not finite\n";
    }
    out
}

fn machine(report: &Report) -> String {
    let m = &report.machine;
    let gpu = m.gpu.as_ref().map_or("no GPU".to_owned(), |gpu| {
        let kind = if gpu.hardware { "" } else { ", software" };
        format!("GPU {}{kind}; driver {}", gpu.name, gpu.driver)
    });
    format!(
        "mixray {} on {}, {} threads, {}; {gpu}",
        report.mixray, m.cpu, m.threads, m.os
    )
}

/// For a terminal.
pub fn text(report: &Report) -> String {
    let head = HEADS.map(str::to_owned).to_vec();
    let cells: Vec<Vec<String>> = std::iter::once(head).chain(rows(report)).collect();
    format!(
        "{}\n{}{}",
        machine(report),
        aligned(&cells),
        summary(report)
    )
}

/// As Markdown: what each case is, its settings, and the worst of its figures on each backend.
pub fn markdown(report: &Report, cases: &[Case]) -> String {
    let mut out = format!("    {}\n\n{}\n\n", report.command, machine(report));
    out += "| case | settings | figure | against | CPU | GPU | bound | control |\n";
    let _ = writeln!(out, "|{}", " --- |".repeat(8));
    for case in cases {
        let of_case: Vec<&Figure> = report
            .figures
            .iter()
            .filter(|figure| figure.case == case.name)
            .collect();
        let mut settings: Vec<&str> = Vec::new();
        for figure in &of_case {
            if !settings.contains(&figure.setting.as_str()) {
                settings.push(&figure.setting);
            }
        }
        let worst = |backend: &str| {
            let figures = of_case.iter().filter(|f| f.backend == backend);
            figures
                // A figure that is not a number is the worst of all.
                .max_by(|a, b| a.measured.total_cmp(&b.measured))
                .map_or("-".to_owned(), |f| {
                    let verdict = if f.passed { "" } else { " **fails**" };
                    format!("{}{verdict}", number(f.measured))
                })
        };
        let control = report.controls.iter().find(|c| c.case == case.name);
        let _ = writeln!(
            out,
            "| {}: {} | {} | {} | {} | {} | {} | {} | {} |",
            case.name,
            case.what,
            settings.join(", "),
            case.quantity,
            case.oracle,
            worst("cpu"),
            worst("gpu"),
            number(case.bound),
            control.map_or("-".to_owned(), |c| number(c.measured)),
        );
    }
    let _ = write!(out, "\n{}", summary(report));
    out
}

/// One line a figure, under a line of names.
pub fn csv(report: &Report) -> String {
    let names = [
        "case",
        "setting",
        "backend",
        "quantity",
        "measured",
        "bound",
        "passed",
        "non_finite_samples",
        "first_non_finite",
        "seconds",
    ];
    let figures = report.figures.iter().map(|figure| {
        vec![
            figure.case.clone(),
            figure.setting.clone(),
            figure.backend.clone(),
            figure.quantity.clone(),
            figure.measured.to_string(),
            figure.bound.to_string(),
            figure.passed.to_string(),
            figure.non_finite_samples.to_string(),
            figure.first_non_finite.clone().unwrap_or_default(),
            figure.seconds.to_string(),
        ]
    });
    csv_text(std::iter::once(names.map(str::to_owned).to_vec()).chain(figures))
}
