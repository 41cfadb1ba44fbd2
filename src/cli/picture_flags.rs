//! What `render` and `sequence` both take: how pictures are rendered and written.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::goal_flags::GoalFlags;
use super::progress::Engine;
use super::scene_flags::SceneFlags;
use super::threads::ThreadsFlag;
use super::values::{choice, png_bits, rays_per_pixel};
use crate::output::PngBits;
use crate::renderer::{Skip, Without};
use crate::scene::{
    BackendChoice, Combine, Composite, Estimator, Overrides, SamplerKind, Settings,
};

#[derive(Debug, Args)]
pub(super) struct PictureFlags {
    /// Primary rays for each pixel
    #[arg(long, value_name = "N", value_parser = rays_per_pixel(1))]
    pub rpp: Option<u32>,
    /// Seed of all random numbers: the same seed gives the same picture; frame n of a sequence has the seed plus n
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
    /// Of the samples on real surfaces, for the picture alone; robust spreads rare bright ones over their neighbourhood [default: robust]
    #[arg(long, value_parser = choice::<Combine>())]
    combine: Option<Combine>,
    /// Surface interactions before the light; 1 is direct light only
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_BOUNCES)))]
    max_bounces: Option<u32>,
    /// Do without a saving, to see what it is worth; may be given several times
    #[arg(long, value_name = "NAME", value_parser = choice::<Skip>())]
    no_skip: Vec<Skip>,
    /// Bits a channel of PNG pictures [default: 16 where the photograph or frame has 16, else 8]
    #[arg(long, value_parser = png_bits())]
    pub png_bits: Option<PngBits>,
    /// Write times and counts as JSON
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Tell how far the work is in lines that an engine reads on standard output: openjd_progress, openjd_status
    #[arg(long, value_name = "ENGINE")]
    pub progress: Option<Engine>,
    #[command(flatten)]
    pub goal: GoalFlags,
    #[command(flatten)]
    pub scene: SceneFlags,
    #[command(flatten)]
    threads: ThreadsFlag,
}

impl PictureFlags {
    /// What wins over the scene file.
    pub(super) fn overrides(&self) -> Overrides {
        Overrides {
            rays_per_pixel: self.rpp,
            max_bounces: self.max_bounces,
            seed: self.seed,
            estimator: self.estimator,
            sampler: self.sampler,
            composite: self.composite,
            combine: self.combine,
            backend: self.backend,
        }
    }

    /// The savings to do without.
    pub(super) fn without(&self) -> Without {
        self.no_skip.iter().copied().collect()
    }

    /// Once, before anything runs on several threads.
    pub(super) fn start_threads(&self) -> Result<(), Failure> {
        self.threads.start()
    }
}
