//! Time on the device by kernel, from timestamp queries.

use serde::Serialize;

use super::{GpuDevice, GpuError};

/// Kernels of the wavefront.
pub const KERNELS: [&str; 8] = [
    "kernel_begin",
    "kernel_generate",
    "kernel_turn",
    "kernel_trace",
    "kernel_advance",
    "kernel_end",
    "kernel_share",
    "kernel_accumulate",
];
pub const BEGIN: usize = 0;
pub const GENERATE: usize = 1;
pub const TURN: usize = 2;
pub const TRACE: usize = 3;
pub const ADVANCE: usize = 4;
pub const END: usize = 5;
pub const SHARE: usize = 6;
pub const ACCUMULATE: usize = 7;

/// Seconds on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct KernelSeconds {
    pub generate: f64,
    /// What one thread does between the others: queues turned, batches begun and ended.
    pub turn: f64,
    pub trace: f64,
    pub advance: f64,
    pub accumulate: f64,
    pub share: f64,
}

impl KernelSeconds {
    fn add(&mut self, kernel: usize, secs: f64) {
        let field = match kernel {
            GENERATE => &mut self.generate,
            TRACE => &mut self.trace,
            ADVANCE => &mut self.advance,
            ACCUMULATE => &mut self.accumulate,
            SHARE => &mut self.share,
            _ => &mut self.turn,
        };
        *field += secs;
    }
}

/// Two timestamps for each dispatch of a submission.
pub struct Profiler {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    /// Kernels of the submission being recorded.
    recorded: Vec<usize>,
    pub seconds: KernelSeconds,
}

/// Dispatches of one submission that get their time taken; later ones go without.
const MOST_DISPATCHES: usize = 256;

impl Profiler {
    /// None where the device takes no timestamps.
    pub fn new(gpu: &GpuDevice) -> Option<Self> {
        gpu.timestamps.then(|| {
            let bytes = 16 * MOST_DISPATCHES as u64;
            let buffer = |usage| {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("timestamps"),
                    size: bytes,
                    usage: usage | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            };
            Self {
                queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("timestamps"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2 * MOST_DISPATCHES as u32,
                }),
                resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
                staging: buffer(wgpu::BufferUsages::MAP_READ),
                recorded: Vec::new(),
                seconds: KernelSeconds::default(),
            }
        })
    }

    /// The queries around the next pass, which runs `kernel` alone.
    pub fn around(&mut self, kernel: usize) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let first = 2 * self.recorded.len() as u32;
        if self.recorded.len() == MOST_DISPATCHES {
            return None;
        }
        self.recorded.push(kernel);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Last command of a submission.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.recorded.len() as u32;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        let bytes = 8 * u64::from(count);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, bytes);
    }

    /// Adds the submission's times.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn collect(&mut self, gpu: &GpuDevice) -> Result<(), GpuError> {
        let bytes = gpu.read(&self.staging, 16 * self.recorded.len() as u64)?;
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
        let secs_per_tick = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        for (kernel, ticks) in self.recorded.drain(..).zip(ticks.chunks_exact(2)) {
            self.seconds.add(
                kernel,
                ticks[1].saturating_sub(ticks[0]) as f64 * secs_per_tick,
            );
        }
        Ok(())
    }
}
