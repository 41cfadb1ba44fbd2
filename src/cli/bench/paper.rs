//! `mixray bench paper-table`.

use clap::Args;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, RunFlags, finish, machine_of};
use crate::bench::{
    PAPER_SCENE, PaperRow, measure, paper_markdown, paper_rays_per_pixel, paper_rows, paper_text,
    picture_png, shrink,
};
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::output::quick::{write_bytes, write_text};
use crate::renderer::Watcher;
use crate::scene;

/// The frame rates of Kan and Kaufmann 2012, Table 1, and ours on a scene like theirs
///
/// Writes paper.json, paper.png and the scene, paper.toml.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    runs: RunFlags,
    #[command(flatten)]
    output: OutputFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let docs = arguments.output.start("paper-table")?;
    let machine = arguments.runs.machine();
    let methods = arguments.runs.methods(&machine);
    let named = machine_of(&machine, &methods);
    let folder = arguments.output.make_folder(&["paper.json", "paper.png"])?;
    let path = folder.join("paper.toml");
    write_text(&path, PAPER_SCENE)?;
    let mut scene = shrink(scene::load(&path)?, arguments.runs.shrink);
    "paper".clone_into(&mut scene.name);
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let watcher = Watcher::none().cancelled_by(&cancelled);
    let plan = (arguments.runs).plan(paper_rays_per_pixel(), methods, &machine);
    let steps = progress::Steps::new(plan.runs());
    let (rows, shots) = measure(&scene, &plan, &|_| None, &watcher, &mut |what| {
        steps.say(what);
        steps.step();
    })?;
    steps.clear();
    let rows: Vec<PaperRow> = paper_rows(&rows);
    write_json(&folder.join("paper.json"), &named, "rows", &rows)?;
    if let Some(shot) = shots.iter().max_by_key(|shot| shot.rays_per_pixel) {
        write_bytes(&folder.join("paper.png"), &picture_png(&shot.picture)?)?;
    }
    print(&paper_text(&named, &rows))?;
    let table = paper_markdown(&command_line(), &named, &rows);
    finish(docs, &table, watcher.is_cancelled())
}
