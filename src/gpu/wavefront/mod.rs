//! Runs samples as a wavefront: batches of them advance one step a dispatch, the finished ones leave the queue, and at the end of a batch one
//! thread a pixel adds the samples to the pixel's sums in their order. What reaches the film does not depend on how the work was cut.
//!
//! Many batches go to the device in one recording, which says how many steps they took before; the device itself goes from one to the next. The host
//! reads back how far they have come when it fetches the sums.

mod run;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use self::run::Job;
use super::course::Course;
use super::kernel::{BindGroups, Kernel};
use super::lanes::{Lanes, most_lanes, state_parts};
use super::pacer::Pacer;
use super::photons::Photons;
use super::portion::{first_tiles, in_order};
use super::profile::{KERNELS, KernelSeconds, Profiler};
use super::slots::{Beside, Slots, most_slots};
use super::{Changed, Composer, Features, GpuDevice, GpuError, SceneBuffers, SceneParts};
use crate::film::Film;
use crate::packed::PackedScene;
use crate::work::{PhotonWork, Place, Places, RayCounts, Watcher, WorkList};

/// The estimator on one device, specialised to one scene.
pub struct GpuBackend {
    gpu: Arc<GpuDevice>,
    scene: SceneBuffers,
    features: Features,
    kernels: Vec<Kernel>,
    /// Kernels of other features that were in use before.
    parked: Vec<Parked>,
    /// Bytes of each part of the state of one sample, by name.
    state_parts: BTreeMap<String, u64>,
    lanes: Option<Lanes>,
    slots: Option<Slots>,
    /// Made once there are photons to trace.
    photons: Option<Photons>,
    /// By kernel and parity; none until they are bound to the buffers that are there.
    groups: Vec<[BindGroups; 2]>,
    /// Which queue the next step reads.
    parity: usize,
    pacer: Pacer,
    /// Of the main pass and the real one.
    courses: [Course; 2],
    /// The first submissions compile the kernels, and say nothing about speed.
    warm: bool,
    profiler: Option<Profiler>,
    places: Places,
    recordings_until_loss: Option<u32>,
    /// The kernels hold no more than the scene needs.
    specialised: bool,
    /// A window is drawn on the same device.
    beside_window: bool,
}

struct Parked {
    features: Features,
    kernels: Vec<Kernel>,
    photons: Option<Photons>,
}

fn compile(
    gpu: &GpuDevice,
    composer: &Composer,
    features: &Features,
) -> Result<Vec<Kernel>, GpuError> {
    KERNELS
        .iter()
        .map(|entry_point| {
            let wgsl = composer.compose("gpu::kernels", entry_point, features)?;
            Kernel::new(gpu, entry_point, &wgsl)
        })
        .collect()
}

fn pacer(gpu: &GpuDevice, state_parts: &BTreeMap<String, u64>, beside_window: bool) -> Pacer {
    Pacer::new(most_lanes(gpu, state_parts), beside_window)
}

impl GpuBackend {
    /// Uploads the scene and compiles kernels that do what it needs, and no more if they are `specialised`.
    ///
    /// # Errors
    /// [`GpuError::Limit`] if the scene does not fit the device.
    pub fn new(
        gpu: Arc<GpuDevice>,
        scene: &PackedScene,
        specialised: bool,
    ) -> Result<Self, GpuError> {
        let buffers = SceneBuffers::from_parts(&gpu, &SceneParts::from(scene))?;
        let features = Features::wanted(scene, specialised);
        let backend = Self::with_modules(gpu, &Composer::default(), &features, buffers)?;
        Ok(Self {
            specialised,
            ..backend
        })
    }

    /// Takes the scene as it is now; compiles again only if it needs other features than before.
    ///
    /// # Errors
    /// As [`GpuBackend::new`].
    pub fn set_scene(&mut self, scene: &PackedScene) -> Result<(), GpuError> {
        self.update_scene(scene, Changed::All)
    }

    /// [`GpuBackend::set_scene`] where no more than `changed` is new since the last time: the rest is not sent again.
    ///
    /// # Errors
    /// As [`GpuBackend::new`].
    pub fn update_scene(&mut self, scene: &PackedScene, changed: Changed) -> Result<(), GpuError> {
        let parts = SceneParts::from(scene);
        if self.scene.update(&self.gpu, &parts, changed)? {
            // Bind groups name the old buffers.
            self.groups.clear();
            if let Some(photons) = &mut self.photons {
                photons.bind(&self.gpu, &self.scene)?;
            }
        }
        let features = Features::wanted(scene, self.specialised);
        if features != self.features {
            self.change_features(features)?;
        }
        match scene.photons_per_ray {
            0 => Ok(()),
            _ => self.prepare_photons(),
        }
    }

