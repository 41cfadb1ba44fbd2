//! The buffers of the samples in flight: the part of bind group 1 (`shaders/gpu/lanes.wgsl`) that batches share, and the parts of the samples'
//! states, bind group 2, as `shaders/cpu/state.wgsl` declares them.

use std::collections::BTreeMap;
use std::mem::offset_of;

use bytemuck::{AnyBitPattern, Pod, Zeroable};

use super::kernel::Kernel;
use super::{GpuDevice, GpuError};
use crate::shared::{WORKGROUP, shared};
use crate::work::SampleRays;

shared! {
    /// Samples that are in flight at once.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct Batch {
        /// Lane l is sample l / pixel_count of the pixel in slot first_slot + l % pixel_count.
        pub first_slot: u32,
        pub pixel_count: u32,
        /// 0: there is no batch any more.
        pub lane_count: u32,
        /// Samples of each pixel that earlier batches of the same pixels have taken.
        pub sample_offset: u32,
        pub sample_count: u32,
        /// 1: the real radiance alone.
        pub real_pass: u32,
        pub with_guides: u32,
        pub with_groups: u32,
        /// Stays 0; the shader hides intermediate sums from the compiler with it.
        pub zero: u32,
    }

    /// Places in the shader's `counters`, which are words: of [`Counters::lanes_in`] and so on.
    const COUNT_IN: u32 = word(offset_of!(Counters, lanes_in));
    const COUNT_OUT: u32 = word(offset_of!(Counters, lanes_out));
    const COUNT_BEGUN: u32 = word(offset_of!(Counters, begun));
    const COUNT_IS_OPEN: u32 = word(offset_of!(Counters, is_open));
    const COUNT_IS_DONE: u32 = word(offset_of!(Counters, is_done));
    const COUNT_RECORD: u32 = word(offset_of!(Counters, record));
    const COUNT_STEPS: u32 = word(offset_of!(Counters, record) + offset_of!(BatchRecord, lane_steps));
    const COUNT_TURNS: u32 = word(offset_of!(Counters, record) + offset_of!(BatchRecord, steps));
    const COUNT_RAYS: u32 = word(offset_of!(Counters, record) + offset_of!(BatchRecord, rays));
    const COUNT_ALIVE: u32 = word(offset_of!(Counters, record) + offset_of!(BatchRecord, alive));
    const COUNTERS: u32 = word(size_of::<Counters>());
    const RAY_KINDS: u32 = word(size_of::<SampleRays>());
    /// Steps of a batch whose lanes are counted one by one.
    const ALIVE_TURNS: u32 = 32;

    /// Words before the records in the shader's `records`, and of one.
    const RECORDS_HEAD: u32 = word(size_of::<RecordsHead>());
    const RECORD_WORDS: u32 = word(size_of::<BatchRecord>());

    /// Places in the shader's `indirect`, whose words say how many workgroups a dispatch has.
    pub const FOR_GENERATE: u32 = 0;
    pub const FOR_STEP: u32 = 3;
    pub const FOR_SHARE: u32 = 6;
    pub const FOR_SUM: u32 = 9;
    const INDIRECT_WORDS: u32 = 12;
}

const fn word(bytes: usize) -> u32 {
    bytes as u32 / 4
}

/// What the device counts.
#[repr(C)]
struct Counters {
    lanes_in: u32,
    lanes_out: u32,
    /// Batches that were opened.
    begun: u32,
    /// 1: the last of them is not closed.
    is_open: u32,
    /// 1: it was summed.
    is_done: u32,
    record: BatchRecord,
}

/// What a batch came to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, AnyBitPattern)]
pub struct BatchRecord {
    /// Steps of all lanes.
    pub lane_steps: u32,
    /// Steps in which a lane was alive.
    pub steps: u32,
    pub rays: SampleRays,
    /// Lanes alive at the beginning of each of the first steps.
    pub alive: [u32; ALIVE_TURNS as usize],
}

/// How far the batches have come.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, AnyBitPattern)]
pub struct RecordsHead {
    /// Batches whose records follow.
    pub closed: u32,
    /// Of the batch after those.
    pub lanes_alive: u32,
}

