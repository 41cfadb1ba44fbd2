//! Choosing and opening a graphics device, noticing its loss, reading buffers back.

use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::GpuError;
use super::traffic::{Traffic, TrafficCounter, count};

/// A submission that has not ended by then never will: a fraction of a second is the rule, shader compilation on a software device
/// the exception.
const PATIENCE: Duration = Duration::from_secs(300);

/// How long the callback of a finished copy may lag behind before the device is polled again.
const CALLBACK_DELAY: Duration = Duration::from_millis(20);

/// Which devices are acceptable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterChoice {
    /// A real GPU; what `--backend auto` looks for.
    Hardware,
    /// A real GPU if there is one, else a software device; what `--backend gpu` takes.
    Any,
}

/// An opened device with its queue.
pub struct GpuDevice {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub info: wgpu::AdapterInfo,
    /// What was asked for and granted.
    pub limits: wgpu::Limits,
    /// GPU timestamps can be taken.
    pub timestamps: bool,
    fault: Arc<Mutex<Option<String>>>,
    traffic: TrafficCounter,
}

/// One line of `mixray info`: an adapter and the limits that matter here.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterReport {
    pub name: String,
    /// vulkan, metal, dx12.
    pub backend: String,
    /// discrete GPU, integrated GPU, virtual GPU, CPU, other.
    pub kind: String,
    pub driver: String,
    /// `--backend auto` would take it.
    pub hardware: bool,
    /// The largest array a kernel can read, bytes.
    pub max_storage_binding_bytes: u64,
    pub max_buffer_bytes: u64,
    /// Arrays a kernel can read.
    pub max_storage_buffers: u32,
    pub max_workgroup_memory_bytes: u32,
    pub max_workgroup_invocations: u32,
    pub timestamps: bool,
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    // Indirect arguments are written by our own kernel, which clamps them; wgpu's check would cost a pass before every dispatch.
    descriptor
        .flags
        .remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(descriptor)
}

fn adapters() -> Vec<wgpu::Adapter> {
    // With the window OpenGL is built in too, whose kernels may bind fewer buffers than ours need.
    pollster::block_on(instance().enumerate_adapters(wgpu::Backends::PRIMARY))
}

fn is_hardware(kind: wgpu::DeviceType) -> bool {
    matches!(
        kind,
        wgpu::DeviceType::DiscreteGpu
            | wgpu::DeviceType::IntegratedGpu
            | wgpu::DeviceType::VirtualGpu
    )
}

/// Lower is better.
fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn kind_name(kind: wgpu::DeviceType) -> &'static str {
    match kind {
        wgpu::DeviceType::DiscreteGpu => "discrete GPU",
        wgpu::DeviceType::IntegratedGpu => "integrated GPU",
        wgpu::DeviceType::VirtualGpu => "virtual GPU",
        wgpu::DeviceType::Cpu => "CPU",
        wgpu::DeviceType::Other => "other",
    }
}

/// Every adapter of this machine, best first.
pub fn list_adapters() -> Vec<AdapterReport> {
    let mut adapters = adapters();
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    adapters
        .iter()
        .map(|adapter| {
            let info = adapter.get_info();
            let limits = adapter.limits();
            AdapterReport {
                name: info.name,
                backend: info.backend.to_string(),
                kind: kind_name(info.device_type).to_owned(),
                driver: format!("{} {}", info.driver, info.driver_info)
                    .trim()
                    .to_owned(),
                hardware: is_hardware(info.device_type),
                max_storage_binding_bytes: limits.max_storage_buffer_binding_size,
                max_buffer_bytes: limits.max_buffer_size,
                max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
                max_workgroup_memory_bytes: limits.max_compute_workgroup_storage_size,
                max_workgroup_invocations: limits.max_compute_invocations_per_workgroup,
                timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            }
        })
        .collect()
}

