//! Runs samples as a wavefront: a batch of them advances one step a dispatch, the finished ones leave the queue, and at the end one
//! thread a pixel adds the samples to the pixel's sums in their order. What reaches the film does not depend on how the work was cut.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::kernel::{BindGroups, Kernel};
use super::lanes::{Batch, Beside, Counters, Lanes, most_lanes, state_parts};
use super::pacer::Pacer;
use super::photons::Photons;
use super::profile::{
    ACCUMULATE, ADVANCE, GENERATE, KERNELS, KernelSeconds, Profiler, SHARE, TRACE, TURN,
};
use super::{Changed, Composer, Features, GpuDevice, GpuError, SceneBuffers, SceneParts};
use crate::cpu::sharing::tile_of;
use crate::film::Film;
use crate::packed::PackedScene;
use crate::shared::WORKGROUP;
use crate::work::list::TILE_PLACES;
use crate::work::{Pass, PhotonWork, PixelWork, Place, Places, RayCounts, Watcher, WorkList};

/// Samples of one pixel in a batch at most, so that a batch has pixels enough to sum in parallel.
const MOST_SAMPLES: u32 = 256;
/// No sample takes so many steps: at 64 bounces a difference chain with a path at each vertex stays under it.
const MOST_STEPS: u32 = 100_000;

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
    /// Made once there are photons to trace.
    photons: Option<Photons>,
    /// By kernel and parity.
    groups: Vec<[BindGroups; 2]>,
    pacer: Pacer,
    /// The first submission compiles the kernels, and says nothing about speed.
    warm: bool,
    profiler: Option<Profiler>,
    places: Places,
    batches_until_loss: Option<u32>,
    /// The kernels hold no more than the scene needs.
    specialised: bool,
}

struct Parked {
    features: Features,
    kernels: Vec<Kernel>,
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

fn pacer(gpu: &GpuDevice, state_parts: &BTreeMap<String, u64>) -> Pacer {
    Pacer::new(most_lanes(gpu, state_parts.values().sum()))
}

/// One dispatch of a submission.
struct Dispatch {
    kernel: usize,
    parity: usize,
    /// None: as many as the queue has lanes.
    workgroups: Option<u32>,
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
        if !self.scene.update(&self.gpu, &parts, changed) {
            self.scene = SceneBuffers::from_parts(&self.gpu, &parts)?;
            // Bind groups name the old buffers.
            self.lanes = None;
            self.photons = None;
        }
        let features = Features::wanted(scene, self.specialised);
        if features != self.features {
            self.change_features(features)?;
        }
        Ok(())
    }

