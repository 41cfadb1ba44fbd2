//! The progressive renderer behind every command.
//!
//! Built once from a scene; [`Renderer::advance`] takes it further by a budget, [`Renderer::film`] shows where it stands at any moment, and
//! edits (lens, object transforms, lights) rebuild only what they change.
//!
//! ```no_run
//! use mixray::renderer::{Budget, Renderer, RendererOptions};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = mixray::scene::load(std::path::Path::new("scenes/demo/scene.toml"))?;
//! let mut renderer = Renderer::new(scene, RendererOptions::default())?;
//! renderer.advance(Budget::Rays(1_000_000), &|| false, &mut |_| ())?;
//! let first_look = renderer.picture(); // composited over the photograph
//! renderer.advance(Budget::Complete, &|| false, &mut |p| eprintln!("{} of {} rays per pixel", p.samples, p.samples_total))?;
//! # let _ = first_look;
//! # Ok(())
//! # }
//! ```

mod adaptive;
mod control;
mod edits;
mod goal;
mod motion;
mod photo_albedo;
mod picture_motion;
mod series;
mod skips;
mod stats;
mod tiles;
mod watch;

use std::borrow::Cow;
use std::sync::Arc;

pub use adaptive::{SCRAMBLES, Stated};
pub use control::{Budget, Cancel, Pass, Progress, RayTotals};
pub use goal::{CameraNoise, ErrorGoal};
pub use motion::FrameEdit;
pub use picture_motion::PreviousView;
pub use skips::{Skip, Without};
pub use stats::{Stats, StatsRays};

use watch::Watch;

use crate::cpu;
use crate::film::{
    Film, MergeError, Picture, Planes, RealSurface, composite, estimated_error, filter_difference,
    planes,
};
use crate::gpu::{AdapterChoice, GpuBackend, GpuDevice, GpuError, KernelSeconds};
use crate::packed::{FRAME_AOVS, Instant, MATERIAL_PHOTO_ALBEDO, PIXEL_OUT_OF_REACH, PackedScene};
use crate::scene::{BackendChoice, Composite, Exposure, Scene, Settings};

/// The longest a pass runs before the film is shown, in rays per pixel.
const MAX_PASS_SAMPLES: u32 = 8;

/// What the caller wants beside the scene's own settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RendererOptions {
    /// Depth, normal and albedo of the first hit, and the real radiance everywhere.
    pub all_planes: bool,
    /// The first and the end of the samples to render of each pixel's `rays_per_pixel`; `None`: all. Films of ranges that follow one
    /// another are put together by [`Renderer::merge`].
    pub sample_range: Option<(u32, u32)>,
    /// Savings to do without.
    pub without: Without,
    /// Pictures and planes show the difference on diffuse real surfaces smoothed: for previews, biased. The film is not touched.
    pub filter: bool,
}

#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    #[error(transparent)]
    Pack(#[from] crate::packed::PackError),
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
    scene: Scene,
    packed: PackedScene,
    film: Film,
    /// Where the range of samples to render ends; it begins at the film's first.
    end_sample: u32,
    backend: Backend,
    options: RendererOptions,
    rays: RayTotals,
    seconds: Seconds,
    notes: Vec<String>,
    /// Where moving objects stand while the shutter is open; empty: nothing moves.
    instants: Vec<Instant>,
    /// The picture's time.
    time_secs: f64,
    /// The error of a film that [`Renderer::render_to_error`] made.
    stated: Option<Stated>,
    /// What the preview filter is guided by; empty where it is off.
    surfaces: Vec<Option<RealSurface>>,
}

enum Backend {
    /// The choice is automatic and there has been nothing to trace, so no device was opened.
    Undecided,
    Cpu,
    Gpu(Box<GpuBackend>),
}

