//! The buffers of a batch of samples in flight: bind group 1, as `shaders/gpu/lanes.wgsl` declares it, and the parts of the samples' states,
//! bind group 2, as `shaders/cpu/state.wgsl` does.

use std::collections::BTreeMap;
use std::mem::offset_of;

use bytemuck::{AnyBitPattern, NoUninit, Pod, Zeroable};

use super::kernel::Kernel;
use super::{GpuDevice, GpuError};
use crate::film::{Film, GroupSums, GuideSums, PixelSums};
use crate::shared::{WORKGROUP, shared};
use crate::work::{PixelWork, SampleRays};

shared! {
    /// Uniform of a batch.
    #[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
    pub struct Batch {
        /// Lane l is sample l / pixel_count of the pixel in slot l % pixel_count.
        pub pixel_count: u32,
        pub lane_count: u32,
        /// Samples of each pixel that earlier batches of the same pixels have taken.
        pub sample_offset: u32,
        pub sample_count: u32,
        /// 1: the real radiance alone.
        pub real_pass: u32,
        pub with_guides: u32,
        /// Stays 0; the shader hides intermediate sums from the compiler with it.
        pub zero: u32,
        pub with_groups: u32,
    }

    /// Places in the shader's `counters`, which are words: of [`Counters::lanes_in`] and so on.
    const COUNT_IN: u32 = word(offset_of!(Counters, lanes_in));
    const COUNT_OUT: u32 = word(offset_of!(Counters, lanes_out));
    const COUNT_STEPS: u32 = word(offset_of!(Counters, steps));
    const COUNT_RAYS: u32 = word(offset_of!(Counters, rays));
    const COUNTERS: u32 = word(size_of::<Counters>());
    const RAY_KINDS: u32 = word(size_of::<SampleRays>());
}

const fn word(bytes: usize) -> u32 {
    bytes as u32 / 4
}

/// What the device counts while a batch runs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, AnyBitPattern)]
pub struct Counters {
    pub lanes_in: u32,
    pub lanes_out: u32,
    pub steps: u32,
    pub rays: SampleRays,
}

pub const COUNTERS_BYTES: u64 = size_of::<Counters>() as u64;
const SUMS_BYTES: u64 = size_of::<PixelSums>() as u64;
const GUIDE_BYTES: u64 = size_of::<GuideSums>() as u64;
const GROUP_BYTES: u64 = size_of::<GroupSums>() as u64;
const WORK_BYTES: u64 = size_of::<PixelWork>() as u64;

/// Bind group of the parts of a sample's state.
pub(super) const PARTS_GROUP: u32 = 2;

/// Bytes of one sample in the array of each part of its state that `kernels` use, by name.
pub fn state_parts(kernels: &[Kernel]) -> BTreeMap<String, u64> {
    kernels
        .iter()
        .flat_map(Kernel::bindings)
        .filter(|binding| binding.group == PARTS_GROUP)
        .map(|binding| (binding.name.clone(), u64::from(binding.stride)))
        .collect()
}

/// What a film may have of a pixel beside its sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beside {
    pub guides: bool,
    pub groups: bool,
}

impl Beside {
    pub fn of(film: &Film) -> Self {
        Self {
            guides: !film.guides.is_empty(),
            groups: !film.groups.is_empty(),
        }
    }
}

/// Buffers for up to `capacity` lanes.
pub struct Lanes {
    pub capacity: usize,
    pub beside: Beside,
    pub batch: wgpu::Buffer,
    pub work: wgpu::Buffer,
    /// By name.
    pub parts: BTreeMap<String, wgpu::Buffer>,
    pub queues: [wgpu::Buffer; 2],
    pub counters: wgpu::Buffer,
    pub indirect: wgpu::Buffer,
    pub pixel_sums: wgpu::Buffer,
    pub guide_sums: wgpu::Buffer,
    pub group_sums: wgpu::Buffer,
    /// Counters, then sums, then guides, then groups.
    pub staging: wgpu::Buffer,
}