const COUNTERS_BYTES: u64 = size_of::<Counters>() as u64;
const BATCH_BYTES: u64 = size_of::<Batch>() as u64;
/// Batches that the device may go through in one go.
pub const MOST_BATCHES: usize = 255;
/// Of the states of all samples in flight, with their queues.
const MOST_STATE_BYTES: u64 = 512 << 20;
/// A lane's place in both queues.
const QUEUES_BYTES: u64 = 8;

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

/// Buffers for up to `capacity` lanes.
pub struct Lanes {
    pub capacity: usize,
    batches: wgpu::Buffer,
    /// By name.
    parts: BTreeMap<String, wgpu::Buffer>,
    queues: [wgpu::Buffer; 2],
    counters: wgpu::Buffer,
    pub indirect: wgpu::Buffer,
    pub records: wgpu::Buffer,
}

/// As many lanes as there may be where one has `parts` of these bytes.
pub fn most_lanes(gpu: &GpuDevice, parts: &BTreeMap<String, u64>) -> usize {
    let largest = parts.values().copied().max().unwrap_or(0).max(1);
    let bindable = gpu
        .limits
        .max_storage_buffer_binding_size
        .min(gpu.limits.max_buffer_size)
        / largest;
    let held = MOST_STATE_BYTES / (parts.values().sum::<u64>() + QUEUES_BYTES);
    let dispatchable =
        u64::from(gpu.limits.max_compute_workgroups_per_dimension) * u64::from(WORKGROUP);
    bindable.min(held).min(dispatchable) as usize
}

impl Lanes {
    /// # Errors
    /// [`GpuError::Limit`] if the device has no memory for them.
    pub fn new(
        gpu: &GpuDevice,
        capacity: usize,
        parts: &BTreeMap<String, u64>,
    ) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let count = capacity as u64;
        let make = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = Usage::STORAGE | Usage::COPY_DST;
        let queue = || make("queue", 4 * count, Usage::STORAGE);
        gpu.catching(|| Self {
            capacity,
            batches: make("batches", BATCH_BYTES * (MOST_BATCHES as u64 + 1), filled),
            parts: parts
                .iter()
                .map(|(name, bytes)| (name.clone(), make(name, bytes * count, Usage::STORAGE)))
                .collect(),
            queues: [queue(), queue()],
            counters: make("counters", COUNTERS_BYTES, filled),
            indirect: make(
                "indirect",
                4 * u64::from(INDIRECT_WORDS),
                Usage::STORAGE | Usage::INDIRECT,
            ),
            records: make(
                "records",
                records_bytes(MOST_BATCHES),
                filled | Usage::COPY_SRC,
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
            "batches" => &self.batches,
            "queue_in" => &self.queues[parity],
            "queue_out" => &self.queues[1 - parity],
            "counters" => &self.counters,
            "indirect" => &self.indirect,
            "records" => &self.records,
            part => return self.parts.get(part),
        })
    }

    /// Sends what is to be done next: at most [`MOST_BATCHES`] batches.
    pub fn begin(&self, gpu: &GpuDevice, batches: &[Batch], encoder: &mut wgpu::CommandEncoder) {
        let all: Vec<Batch> = (batches.iter().copied())
            .chain(std::iter::once(Batch::default()))
            .collect();
        gpu.write(&self.batches, 0, bytemuck::cast_slice(&all));
        encoder.clear_buffer(&self.counters, 0, None);
        encoder.clear_buffer(&self.records, 0, Some(size_of::<RecordsHead>() as u64));
    }
}

/// Of the shader's `records`, those of so many batches and what comes before them.
pub const fn records_bytes(batches: usize) -> u64 {
    (size_of::<RecordsHead>() + batches * size_of::<BatchRecord>()) as u64
}

/// The head of the shader's `records`, and the records that it counts, of which `known` are left out.
pub fn read_records(bytes: &[u8], known: usize) -> (RecordsHead, Vec<BatchRecord>) {
    let (head, records) = bytes.split_at(size_of::<RecordsHead>());
    let head: RecordsHead = bytemuck::pod_read_unaligned(head);
    let records = records
        .chunks_exact(size_of::<BatchRecord>())
        .take(head.closed as usize)
        .skip(known)
        .map(bytemuck::pod_read_unaligned)
        .collect();
    (head, records)
}
