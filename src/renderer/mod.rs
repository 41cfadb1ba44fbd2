//! The progressive renderer behind every command.
//!
//! Built once from a scene; [`Renderer::advance`] takes it further by a budget, [`Renderer::film`] shows where it stands at any moment, and
//! edits (lens, object transforms, lights) rebuild only what they change.
//!
//! A core holds scene, film and backend; three drivers give it lists of work: one for what stands still, one for objects that move while the
//! shutter is open, one that renders to an error.
//!
//! ```no_run
//! use mixray::renderer::{Budget, Progress, Renderer, RendererOptions, Watcher};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = mixray::scene::load(std::path::Path::new("scenes/demo/scene.toml"))?;
//! let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;
//! renderer.advance(Budget::Rays(1_000_000), &Watcher::none())?;
//! let first_look = renderer.picture(); // composited over the photograph
//! let say = |p: &Progress| eprintln!("{}: {:.0}%", p.phase.name(), 100.0 * p.share_done);
//! renderer.advance(Budget::Complete, &Watcher::none().heard_by(&say))?;
//! # let _ = first_look;
//! # Ok(())
//! # }
//! ```

mod adaptive;
mod backend;
mod budget;
mod core;
mod edits;
mod films;
mod frames;
mod goal;
mod mattes;
mod motion_vectors;
mod moving;
mod needs;
mod photo_albedo;
mod picture_motion;
mod prepare;
mod shown;
mod skips;
mod stats;
mod still;
mod stopwatch;
mod tiles;

use std::sync::Arc;

use rayon::prelude::*;

pub use adaptive::{SCRAMBLES, Stated};
pub use budget::Budget;
pub use frames::FrameEdit;
pub use goal::{CameraNoise, ErrorGoal, Goal};
pub use mattes::Mattes;
pub use motion_vectors::MotionVectors;
pub use picture_motion::NeighbourView;
pub use prepare::{roughly_fitted_exposure_ev, roughly_limited_albedo};
pub use shown::Delivered;
pub use skips::{Skip, Without};
pub use stats::Stats;

pub use crate::work::{Phase, Place, Places, Progress, RayCounts, Spent, Watcher};

use self::core::Core;
use backend::Backend;
use moving::Moving;
use stopwatch::Stopwatch;

use crate::clock::HostThreads;
use crate::cpu;
use crate::film::{Film, RealSurface};
use crate::gpu::{GpuDevice, KernelSeconds, Traffic};
use crate::packed::PackedScene;
use crate::scene::{Choice, Combine, Scene, Settings};

/// What the caller wants beside the scene's own settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RendererOptions {
    /// Depth, normal and albedo of the first hit.
    pub guides: bool,
    /// The real radiance, and with it the mixed, where the composite does not need it too: it may cost several times the rest.
    pub real_everywhere: bool,
    /// The first and the end of the samples to render of each pixel's `rays_per_pixel`; `None`: all. Films of ranges that follow one
    /// another are put together by [`Renderer::merge`].
    pub sample_range: Option<(u32, u32)>,
    /// Savings to do without.
    pub without: Without,
    /// Pictures show the difference filtered; the film is not touched.
    pub filter: Option<Filter>,
    /// For a first look: albedo from the photograph follows from the light that was found first, and bounds are looser.
    pub draft: bool,
    /// A window is drawn on the device that renders, which is left to it more often.
    pub beside_window: bool,
}

impl RendererOptions {
    /// The film of such a scene has groups of samples.
    fn keeps_groups(&self, combine: Combine) -> bool {
        self.filter == Some(Filter::Final) || (combine == Combine::Robust && self.filter.is_none())
    }
}

/// A filter of the difference. Biased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Of pictures and planes, for previews of a few rays per pixel: smooth on diffuse real surfaces.
    Preview,
    /// Of what is delivered: as smooth as its own error calls for, for stills and videos.
    Final,
}

impl Choice for Filter {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("preview", Self::Preview), ("final", Self::Final)];
}

#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    #[error(transparent)]
    Memory(#[from] crate::memory::Shortage),
    #[error(transparent)]
    Pack(#[from] crate::pack::PackError),
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    #[error(transparent)]
    Merge(#[from] crate::film::MergeError),
    #[error(
        "the samples {0}..{1} are not a range of the scene's {2} rays per pixel; name others, or more rays per pixel"
    )]
    SampleRange(u32, u32, u32),
    #[error(
        "{0} rays per pixel; expected 1 to {max}; choose another number",
        max = Settings::MAX_RAYS_PER_PIXEL
    )]
    RaysPerPixel(u32),
    #[error(
        "objects that move while the shutter is open are not rendered to a stated error; leave out the goal, or [shutter]"
    )]
    MovingGoal,
    #[error(
        "the scene has no [noise], where --stop-at camera-noise finds the camera's; give --camera-noise NOISE.toml or A,B"
    )]
    NoCameraNoise,
    #[error("there is no object number {0} in the scene")]
    NoSuchObject(usize),
}

