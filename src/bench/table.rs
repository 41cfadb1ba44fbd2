//! A report as text for a terminal, as CSV and as Markdown.

use std::fmt::Write as _;

use super::columns::{aligned, csv_text};
use super::{Figures, Reach, Report, Row};

/// One heading and how a row's cell is written.
type Column = (&'static str, fn(&Row) -> String);

/// What people read.
const COLUMNS: [Column; 16] = [
    ("scene", |r| r.scene.clone()),
    ("method", |r| r.method.label()),
    ("rays/px", |r| match r.mean_rays_per_pixel {
        Some(mean) => format!("{mean:.1}"),
        None => r.rays_per_pixel.to_string(),
    }),
    ("wall s", |r| spread(r.wall_secs, r.wall_secs_sd)),
    ("CPU s", |r| spread(r.cpu_secs, r.cpu_secs_sd)),
    ("Mrays", |r| format!("{:.3}", traced(r) as f64 / 1e6)),
    ("Mrays/s", |r| format!("{:.2}", r.mrays_per_sec)),
    ("skipped", |r| format!("{:.1}%", 100.0 * r.skipped_fraction)),
    ("RMSE", |r| {
        // A tilde: a quarter or more of the squared error was the reference's own.
        let doubt = if r.errors.reference_share > 0.25 {
            "~"
        } else {
            ""
        };
        format!("{doubt}{:.5}", r.errors.all.rmse)
    }),
    ("rel MSE", |r| format!("{:.2e}", r.errors.all.rel_mse)),
    ("FLIP", |r| format!("{:.4}", r.errors.all.flip)),
    ("p99", |r| format!("{:.4}", r.errors.all.p99)),
    ("RMSE bg", |r| rmse(r.errors.background)),
    ("edge", |r| rmse(r.errors.edge)),
    ("virtual", |r| rmse(r.errors.virtual_)),
    ("1/(s MSE)", |r| {
        r.efficiency.map_or("-".to_owned(), |e| format!("{e:.3e}"))
    }),
];

fn traced(row: &Row) -> u64 {
    let rays = &row.rays;
    rays.mixed + rays.real + rays.mixed_shadow + rays.real_shadow
}

fn rmse(figures: Option<Figures>) -> String {
    figures.map_or("-".to_owned(), |f| format!("{:.5}", f.rmse))
}

fn spread(mean: f64, deviation: f64) -> String {
    let decimals = if mean < 1.0 { 4 } else { 2 };
    format!("{mean:.decimals$} ±{deviation:.decimals$}")
}

/// For a terminal: the machine, the references, the rows, slopes and targets.
pub fn text(report: &Report) -> String {
    let mut out = preamble(report);
    let cells: Vec<Vec<String>> = std::iter::once(COLUMNS.map(|c| c.0.to_owned()).to_vec())
        .chain(report.rows.iter().map(row_cells))
        .collect();
    out += &aligned(&cells);
    for line in remarks(report) {
        out += &line;
        out.push('\n');
    }
    out
}

/// The same with Markdown tables, and the command that made them.
pub fn markdown(report: &Report) -> String {
    let mut out = format!("    {}\n\n", report.command);
    for line in preamble(report).lines() {
        let _ = writeln!(out, "- {line}");
    }
    let heads = COLUMNS.map(|c| c.0);
    let _ = writeln!(out, "\n| {} |", heads.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(heads.len()));
    for row in &report.rows {
        let _ = writeln!(out, "| {} |", row_cells(row).join(" | "));
    }
    out.push('\n');
    for line in remarks(report) {
        let _ = writeln!(out, "- {line}");
    }
    out
}

fn row_cells(row: &Row) -> Vec<String> {
    COLUMNS.iter().map(|(_, cell)| cell(row)).collect()
}

fn preamble(report: &Report) -> String {
    let machine = &report.machine;
    let mut out = format!(
        "mixray {} on {}, {} threads, {}\n",
        report.mixray, machine.cpu, machine.threads, machine.os
    );
    if let Some(gpu) = &machine.gpu {
        let kind = if gpu.hardware { "" } else { ", software" };
        let _ = writeln!(out, "GPU {}{kind}; driver {}", gpu.name, gpu.driver);
    }
    for note in &report.references {
        let rays = match note.rays_per_pixel {
            0 => String::new(),
            rays => format!(", {rays} rays per pixel in {} scrambles", note.scrambles),
        };
        let error = if note.standard_error > 0.0 {
            format!("standard error {:.2e}", note.standard_error)
        } else {
            "standard error not known".to_owned()
        };
        let short = if note.standard_error > note.wanted_standard_error
            && note.wanted_standard_error > 0.0
        {
            format!(
                ", above the {:.1e} that was asked for: its rays ran out",
                note.wanted_standard_error
            )
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            "reference of {} ({}, {}): {error}{rays}{short}; virtual objects in {:.1}% of the pixels",
            note.scene,
            composite_name(note.composite),
            note.source,
            100.0 * note.virtual_fraction
        );
    }
    let runs = report.rows.iter().map(|r| r.runs.len());
    if let (Some(fewest), Some(most)) = (runs.clone().min(), runs.max()) {
        let runs = if fewest == most {
            format!("{most}")
        } else {
            format!("{fewest} to {most}")
        };
        let _ = writeln!(
            out,
            "{runs} runs a row in turns with the other methods, each with its own seed, after one untimed run of each method; ± is the standard deviation"
        );
    }
    out
}

fn composite_name(composite: crate::scene::Composite) -> &'static str {
    use crate::scene::Choice;
    composite.name()
}

