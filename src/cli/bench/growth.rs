//! `mixray bench --growth`: cost as work grows.

use std::path::Path;

use crate::bench::{
    FORMAT, Law, Machine, Plan, grow, growth_csv, growth_markdown, growth_plot, growth_text,
};
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::output::quick::{write_bytes, write_text};
use crate::scene::Choice;

/// Measures these laws, all if none is named; `about` is the machine and what was typed. Gives the table as Markdown too.
pub(super) fn run(
    laws: &[Law],
    plan: &Plan,
    shrink: u32,
    folder: &Path,
    (machine, command): (&Machine, &str),
) -> Result<(Outcome, String), Failure> {
    let wanted = |law: &Law| laws.is_empty() || laws.contains(law);
    let laws: Vec<Law> = Law::CHOICES
        .iter()
        .map(|(_, law)| *law)
        .filter(wanted)
        .collect();
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let count = laws.iter().map(|law| law.steps(plan)).sum();
    let steps = progress::Steps::new(count);
    let mut curves = Vec::new();
    for &law in &laws {
        if cancelled() {
            break;
        }
        curves.extend(grow(law, plan, shrink, &cancelled, &mut |what| {
            steps.say(what);
            steps.step();
        })?);
    }
    steps.clear();
    if curves.is_empty() {
        // An earlier run's figures stay.
        return Ok((Outcome::Interrupted, String::new()));
    }
    let mut json = serde_json::to_string_pretty(&serde_json::json!({
        "format": FORMAT,
        "mixray": env!("CARGO_PKG_VERSION"),
        "command": command,
        "machine": machine,
        "curves": curves,
    }))?;
    json.push('\n');
    write_text(&folder.join("growth.json"), &json)?;
    write_text(&folder.join("growth.csv"), &growth_csv(&curves))?;
    for &law in &laws {
        if let Some(plot) = growth_plot(law, &curves) {
            let (svg, png) = plot.map_err(|reason| {
                Failure(format!(
                    "the plot of {} cannot be drawn: {reason}",
                    law.name()
                ))
            })?;
            let path = folder.join(format!("growth-{}.svg", law.name()));
            write_text(&path, &svg)?;
            write_bytes(&path.with_extension("png"), &png)?;
        }
    }
    print(&growth_text(machine, &curves))?;
    let outcome = match interrupted.is_set() {
        true => Outcome::Interrupted,
        false => Outcome::Done,
    };
    Ok((outcome, growth_markdown(command, machine, &curves)))
}