/// Seconds spent before and in rendering.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// Acceleration structures, packing and the albedo estimate.
    pub build: f64,
    /// Opening the device, and what it alone needs: shaders, and trees in its own form.
    pub compile: f64,
    /// The pilot.
    pub look_ahead: f64,
    pub render: f64,
    /// Of the processors, in all threads of the process, for `look_ahead` and `render`.
    pub cpu: f64,
}

/// A scene being rendered.
pub struct Renderer {
    core: Core,
    driver: Driver,
    /// Where the range of samples to render ends, in rays per pixel; it begins at the film's first.
    end_sample: u32,
    /// The error of a film that [`Renderer::render_to_error`] made.
    stated: Option<Stated>,
    /// What the filter is guided by; empty where it is off. A draft's outlast all but another camera and another real world.
    surfaces: Vec<Option<RealSurface>>,
}

/// Who takes a film to its rays per pixel.
enum Driver {
    Still,
    Moving(Moving),
}

impl Driver {
    fn advance(
        &self,
        core: &mut Core,
        end: u32,
        end_of_all: u32,
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        match self {
            Self::Still => still::advance(core, end, end_of_all, watcher),
            Self::Moving(moving) => moving.advance(core, end, end_of_all, watcher),
        }
    }

    /// Traces the real rays that edge pixels lack.
    fn replay_real(&self, core: &mut Core) -> Result<(), RenderError> {
        match self {
            Self::Still => still::replay_real(core),
            Self::Moving(moving) => moving.replay_real(core),
        }
    }
}

impl Renderer {
    /// Builds acceleration structures and everything else that rendering needs. The watcher hears how far it is; it can end the pilot alone, which
    /// then comes before the first sample.
    ///
    /// # Errors
    /// The scene does not fit the packed form or the adapter, or `gpu` was asked for where there is none.
    pub fn new(
        scene: Scene,
        options: RendererOptions,
        watcher: &Watcher<'_>,
    ) -> Result<Self, RenderError> {
        let stopwatch = Stopwatch::start();
        let total = scene.settings.rays_per_pixel;
        let (first_sample, end_sample) = options.sample_range.unwrap_or((0, total));
        if first_sample >= end_sample || end_sample > total {
            return Err(RenderError::SampleRange(first_sample, end_sample, total));
        }
        let grouped = options.keeps_groups(scene.settings.combine);
        needs::ensure_scene(&scene, options.guides, grouped)?;
        let anchor = scene.camera.world_from_camera.w_axis.truncate();
        let packed = core::packed(&scene, anchor, &options, watcher)?;
        needs::ensure_film(&packed, options.guides, grouped)?;
        let film = Film::new(
            packed.frame.width,
            packed.frame.height,
            first_sample,
            options.guides,
        );
        let mut renderer = Self {
            core: Core {
                time_secs: scene.shutter.map_or(0.0, |shutter| shutter.time_secs),
                scene,
                packed,
                lens_grid: None,
                film,
                film_is_new: false,
                backend: Backend::Undecided,
                options,
                rays: RayCounts::default(),
                seconds: Seconds::default(),
                places: Places::default(),
                notes: Vec::new(),
                coarse_photo: None,
                photo_light: None,
                photo_here: None,
                is_planned: false,
                secs_per_ray: None,
            },
            driver: Driver::Still,
            end_sample,
            stated: None,
            surfaces: Vec::new(),
        };
        renderer.prepare_photo(watcher);
        renderer.prepare_shutter(watcher)?;
        renderer.look_ahead(watcher);
        let seconds = &mut renderer.core.seconds;
        seconds.build = stopwatch.secs() - seconds.look_ahead;
        renderer.open_backend(watcher)?;
        Ok(renderer)
    }

