//! `mixray render`: a scene file to pictures.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::check::noted_focal_px;
use super::picture_flags::PictureFlags;
use super::progress::{Bar, SCRAMBLES};
use super::values::part;
use super::{Failure, Outcome, interrupt, say, summarize, summary};
use crate::check::{self, Extent};
use crate::files;
use crate::output::{
    ExrLayer, ExrLayers, ExrPicture, FilmNote, Format, Metadata, PngBits, Target,
    check_writable_as, read_film_if_whole, write_exr, write_film, write_png, write_text,
};
use crate::renderer::{
    Budget, Delivered, Goal, Progress, Renderer, RendererOptions, Stats, Watcher,
};
use crate::scene::{MotionBlurMethod, Overrides};
use crate::stages::{GpuStages, finish, finish_in_layers};

/// Renders a scene's virtual objects into its photograph
///
/// Flags win over the scene file. Ctrl-C ends the render early and writes what it has.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Picture to write, .png or .exr; may be given several times [default: the scene's folder name + .png]
    #[arg(short, long, value_name = "OUT")]
    output: Vec<PathBuf>,
    /// Layers of .exr pictures, with commas between: composite, difference, virtual, change, ratio, sharpness, noise, mask, depth, normal, variance,
    /// samples, which are the default, and albedo, real, mixed, cryptomatte. real and mixed ask for the real light everywhere, which may cost several times
    /// the rest; the quotient composite does anyhow, and has real by default
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Vec<ExrLayer>,
    #[command(flatten)]
    flags: PictureFlags,
    /// Render only these of each pixel's rays, FROM to TO - 1 (or FROM-LAST), into an .exr that `mixray merge` puts together with the others
    #[arg(long, value_name = "FROM..TO", value_parser = part, conflicts_with_all = ["target_error", "stop_at", "filter"])]
    range: Option<(u32, u32)>,
    /// With --range: keep the part that is there, if it is this one and whole; a damaged one is rendered again, a part of another render is an error
    #[arg(long, requires = "range")]
    resume: bool,
    /// Frame number of a video: with [noise], every frame has its own
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
}

/// What was asked for, with outputs that can be written.
#[derive(Debug)]
pub(super) struct Job {
    scene: PathBuf,
    /// Empty: the default, which the scene's name decides.
    targets: Vec<Target>,
    flags: PictureFlags,
    overrides: Overrides,
    frame: u32,
    range: Option<(u32, u32)>,
    resume: bool,
    goal: Option<Goal>,
    layers: Vec<ExrLayer>,
}

impl Arguments {
    #[cfg(test)]
    pub(super) fn filter(&self) -> Option<crate::renderer::Filter> {
        self.flags.goal.filter
    }

    pub(super) fn check(self) -> Result<Job, Failure> {
        let targets: Vec<Target> = self
            .output
            .iter()
            .map(|path| Target::picture(path))
            .collect::<Result<_, _>>()?;
        if let Some(path) = &self.flags.stats {
            check_writable_as(path, "json")?;
        }
        if self.range.is_some() && !targets.iter().any(|t| t.format() == Format::Exr) {
            let message =
                "--range wants an .exr to write (-o part.exr): other pictures do not keep the film";
            return Err(Failure(message.to_owned()));
        }
        if self.resume && targets.len() != 1 {
            let message = "--resume wants one output, the part's .exr (-o part.exr): pictures come from `mixray merge`";
            return Err(Failure(message.to_owned()));
        }
        refuse_motion(&self.layers)?;
        let goal = self.flags.goal.goal(self.flags.rpp)?;
        Ok(Job {
            goal,
            layers: self.layers,
            scene: self.scene,
            targets,
            overrides: Overrides {
                // With a goal it is a limit, and not what the pilot plans for.
                rays_per_pixel: self.flags.rpp.filter(|_| goal.is_none()),
                ..self.flags.overrides()
            },
            flags: self.flags,
            frame: self.frame,
            range: self.range,
            resume: self.resume,
        })
    }
}