impl GpuDevice {
    /// Opens the best adapter that `choice` allows.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] says what was found instead; [`GpuError::Open`] if the driver refuses.
    pub fn open(choice: AdapterChoice) -> Result<Self, GpuError> {
        if let Some(kilobytes) = crate::memory::small_stacks() {
            return Err(GpuError::NoAdapter(format!(
                "the stacks of {kilobytes} kB that the shell allows are too small for drivers; expected 1024 or more (ulimit -s)"
            )));
        }
        let found = adapters();
        let best = found
            .iter()
            .filter(|adapter| {
                choice == AdapterChoice::Any || is_hardware(adapter.get_info().device_type)
            })
            .min_by_key(|adapter| rank(adapter.get_info().device_type));
        let Some(adapter) = best else {
            return Err(GpuError::NoAdapter(if found.is_empty() {
                "no Vulkan, Metal or DirectX 12 driver answers".to_owned()
            } else {
                let names: Vec<String> = found
                    .iter()
                    .map(|adapter| adapter.get_info().name)
                    .collect();
                format!("only software devices ({})", names.join(", "))
            }));
        };
        Self::open_adapter(adapter)
    }

    fn open_adapter(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let offered = adapter.limits();
        let limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: offered.max_storage_buffers_per_shader_stage,
            max_buffers_and_acceleration_structures_per_shader_stage: offered
                .max_buffers_and_acceleration_structures_per_shader_stage,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            max_uniform_buffer_binding_size: offered.max_uniform_buffer_binding_size,
            max_compute_workgroup_storage_size: offered.max_compute_workgroup_storage_size,
            max_compute_invocations_per_workgroup: offered.max_compute_invocations_per_workgroup,
            max_compute_workgroup_size_x: offered.max_compute_workgroup_size_x,
            max_compute_workgroup_size_y: offered.max_compute_workgroup_size_y,
            max_compute_workgroup_size_z: offered.max_compute_workgroup_size_z,
            max_compute_workgroups_per_dimension: offered.max_compute_workgroups_per_dimension,
            ..wgpu::Limits::downlevel_defaults()
        };
        let timestamps = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("mixray"),
            required_features: if timestamps {
                wgpu::Features::TIMESTAMP_QUERY
            } else {
                wgpu::Features::empty()
            },
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|error| GpuError::Open {
            adapter: info.name.clone(),
            reason: error.to_string(),
        })?;

        let fault = Arc::new(Mutex::new(None));
        let lost = Arc::clone(&fault);
        device.set_device_lost_callback(move |reason, message| {
            note(&lost, format!("{reason:?}: {message}"));
        });
        let refused = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(&refused, error.to_string());
        }));
        Ok(Self {
            device,
            queue,
            info,
            limits,
            timestamps,
            fault,
            traffic: TrafficCounter::default(),
        })
    }

    /// "NVIDIA H100 (vulkan)".
    pub fn name(&self) -> String {
        format!("{} ({})", self.info.name, self.info.backend)
    }

    /// # Errors
    /// [`GpuError::Lost`] once the device is gone or has refused a command.
    pub fn check(&self) -> Result<(), GpuError> {
        match &*self.fault.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(message) => Err(GpuError::Lost(message.clone())),
            None => Ok(()),
        }
    }

    /// What went to it and back since it was opened.
    pub fn traffic(&self) -> Traffic {
        self.traffic.counts()
    }

    /// Sends `bytes`, which arrive before the next submission begins.
    pub fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        count(&self.traffic.bytes_up, bytes.len() as u64);
        self.queue.write_buffer(buffer, offset, bytes);
    }

    /// Submits commands with so many dispatches.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn submit(
        &self,
        encoder: wgpu::CommandEncoder,
        dispatches: u64,
    ) -> Result<wgpu::SubmissionIndex, GpuError> {
        count(&self.traffic.submissions, 1);
        count(&self.traffic.dispatches, dispatches);
        let index = self.queue.submit([encoder.finish()]);
        self.check()?;
        Ok(index)
    }

    /// A recording ends.
    pub(super) fn count_recording(&self) {
        count(&self.traffic.recordings, 1);
    }

    /// So many steps of batches were recorded, of which so many were needed.
    pub(super) fn count_steps(&self, recorded: u64, needed: u64) {
        count(&self.traffic.steps, recorded);
        count(&self.traffic.idle_steps, recorded.saturating_sub(needed));
    }

    /// Waits for the end of a submission, and of those before it.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn wait_for(&self, index: &wgpu::SubmissionIndex) -> Result<(), GpuError> {
        count(&self.traffic.waits, 1);
        self.wait(Some(index.clone()))
    }

    /// Submits and waits for the end.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn submit_and_wait(&self, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        count(&self.traffic.submissions, 1);
        let index = self.queue.submit([encoder.finish()]);
        self.wait(Some(index))
    }

    fn wait(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        let outcome = self.device.poll(wgpu::PollType::Wait {
            submission_index,
            timeout: Some(PATIENCE),
        });
        self.check()?;
        outcome
            .map(|_| ())
            .map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// Bytes of a buffer made with MAP_READ, once everything submitted has ended.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn read(&self, staging: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, GpuError> {
        self.map(staging, bytes)?;
        self.take_mapped(staging, bytes, <[u8]>::to_vec)
    }

    /// Waits until everything submitted has ended, and maps a buffer made with MAP_READ; [`GpuDevice::take_mapped`] follows.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn map(&self, staging: &wgpu::Buffer, bytes: u64) -> Result<(), GpuError> {
        count(&self.traffic.waits, 1);
        count(&self.traffic.bytes_down, bytes);
        let (sender, receiver) = mpsc::channel();
        staging
            .slice(..bytes)
            .map_async(wgpu::MapMode::Read, move |result| {
                // The receiver outlives the poll below; if it does not, nobody waits for the answer.
                let _ = sender.send(result);
            });
        let lost = |message: String| GpuError::Lost(message);
        // Where several threads poll, another one may be about to run our callback when this one's poll returns.
        let deadline = Instant::now() + PATIENCE;
        let answer = loop {
            self.wait(None)?;
            match receiver.recv_timeout(CALLBACK_DELAY) {
                Ok(answer) => break answer,
                Err(mpsc::RecvTimeoutError::Timeout) if Instant::now() < deadline => {}
                Err(error) => return Err(lost(error.to_string())),
            }
        };
        answer.map_err(|error| lost(error.to_string()))
    }

    /// What `take` makes of the bytes of a mapped buffer, which is unmapped.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn take_mapped<T>(
        &self,
        staging: &wgpu::Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        let mapped = staging.slice(..bytes).get_mapped_range();
        let taken = mapped
            .map(|mapped| take(&mapped))
            .map_err(|error| GpuError::Lost(error.to_string()));
        staging.unmap();
        taken
    }

    /// Runs `make` and turns what the driver objects to into an error.
    pub(super) fn catching<T>(&self, make: impl FnOnce() -> T) -> Result<T, wgpu::Error> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let errors = [
            pollster::block_on(validation.pop()),
            pollster::block_on(internal.pop()),
            pollster::block_on(memory.pop()),
        ];
        match errors.into_iter().flatten().next() {
            Some(error) => Err(error),
            None => Ok(made),
        }
    }
}