/// What follows from the rows together.
fn remarks(report: &Report) -> Vec<String> {
    let mut lines = Vec::new();
    for (name, slope) in &report.slopes {
        lines.push(format!(
            "{name}: RMSE falls as rays per pixel to the power {slope:.3}"
        ));
    }
    for target in &report.targets {
        let need = match (target.cpu_secs, target.wall_secs, target.rays_per_pixel) {
            (Reach::At(cpu), Reach::At(wall), Reach::At(rays)) => format!(
                "{cpu:.4} CPU s, {wall:.4} s on the clock, {rays:.1} rays per pixel (on the line between the two nearest points, log over log)"
            ),
            (Reach::NotReached, ..) => "not reached".to_owned(),
            (Reach::Below(cpu), ..) => {
                format!("less than {cpu:.4} CPU s: the cheapest point is already better")
            }
            (Reach::At(cpu), ..) => format!("{cpu:.4} CPU s"),
        };
        lines.push(format!(
            "{} {}, RMSE {}: {need}",
            target.scene,
            target.method.label(),
            target.rmse
        ));
    }
    let limits = report.rows.iter().filter(|r| r.method.goal.is_some());
    if let Some(most) = limits.map(|r| r.rays_per_pixel).max() {
        lines.push(format!(
            "with a goal, rays/px are those that a pixel within reach took on average, at most {most}; the seconds and Mrays hold the pilot's"
        ));
    }
    let non_finite: u64 = report.rows.iter().map(|r| r.non_finite_samples).sum();
    if non_finite > 0 {
        lines.push(format!("{non_finite} samples were not finite"));
    }
    if report.rows.iter().any(|r| r.errors.reference_share > 0.25) {
        lines.push("~ a quarter or more of the squared error was the reference's own and is taken off; a finer reference (--reference-error) makes the figure surer".to_owned());
    }
    lines
}

