//! The buffers of the pixels that are worked on, one slot each: what is wanted of them, and their sums, which stay until they are brought home.
//! The part of bind group 1 (`shaders/gpu/lanes.wgsl`) that is kept by slot.

use std::ops::Range;

use bytemuck::{AnyBitPattern, NoUninit};

use super::lanes::{MOST_BATCHES, records_bytes};
use super::{GpuDevice, GpuError};
use crate::film::{Film, GroupSums, GuideSums, PixelSums};
use crate::work::PixelWork;

const SUMS_BYTES: u64 = size_of::<PixelSums>() as u64;
const GUIDE_BYTES: u64 = size_of::<GuideSums>() as u64;
const GROUP_BYTES: u64 = size_of::<GroupSums>() as u64;
const WORK_BYTES: u64 = size_of::<PixelWork>() as u64;
/// Pixels whose sums the device holds at once.
const MOST_SLOTS: usize = 1 << 20;

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

    /// Of sums, guides and groups of so many pixels.
    fn bytes(self, pixels: usize) -> [u64; 3] {
        let counts = [1, u64::from(self.guides), u64::from(self.groups)];
        let bytes = [SUMS_BYTES, GUIDE_BYTES, GROUP_BYTES];
        std::array::from_fn(|part| counts[part] * bytes[part] * pixels as u64)
    }
}

/// What is brought home: the records of so many batches, and the sums of these slots.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Home {
    pub batches: usize,
    pub slots: Range<usize>,
    /// The sums began at 0 on the device.
    pub from_zero: bool,
}

/// Buffers for up to `capacity` pixels.
pub struct Slots {
    pub capacity: usize,
    pub beside: Beside,
    work: wgpu::Buffer,
    pixel_sums: wgpu::Buffer,
    guide_sums: wgpu::Buffer,
    group_sums: wgpu::Buffer,
    /// Records of batches, sums, guides, groups: one behind the other.
    staging: wgpu::Buffer,
}

/// As many pixels as may be worked on at once.
pub fn most_slots(gpu: &GpuDevice) -> usize {
    let largest = SUMS_BYTES.max(GUIDE_BYTES).max(GROUP_BYTES);
    let bindable = gpu.limits.max_storage_buffer_binding_size / largest;
    let whole = SUMS_BYTES + GUIDE_BYTES + GROUP_BYTES;
    let readable = gpu
        .limits
        .max_buffer_size
        .saturating_sub(records_bytes(MOST_BATCHES))
        / whole;
    MOST_SLOTS.min(bindable.min(readable) as usize)
}

impl Slots {
    /// # Errors
    /// [`GpuError::Limit`] if the device has no memory for them.
    pub fn new(gpu: &GpuDevice, capacity: usize, beside: Beside) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let make = |label, size: u64, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = Usage::STORAGE | Usage::COPY_DST;
        let both = filled | Usage::COPY_SRC;
        let [sums, guides, groups] = beside.bytes(capacity);
        let work = WORK_BYTES * capacity as u64;
        gpu.catching(|| Self {
            capacity,
            beside,
            work: make("work", work, filled),
            pixel_sums: make("pixel sums", sums, both),
            guide_sums: make("guide sums", guides.max(GUIDE_BYTES), both),
            group_sums: make("group sums", groups.max(GROUP_BYTES), both),
            staging: make(
                "staging",
                records_bytes(MOST_BATCHES) + sums + guides + groups,
                Usage::MAP_READ | Usage::COPY_DST,
            ),
        })
        .map_err(|error| GpuError::Limit {
            what: format!("the sums of {capacity} pixels"),
            needed: format!("{} MiB", (work + 2 * (sums + guides + groups)) >> 20),
            available: format!("memory ({error})"),
            adapter: gpu.name(),
            advice: "render with --backend cpu",
        })
    }

    /// The buffer of that name in `shaders/gpu/lanes.wgsl`.
    pub fn get(&self, name: &str) -> Option<&wgpu::Buffer> {
        Some(match name {
            "work" => &self.work,
            "pixel_sums" => &self.pixel_sums,
            "guide_sums" => &self.guide_sums,
            "group_sums" => &self.group_sums,
            _ => return None,
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
        for (buffer, bytes) in parts.into_iter().zip(self.beside.bytes(pixels)) {
            if bytes > 0 {
                encoder.clear_buffer(buffer, 0, Some(bytes));
            }
        }
    }

    /// Copies what comes home of `records` and the sums to where the host reads it.
    pub fn copy_home(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        records: &wgpu::Buffer,
        home: &Home,
    ) {
        let mut to = records_bytes(home.batches);
        encoder.copy_buffer_to_buffer(records, 0, &self.staging, 0, to);
        let parts = [&self.pixel_sums, &self.guide_sums, &self.group_sums];
        let from = self.beside.bytes(home.slots.start);
        let bytes = self.beside.bytes(home.slots.len());
        for ((buffer, from), bytes) in parts.into_iter().zip(from).zip(bytes) {
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(buffer, from, &self.staging, to, bytes);
            }
            to += bytes;
        }
    }

    /// Waits for what [`Slots::copy_home`] copied.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn wait(&self, gpu: &GpuDevice, home: &Home) -> Result<(), GpuError> {
        gpu.map(&self.staging, self.staged_bytes(home))
    }

    /// After [`Slots::wait`]: `take` gets the records, and says whether the sums of the pixels, by slot in `work`, go into the film.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn take_home<T>(
        &self,
        gpu: &GpuDevice,
        film: &mut Film,
        work: &[PixelWork],
        home: &Home,
        take: impl FnOnce(&[u8]) -> (bool, T),
    ) -> Result<T, GpuError> {
        fn put<T: AnyBitPattern>(all: &mut [T], work: &[PixelWork], bytes: &[u8]) {
            for (work, bytes) in work.iter().zip(bytes.chunks_exact(size_of::<T>())) {
                all[work.pixel as usize] = bytemuck::pod_read_unaligned(bytes);
            }
        }
        let work = &work[home.slots.clone()];
        let [sums, guides, _] = self.beside.bytes(work.len());
        gpu.take_mapped(&self.staging, self.staged_bytes(home), |bytes| {
            let (records, rest) = bytes.split_at(records_bytes(home.batches) as usize);
            let (is_wanted, taken) = take(records);
            if is_wanted {
                let (sums, rest) = rest.split_at(sums as usize);
                let (guides, groups) = rest.split_at(guides as usize);
                for (work, sums) in work.iter().zip(sums.chunks_exact(size_of::<PixelSums>())) {
                    let kept = &mut film.pixels[work.pixel as usize];
                    // What the device does not know where it began with cleared sums: the factor, and photons that were left out.
                    let (factor, left_out, first) =
                        (kept.sample_factor, kept.non_finite, kept.first_non_finite);
                    *kept = bytemuck::pod_read_unaligned(sums);
                    kept.sample_factor = factor;
                    if home.from_zero && left_out > 0 {
                        kept.non_finite += left_out;
                        kept.first_non_finite = first;
                    }
                }
                put(&mut film.guides, work, guides);
                put(&mut film.groups, work, groups);
            }
            taken
        })
    }

    fn staged_bytes(&self, home: &Home) -> u64 {
        let sums: u64 = self.beside.bytes(home.slots.len()).iter().sum();
        records_bytes(home.batches) + sums
    }
}
