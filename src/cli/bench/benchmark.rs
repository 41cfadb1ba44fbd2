//! Error against time, scene by scene.

use std::collections::BTreeMap;

use super::Job;
use super::conclusions::conclude;
use super::files::{write_figures, write_pictures};
use super::load_scenes;
use crate::bench::{Method, ReferenceGoal, Report, Shot, Source, Truth, measure, reference};
use crate::cli::{Failure, interrupt, progress, say};
use crate::scene::{Choice, Composite};

/// All that a scene's pictures are shown with.
#[derive(Default)]
pub(super) struct Gallery {
    pub shots: Vec<Shot>,
    pub truths: Vec<(String, Composite, Truth)>,
}

/// Measures; true if it was interrupted.
pub(super) fn benchmark(job: &Job) -> Result<(Report, bool), Failure> {
    let arguments = &job.arguments;
    let scenes = load_scenes(arguments, job.hardware_gpu())?;
    let plots = scenes.iter().flat_map(|scene| {
        let name = |axis, format| format!("{}-error-{axis}.{format}", scene.name);
        [
            ("time", "svg"),
            ("time", "png"),
            ("rays", "svg"),
            ("rays", "png"),
        ]
        .map(|(axis, format)| name(axis, format))
    });
    let plots: Vec<String> = plots.collect();
    let mut names = vec!["results.json", "results.csv", "index.html"];
    names.extend(plots.iter().map(String::as_str));
    job.make_folder(&names)?;
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let steps = progress::Steps::new(scenes.iter().map(|scene| job.runs_of(scene)).sum());
    let mut report = job.empty_report();
    let mut gallery = Gallery::default();
    let goal = ReferenceGoal {
        standard_error: arguments.reference_error,
        max_rays_per_pixel: arguments.reference_rpp,
    };
    let source = match &arguments.reference {
        Some(path) => Source::Given(path.clone()),
        None => Source::Folder(arguments.output.clone()),
    };
    'scenes: for scene in &scenes {
        let mut truths = BTreeMap::new();
        for composite in &arguments.composites {
            let found = reference(scene, *composite, &source, goal, &cancelled, &mut |what| {
                steps.say(what);
            })?;
            let Some(found) = found else {
                break 'scenes;
            };
            report.references.push(found.note);
            truths.insert(composite.name(), found.truth);
        }
        let truth_of = |method: &Method| truths.get(method.composite.name());
        let mut methods = job.methods.clone();
        methods.extend(job.goal_methods(scene, &truth_of, &cancelled, &steps)?);
        if cancelled() {
            break;
        }
        let plan = job.plan(arguments.rpp.clone(), methods);
        let (rows, shots) = measure(scene, &plan, &truth_of, &cancelled, &mut |what| {
            steps.say(what);
            steps.step();
        })?;
        report.rows.extend(rows);
        gallery.shots.extend(shots);
        for composite in &arguments.composites {
            if let Some(truth) = truths.remove(composite.name()) {
                let name = scene.name.clone();
                gallery.truths.push((name, *composite, truth));
            }
        }
        conclude(&mut report, arguments.target_rmse);
        write_figures(&report, &arguments.output)?;
        if cancelled() {
            break;
        }
    }
    steps.clear();
    if report.rows.is_empty() {
        say("note", "interrupted before anything was measured");
    } else {
        write_pictures(&report, &gallery, &arguments.output)?;
    }
    Ok((report, cancelled()))
}
