//! What every driver drives: a scene, its film, and the backend that fills the one from the other.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::backend::Backend;
use super::photo_albedo::PhotoLight;
use super::stopwatch::Stopwatch;
use super::{RenderError, RendererOptions, Seconds, Skip};
use crate::cpu::{self, LensGrid};
use crate::film::Film;
use crate::gpu::GpuError;
use crate::pack::PackError;
use crate::packed::{Frame, PIXEL_OUT_OF_REACH, PackedScene, PixelInfo};
use crate::scene::{Composite, Photo, Scene};
use crate::work::{
    Meter, Phase, PhotonWork, Place, Places, Progress, RayCounts, Watcher, WorkList,
};

pub(super) struct Core {
    pub scene: Scene,
    pub packed: PackedScene,
    /// Of the frames of a video, and of a scene that is edited.
    pub lens_grid: Option<LensGrid>,
    pub film: Film,
    /// No pixel of the film has a sample, and its plan is the packed scene's.
    pub film_is_new: bool,
    pub backend: Backend,
    pub options: RendererOptions,
    pub rays: RayCounts,
    pub seconds: Seconds,
    /// What a frame takes beside the device's backend, which has its own.
    pub places: Places,
    /// Things the user should hear: fallbacks taken, values fitted.
    pub notes: Vec<String>,
    /// The photograph in the size of a coarser frame.
    pub coarse_photo: Option<Photo>,
    /// Of a draft: other exposures and cameras make do with it.
    pub photo_light: Option<PhotoLight>,
    /// The same as the present camera sees it.
    pub photo_here: Option<PhotoLight>,
    /// The picture's time.
    pub time_secs: f64,
    /// The pilot was not ended by its watcher.
    pub is_planned: bool,
    /// What a ray in every pixel took the last time.
    pub secs_per_ray: Option<f64>,
}

impl Core {
    /// Packs the whole scene anew, anchored at its camera.
    pub fn pack(&mut self, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let anchor = self.scene.camera.world_from_camera.w_axis.truncate();
        self.pack_at(anchor, watcher)
    }

    /// The same, anchored at a point of the world.
    pub fn pack_at(&mut self, anchor: DVec3, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let begun = self.places.begin();
        self.packed = packed(&self.scene, anchor, &self.options, watcher)?;
        self.places.end(Place::Trees, begun);
        Ok(())
    }

    /// Packs the virtual world anew.
    pub fn pack_virtual(&mut self, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let meter = Meter::begin(watcher, Phase::Trees, 1);
        let begun = self.places.begin();
        self.packed.rebuild_virtual(&self.scene)?;
        self.places.end(Place::Trees, begun);
        meter.end();
        Ok(())
    }

    /// Packs the virtual world anew after an edit that keeps its trees.
    pub fn pack_moved(&mut self, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let meter = Meter::begin(watcher, Phase::Trees, 1);
        let begun = self.places.begin();
        self.packed.move_virtual(&self.scene)?;
        self.places.end(Place::Trees, begun);
        meter.end();
        Ok(())
    }

    /// Packs one virtual object anew, which rests as it did before.
    pub fn pack_object(&mut self, object: usize, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let meter = Meter::begin(watcher, Phase::Trees, 1);
        let begun = self.places.begin();
        self.packed.move_object(&self.scene, object)?;
        self.places.end(Place::Trees, begun);
        meter.end();
        Ok(())
    }

    /// Packs anew what moves.
    pub fn pack_moving(&mut self, watcher: &Watcher<'_>) -> Result<(), PackError> {
        let meter = Meter::begin(watcher, Phase::Trees, 1);
        let begun = self.places.begin();
        self.packed.rebuild_moving(&self.scene)?;
        self.places.end(Place::Trees, begun);
        meter.end();
        Ok(())
    }