impl Renderer {
    /// Builds acceleration structures and everything else that rendering needs.
    ///
    /// # Errors
    /// The scene does not fit the packed form or the adapter, or `gpu` was asked for where there is none.
    pub fn new(scene: Scene, options: RendererOptions) -> Result<Self, RenderError> {
        let watch = Watch::start();
        let total = scene.settings.rays_per_pixel;
        let (first_sample, end_sample) = options.sample_range.unwrap_or((0, total));
        if first_sample >= end_sample || end_sample > total {
            return Err(RenderError::SampleRange(first_sample, end_sample, total));
        }
        let packed = PackedScene::build(&scene)?;
        let time_secs = scene.shutter.map_or(0.0, |shutter| shutter.time_secs);
        let film = Film::new(
            packed.frame.width,
            packed.frame.height,
            first_sample,
            options.all_planes,
        );
        let mut renderer = Self {
            scene,
            packed,
            film,
            end_sample,
            backend: Backend::Undecided,
            options,
            rays: RayTotals::default(),
            seconds: Seconds::default(),
            notes: Vec::new(),
            instants: Vec::new(),
            time_secs,
            stated: None,
            surfaces: Vec::new(),
        };
        renderer.prepare_photo();
        renderer.prepare_shutter()?;
        renderer.look_ahead();
        renderer.seconds.build = watch.secs() - renderer.seconds.look_ahead;
        let watch = Watch::start();
        renderer.backend = renderer.open_backend()?;
        renderer.seconds.compile = watch.secs();
        Ok(renderer)
    }