pub(super) fn run(job: Job) -> Result<Outcome, Failure> {
    job.flags.start_threads()?;
    let start = Instant::now();
    let unit = match job.goal {
        Some(_) => SCRAMBLES,
        None => "rays per pixel",
    };
    let bar = Bar::new("reading the scene", unit).told_to(job.flags.progress);
    let mut scene = job.flags.scene.load(&job.scene)?;
    scene.settings.apply(&job.overrides);
    let goal = job.goal.map(|goal| goal.of(&scene)).transpose()?;
    bar.aside(|| {
        for warning in &scene.warnings {
            say("warning", warning);
        }
    });
    let targets = match job.targets.as_slice() {
        [] => vec![Target::picture(&PathBuf::from(format!(
            "{}.png",
            scene.name
        )))?],
        given => given.to_vec(),
    };
    let load_secs = start.elapsed().as_secs_f64();

    let is_exr = targets.iter().any(|t| t.format() == Format::Exr);
    let layers = ExrLayers::new(&job.layers, scene.settings.composite);
    let options = RendererOptions {
        // A film has what merge cannot make up for.
        guides: is_exr && (layers.need_guides() || job.range.is_some()),
        real_everywhere: is_exr && layers.need_real_everywhere(),
        sample_range: job.range,
        without: job.flags.without(),
        filter: job.flags.goal.filter,
        draft: false,
        beside_window: false,
    };
    let hear = |progress: &Progress| bar.hear(progress);
    let watcher = Watcher::none().heard_by(&hear);
    let mut renderer = Renderer::new(scene, options, &watcher)?;
    let without = renderer.without();
    if let (true, Some(range), [target]) = (job.resume, job.range, targets.as_slice())
        && is_kept(target.path(), &renderer, range, &bar)?
    {
        drop(bar);
        let (from, to) = range;
        summarize(&format!(
            "picture {} kept (rays {from}..{to} per pixel)\n",
            target.path().display()
        ))?;
        return Ok(Outcome::Done);
    }
    let estimator = renderer.scene().settings.estimator;
    let on_gpu = renderer.gpu_device().is_some();
    for (saving, reason) in without.idle(estimator, on_gpu, goal.as_ref()) {
        bar.aside(|| say_idle(saving, reason));
    }
    let mut findings = check::scene(renderer.scene(), Extent::Still);
    let noted_px = noted_focal_px(renderer.scene());
    findings.extend(check::focal_length(renderer.scene(), noted_px));
    let fitted_ev = renderer.roughly_fitted_exposure_ev();
    findings.extend(check::exposure(renderer.scene(), fitted_ev));
    bar.aside(|| {
        for finding in &findings {
            say("warning", &finding.to_string());
        }
    });
    let goal = goal.map(|goal| goal.without(without));
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let watcher = watcher.cancelled_by(&cancelled);
    match &goal {
        Some(goal) => renderer.render_to_error(goal, &watcher)?,
        None => renderer.advance(Budget::Complete, &watcher)?,
    }
    drop(bar);
    for note in renderer.notes() {
        say("note", note);
    }
    warn_of_non_finite(&renderer);
    if !shows_virtual(&renderer) {
        say(
            "note",
            "nothing virtual is seen: no ray of the camera meets a virtual object first; look at the objects' places and scales and at the camera",
        );
    }

    let start = Instant::now();
    let film_range = job.range.map(|_| {
        let first = renderer.film().first_sample;
        (first, first + renderer.samples())
    });
    let moved = write(
        &mut renderer,
        &targets,
        &layers,
        job.flags.png_bits,
        job.frame,
        film_range,
    )?;
    let write_secs = start.elapsed().as_secs_f64();
    let stats = Stats::new(&renderer, load_secs, write_secs);
    if let Some(path) = &job.flags.stats {
        write_text(path, &stats.to_json())?;
    }
    let aims = goal.is_some_and(|goal| !goal.takes_all_rays());
    summarize(&summary::text(&mut renderer, &stats, &targets, aims, moved))?;
    if job.range.is_some() && interrupted.is_set() {
        say("warning", "the range is not complete: it cannot be merged");
    }
    Ok(if interrupted.is_set() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

/// The part is there: of this render, with all of these rays. One that was ended early or is damaged is not.
fn is_kept(
    path: &Path,
    renderer: &Renderer,
    range: (u32, u32),
    bar: &Bar,
) -> Result<bool, Failure> {
    if !path.exists() {
        return Ok(false);
    }
    files::read_back(path);
    let Some((_, found)) = read_film_if_whole(path)? else {
        let warning = format!("{}: is damaged, and rendered again", path.display());
        bar.aside(|| say("warning", &warning));
        return Ok(false);
    };
    let without = renderer.without().of_films(renderer.gpu_device().is_some());
    let wanted = FilmNote::new(renderer.scene(), range, without);
    let ((from, to), (first, end)) = (range, found.range);
    let problem = match found.mismatch(&wanted) {
        None if first == from && end <= to => return Ok(end == to),
        None => format!("rays {first}..{end} where {from}..{to} are rendered"),
        Some(problem) => problem,
    };
    Err(Failure(format!(
        "{}: holds another part: {problem}; expected this part or no file; name another output, or remove it",
        path.display()
    )))
}

/// `film_range`: EXR files keep the film's sums, which are of these rays per pixel. Gives [`Delivered::moved`].
pub(super) fn write(
    renderer: &mut Renderer,
    targets: &[Target],
    layers: &ExrLayers,
    png_bits: Option<PngBits>,
    frame: u32,
    film_range: Option<(u32, u32)>,
) -> Result<Option<f64>, Failure> {
    let gpu = renderer.gpu_device().cloned().map(GpuStages::new);
    let is_exr = targets.iter().any(|t| t.format() == Format::Exr);
    let mattes = match is_exr && layers.need_mattes() {
        true => Some(renderer.mattes()?),
        false => None,
    };
    let renderer = &*renderer;
    let Delivered {
        picture,
        film: shown,
        moved,
    } = renderer.delivered();
    let finish = match is_exr && layers.need_stages() {
        true => finish_in_layers,
        false => finish,
    };
    let finished = finish(
        picture,
        renderer.film(),
        renderer.scene(),
        frame,
        None,
        gpu.as_ref(),
    );
    if (renderer.scene().stages.motion_blur)
        .is_some_and(|settings| settings.method == MotionBlurMethod::Copies)
    {
        say(
            "note",
            "[motion_blur] copies are left out: they go along the motion since the frame before, which `mixray sequence` knows",
        );
    }
    for note in &finished.notes {
        say("note", note);
    }
    let photo = renderer.scene().photo.as_ref();
    for target in targets {
        match target.format() {
            Format::Png => {
                let bits = png_bits.unwrap_or_else(|| PngBits::for_photo(photo));
                write_png(target, &finished.picture, photo, bits)?;
            }
            Format::Exr => {
                let metadata = Metadata::of(renderer, renderer.scene().fingerprint());
                let exr = ExrPicture {
                    mattes: mattes.clone(),
                    ..ExrPicture::of(renderer, metadata, &shown, finished.clone(), layers)
                };
                if let Some(range) = film_range {
                    let film = renderer.film();
                    let on_gpu = renderer.gpu_device().is_some();
                    let without = renderer.without().of_films(on_gpu);
                    let note = FilmNote::new(renderer.scene(), range, without);
                    write_film(target, &exr, film, &note)?;
                } else {
                    write_exr(target, &exr)?;
                }
            }
        }
    }
    Ok(moved)
}

/// A still has no frames before and after.
pub(super) fn refuse_motion(layers: &[ExrLayer]) -> Result<(), Failure> {
    if layers.contains(&ExrLayer::Motion) {
        let message = "--layers motion: a still moves to no next frame; expected it of frames with a trajectory; leave it out, or render with `mixray sequence`";
        return Err(Failure(message.to_owned()));
    }
    Ok(())
}

/// Says that a saving was switched off in vain.
pub(super) fn say_idle(saving: &str, reason: &str) {
    say(
        "note",
        &format!("--no-skip {saving} changes nothing here: {reason}"),
    );
}

fn shows_virtual(renderer: &Renderer) -> bool {
    renderer.film().pixels.iter().any(|pixel| pixel.m > 0)
}

/// Says which sample to render again to see the first of them.
fn warn_of_non_finite(renderer: &Renderer) {
    let film = renderer.film();
    if let Some((pixel, sample)) = film.first_non_finite() {
        let width = film.width as usize;
        let settings = &renderer.scene().settings;
        say(
            "warning",
            &format!(
                "{} samples were not finite and are left out; the first: pixel ({}, {}), sample {sample} of {}, seed {}",
                film.non_finite_samples(),
                pixel % width,
                pixel / width,
                settings.rays_per_pixel,
                settings.seed
            ),
        );
    }
}