    /// Takes the samples of a list. A device that is lost is replaced by the CPU, which takes what is left.
    pub fn take(&mut self, work: &WorkList, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        self.film_is_new = false;
        if let Some(gpu) = self.backend.gpu_mut() {
            match gpu.render(&mut self.film, work, &mut self.rays, watcher) {
                Err(error @ GpuError::Lost(_)) => {
                    self.replace_device(&error);
                    let left = work.left(&self.film);
                    self.rays += cpu::render::render(&self.packed, &mut self.film, &left, watcher);
                    return Ok(());
                }
                other => return Ok(other?),
            }
        }
        self.rays += cpu::render::render(&self.packed, &mut self.film, work, watcher);
        Ok(())
    }

    /// Traces the photons of the rays per pixel before `end` that the film lacks; fewer if the watcher ends it.
    pub fn take_photons(&mut self, end: u32, watcher: &Watcher<'_>) -> Result<(), RenderError> {
        let end = u64::from(end) * self.packed.photons_per_ray;
        self.take_photons_of(end, [0.0, 1.0], watcher)
    }

    /// The same, of the photons numbered below `end`, which fly in a part of the shutter's time: its beginning and length. A device that is lost is
    /// replaced by the CPU.
    pub fn take_photons_of(
        &mut self,
        end: u64,
        window: [f32; 2],
        watcher: &Watcher<'_>,
    ) -> Result<(), RenderError> {
        let Some(work) = self.lacking_photons(end, window) else {
            return Ok(());
        };
        if let Some(gpu) = self.backend.gpu_mut() {
            match gpu.trace_photons(&mut self.film, &work, &mut self.rays, watcher) {
                Err(error @ GpuError::Lost(_)) => self.replace_device(&error),
                other => return Ok(other?),
            }
        }
        if let Some(work) = self.lacking_photons(end, window) {
            self.rays += cpu::photons::render::render(&self.packed, &mut self.film, &work, watcher);
        }
        Ok(())
    }

    pub fn lacks_photons(&self, end: u64) -> bool {
        self.lacking_photons(end, [0.0, 1.0]).is_some()
    }

    fn lacking_photons(&self, end: u64, window: [f32; 2]) -> Option<PhotonWork> {
        let film = &self.film;
        let first = u64::from(film.first_sample) * self.packed.photons_per_ray + film.photons();
        let is_lacking = !film.splats.is_empty() && first < end;
        is_lacking.then_some(PhotonWork { first, end, window })
    }

    fn replace_device(&mut self, error: &GpuError) {
        self.notes.push(format!(
            "{error}; the CPU goes on from what was accumulated"
        ));
        self.backend = Backend::Cpu;
    }

    /// The samples of the main pass that lie before `end_of_row`, in rays per pixel.
    pub fn main_work(&mut self, end_of_row: impl Fn(usize) -> u32 + Sync) -> WorkList {
        let begun = self.places.begin();
        let work = match self.film_is_new {
            true => WorkList::first(&self.packed.pixels, &self.film, end_of_row),
            false => WorkList::main(&self.packed.pixels, &self.film, end_of_row),
        };
        self.places.end(Place::List, begun);
        work
    }

    /// The real samples before `end_of_row` that the composite, or a plane, lacks.
    pub fn real_work(&mut self, end_of_row: impl Fn(usize) -> u32 + Sync) -> WorkList {
        let begun = self.places.begin();
        let everywhere = self.options.real_everywhere
            || self.scene.settings.composite == Composite::Quotient
            || self.options.without.contains(Skip::EdgeReal);
        let work = WorkList::real(&self.packed.pixels, &self.film, everywhere, end_of_row);
        self.places.end(Place::List, begun);
        work
    }

    /// True if no pixel is within reach of anything virtual: the picture is the photograph.
    pub fn nothing_to_trace(&self) -> bool {
        !self.packed.pixels.iter().any(is_within_reach)
    }

    /// The photograph in the size that is traced.
    pub fn traced_photo(&self) -> Option<&Photo> {
        photo_of_size(&self.scene, self.coarse_photo.as_ref(), &self.packed.frame)
    }

