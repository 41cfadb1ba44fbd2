//! `mixray bench growth`: cost as work grows.

use clap::Args;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, RunFlags, finish, machine_of};
use crate::bench::{Law, grow, growth_csv, growth_markdown, growth_plot, growth_text};
use crate::cli::values::choice;
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::output::quick::{write_bytes, write_text};
use crate::renderer::Watcher;
use crate::scene::Choice;

/// How the cost grows with triangles, pixels, rays, objects and lights: the exponent of each, beside what is expected; minutes
///
/// Writes growth.json, growth.csv and plots.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// What grows [default: each in turn]
    #[arg(value_name = "WHAT", value_delimiter = ',', value_parser = choice::<Law>())]
    laws: Vec<Law>,
    #[command(flatten)]
    runs: RunFlags,
    #[command(flatten)]
    output: OutputFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let docs = arguments.output.start("growth")?;
    let machine = arguments.runs.machine();
    let methods = arguments.runs.methods(&machine);
    let named = machine_of(&machine, &methods);
    let plan = arguments.runs.plan(Vec::new(), methods, &machine);
    let folder = arguments
        .output
        .make_folder(&["growth.json", "growth.csv"])?;
    let wanted = |law: &Law| arguments.laws.is_empty() || arguments.laws.contains(law);
    let laws: Vec<Law> = Law::CHOICES
        .iter()
        .map(|(_, law)| *law)
        .filter(wanted)
        .collect();
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let watcher = Watcher::none().cancelled_by(&cancelled);
    let count = laws.iter().map(|law| law.steps(&plan)).sum();
    let steps = progress::Steps::new(count);
    let mut curves = Vec::new();
    for &law in &laws {
        if watcher.is_cancelled() {
            break;
        }
        let more = grow(law, &plan, arguments.runs.shrink, &watcher, &mut |what| {
            steps.say(what);
            steps.step();
        })?;
        curves.extend(more);
    }
    steps.clear();
    if curves.is_empty() {
        // An earlier run's figures stay.
        return Ok(Outcome::Interrupted);
    }
    write_json(&folder.join("growth.json"), &named, "curves", &curves)?;
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
    print(&growth_text(&named, &curves))?;
    let table = growth_markdown(&command_line(), &named, &curves);
    finish(docs, &table, watcher.is_cancelled())
}