    /// Takes other kernels, compiled now or kept from before: a video goes back and forth between moving and resting.
    fn change_features(&mut self, features: Features) -> Result<(), GpuError> {
        let kept = (self.parked.iter()).position(|parked| parked.features == features);
        let (kernels, mut photons) = match kept {
            Some(kept) => {
                let parked = self.parked.swap_remove(kept);
                (parked.kernels, parked.photons)
            }
            None => {
                let begun = self.places.begin();
                let kernels = compile(&self.gpu, &Composer::default(), &features)?;
                self.places.end(Place::Kernels, begun);
                (kernels, None)
            }
        };
        if let Some(photons) = &mut photons {
            photons.bind(&self.gpu, &self.scene)?;
        }
        if let Some(photons) = &mut self.photons {
            photons.unbind();
        }
        let before = Parked {
            features: std::mem::replace(&mut self.features, features),
            kernels: std::mem::replace(&mut self.kernels, kernels),
            photons: std::mem::replace(&mut self.photons, photons),
        };
        self.parked.push(before);
        let state_parts = state_parts(&self.kernels);
        if state_parts != self.state_parts {
            self.pacer = pacer(&self.gpu, &state_parts, self.beside_window);
            self.state_parts = state_parts;
            self.lanes = None;
        }
        self.groups.clear();
        self.courses = Default::default();
        self.warm = false;
        Ok(())
    }

    /// Another seed or number of samples of the same scene, which costs next to nothing.
    pub fn set_frame(&mut self, scene: &PackedScene) {
        self.scene.set_frame(&self.gpu, &SceneParts::from(scene));
    }

    /// Compiles the kernels for `features` from `composer`'s modules; `scene` is what they read.
    ///
    /// # Errors
    /// [`GpuError::Shader`], or [`GpuError::Limit`] if the adapter cannot run them.
    pub fn with_modules(
        gpu: Arc<GpuDevice>,
        composer: &Composer,
        features: &Features,
        scene: SceneBuffers,
    ) -> Result<Self, GpuError> {
        let kernels = compile(&gpu, composer, features)?;
        let state_parts = state_parts(&kernels);
        let pacer = pacer(&gpu, &state_parts, false);
        Ok(Self {
            gpu,
            scene,
            features: *features,
            kernels,
            parked: Vec::new(),
            state_parts,
            lanes: None,
            slots: None,
            photons: None,
            groups: Vec::new(),
            parity: 0,
            pacer,
            courses: Default::default(),
            warm: false,
            profiler: None,
            places: Places::default(),
            recordings_until_loss: None,
            specialised: true,
            beside_window: false,
        })
    }

    /// The device, for the stages that follow.
    pub fn device(&self) -> &Arc<GpuDevice> {
        &self.gpu
    }

    /// Name and driver of the device.
    pub fn device_name(&self) -> String {
        self.gpu.name()
    }

    /// Leaves the device to others more often, for a window is drawn on it.
    pub fn make_way_for_window(&mut self) {
        self.beside_window = true;
        self.pacer = pacer(&self.gpu, &self.state_parts, true);
    }

    /// Takes the time of every kernel from now on, which costs a pass for each dispatch; false where the device cannot.
    pub fn profile(&mut self) -> bool {
        self.profiler = Profiler::new(&self.gpu);
        self.profiler.is_some()
    }

    /// Seconds by kernel since [`GpuBackend::profile`].
    pub fn kernel_seconds(&self) -> Option<KernelSeconds> {
        self.profiler.as_ref().map(|profiler| profiler.seconds)
    }

    /// Books the host's time from now on.
    pub fn set_places(&mut self, places: Places) {
        self.places = places;
    }