/// One line a row with every figure, under a line of names.
pub fn csv(report: &Report) -> String {
    let mut records = Vec::new();
    let machine = &report.machine;
    let gpu = machine.gpu.as_ref();
    for (number, row) in report.rows.iter().enumerate() {
        let mut names = Vec::new();
        let mut values = Vec::new();
        let mut put = |name: &str, value: String| {
            names.push(name.to_owned());
            values.push(value);
        };
        let method = row.method.label();
        put("scene", row.scene.clone());
        put("method", method);
        put("width", row.width.to_string());
        put("height", row.height.to_string());
        put("rays_per_pixel", row.rays_per_pixel.to_string());
        let mean = row.mean_rays_per_pixel.map(|mean| mean.to_string());
        put("mean_rays_per_pixel", mean.unwrap_or_default());
        put("runs", row.runs.len().to_string());
        let seeds = row.runs.iter().map(|r| r.seed.to_string());
        put("seeds", seeds.collect::<Vec<_>>().join(" "));
        for (name, value) in [
            ("build_secs", row.build_secs),
            ("compile_secs", row.compile_secs),
            ("wall_secs", row.wall_secs),
            ("wall_secs_sd", row.wall_secs_sd),
            ("setup_secs", row.setup_secs),
            ("cpu_secs", row.cpu_secs),
            ("cpu_secs_sd", row.cpu_secs_sd),
            ("mrays_per_sec", row.mrays_per_sec),
            ("skipped_fraction", row.skipped_fraction),
        ] {
            put(name, value.to_string());
        }
        for (name, value) in [
            ("rays_primary", row.rays.primary),
            ("rays_mixed", row.rays.mixed),
            ("rays_real", row.rays.real),
            ("rays_mixed_shadow", row.rays.mixed_shadow),
            ("rays_real_shadow", row.rays.real_shadow),
            ("non_finite_samples", row.non_finite_samples),
        ] {
            put(name, value.to_string());
        }
        for (prefix, figures) in [
            ("", Some(row.errors.all)),
            ("background_", row.errors.background),
            ("edge_", row.errors.edge),
            ("virtual_", row.errors.virtual_),
        ] {
            let of = |pick: fn(&Figures) -> f64| {
                figures.map_or(String::new(), |figures| pick(&figures).to_string())
            };
            put(
                &format!("{prefix}pixels"),
                figures.map_or(0, |f| f.pixels).to_string(),
            );
            put(&format!("{prefix}rmse"), of(|f| f.rmse));
            put(&format!("{prefix}rel_mse"), of(|f| f.rel_mse));
            put(&format!("{prefix}flip"), of(|f| f.flip));
            put(&format!("{prefix}p99"), of(|f| f.p99));
        }
        put("mse", row.errors.all.mse.to_string());
        put("mse_sd", row.mse_sd.to_string());
        put("reference_share", row.errors.reference_share.to_string());
        put("cost", row.cost.clone());
        let efficiency = row.efficiency.map_or(String::new(), |e| e.to_string());
        put("efficiency", efficiency);
        put("device", row.device.clone());
        put("cpu", machine.cpu.clone());
        put("driver", gpu.map_or(String::new(), |g| g.driver.clone()));
        put("mixray", report.mixray.clone());
        put("command", report.command.clone());
        if number == 0 {
            records.push(names);
        }
        records.push(values);
    }
    csv_text(records)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::test_support::report;

    #[test]
    fn csv_has_one_value_a_name() {
        let csv = csv(&report());
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 3);
        let names: Vec<&str> = lines[0].split(',').collect();
        let value_of = |line: &str, name: &str| {
            // The scene's name holds one comma between its quotes.
            let rest = line.strip_prefix("\"a <b>, \"\"c\"\"\"").expect("escaped");
            let values: Vec<&str> = rest.split(',').collect();
            assert_eq!(values.len(), names.len());
            let at = names.iter().position(|n| *n == name).expect(name);
            values[at].to_owned()
        };
        assert_eq!(value_of(lines[1], "method"), "cpu direct sobol");
        assert_eq!(value_of(lines[1], "rays_mixed_shadow"), "70");
        assert_eq!(value_of(lines[2], "cpu_secs"), "0.4");
        assert_eq!(value_of(lines[2], "rmse"), "0.02");
        assert_eq!(value_of(lines[1], "seeds"), "0 1");
        assert_eq!(value_of(lines[1], "edge_pixels"), "0");
        let mut sorted = names.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), names.len(), "no name stands twice");
    }

    #[test]
    fn tables_hold_the_command_the_machine_and_every_row() {
        let report = report();
        let page = markdown(&report);
        assert!(page.starts_with("    mixray bench\n"));
        assert!(page.contains("2 threads") && page.contains("2 runs a row"));
        let heads = page.lines().find(|l| l.starts_with("| scene")).unwrap();
        let rows: Vec<&str> = page.lines().filter(|l| l.starts_with("| a <b>")).collect();
        assert_eq!(rows.len(), 2);
        for row in rows {
            assert_eq!(row.matches(" | ").count(), heads.matches(" | ").count());
        }
        let text = text(&report);
        let lines: Vec<&str> = text.lines().filter(|l| l.contains("a <b>")).collect();
        assert_eq!(
            lines[0].chars().count(),
            lines[1].chars().count(),
            "aligned"
        );
    }
}
