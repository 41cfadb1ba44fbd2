//! `mixray render`: a scene file to pictures.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::{Failure, Outcome, interrupt, print, progress, say, summary};
use crate::gpu::GpuStages;
use crate::output::{
    Format, Metadata, PngBits, Target, check_writable, write_exr, write_png, write_text,
};
use crate::renderer::{Budget, Renderer, RendererOptions, Stats};
use crate::scene::{
    self, BackendChoice, Choice, Composite, Estimator, Overrides, SamplerKind, Settings,
};
use crate::stages::finish;

/// Renders a scene's virtual objects into its photograph
///
/// Flags win over the scene file. Ctrl-C ends the render early and writes what it has.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Picture to write, .png or .exr with all planes; may be given several times [default: the scene's folder name + .png]
    #[arg(short, long, value_name = "OUT")]
    output: Vec<PathBuf>,
    /// Primary rays for each pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_RAYS_PER_PIXEL)))]
    rpp: Option<u32>,
    /// Seed of all random numbers: the same seed gives the same picture
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Where to render; auto: on a hardware GPU if there is one
    #[arg(long, value_parser = choice::<BackendChoice>())]
    backend: Option<BackendChoice>,
    /// paper is the baseline of Kan and Kaufmann 2012
    #[arg(long, value_parser = choice::<Estimator>())]
    estimator: Option<Estimator>,
    #[arg(long, value_parser = choice::<SamplerKind>())]
    sampler: Option<SamplerKind>,
    /// quotient cancels an error in the proxy's albedo or the overall light
    #[arg(long, value_parser = choice::<Composite>())]
    composite: Option<Composite>,
    /// Surface interactions before the light; 1 is direct light only
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_BOUNCES)))]
    max_bounces: Option<u32>,
    /// Bits a channel of PNG pictures [default: 16 for a 16-bit photograph, else 8]
    #[arg(long, value_parser = PossibleValuesParser::new(["8", "16"]).map(png_bits))]
    png_bits: Option<PngBits>,
    /// Write times and counts as JSON
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Frame number of a video: with [noise], every frame has its own
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
    /// CPU threads [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

fn choice<T: Choice + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let names = T::CHOICES.iter().map(|&(name, _)| name);
    PossibleValuesParser::new(names).try_map(|name| T::from_name(&name).ok_or("is not a choice"))
}

fn png_bits(name: String) -> PngBits {
    match name.as_str() {
        "16" => PngBits::Sixteen,
        _ => PngBits::Eight,
    }
}

/// What was asked for, with outputs that can be written.
#[derive(Debug)]
pub(super) struct Job {
    scene: PathBuf,
    /// Empty: the default, which the scene's name decides.
    targets: Vec<Target>,
    overrides: Overrides,
    png_bits: Option<PngBits>,
    stats: Option<PathBuf>,
    frame: u32,
    threads: Option<u16>,
}

impl Arguments {
    pub(super) fn check(self) -> Result<Job, Failure> {
        let targets = self
            .output
            .iter()
            .map(|path| Target::picture(path))
            .collect::<Result<_, _>>()?;
        if let Some(path) = &self.stats {
            check_writable(path)?;
        }
        Ok(Job {
            scene: self.scene,
            targets,
            overrides: Overrides {
                rays_per_pixel: self.rpp,
                max_bounces: self.max_bounces,
                seed: self.seed,
                estimator: self.estimator,
                sampler: self.sampler,
                composite: self.composite,
                backend: self.backend,
            },
            png_bits: self.png_bits,
            stats: self.stats,
            frame: self.frame,
            threads: self.threads,
        })
    }
}

pub(super) fn run(job: Job) -> Result<Outcome, Failure> {
    if let Some(threads) = job.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()?;
    }
    let start = Instant::now();
    let mut scene = scene::load(&job.scene)?;
    scene.settings.apply(&job.overrides);
    for warning in &scene.warnings {
        say("warning", warning);
    }
    let targets = match job.targets.as_slice() {
        [] => vec![Target::picture(&PathBuf::from(format!(
            "{}.png",
            scene.name
        )))?],
        given => given.to_vec(),
    };
    let load_secs = start.elapsed().as_secs_f64();

    let options = RendererOptions {
        all_planes: targets.iter().any(|t| t.format() == Format::Exr),
        ..RendererOptions::default()
    };
    let mut renderer = Renderer::new(scene, options)?;
    let interrupted = interrupt::watch()?;
    let bar = progress::Bar::new(renderer.scene().settings.rays_per_pixel);
    let result = renderer.advance(Budget::Complete, &|| interrupted.is_set(), &mut |p| {
        bar.show(&p);
    });
    bar.clear();
    result?;
    for note in renderer.notes() {
        say("note", note);
    }
    warn_of_non_finite(&renderer);

    let start = Instant::now();
    write(&renderer, &targets, job.png_bits, job.frame)?;
    let write_secs = start.elapsed().as_secs_f64();
    let stats = Stats::new(&renderer, load_secs, write_secs);
    if let Some(path) = &job.stats {
        write_text(path, &stats.to_json())?;
    }
    print(&summary::text(&renderer, &stats, &targets));
    Ok(if interrupted.is_set() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

fn write(
    renderer: &Renderer,
    targets: &[Target],
    png_bits: Option<PngBits>,
    frame: u32,
) -> Result<(), Failure> {
    let gpu = renderer.gpu_device().cloned().map(GpuStages::new);
    let finished = finish(
        renderer.picture(),
        renderer.film(),
        renderer.scene(),
        frame,
        gpu.as_ref(),
    );
    for note in &finished.notes {
        say("note", note);
    }
    let picture = finished.picture;
    let photo = renderer.scene().photo.as_ref();
    for target in targets {
        match target.format() {
            Format::Png => {
                let bits = png_bits.unwrap_or_else(|| PngBits::for_photo(photo));
                write_png(target, &picture, photo, bits)?;
            }
            Format::Exr => {
                let metadata = Metadata::new(renderer.scene(), renderer.samples());
                write_exr(target, &picture, &renderer.planes(), &metadata)?;
            }
        }
    }
    Ok(())
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
