//! Photons on the device: one an invocation, from its light to its end. Their splats come back as a list, which the host adds up in fixed point: the
//! order in which they were listed leaves no trace.

use std::time::Instant;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::kernel::{BindGroups, Kernel, UNIFORM_USAGE};
use super::{Composer, Features, GpuDevice, GpuError, SceneBuffers};
use crate::cpu::photons::path::SEQUENCE_BITS;
use crate::film::{Film, Splat};
use crate::shared::{WORKGROUP, shared};
use crate::work::{PhotonWork, Place, Places, RayCounts, Watcher};

shared! {
    /// Uniform of a batch of photons of one sequence.
    #[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
    pub struct PhotonBatch {
        pub sequence: u32,
        /// Place of the first photon.
        pub first: u32,
        pub count: u32,
        /// Room in the list.
        pub most_splats: u32,
        /// When they fly, as shares of the shutter's time.
        pub window_begin: f32,
        pub window_length: f32,
        pub pad: [u32; 2],
    }

    /// What a photon brings to a pixel.
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    pub struct ListedSplat {
        pub value: Vec3,
        /// Twice the pixel's index, plus 1 if it comes from a virtual surface.
        pub place: u32,
    }

    /// Splats, mixed rays, mixed shadow rays.
    const PHOTON_COUNTERS: u32 = 3;
}

/// The entry point.
pub const PHOTON_KERNEL: &str = "kernel_photons";

const COUNTERS_BYTES: u64 = 4 * PHOTON_COUNTERS as u64;
const SPLAT_BYTES: u64 = size_of::<ListedSplat>() as u64;
/// Photons of the first submission, and of any.
const FIRST_BATCH: u32 = 1 << 12;
const LARGEST_BATCH: u32 = 1 << 18;
/// Seconds that a submission should take: short enough for a desktop to stay responsive.
const TARGET_SECS: f64 = 0.1;

/// The photons' kernel with its buffers.
pub struct Photons {
    kernel: Kernel,
    groups: BindGroups,
    batch: wgpu::Buffer,
    counters: wgpu::Buffer,
    splats: wgpu::Buffer,
    staging: wgpu::Buffer,
    /// Photons that the next submission may have.
    next_batch: u32,
    /// The first submission compiles the kernel, and says nothing about speed.
    warm: bool,
}

