//! What the stages' twins share on wgpu. Each stage adds its own to [`GpuStages`], in its `gpu.rs`; it equals the CPU's within one 8-bit code.
//!
//! A stage uploads its pictures, runs its kernels once and reads the result back; kernels are compiled at their first use.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::STAGES;
use crate::gpu::kernel::{Kernel, UNIFORM_USAGE};
use crate::gpu::{Composer, Features, GpuDevice, GpuError};

/// Threads of a workgroup along each axis.
const TILE: u32 = 8;

/// A kernel by the module of `shaders/` that it stands in and its entry point.
pub(super) type KernelName = (&'static str, &'static str);

/// The stages on one device.
pub struct GpuStages {
    gpu: Arc<GpuDevice>,
    composer: Composer,
    kernels: Mutex<HashMap<KernelName, Arc<Kernel>>>,
}

/// The shaders with what the stages declare.
pub(super) fn composer() -> Composer {
    let declared = STAGES.iter().flat_map(|stage| stage.declared);
    declared.fold(Composer::default(), |composer, module| {
        composer.with_shared(module)
    })
}

impl GpuStages {
    pub fn new(gpu: Arc<GpuDevice>) -> Self {
        Self {
            gpu,
            composer: composer(),
            kernels: Mutex::default(),
        }
    }

    pub fn device_name(&self) -> String {
        self.gpu.name()
    }

    /// The kernel of that name, compiled at its first use.
    fn kernel(&self, name: KernelName) -> Result<Arc<Kernel>, GpuError> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(&name) {
            return Ok(Arc::clone(kernel));
        }
        let (module, entry_point) = name;
        let wgsl = self
            .composer
            .compose(module, entry_point, &Features::default())?;
        let kernel = Arc::new(Kernel::new(&self.gpu, entry_point, &wgsl)?);
        kernels.insert(name, Arc::clone(&kernel));
        Ok(kernel)
    }

    /// An array with these contents; never empty, for a binding must not be.
    pub(super) fn array(&self, what: &str, contents: &[f32]) -> Result<wgpu::Buffer, GpuError> {
        let buffer = self.room(what, contents.len())?;
        self.gpu.write(&buffer, 0, bytemuck::cast_slice(contents));
        Ok(buffer)
    }

    /// An array of that many words.
    pub(super) fn room(&self, what: &str, words: usize) -> Result<wgpu::Buffer, GpuError> {
        let bytes = 4 * words.max(4) as u64;
        let allowed = self
            .gpu
            .limits
            .max_storage_buffer_binding_size
            .min(self.gpu.limits.max_buffer_size);
        if bytes > allowed {
            return Err(GpuError::Limit {
                what: format!("the stage's {what}"),
                needed: format!("{bytes} bytes"),
                available: allowed.to_string(),
                adapter: self.gpu.name(),
                advice: "use --backend cpu",
            });
        }
        use wgpu::BufferUsages as Usage;
        Ok(self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage: Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
            mapped_at_creation: false,
        }))
    }

    pub(super) fn uniform<T: bytemuck::Pod>(&self, params: &T) -> wgpu::Buffer {
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: size_of::<T>() as u64,
            usage: UNIFORM_USAGE,
            mapped_at_creation: false,
        });
        self.gpu.write(&buffer, 0, bytemuck::bytes_of(params));
        buffer
    }

    /// One thread for each of `width` x `height`. `buffers` by their names in the shader; what the kernel does not read may be among them.
    pub(super) fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        kernel: KernelName,
        buffers: &[(&str, &wgpu::Buffer)],
        (width, height): (u32, u32),
    ) -> Result<(), GpuError> {
        let kernel = self.kernel(kernel)?;
        let groups = kernel.bind(&self.gpu, |name| {
            let named = buffers.iter().find(|(given, _)| *given == name);
            named.map(|(_, buffer)| *buffer)
        })?;
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.set(&mut pass, &groups);
        pass.dispatch_workgroups(width.div_ceil(TILE), height.div_ceil(TILE), 1);
        Ok(())
    }

    /// Runs what was recorded and brings the first `words` of `buffer` back.
    pub(super) fn finish(
        &self,
        mut encoder: wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        words: usize,
    ) -> Result<Vec<f32>, GpuError> {
        let bytes = 4 * words as u64;
        let staging = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("result"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        self.gpu.submit_and_wait(encoder)?;
        let bytes = self.gpu.read(&staging, bytes)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu.device.create_command_encoder(&Default::default())
    }
}