    /// Takes other kernels, compiled now or kept from before: a video goes back and forth between moving and resting.
    fn change_features(&mut self, features: Features) -> Result<(), GpuError> {
        let kept = (self.parked.iter()).position(|parked| parked.features == features);
        let kernels = match kept {
            Some(kept) => self.parked.swap_remove(kept).kernels,
            None => compile(&self.gpu, &Composer::default(), &features)?,
        };
        let before = Parked {
            features: std::mem::replace(&mut self.features, features),
            kernels: std::mem::replace(&mut self.kernels, kernels),
        };
        self.parked.push(before);
        let state_parts = state_parts(&self.kernels);
        if state_parts != self.state_parts {
            self.pacer = pacer(&self.gpu, &state_parts);
            self.state_parts = state_parts;
        }
        self.lanes = None;
        self.photons = None;
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
        let pacer = pacer(&gpu, &state_parts);
        Ok(Self {
            gpu,
            scene,
            features: *features,
            kernels,
            parked: Vec::new(),
            state_parts,
            lanes: None,
            photons: None,
            groups: Vec::new(),
            pacer,
            warm: false,
            profiler: None,
            places: Places::default(),
            batches_until_loss: None,
            specialised: true,
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

    /// For tests: the device is destroyed before its n-th batch from now.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, batches: u32) {
        self.batches_until_loss = Some(batches);
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
        // Pixels that share a batch take equally many samples of it: no lanes stay empty. Those of a sharing tile lie together.
        let mut pixels = work.pixels.clone();
        for work in &mut pixels {
            work.tile = tile_of(film.width, work.pixel);
        }
        pixels.sort_unstable_by_key(|work| (Reverse(work.samples()), work.tile, work.pixel));
        for members in pixels.chunk_by_mut(|a, b| a.samples() == b.samples() && a.tile == b.tile) {
            let count = members.len() as u32;
            for (place, work) in (0..).zip(members) {
                work.tile = place + TILE_PLACES * count;
            }
        }
        self.places.end(Place::List, begun);
        let mut rest = pixels.as_slice();
        while !rest.is_empty() && !watcher.is_cancelled() {
            let lanes = self.pacer.lanes();
            let lanes = self.prepare(lanes, Beside::of(film))?;
            let (now, later) = rest.split_at(pixels_that_fit(rest, lanes));
            let at_once = (lanes / now.len()).clamp(1, MOST_SAMPLES as usize) as u32;
            self.render_pixels(film, work.pass, now, at_once, rays)?;
            rest = later;
            watcher.taken(now.iter().map(|pixel| u64::from(pixel.samples())).sum());
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
        let photons = match &mut self.photons {
            Some(photons) => photons,
            none => none.insert(Photons::new(
                &self.gpu,
                &Composer::default(),
                &self.features,
                &self.scene,
            )?),
        };
        photons.render(&self.gpu, film, work, rays, &mut self.places, watcher)
    }

    /// Makes room for `wanted` lanes, or for as many as there is memory for; returns how many may be used.
    fn prepare(&mut self, wanted: usize, beside: Beside) -> Result<usize, GpuError> {
        let present = match &self.lanes {
            Some(lanes) if lanes.beside == beside => lanes.capacity,
            _ => 0,
        };
        if present >= wanted {
            return Ok(wanted);
        }
        let room = self.pacer.room(wanted);
        match Lanes::new(&self.gpu, room, &self.state_parts, beside) {
            Ok(lanes) => {
                self.bind(&lanes)?;
                self.lanes = Some(lanes);
                Ok(wanted)
            }
            Err(GpuError::Limit { .. }) if present > 0 => Ok(present),
            Err(error) => Err(error),
        }
    }

    fn bind(&mut self, lanes: &Lanes) -> Result<(), GpuError> {
        let bind = |kernel: &Kernel, parity: usize| {
            kernel.bind(&self.gpu, |name| {
                lanes.get(name, parity).or_else(|| self.scene.get(name))
            })
        };
        self.groups = self
            .kernels
            .iter()
            .map(|kernel| Ok([bind(kernel, 0)?, bind(kernel, 1)?]))
            .collect::<Result<_, GpuError>>()?;
        Ok(())
    }

    /// All samples of a few pixels, from upload to film, `at_once` a batch; `rays` grows once the film has them.
    fn render_pixels(
        &mut self,
        film: &mut Film,
        pass: Pass,
        work: &[PixelWork],
        at_once: u32,
        rays: &mut RayCounts,
    ) -> Result<(), GpuError> {
        let Some(lanes) = self.lanes.take() else {
            return Err(GpuError::Lost("no room for samples".to_owned()));
        };
        let outcome = self.render_pixels_on(&lanes, film, pass, work, at_once);
        self.lanes = Some(lanes);
        *rays += outcome?;
        Ok(())
    }

    fn render_pixels_on(
        &mut self,
        lanes: &Lanes,
        film: &mut Film,
        pass: Pass,
        work: &[PixelWork],
        at_once: u32,
    ) -> Result<RayCounts, GpuError> {
        let begun = self.places.begin();
        lanes.upload_work(&self.gpu, work);
        let begun = self.places.end(Place::List, begun);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let is_empty = |work: &PixelWork| film.pixels[work.pixel as usize].is_empty();
        if work.iter().all(is_empty) {
            lanes.clear_sums(&mut encoder, work.len());
        } else {
            lanes.upload_sums(&self.gpu, film, work);
        }
        self.places.end(Place::Sums, begun);

        let longest = work.iter().map(PixelWork::samples).max().unwrap_or(0);
        let real_pass = pass == Pass::Real;
        let mut rays = RayCounts::default();
        let mut sample_offset = 0;
        while sample_offset < longest {
            let sample_count = at_once.min(longest - sample_offset);
            let batch = Batch {
                pixel_count: work.len() as u32,
                lane_count: work.len() as u32 * sample_count,
                sample_offset,
                sample_count,
                real_pass: u32::from(real_pass),
                with_guides: u32::from(lanes.beside.guides && !real_pass),
                with_groups: u32::from(lanes.beside.groups && !real_pass),
                ..Batch::default()
            };
            self.run_batch(lanes, &batch, encoder)?;
            encoder = self.gpu.device.create_command_encoder(&Default::default());
            sample_offset += sample_count;
            let last = sample_offset == longest;
            let counters = self.finish_batch(lanes, &batch, film, work, last)?;
            rays += counters.rays;
        }
        Ok(rays)
    }

    /// Takes every sample of the batch to its end; `encoder` has what comes before.
    fn run_batch(
        &mut self,
        lanes: &Lanes,
        batch: &Batch,
        mut encoder: wgpu::CommandEncoder,
    ) -> Result<(), GpuError> {
        self.count_down_to_loss();
        let mut begun = self.places.begin();
        self.gpu.write(&lanes.batch, 0, bytemuck::bytes_of(batch));
        lanes.clear_counters(&mut encoder);

        // The first queue is written with parity 1, so that parity 0 reads it.
        let mut parity = 0;
        let mut dispatches = vec![Dispatch {
            kernel: GENERATE,
            parity: 1,
            workgroups: Some(batch.lane_count.div_ceil(WORKGROUP)),
        }];
        let mut alive = batch.lane_count;
        let mut steps_before = 0;
        let mut steps = 0;
        loop {
            let count = self.pacer.steps(alive as usize);
            for _ in 0..count {
                for (kernel, workgroups) in [(TURN, Some(1)), (TRACE, None), (ADVANCE, None)] {
                    dispatches.push(Dispatch {
                        kernel,
                        parity,
                        workgroups,
                    });
                }
                parity = 1 - parity;
            }
            let start = Instant::now();
            self.encode(&mut encoder, lanes, &dispatches);
            lanes.copy_counters(&mut encoder);
            self.gpu.submit(encoder, dispatches.len() as u64)?;
            begun = self.places.end(Place::Record, begun);
            let counters = lanes.read_counters(&self.gpu)?;
            self.take_times()?;
            begun = self.places.end(Place::Wait, begun);
            if self.warm {
                let begun = if steps == 0 { batch.lane_count } else { 0 };
                let done = u64::from(begun) + u64::from(counters.steps - steps_before);
                self.pacer.record(start.elapsed(), done, steps == 0);
            }
            self.warm = true;
            steps_before = counters.steps;
            alive = counters.lanes_out;
            if alive == 0 {
                return Ok(());
            }
            steps += count as u32;
            if steps > MOST_STEPS {
                return Err(GpuError::Endless(steps));
            }
            dispatches.clear();
            encoder = self.gpu.device.create_command_encoder(&Default::default());
        }
    }

    /// Sums the batch; after the last one of these pixels, brings their sums home.
    fn finish_batch(
        &mut self,
        lanes: &Lanes,
        batch: &Batch,
        film: &mut Film,
        work: &[PixelWork],
        last: bool,
    ) -> Result<Counters, GpuError> {
        let once = |kernel, count: u32| Dispatch {
            kernel,
            parity: 0,
            workgroups: Some(count.div_ceil(WORKGROUP)),
        };
        let mut dispatches = vec![once(ACCUMULATE, batch.pixel_count)];
        if self.features.sharing && batch.real_pass == 0 {
            dispatches.insert(0, once(SHARE, batch.lane_count));
        }
        let begun = self.places.begin();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.encode(&mut encoder, lanes, &dispatches);
        lanes.copy_counters(&mut encoder);
        if last {
            lanes.copy_sums(&mut encoder, work.len());
        }
        self.gpu.submit(encoder, dispatches.len() as u64)?;
        let begun = self.places.end(Place::Record, begun);
        if !last {
            let counters = lanes.read_counters(&self.gpu)?;
            self.take_times()?;
            self.places.end(Place::Wait, begun);
            return Ok(counters);
        }
        lanes.wait_for_sums(&self.gpu, work.len())?;
        let begun = self.places.end(Place::Wait, begun);
        let counters = lanes.read_sums(&self.gpu, film, work)?;
        self.take_times()?;
        self.places.end(Place::Sums, begun);
        Ok(counters)
    }

    fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        lanes: &Lanes,
        dispatches: &[Dispatch],
    ) {
        let kernels = &self.kernels;
        let groups = &self.groups;
        let run = |pass: &mut wgpu::ComputePass<'_>, dispatch: &Dispatch| {
            kernels[dispatch.kernel].set(pass, &groups[dispatch.kernel][dispatch.parity]);
            match dispatch.workgroups {
                Some(count) => pass.dispatch_workgroups(count, 1, 1),
                None => pass.dispatch_workgroups_indirect(&lanes.indirect, 0),
            }
        };
        match &mut self.profiler {
            None => {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                for dispatch in dispatches {
                    run(&mut pass, dispatch);
                }
            }
            Some(profiler) => {
                for dispatch in dispatches {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some(KERNELS[dispatch.kernel]),
                        timestamp_writes: profiler.around(dispatch.kernel),
                    });
                    run(&mut pass, dispatch);
                }
                profiler.resolve(encoder);
            }
        }
    }

    fn take_times(&mut self) -> Result<(), GpuError> {
        match &mut self.profiler {
            Some(profiler) => profiler.collect(&self.gpu),
            None => Ok(()),
        }
    }

    fn count_down_to_loss(&mut self) {
        if let Some(batches) = &mut self.batches_until_loss {
            match batches.checked_sub(1) {
                Some(left) => *batches = left,
                None => self.gpu.device.destroy(),
            }
        }
    }
}

/// How many of the first pixels of `work` take their samples, or [`MOST_SAMPLES`] of them, in one batch of `lanes`; whole tiles, at least one.
fn pixels_that_fit(work: &[PixelWork], lanes: usize) -> usize {
    let mut longest = 1;
    let fitting = work.iter().enumerate().position(|(before, pixel)| {
        longest = longest.max(pixel.samples().min(MOST_SAMPLES) as usize);
        (before + 1) * longest > lanes
    });
    let Some(fitting) = fitting else {
        return work.len();
    };
    let (place, count) = (
        work[fitting].tile % TILE_PLACES,
        work[fitting].tile / TILE_PLACES,
    );
    match fitting - place as usize {
        0 => (count as usize).max(1),
        whole_tiles => whole_tiles,
    }
}