impl Photons {
    /// # Errors
    /// As [`Kernel::new`].
    pub fn new(
        gpu: &GpuDevice,
        composer: &Composer,
        features: &Features,
        scene: &SceneBuffers,
    ) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let wgsl = composer.compose("gpu::photons", PHOTON_KERNEL, features)?;
        let kernel = Kernel::new(gpu, PHOTON_KERNEL, &wgsl)?;
        let make = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let list = SPLAT_BYTES * u64::from(LARGEST_BATCH);
        let filled = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let batch_bytes = size_of::<PhotonBatch>() as u64;
        let batch = make("photon batch", batch_bytes, UNIFORM_USAGE);
        let counters = make("photon counters", COUNTERS_BYTES, filled);
        let splats = make("splats", list, Usage::STORAGE | Usage::COPY_SRC);
        let read = Usage::MAP_READ | Usage::COPY_DST;
        let staging = make("splats' staging", list.max(COUNTERS_BYTES), read);
        let mut photons = Self {
            kernel,
            groups: Vec::new(),
            batch,
            counters,
            splats,
            staging,
            next_batch: FIRST_BATCH,
            warm: false,
        };
        photons.bind(gpu, scene)?;
        Ok(photons)
    }

    /// Reads these buffers from now on.
    ///
    /// # Errors
    /// As [`Kernel::bind`].
    pub fn bind(&mut self, gpu: &GpuDevice, scene: &SceneBuffers) -> Result<(), GpuError> {
        self.groups = self.kernel.bind(gpu, |name| match name {
            "photon_batch" => Some(&self.batch),
            "photon_counters" => Some(&self.counters),
            "splats" => Some(&self.splats),
            name => scene.get(name),
        })?;
        Ok(())
    }

    /// Holds on to no scene's buffers any more; [`Photons::bind`] comes before the next photons.
    pub fn unbind(&mut self) {
        self.groups.clear();
    }

    /// Traces the photons of `work` and adds what they bring to the film, as [`crate::cpu::photons::render::render`] does.
    ///
    /// # Errors
    /// [`GpuError::Lost`]: the film keeps what was finished before.
    pub fn render(
        &mut self,
        gpu: &GpuDevice,
        film: &mut Film,
        work: &PhotonWork,
        rays: &mut RayCounts,
        places: &mut Places,
        watcher: &Watcher<'_>,
    ) -> Result<(), GpuError> {
        let mut first = work.first;
        let mut outcome = Ok(());
        while outcome.is_ok() && first < work.end && !watcher.is_cancelled() {
            let taken = self.render_batch(gpu, film, work, first, rays, places);
            first += *taken.as_ref().unwrap_or(&0);
            outcome = taken.map(|_| ());
        }
        // Once for all batches: every pixel counts them.
        let booked = places.begin();
        film.add_splats(first - work.first, std::iter::empty());
        places.end(Place::Photons, booked);
        outcome
    }

    /// The next photons from number `first` on, which pixels do not count yet; how many they are.
    fn render_batch(
        &mut self,
        gpu: &GpuDevice,
        film: &mut Film,
        work: &PhotonWork,
        first: u64,
        rays: &mut RayCounts,
        places: &mut Places,
    ) -> Result<u64, GpuError> {
        let place = first & ((1 << SEQUENCE_BITS) - 1);
        let count = ((1 << SEQUENCE_BITS) - place)
            .min(work.end - first)
            .min(u64::from(self.next_batch));
        let batch = PhotonBatch {
            sequence: (first >> SEQUENCE_BITS) as u32,
            first: place as u32,
            count: count as u32,
            most_splats: LARGEST_BATCH,
            window_begin: work.window[0],
            window_length: work.window[1],
            pad: [0; 2],
        };
        let begin = Instant::now();
        let [listed, mixed, mixed_shadow] = self.run(gpu, &batch, places)?;
        if listed > LARGEST_BATCH {
            // No room for all: again, fewer at a time.
            self.next_batch = (self.next_batch / 2).max(WORKGROUP);
            return Ok(0);
        }
        let booked = places.begin();
        let list = self.list(gpu, listed)?;
        film.add_splats(0, list.into_iter().map(Splat::from));
        *rays += RayCounts {
            mixed: mixed.into(),
            mixed_shadow: mixed_shadow.into(),
            ..RayCounts::default()
        };
        places.end(Place::Photons, booked);
        let secs = begin.elapsed().as_secs_f64();
        let room = u64::from(LARGEST_BATCH) * count / u64::from(2 * listed.max(1));
        let affordable = match std::mem::replace(&mut self.warm, true) {
            true => (count as f64 * TARGET_SECS / secs.max(1e-6)) as u64,
            false => count,
        };
        let most = room.min(affordable).min(4 * u64::from(self.next_batch));
        self.next_batch = most.clamp(u64::from(WORKGROUP), u64::from(LARGEST_BATCH)) as u32;
        Ok(count)
    }

    /// The counters after a batch.
    fn run(
        &self,
        gpu: &GpuDevice,
        batch: &PhotonBatch,
        places: &mut Places,
    ) -> Result<[u32; 3], GpuError> {
        let begun = places.begin();
        gpu.write(&self.batch, 0, bytemuck::bytes_of(batch));
        gpu.write(&self.counters, 0, &[0; COUNTERS_BYTES as usize]);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.kernel.set(&mut pass, &self.groups);
            pass.dispatch_workgroups(batch.count.div_ceil(WORKGROUP), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&self.counters, 0, &self.staging, 0, COUNTERS_BYTES);
        gpu.submit(encoder, 1)?;
        let begun = places.end(Place::Record, begun);
        let bytes = gpu.read(&self.staging, COUNTERS_BYTES)?;
        places.end(Place::Wait, begun);
        Ok(bytemuck::pod_read_unaligned(&bytes))
    }

    fn list(&self, gpu: &GpuDevice, listed: u32) -> Result<Vec<ListedSplat>, GpuError> {
        let bytes = SPLAT_BYTES * u64::from(listed);
        if bytes == 0 {
            return Ok(Vec::new());
        }
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.splats, 0, &self.staging, 0, bytes);
        gpu.submit(encoder, 0)?;
        Ok(bytemuck::pod_collect_to_vec(
            &gpu.read(&self.staging, bytes)?,
        ))
    }
}

impl From<ListedSplat> for Splat {
    fn from(listed: ListedSplat) -> Self {
        Self {
            pixel: listed.place >> 1,
            is_virtual: listed.place & 1 == 1,
            value: listed.value,
        }
    }
}
