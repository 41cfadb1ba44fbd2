//! What is read and written: earlier results, figures, plots, the page.

use std::path::Path;

use serde::Serialize;

use super::command_line;
use crate::bench::{Axis, FORMAT, Machine, Plot, Report, Shot, Truth, csv, page, plots};
use crate::cli::{Failure, say};
use crate::decode::{self, MAX_TEXT_BYTES};
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

pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    decode::read_text(path, MAX_TEXT_BYTES)
        .map_err(|reason| Failure(format!("{}: {reason}", path.display())))
}

pub(super) fn read_report(path: &Path) -> Result<Report, Failure> {
    let problem = |reason: String| Failure(format!("{}: {reason}", path.display()));
    let text = read_text(path)?;
    let value: serde_json::Value = serde_json::from_str(&text)
        .map_err(|error| problem(format!("is no results.json: {error}")))?;
    let format = value.get("format").and_then(serde_json::Value::as_u64);
    if format != Some(u64::from(FORMAT)) {
        return Err(problem(format!(
            "is no results.json of format {FORMAT}; make it again with this version"
        )));
    }
    serde_json::from_value(value).map_err(|error| problem(format!("is no results.json: {error}")))
}