/// As many lanes as take no more memory than the largest array that the device can bind, with `state_bytes` for the state of one.
pub fn most_lanes(gpu: &GpuDevice, state_bytes: u64) -> usize {
    let largest = state_bytes.max(SUMS_BYTES + GUIDE_BYTES + GROUP_BYTES + COUNTERS_BYTES);
    let bindable = gpu
        .limits
        .max_storage_buffer_binding_size
        .min(gpu.limits.max_buffer_size)
        / largest;
    let dispatchable =
        u64::from(gpu.limits.max_compute_workgroups_per_dimension) * u64::from(WORKGROUP);
    bindable.min(dispatchable) as usize
}

impl Lanes {
    /// # Errors
    /// [`GpuError::Limit`] if the device has no memory for them.
    pub fn new(
        gpu: &GpuDevice,
        capacity: usize,
        parts: &BTreeMap<String, u64>,
        beside: Beside,
    ) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let count = capacity as u64;
        let guides = if beside.guides { count } else { 1 };
        let groups = if beside.groups { count } else { 1 };
        let make = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = Usage::STORAGE | Usage::COPY_DST;
        let both = filled | Usage::COPY_SRC;
        let queue = || make("queue", 4 * count, Usage::STORAGE);
        gpu.catching(|| Self {
            capacity,
            beside,
            batch: make(
                "batch",
                size_of::<Batch>() as u64,
                Usage::UNIFORM | Usage::COPY_DST,
            ),
            work: make("work", WORK_BYTES * count, filled),
            parts: parts
                .iter()
                .map(|(name, bytes)| (name.clone(), make(name, bytes * count, Usage::STORAGE)))
                .collect(),
            queues: [queue(), queue()],
            counters: make("counters", COUNTERS_BYTES, both),
            indirect: make("indirect", 12, Usage::STORAGE | Usage::INDIRECT),
            pixel_sums: make("pixel sums", SUMS_BYTES * count, both),
            guide_sums: make("guide sums", GUIDE_BYTES * guides, both),
            group_sums: make("group sums", GROUP_BYTES * groups, both),
            staging: make(
                "staging",
                COUNTERS_BYTES + SUMS_BYTES * count + GUIDE_BYTES * guides + GROUP_BYTES * groups,
                Usage::MAP_READ | Usage::COPY_DST,
            ),
        })
        .map_err(|error| GpuError::Limit {
            what: format!("a batch of {capacity} samples"),
            needed: format!("{} MiB", (count * parts.values().sum::<u64>()) >> 20),
            available: format!("memory ({error})"),
            adapter: gpu.name(),
            advice: "render with --backend cpu",
        })
    }

    /// The buffer of that name in `shaders/gpu/lanes.wgsl` or `shaders/cpu/state.wgsl`; `parity` says which queue is read.
    pub fn get(&self, name: &str, parity: usize) -> Option<&wgpu::Buffer> {
        Some(match name {
            "batch" => &self.batch,
            "work" => &self.work,
            "queue_in" => &self.queues[parity],
            "queue_out" => &self.queues[1 - parity],
            "counters" => &self.counters,
            "indirect" => &self.indirect,
            "pixel_sums" => &self.pixel_sums,
            "guide_sums" => &self.guide_sums,
            "group_sums" => &self.group_sums,
            part => return self.parts.get(part),
        })
    }

    /// Sends which samples are taken of which pixels.
    pub fn upload_work(&self, gpu: &GpuDevice, work: &[PixelWork]) {
        gpu.write(&self.work, 0, bytemuck::cast_slice(work));
    }

    /// Sends the sums of these pixels.
    pub fn upload_sums(&self, gpu: &GpuDevice, film: &Film, work: &[PixelWork]) {
        fn send<T: NoUninit>(gpu: &GpuDevice, to: &wgpu::Buffer, all: &[T], work: &[PixelWork]) {
            let of_pixel = |work: &PixelWork| all.get(work.pixel as usize).copied();
            let some: Vec<T> = work.iter().filter_map(of_pixel).collect();
            gpu.write(to, 0, bytemuck::cast_slice(&some));
        }
        send(gpu, &self.pixel_sums, &film.pixels, work);
        send(gpu, &self.guide_sums, &film.guides, work);
        send(gpu, &self.group_sums, &film.groups, work);
    }

    /// Sets the sums of the first `pixels` slots to 0.
    pub fn clear_sums(&self, encoder: &mut wgpu::CommandEncoder, pixels: usize) {
        let parts = [&self.pixel_sums, &self.guide_sums, &self.group_sums];
        for (buffer, bytes) in parts.into_iter().zip(self.sums_bytes(pixels)) {
            if bytes > 0 {
                encoder.clear_buffer(buffer, 0, Some(bytes));
            }
        }
    }

    pub fn clear_counters(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.counters, 0, None);
    }

    pub fn copy_counters(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.counters, 0, &self.staging, 0, COUNTERS_BYTES);
    }

    pub fn copy_sums(&self, encoder: &mut wgpu::CommandEncoder, pixels: usize) {
        let parts = [&self.pixel_sums, &self.guide_sums, &self.group_sums];
        let mut to = COUNTERS_BYTES;
        for (buffer, bytes) in parts.into_iter().zip(self.sums_bytes(pixels)) {
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(buffer, 0, &self.staging, to, bytes);
            }
            to += bytes;
        }
    }

    /// Of sums, guides and groups.
    fn sums_bytes(&self, pixels: usize) -> [u64; 3] {
        let Beside { guides, groups } = self.beside;
        let counts = [1, u64::from(guides), u64::from(groups)];
        let bytes = [SUMS_BYTES, GUIDE_BYTES, GROUP_BYTES];
        std::array::from_fn(|part| counts[part] * bytes[part] * pixels as u64)
    }

    /// # Errors
    /// [`GpuError::Lost`].
    pub fn read_counters(&self, gpu: &GpuDevice) -> Result<Counters, GpuError> {
        let bytes = gpu.read(&self.staging, COUNTERS_BYTES)?;
        Ok(bytemuck::pod_read_unaligned(&bytes))
    }

    /// Waits for what [`Lanes::copy_counters`] and [`Lanes::copy_sums`] copied.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn wait_for_sums(&self, gpu: &GpuDevice, pixels: usize) -> Result<(), GpuError> {
        gpu.map(&self.staging, self.read_bytes(pixels))
    }

    /// After [`Lanes::wait_for_sums`]: puts the sums of these pixels into the film.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn read_sums(
        &self,
        gpu: &GpuDevice,
        film: &mut Film,
        work: &[PixelWork],
    ) -> Result<Counters, GpuError> {
        fn put<T: AnyBitPattern>(all: &mut [T], work: &[PixelWork], bytes: &[u8]) {
            for (work, bytes) in work.iter().zip(bytes.chunks_exact(size_of::<T>())) {
                all[work.pixel as usize] = bytemuck::pod_read_unaligned(bytes);
            }
        }
        let [sums, guides, _] = self.sums_bytes(work.len());
        gpu.take_mapped(&self.staging, self.read_bytes(work.len()), |bytes| {
            let (counters, rest) = bytes.split_at(COUNTERS_BYTES as usize);
            let (sums, rest) = rest.split_at(sums as usize);
            let (guides, groups) = rest.split_at(guides as usize);
            for (work, sums) in work.iter().zip(sums.chunks_exact(size_of::<PixelSums>())) {
                // The device does not know the factor where it began with cleared sums.
                let kept = &mut film.pixels[work.pixel as usize];
                *kept = PixelSums {
                    sample_factor: kept.sample_factor,
                    ..bytemuck::pod_read_unaligned(sums)
                };
            }
            put(&mut film.guides, work, guides);
            put(&mut film.groups, work, groups);
            bytemuck::pod_read_unaligned(counters)
        })
    }

    fn read_bytes(&self, pixels: usize) -> u64 {
        COUNTERS_BYTES + self.sums_bytes(pixels).iter().sum::<u64>()
    }
}