    /// Where the host's time went.
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// For tests: the device is destroyed after so many recordings from now.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, recordings: u32) {
        self.recordings_until_loss = Some(recordings);
    }

    /// Takes the samples of `work` and adds them to the film, as [`crate::cpu::render::render`] does; `rays` grows by the rays traced.
    ///
    /// Whatever the outcome, every pixel of the film has taken all of its samples or none.
    ///
    /// # Errors
    /// [`GpuError::Lost`]: the film keeps what was finished before, and a list of what is left on another backend goes on from there.
    pub fn render(
        &mut self,
        film: &mut Film,
        work: &WorkList,
        rays: &mut RayCounts,
        watcher: &Watcher<'_>,
    ) -> Result<(), GpuError> {
        let begun = self.places.begin();
        let pixels = in_order(film.width, &work.pixels);
        self.places.end(Place::List, begun);
        let mut job = Job {
            film,
            pass: work.pass,
            is_first: work.is_first,
            from_zero: false,
            rays,
            watcher,
            rays_of_parts: RayCounts::default(),
        };
        let mut rest = pixels.as_slice();
        while !rest.is_empty() && !watcher.is_cancelled() {
            let (now, later) = rest.split_at(first_tiles(rest, most_slots(&self.gpu)));
            self.render_portion(&mut job, now)?;
            rest = later;
        }
        Ok(())
    }

    /// Traces the photons of `work` and adds what they bring to the film, as [`crate::cpu::photons::render::render`] does.
    ///
    /// # Errors
    /// As [`GpuBackend::render`].
    pub fn trace_photons(
        &mut self,
        film: &mut Film,
        work: &PhotonWork,
        rays: &mut RayCounts,
        watcher: &Watcher<'_>,
    ) -> Result<(), GpuError> {
        self.prepare_photons()?;
        let photons = self.photons.as_mut().expect("they are prepared");
        photons.render(&self.gpu, film, work, rays, &mut self.places, watcher)
    }

    /// Compiles the photons' kernel, unless it is there.
    fn prepare_photons(&mut self) -> Result<(), GpuError> {
        if self.photons.is_none() {
            let begun = self.places.begin();
            let composer = Composer::default();
            let made = Photons::new(&self.gpu, &composer, &self.features, &self.scene)?;
            self.photons = Some(made);
            self.places.end(Place::Kernels, begun);
        }
        Ok(())
    }

    /// Makes room for so many pixels.
    fn prepare_slots(&mut self, pixels: usize, beside: Beside) -> Result<(), GpuError> {
        let fits = |slots: &Slots| slots.beside == beside && slots.capacity >= pixels;
        if !self.slots.as_ref().is_some_and(fits) {
            self.slots = None;
            self.groups.clear();
            let room = pixels.next_power_of_two().min(most_slots(&self.gpu));
            self.slots = Some(Slots::new(&self.gpu, room.max(pixels), beside)?);
        }
        Ok(())
    }

    /// Makes room for `wanted` lanes, or for as many as there is memory for; returns how many may be used.
    fn prepare_lanes(&mut self, wanted: usize) -> Result<usize, GpuError> {
        let present = self.lanes.as_ref().map_or(0, |lanes| lanes.capacity);
        if present >= wanted {
            return Ok(wanted);
        }
        let room = self.pacer.room(wanted);
        match Lanes::new(&self.gpu, room, &self.state_parts) {
            Ok(lanes) => {
                self.lanes = Some(lanes);
                self.groups.clear();
                Ok(wanted)
            }
            Err(GpuError::Limit { .. }) if present > 0 => Ok(present),
            Err(error) => Err(error),
        }
    }

    /// Binds the kernels to the buffers, unless they are.
    fn bind(&mut self, lanes: &Lanes, slots: &Slots) -> Result<(), GpuError> {
        if !self.groups.is_empty() {
            return Ok(());
        }
        let bind = |kernel: &Kernel, parity: usize| {
            kernel.bind(&self.gpu, |name| {
                let of_batches = lanes.get(name, parity).or_else(|| slots.get(name));
                of_batches.or_else(|| self.scene.get(name))
            })
        };
        self.groups = self
            .kernels
            .iter()
            .map(|kernel| Ok([bind(kernel, 0)?, bind(kernel, 1)?]))
            .collect::<Result<_, GpuError>>()?;
        Ok(())
    }

    fn count_down_to_loss(&mut self) {
        if let Some(recordings) = &mut self.recordings_until_loss {
            match recordings.checked_sub(1) {
                Some(left) => *recordings = left,
                None => self.gpu.device.destroy(),
            }
        }
    }
}
