//! What is read and written: earlier results, figures, plots, the page.

use std::path::Path;

use serde::Serialize;

use super::command_line;
use crate::bench::{Axis, FORMAT, Machine, Plot, Report, Shot, Truth, csv, page, plots};
use crate::cli::{Failure, say};
use crate::output::quick::{write_bytes, write_text};
use crate::scene::Composite;

/// All that a scene's pictures are shown with.
#[derive(Default)]
pub(super) struct Gallery {
    pub shots: Vec<Shot>,
    pub truths: Vec<(String, Composite, Truth)>,
}

/// Figures under `name`, with what they were measured by and on.
pub(super) fn write_json(
    path: &Path,
    machine: &Machine,
    name: &str,
    figures: &impl Serialize,
) -> Result<(), Failure> {
    let mut json = serde_json::to_string_pretty(&serde_json::json!({
        "format": FORMAT,
        "mixray": env!("CARGO_PKG_VERSION"),
        "command": command_line(),
        "machine": machine,
        name: figures,
    }))?;
    json.push('\n');
    write_text(path, &json)?;
    Ok(())
}

pub(super) fn write_figures(report: &Report, folder: &Path) -> Result<(), Failure> {
    let mut json = serde_json::to_string_pretty(report)?;
    json.push('\n');
    write_text(&folder.join("results.json"), &json)?;
    write_text(&folder.join("results.csv"), &csv(report))?;
    Ok(())
}

pub(super) fn write_pictures(
    report: &Report,
    gallery: &Gallery,
    folder: &Path,
) -> Result<(), Failure> {
    let plots: Vec<Plot> = plots(report)?;
    for plot in &plots {
        let axis = match plot.axis {
            Axis::Secs => "time",
            Axis::RaysPerPixel => "rays",
        };
        let path = folder.join(format!("{}-error-{axis}.svg", plot.scene));
        write_text(&path, &plot.svg)?;
        write_bytes(&path.with_extension("png"), &plot.png)?;
    }
    let page = page(report, &plots, &gallery.shots, &gallery.truths)?;
    write_text(&folder.join("index.html"), &page)?;
    say(
        "note",
        &format!("the report is {}", folder.join("index.html").display()),
    );
    Ok(())
}
