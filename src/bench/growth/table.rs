//! Tables of how cost grows: for a terminal, as Markdown, as CSV.

use std::fmt::Write as _;

use super::{Curve, Law, Point, SLACK};
use crate::bench::Machine;
use crate::bench::columns::{aligned, csv_text};
use crate::bench::fit::Fit;
use crate::scene::Choice;

const HEADS: [&str; 9] = [
    "cost of",
    "method",
    "against",
    "from",
    "to",
    "s",
    "exponent",
    "of the rays",
    "expected",
];

fn cells(curve: &Curve) -> Vec<String> {
    let ends = [curve.points.first(), curve.points.last()];
    let work = ends.map(|p| p.map_or_else(String::new, |p| p.work.to_string()));
    let secs = ends.map(|p| p.map_or_else(String::new, |p| short_secs(p.secs)));
    let [from, to] = work;
    let (least, most) = curve.law.expected();
    let verdict = if curve.is_worse_than_expected() {
        ", worse"
    } else {
        ""
    };
    vec![
        curve.law.timed().to_owned(),
        curve.method.clone(),
        curve.law.unit().to_owned(),
        from,
        to,
        secs.join(" to "),
        exponent(curve.exponent.as_ref()),
        exponent(curve.rays_exponent.as_ref()),
        format!("{least} to {most}{verdict}"),
    ]
}

fn exponent(fit: Option<&Fit>) -> String {
    match fit {
        Some(Fit {
            slope,
            standard_error: Some(error),
        }) => format!("{slope:.3} ±{error:.3}"),
        Some(Fit { slope, .. }) => format!("{slope:.3}"),
        None => String::new(),
    }
}

/// Three significant digits.
fn short_secs(secs: f64) -> String {
    if secs <= 0.0 {
        return "0".to_owned();
    }
    let decimals = (2.0 - secs.log10().floor()).clamp(0.0, 7.0) as usize;
    format!("{secs:.decimals$}")
}

/// Every size of a curve on one line.
fn points(curve: &Curve) -> String {
    let each = curve.points.iter().map(|p| {
        let rays = match p.rays {
            0 => String::new(),
            rays => format!(", {:.2} Mrays", rays as f64 / 1e6),
        };
        format!("{} in {} s{rays}", p.work, short_secs(p.secs))
    });
    let each: Vec<String> = each.collect();
    format!(
        "{} {}, {}: {}",
        curve.law.name(),
        curve.law.timed(),
        curve.method,
        each.join("; ")
    )
}

fn preamble(machine: &Machine, curves: &[Curve]) -> Vec<String> {
    let runs = curves
        .iter()
        .flat_map(|c| &c.points)
        .map(|p| p.runs.len())
        .min();
    let cost = if curves.iter().any(|c| c.cost == "wall") {
        "on the CPU of the processor, on the GPU on the clock"
    } else {
        "of the processor, all threads together"
    };
    let mut lines = vec![
        format!(
            "{}, {} threads, {}",
            machine.cpu, machine.threads, machine.os
        ),
        format!(
            "seconds {cost}; the least of {} runs of each size, sizes in turns, after one untimed run",
            runs.unwrap_or(0)
        ),
        format!(
            "exponents: least squares in log over log, ± their standard error from the scatter about the line; \"worse\": above the expected range by more \
             than {SLACK} and twice what the spread of the runs explains"
        ),
    ];
    if let Some(gpu) = &machine.gpu {
        let kind = if gpu.hardware { "" } else { ", software" };
        lines.push(format!("GPU {}{kind}; driver {}", gpu.name, gpu.driver));
    }
    lines
}

/// The laws that were measured, each with what is expected of it and why.
fn reasons(curves: &[Curve]) -> Vec<String> {
    let laws = Law::CHOICES.iter().map(|(_, law)| *law);
    laws.filter(|law| curves.iter().any(|c| c.law == *law))
        .map(|law| {
            let (least, most) = law.expected();
            format!("{}: {least} to {most}, for {}", law.name(), law.reason())
        })
        .collect()
}

/// For a terminal.
pub fn growth_text(machine: &Machine, curves: &[Curve]) -> String {
    let mut all = vec![HEADS.map(str::to_owned).to_vec()];
    all.extend(curves.iter().map(cells));
    let mut out = preamble(machine, curves).join("\n") + "\n" + &aligned(&all);
    for line in reasons(curves).into_iter().chain(curves.iter().map(points)) {
        out += &line;
        out.push('\n');
    }
    out
}

/// The same as Markdown, with the command.
pub fn growth_markdown(command: &str, machine: &Machine, curves: &[Curve]) -> String {
    let mut out = format!("    {command}\n\n");
    for line in preamble(machine, curves) {
        let _ = writeln!(out, "- {line}");
    }
    let _ = writeln!(out, "\n| {} |", HEADS.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(HEADS.len()));
    for curve in curves {
        let _ = writeln!(out, "| {} |", cells(curve).join(" | "));
    }
    out += "\nWhat is expected, and why:\n\n";
    for line in reasons(curves) {
        let _ = writeln!(out, "- {line}");
    }
    out += "\nEvery size:\n\n";
    for curve in curves {
        let _ = writeln!(out, "- {}", points(curve));
    }
    out
}

/// One line a size.
pub fn growth_csv(curves: &[Curve]) -> String {
    let names = [
        "law", "timed", "unit", "method", "device", "cost", "work", "secs", "runs", "rays",
    ];
    let of_point = |curve: &Curve, point: &Point| {
        vec![
            curve.law.name().to_owned(),
            curve.law.timed().to_owned(),
            curve.law.unit().to_owned(),
            curve.method.clone(),
            curve.device.clone(),
            curve.cost.to_owned(),
            point.work.to_string(),
            format!("{:.9}", point.secs),
            point.runs.len().to_string(),
            point.rays.to_string(),
        ]
    };
    let points = curves
        .iter()
        .flat_map(|curve| curve.points.iter().map(move |point| of_point(curve, point)));
    csv_text(std::iter::once(names.map(str::to_owned).to_vec()).chain(points))
}

#[cfg(test)]
mod tests {
    use super::super::test_support::curve;
    use super::*;

    #[test]
    fn a_broken_law_is_named() {
        let machine = Machine {
            cpu: "C".into(),
            threads: 2,
            os: "o".into(),
            gpu: None,
        };
        let kept = [curve(Law::Objects, 0.1)];
        let broken = [curve(Law::Objects, 0.6)];
        for (curves, worse) in [(&kept, false), (&broken, true)] {
            for table in [
                growth_text(&machine, curves),
                growth_markdown("c", &machine, curves),
            ] {
                assert_eq!(table.contains("0 to 0.2, worse"), worse, "{table}");
                assert!(table.contains("16 spheres"), "{table}");
                assert!(
                    !table.contains("alias"),
                    "control: lights were not measured"
                );
            }
        }
        let csv = growth_csv(&kept);
        assert_eq!(csv.lines().count(), 6);
        let columns = |line: &str| line.split(',').count();
        assert!(csv.lines().all(|line| columns(line) == 10), "{csv}");
    }

    #[test]
    fn seconds_keep_three_digits() {
        for (secs, text) in [
            (0.000_123_4, "0.000123"),
            (1.234, "1.23"),
            (123.4, "123"),
            (0.0, "0"),
        ] {
            assert_eq!(short_secs(secs), text);
        }
    }
}
