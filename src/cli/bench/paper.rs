//! `--paper-table`.

use super::{Job, command_line};
use crate::bench::{
    FORMAT, PAPER_SCENE, PaperRow, measure, paper_markdown, paper_rays_per_pixel, paper_rows,
    paper_text, picture_png, shrink,
};
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::output::quick::{write_bytes, write_text};
use crate::scene;

pub(super) fn paper_table(job: &Job) -> Result<Outcome, Failure> {
    job.make_folder(&["paper.json", "paper.png"])?;
    let folder = &job.arguments.output;
    let path = folder.join("paper.toml");
    write_text(&path, PAPER_SCENE)?;
    let mut scene = shrink(scene::load(&path)?, job.arguments.shrink);
    "paper".clone_into(&mut scene.name);
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let plan = job.plan(paper_rays_per_pixel(), job.methods.clone());
    let steps = progress::Steps::new(plan.runs());
    let (rows, shots) = measure(&scene, &plan, &|_| None, &cancelled, &mut |what| {
        steps.say(what);
        steps.step();
    })?;
    steps.clear();
    let machine = job.empty_report().machine;
    let rows: Vec<PaperRow> = paper_rows(&rows);
    let mut json = serde_json::to_string_pretty(&serde_json::json!({
        "format": FORMAT,
        "mixray": env!("CARGO_PKG_VERSION"),
        "command": command_line(),
        "machine": machine,
        "rows": rows,
    }))?;
    json.push('\n');
    write_text(&folder.join("paper.json"), &json)?;
    if let Some(shot) = shots.iter().max_by_key(|shot| shot.rays_per_pixel) {
        write_bytes(&folder.join("paper.png"), &picture_png(&shot.picture)?)?;
    }
    print(&paper_text(&machine, &rows))?;
    if let Some(docs) = &job.docs
        && !cancelled()
    {
        docs.write(&paper_markdown(&command_line(), &machine, &rows))?;
    }
    Ok(if cancelled() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}
