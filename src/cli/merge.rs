//! `mixray merge`: films of sample ranges to one picture.

use std::path::{Path, PathBuf};

use clap::Args;

use super::progress::Bar;
use super::render::{refuse_motion, write};
use super::scene_flags::SceneFlags;
use super::summary::combination;
use super::values::png_bits;
use super::{Failure, Outcome, say, summarize};
use crate::film::Film;
use crate::output::{ExrLayer, ExrLayers, FilmNote, Format, PngBits, Target, read_film};
use crate::renderer::{Progress, Renderer, Watcher};
use crate::scene::sandbox::Sandbox;
use crate::scene::{BackendChoice, Scene};

/// Puts films of sample ranges together
///
/// The parts come from `mixray render --range` and must be of one render: same scene, seed, sampler, estimator and rays per pixel in all.
/// Their ranges must follow one another; their order here does not matter. The result equals one render of all of them.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parts (.exr)
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// Picture to write, .png or .exr (an incomplete range stays mergeable); may be given several times
    #[arg(short, long, value_name = "OUT", required = true)]
    output: Vec<PathBuf>,
    /// Layers of .exr pictures, as those of `mixray render`; for real and mixed the rays that the parts lack are traced, all of them unless the
    /// parts were rendered with these layers
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Vec<ExrLayer>,
    /// Scene file [default: where it was, seen from the first part, when that was rendered]
    #[arg(long)]
    scene: Option<PathBuf>,
    #[command(flatten)]
    flags: SceneFlags,
    /// Bits a channel of PNG pictures [default: 16 for a 16-bit photograph, else 8]
    #[arg(long, value_parser = png_bits())]
    png_bits: Option<PngBits>,
    /// Frame number of a video: with [noise], every frame has its own
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
}

struct Part<'a> {
    path: &'a Path,
    film: Film,
    note: FilmNote,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let targets = arguments
        .output
        .iter()
        .map(|path| Target::picture(path))
        .collect::<Result<Vec<_>, _>>()?;
    refuse_motion(&arguments.layers)?;
    let mut parts = Vec::new();
    for path in &arguments.parts {
        let (film, note) = read_film(path)?;
        parts.push(Part { path, film, note });
    }
    parts.sort_by_key(|part| part.note.range);
    check(&parts)?;
    let mut parts = parts.into_iter();
    let Some(first) = parts.next() else {
        return Err(Failure("there is nothing to merge".to_owned()));
    };
    let scene = load(&first, arguments.scene.as_deref(), arguments.flags)?;
    let (mut film, mut range) = (first.film, first.note.range);
    for part in parts {
        film.merge(&part.film)
            .map_err(|error| Failure(format!("{}: {error}", part.path.display())))?;
        range.1 = part.note.range.1;
    }
    let total = first.note.total;
    let bar = Bar::new("building trees", "rays per pixel");
    let hear = |progress: &Progress| bar.hear(progress);
    let layers = ExrLayers::new(&arguments.layers, scene.settings.composite);
    let is_exr = targets.iter().any(|target| target.format() == Format::Exr);
    let mut renderer = Renderer::with_film(
        scene,
        film,
        range.1,
        is_exr && layers.need_real_everywhere(),
        first.note.without,
        &Watcher::none().heard_by(&hear),
    )?;
    drop(bar);
    let complete = range == (0, total);
    let moved = write(
        &mut renderer,
        &targets,
        &layers,
        arguments.png_bits,
        arguments.frame,
        (!complete).then_some(range),
    )?;
    let mut out = String::new();
    for target in &targets {
        out += &format!(
            "picture {} (rays {}..{} of {total} per pixel)\n",
            target.path().display(),
            range.0,
            range.1
        );
    }
    out += &moved.map(combination).unwrap_or_default();
    summarize(&out)?;
    Ok(Outcome::Done)
}

/// That they are parts of one render, made by this program, one after the other.
fn check(parts: &[Part]) -> Result<(), Failure> {
    for pair in parts.windows(2) {
        let [a, b] = pair else { continue };
        let refuse = |problem: String| {
            let (a, b) = (a.path.display(), b.path.display());
            Err(Failure(format!("{a} and {b} cannot be merged: {problem}")))
        };
        if let Some(problem) = a.note.mismatch(&b.note) {
            return refuse(problem);
        }
        let ((from, to), (next, end)) = (a.note.range, b.note.range);
        if to != next {
            let problem = if to > next { "overlap" } else { "leave a gap" };
            return refuse(format!(
                "the ranges {from}..{to} and {next}..{end} {problem}"
            ));
        }
    }
    match parts.first() {
        Some(part) if part.note.version != env!("CARGO_PKG_VERSION") => Err(Failure(format!(
            "{}: was rendered by version {}, this is {}; render the parts again",
            part.path.display(),
            part.note.version,
            env!("CARGO_PKG_VERSION")
        ))),
        _ => Ok(()),
    }
}

/// The scene as it was rendered.
fn load(part: &Part, given: Option<&Path>, flags: SceneFlags) -> Result<Scene, Failure> {
    let outside = |path: &Path| flags.sandbox && Sandbox::around(part.path).refusal(path).is_some();
    let hint = part
        .note
        .scene
        .as_deref()
        .filter(|path| !outside(path) && path.is_file());
    let Some(path) = given.or(hint) else {
        let place = match &part.note.scene {
            Some(path) if outside(path) => format!(
                "is at {}, outside the film's folder, where --sandbox follows nothing",
                path.display()
            ),
            Some(path) => format!("is no longer at {}", path.display()),
            None => "has no place in common with the film".to_owned(),
        };
        return Err(Failure(format!(
            "{}: its scene {place}; expected the scene file that it was rendered from; say where it is with --scene",
            part.path.display()
        )));
    };
    let mut scene = flags.load(path)?;
    scene.settings.apply(&part.note.overrides());
    scene.settings.backend = BackendChoice::Cpu;
    for warning in &scene.warnings {
        say("warning", warning);
    }
    if scene.fingerprint() != part.note.fingerprint {
        return Err(Failure(format!(
            "{}: is not the scene that {} was rendered from, or it has changed since",
            path.display(),
            part.path.display()
        )));
    }
    Ok(scene)
}