    /// The film as pictures show it.
    fn shown(&self) -> Cow<'_, Film> {
        if self.options.filter {
            Cow::Owned(filter_difference(&self.film, &self.surfaces))
        } else {
            Cow::Borrowed(&self.film)
        }
    }

    /// The savings that it does without.
    pub fn without(&self) -> Without {
        self.options.without
    }

    /// Whether the preview filter is on.
    pub fn is_filtered(&self) -> bool {
        self.options.filter
    }

    fn open_backend(&mut self) -> Result<Backend, RenderError> {
        let choice = match self.scene.settings.backend {
            BackendChoice::Cpu => return Ok(Backend::Cpu),
            BackendChoice::Gpu => AdapterChoice::Any,
            BackendChoice::Auto if self.nothing_to_trace() => return Ok(Backend::Undecided),
            BackendChoice::Auto => AdapterChoice::Hardware,
        };
        let specialised = !self.options.without.contains(Skip::Specialisation);
        let opened = GpuDevice::open(choice)
            .and_then(|gpu| GpuBackend::new(Arc::new(gpu), &self.packed, specialised));
        match opened {
            Ok(gpu) => Ok(Backend::Gpu(Box::new(gpu))),
            Err(error) if self.scene.settings.backend == BackendChoice::Auto => {
                if !matches!(error, GpuError::NoAdapter(_)) {
                    self.notes
                        .push(format!("the CPU renders, for the GPU cannot: {error}"));
                }
                Ok(Backend::Cpu)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// What follows from the real world and its light: exposure, and albedo from the photograph.
    fn prepare_photo(&mut self) {
        if self.options.all_planes {
            self.packed.frame.flags |= FRAME_AOVS;
        }
        let from_photo = self
            .packed
            .materials
            .iter()
            .any(|m| m.flags & MATERIAL_PHOTO_ALBEDO != 0);
        if let Some(photo) = &self.scene.photo {
            if self.scene.settings.exposure == Exposure::Auto {
                match photo_albedo::fit_exposure_ev(&mut self.packed, photo) {
                    Some(ev) => {
                        self.packed.frame.exposure_scale = ev.exp2() as f32;
                        self.notes.push(format!(
                            "exposure_ev = {ev:.3} fits the proxy's light to the photograph"
                        ));
                    }
                    None => self.notes.push(
                        "exposure_ev = \"auto\": the camera sees no lit proxy; 0 is used"
                            .to_owned(),
                    ),
                }
            }
            if from_photo {
                photo_albedo::estimate_photo_albedo(&mut self.packed, photo);
            }
        }
    }

    /// True if no pixel is within reach of anything virtual: the picture is the photograph.
    fn nothing_to_trace(&self) -> bool {
        self.packed
            .pixels
            .iter()
            .all(|p| p.flags & PIXEL_OUT_OF_REACH != 0)
    }

    /// Renders on until the budget is spent, the scene's rays per pixel are reached or `cancelled` says so; `progress` hears after each pass.
    /// The film is then complete as far as it goes, edge pixels included.
    ///
    /// # Errors
    /// Only what the GPU refuses for good; a device that is lost is replaced by the CPU.
    pub fn advance(
        &mut self,
        budget: Budget,
        cancelled: &(dyn Fn() -> bool + Sync),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(), RenderError> {
        if self.stated.is_some() {
            return Ok(());
        }
        let watch = Watch::start();
        let deadline = match budget {
            Budget::Time(time) => Some(watch.begin + time),
            Budget::Complete | Budget::Rays(_) => None,
        };
        let first = self.film.first_sample;
        let total = self.end_sample - first;
        let pixels = u64::from(self.film.width) * u64::from(self.film.height);
        let before = self.samples();
        let end =
            match budget {
                Budget::Rays(rays) => total.min(before.saturating_add(
                    u32::try_from((rays / pixels.max(1)).max(1)).unwrap_or(u32::MAX),
                )),
                Budget::Complete | Budget::Time(_) => total,
            };
        if !self.instants.is_empty() && !self.nothing_to_trace() {
            self.advance_in_time(first + end, cancelled, deadline, progress)?;
            self.count_render(&watch);
            return Ok(());
        }
        let mut done = before;
        while done < end && !self.nothing_to_trace() {
            let step = done.clamp(1, MAX_PASS_SAMPLES).min(end - done);
            let cancel = Cancel::new(cancelled, deadline);
            self.run_pass(
                Pass::Main {
                    end: first + done + step,
                },
                &cancel,
            )?;
            if cancel.is_cancelled() {
                break;
            }
            done += step;
            progress(Progress {
                samples: done,
                samples_total: total,
                rays: self.rays,
                elapsed: watch.begin.elapsed(),
            });
        }
        self.replay_real()?;
        self.count_render(&watch);
        Ok(())
    }

    /// Short beside the main passes, and without it edge pixels would not be Eq. 4: not cancelled.
    fn replay_real(&mut self) -> Result<(), RenderError> {
        let everywhere = self.options.all_planes
            || self.scene.settings.composite == Composite::Quotient
            || self.options.without.contains(Skip::EdgeReal);
        if self.instants.is_empty() {
            return self.run_pass(Pass::Real { everywhere }, &Cancel::new(&|| false, None));
        }
        self.replay_real_in_time(everywhere)
    }

    /// A renderer that goes on from the film of an earlier one of the same scene, settings and savings left out: it stands at the film's last sample, which
    /// comes just before `end` in rays per pixel, and traces what edge pixels lack.
    ///
    /// # Errors
    /// As [`Renderer::new`]; or the film is of another size than the camera.
    pub fn with_film(
        scene: Scene,
        film: Film,
        end: u32,
        without: Without,
    ) -> Result<Self, RenderError> {
        let size = (scene.camera.width, scene.camera.height);
        if (film.width, film.height) != size {
            let sizes = MergeError::Size(film.width, film.height, size.0, size.1);
            return Err(sizes.into());
        }
        let options = RendererOptions {
            all_planes: !film.guides.is_empty(),
            sample_range: Some((film.first_sample, end)),
            without,
            ..RendererOptions::default()
        };
        let mut renderer = Self::new(scene, options)?;
        // The film's samples were taken by its own plan: on a machine that rounds otherwise, another one than ours.
        for (info, sums) in renderer.packed.pixels.iter_mut().zip(&film.pixels) {
            info.sample_factor = sums.sample_factor.max(1);
        }
        renderer.film = film;
        renderer.replay_real()?;
        Ok(renderer)
    }

    /// Adds the film of another renderer of the same scene whose samples come just before or just after this one's, and traces what edge
    /// pixels then lack. The result equals one render of both ranges within 2 units in the last place.
    ///
    /// # Errors
    /// The films differ in size or planes, or their ranges leave a gap or overlap; nothing is changed then.
    pub fn merge(&mut self, other: &Film) -> Result<(), RenderError> {
        self.film.merge(other)?;
        let end = self.film.first_sample + self.samples();
        self.end_sample = self.end_sample.max(end);
        self.replay_real()
    }

    fn count_render(&mut self, watch: &Watch) {
        self.seconds.render += watch.secs();
        self.seconds.cpu += watch.cpu_secs();
    }

    /// For tests: the graphics device, if one renders, is destroyed before its n-th batch from now.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, batches: u32) {
        if let Backend::Gpu(gpu) = &mut self.backend {
            gpu.lose_device_after(batches);
        }
    }

    fn run_pass(&mut self, pass: Pass<'_>, cancel: &Cancel) -> Result<(), RenderError> {
        if let Backend::Gpu(gpu) = &mut self.backend {
            match gpu.render_pass(&self.packed, &mut self.film, pass, cancel, &mut self.rays) {
                Err(error @ GpuError::Lost(_)) => {
                    self.notes.push(format!(
                        "{error}; the CPU goes on from what was accumulated"
                    ));
                    self.backend = Backend::Cpu;
                }
                other => return Ok(other?),
            }
        }
        self.rays += cpu::render::render_pass(&self.packed, &mut self.film, pass, cancel);
        Ok(())
    }

    /// Rays per pixel that every pixel within reach has taken.
    pub fn samples(&self) -> u32 {
        let within_reach = self
            .film
            .pixels
            .iter()
            .zip(&self.packed.pixels)
            .filter(|(_, info)| info.flags & PIXEL_OUT_OF_REACH == 0);
        within_reach
            .map(|(sums, _)| sums.n / sums.sample_factor.max(1))
            .min()
            .unwrap_or(self.end_sample - self.film.first_sample)
    }

    pub fn film(&self) -> &Film {
        &self.film
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    pub fn packed(&self) -> &PackedScene {
        &self.packed
    }

    /// The film composited over the photograph.
    pub fn picture(&self) -> Picture {
        composite(
            &self.shown(),
            self.scene.photo.as_ref(),
            self.scene.settings.composite,
        )
    }

    /// The variance plane is that of the scrambles where there are any, else that of the samples.
    pub fn planes(&self) -> Planes {
        let mut planes = planes(&self.shown(), self.scene.photo.as_ref());
        if let Some(stated) = &self.stated {
            planes.variance.clone_from(&stated.variance);
        }
        planes
    }

    /// Root-mean-square error of the picture, linear: from the scrambles where there are any, else from the variance of the samples, which
    /// overstates that of a stratified sampler.
    pub fn error(&self) -> f64 {
        match &self.stated {
            Some(stated) => stated.rms(),
            None => estimated_error(&self.film, self.scene.photo.as_ref()),
        }
    }

    pub fn rays(&self) -> RayTotals {
        self.rays
    }

    pub fn seconds(&self) -> Seconds {
        self.seconds
    }

    /// Things the user should hear: fallbacks taken, values fitted.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The graphics device that renders, if one does.
    pub fn gpu_device(&self) -> Option<&Arc<GpuDevice>> {
        match &self.backend {
            Backend::Cpu | Backend::Undecided => None,
            Backend::Gpu(gpu) => Some(gpu.device()),
        }
    }

    /// Takes the time of every kernel from now on, at a small cost; false where no graphics device renders, or it takes no timestamps.
    pub fn profile_gpu(&mut self) -> bool {
        match &mut self.backend {
            Backend::Cpu | Backend::Undecided => false,
            Backend::Gpu(gpu) => gpu.profile(),
        }
    }

    /// Seconds by kernel since [`Renderer::profile_gpu`].
    pub fn gpu_kernel_seconds(&self) -> Option<KernelSeconds> {
        match &self.backend {
            Backend::Cpu | Backend::Undecided => None,
            Backend::Gpu(gpu) => gpu.kernel_seconds(),
        }
    }

    /// "cpu" or "gpu".
    pub fn backend_name(&self) -> &'static str {
        match self.backend {
            Backend::Undecided | Backend::Cpu => "cpu",
            Backend::Gpu(_) => "gpu",
        }
    }

    /// The adapter's name, or the number of threads.
    pub fn device_name(&self) -> String {
        match &self.backend {
            Backend::Undecided | Backend::Cpu => {
                format!("{} CPU threads", rayon::current_num_threads())
            }
            Backend::Gpu(gpu) => gpu.device_name(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::test_scene;
    use crate::scene::{Light, LightKind, Side};

    #[test]
    fn no_device_is_opened_until_there_is_something_to_trace() {
        let mut scene = test_scene();
        scene.settings.backend = BackendChoice::Auto;
        let mut renderer = Renderer::new(scene, RendererOptions::default()).expect("fits");
        assert!(matches!(renderer.backend, Backend::Undecided));
        (renderer.advance(Budget::Complete, &|| false, &mut |_| ())).expect("nothing to do");
        assert_eq!(renderer.rays(), RayTotals::default());
        let lamp = Light {
            kind: LightKind::Quad {
                corner: [-1.0, -1.0, -2.0],
                edge_u: [2.0, 0.0, 0.0],
                edge_v: [0.0, 2.0, 0.0],
                radiance: [1.0; 3],
            },
            side: Side::Virtual,
        };
        renderer.set_lights(vec![lamp]).expect("fits");
        assert!(!matches!(renderer.backend, Backend::Undecided));
    }
}