    /// Rays per pixel that every pixel within reach has taken; `None`: there is no such pixel.
    pub fn samples(&self) -> Option<u32> {
        let pixels = self.film.pixels.par_iter().zip(&self.packed.pixels);
        pixels
            .filter(|(_, info)| is_within_reach(info))
            .map(|(sums, _)| sums.n / sums.sample_factor.max(1))
            .min()
    }

    pub fn count_render(&mut self, stopwatch: &Stopwatch) {
        self.seconds.render += stopwatch.secs();
        self.seconds.cpu += stopwatch.cpu_secs();
    }
}

/// Of the scene's photograph and one of a coarser frame, that of the frame's size.
pub(super) fn photo_of_size<'a>(
    scene: &'a Scene,
    coarse: Option<&'a Photo>,
    frame: &Frame,
) -> Option<&'a Photo> {
    let fits = |photo: &&Photo| (photo.width, photo.height) == (frame.width, frame.height);
    coarse.filter(fits).or(scene.photo.as_ref())
}

/// The whole scene, packed as the options ask.
pub(super) fn packed(
    scene: &Scene,
    anchor: DVec3,
    options: &RendererOptions,
    watcher: &Watcher<'_>,
) -> Result<PackedScene, PackError> {
    match options.draft {
        true => PackedScene::build_draft(scene, anchor, watcher),
        false => PackedScene::build_at(scene, anchor, watcher),
    }
}

pub(super) fn is_within_reach(info: &PixelInfo) -> bool {
    info.flags & PIXEL_OUT_OF_REACH == 0
}

/// Main passes on their way to an end, as a watcher hears of them.
pub(super) struct Way<'a> {
    watcher: Watcher<'a>,
    begin: Instant,
    /// Samples of all pixels.
    taken: u64,
    wanted: u64,
    /// Rays per pixel that every pixel has taken, and all of them.
    pub samples: u32,
    samples_total: u32,
}

impl<'a> Way<'a> {
    /// From where the film stands to `end`, in rays per pixel.
    pub fn to(end: u32, core: &mut Core, watcher: &Watcher<'a>) -> Self {
        let begun = core.places.begin();
        let samples_total = end - core.film.first_sample;
        let pixels = core.packed.pixels.par_iter().enumerate();
        let (taken, factors, samples) = pixels
            .filter(|(_, info)| is_within_reach(info))
            .map(|(pixel, info)| {
                // A film is large: where it is new, it is not looked at.
                let (n, factor) = match core.film_is_new {
                    true => (0, info.sample_factor.max(1)),
                    false => {
                        let sums = &core.film.pixels[pixel];
                        (sums.n, sums.sample_factor.max(1))
                    }
                };
                (u64::from(n), u64::from(factor), n / factor)
            })
            .reduce(
                || (0, 0, u32::MAX),
                |a, b| (a.0 + b.0, a.1 + b.1, a.2.min(b.2)),
            );
        let wanted = u64::from(samples_total) * factors;
        // Where there is no such pixel all is done.
        let samples = if factors == 0 { samples_total } else { samples };
        core.places.end(Place::List, begun);
        Self {
            watcher: *watcher,
            begin: Instant::now(),
            taken,
            wanted,
            samples,
            samples_total,
        }
    }

    /// Takes the samples of a list; false if the watcher did not wait for all of them.
    pub fn take(&mut self, core: &mut Core, work: &WorkList) -> Result<bool, RenderError> {
        let from = self.progress(core);
        let samples = work.samples();
        self.taken += samples;
        let meter = Meter::part(&self.watcher, from, self.share(), samples);
        core.take(work, &self.watcher.metered(&meter))?;
        Ok(!self.watcher.is_cancelled())
    }

    pub fn tell(&self, core: &Core) {
        self.watcher.hear(&self.progress(core));
    }

    fn share(&self) -> f64 {
        self.taken as f64 / self.wanted.max(1) as f64
    }

    fn progress(&self, core: &Core) -> Progress {
        Progress {
            phase: Phase::Rendering,
            share_done: self.share(),
            elapsed: self.begin.elapsed(),
            samples: self.samples,
            samples_total: self.samples_total,
            rays: core.rays,
        }
    }
}