    /// Renders on until the budget is spent, the scene's rays per pixel are reached or the watcher ends it; it hears after each pass, and now
    /// and then in between. The film is then complete as far as it goes, edge pixels included.
    ///
    /// # Errors
    /// Only what the GPU refuses for good; a device that is lost is replaced by the CPU.
    pub fn advance(&mut self, budget: Budget, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        if self.stated.is_some() || !self.plan(watcher)? || self.core.nothing_to_trace() {
            return Ok(());
        }
        let stopwatch = Stopwatch::start();
        let total = self.end_sample - self.core.film.first_sample;
        let (samples, deadline) = match budget {
            Budget::Complete => (total, None),
            Budget::Time(time) => (total, stopwatch.begin.checked_add(time)),
            Budget::Rays(rays) => {
                let film = &self.core.film;
                let pixels = u64::from(film.width) * u64::from(film.height);
                let more = u32::try_from((rays / pixels.max(1)).max(1)).unwrap_or(u32::MAX);
                (total.min(self.samples().saturating_add(more)), None)
            }
        };
        let end = self.core.film.first_sample + samples;
        self.driver.advance(
            &mut self.core,
            end,
            self.end_sample,
            &watcher.until(deadline),
        )?;
        self.core.count_render(&stopwatch);
        Ok(())
    }

    /// For tests: the graphics device, if one renders, is destroyed before its n-th batch from now.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, batches: u32) {
        if let Some(gpu) = self.core.backend.gpu_mut() {
            gpu.lose_device_after(batches);
        }
    }

    /// Rays per pixel that every pixel within reach has taken.
    pub fn samples(&self) -> u32 {
        let all = self.end_sample - self.core.film.first_sample;
        self.core.samples().unwrap_or(all)
    }

    /// Samples that one ray per pixel takes, in all pixels within reach of something virtual.
    pub fn samples_of_a_ray(&self) -> u64 {
        let Core { film, packed, .. } = &self.core;
        let pixels = film.pixels.par_iter().zip(&packed.pixels);
        pixels
            .filter(|(_, info)| core::is_within_reach(info))
            .map(|(sums, _)| u64::from(sums.sample_factor.max(1)))
            .sum()
    }

    /// The savings that it does without.
    pub fn without(&self) -> Without {
        self.core.options.without
    }

    pub fn filter(&self) -> Option<Filter> {
        self.core.options.filter
    }

    /// Of the size that is traced, which [`FrameEdit::coarseness`] divides.
    pub fn film(&self) -> &Film {
        &self.core.film
    }

    pub fn scene(&self) -> &Scene {
        &self.core.scene
    }

    pub fn packed(&self) -> &PackedScene {
        &self.core.packed
    }

    pub fn rays(&self) -> RayCounts {
        self.core.rays
    }

    pub fn seconds(&self) -> Seconds {
        self.core.seconds
    }

    /// Share of the light of virtual pixels that they show of the photograph, where nothing is modelled behind them; estimated from a few samples,
    /// anew at each call.
    pub fn backdrop_share(&mut self) -> Option<f64> {
        cpu::backdrop_share(&mut self.core.packed)
    }

    /// Things the user should hear: fallbacks taken, values fitted.
    pub fn notes(&self) -> &[String] {
        &self.core.notes
    }

    /// The graphics device that renders, if one does.
    pub fn gpu_device(&self) -> Option<&Arc<GpuDevice>> {
        self.core.backend.gpu().map(|gpu| gpu.device())
    }

    /// Takes the time of every kernel from now on, at a small cost; false where no graphics device renders, or it takes no timestamps.
    pub fn profile_gpu(&mut self) -> bool {
        let gpu = self.core.backend.gpu_mut();
        gpu.is_some_and(|gpu| gpu.profile())
    }

    /// Seconds by kernel since [`Renderer::profile_gpu`].
    pub fn gpu_kernel_seconds(&self) -> Option<KernelSeconds> {
        self.core.backend.gpu()?.kernel_seconds()
    }

    /// Books the host's work anew from now on, with what the processors spend on it.
    pub fn count_places(&mut self) {
        let places = Places::counting(HostThreads::here().map(Arc::new));
        if let Some(gpu) = self.core.backend.gpu_mut() {
            gpu.set_places(places.clone());
        }
        self.core.places = places;
    }

    /// Where the host's time went since the renderer was made, or since [`Renderer::count_places`].
    pub fn places(&self) -> Places {
        let mut places = self.core.places.clone();
        if let Some(gpu) = self.core.backend.gpu() {
            places.add(gpu.places());
        }
        places
    }

    /// What went to the graphics device and back, if one renders.
    pub fn gpu_traffic(&self) -> Option<Traffic> {
        Some(self.gpu_device()?.traffic())
    }

    /// "cpu" or "gpu".
    pub fn backend_name(&self) -> &'static str {
        self.core.backend.name()
    }

    /// The adapter's name, or the number of threads.
    pub fn device_name(&self) -> String {
        self.core.backend.device_name()
    }
}

#[cfg(test)]
mod tests;