/// Keeps the first fault: later ones follow from it.
fn note(fault: &Mutex<Option<String>>, message: String) {
    let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
    fault.get_or_insert(message);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_are_listed_best_first_for_people_and_programs() {
        let adapters = list_adapters();
        eprintln!("{} adapters", adapters.len());
        assert!(adapters.is_sorted_by_key(|adapter| !adapter.hardware));
        let json = serde_json::to_value(&adapters).expect("serialises");
        assert_eq!(json.as_array().map(Vec::len), Some(adapters.len()));
        if let Ok(gpu) = GpuDevice::open(AdapterChoice::Any) {
            assert_eq!(json[0]["name"], gpu.info.name.as_str());
        }
    }

    #[test]
    fn hardware_is_not_replaced_by_software() {
        let hardware = list_adapters().iter().any(|adapter| adapter.hardware);
        match GpuDevice::open(AdapterChoice::Hardware) {
            Ok(gpu) => assert!(hardware && is_hardware(gpu.info.device_type)),
            Err(GpuError::NoAdapter(_)) => assert!(!hardware),
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        if crate::gpu::harness::test_device().is_none() {
            return;
        }
        let gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
        let words: Vec<u32> = (0..999).collect();
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 4 * words.len() as u64,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let before = gpu.traffic();
        gpu.write(&buffer, 0, bytemuck::cast_slice(&words));
        let encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.submit(encoder, 0).expect("submits");
        let bytes = gpu.read(&buffer, 4 * 500).expect("reads");
        assert_eq!(bytes, bytemuck::cast_slice::<u32, u8>(&words[..500]));
        let traffic = Traffic {
            bytes_up: 4 * 999,
            bytes_down: 4 * 500,
            submissions: 1,
            waits: 1,
            ..Traffic::default()
        };
        assert_eq!(gpu.traffic() - before, traffic);
    }
}
