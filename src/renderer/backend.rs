//! The backend that renders: chosen once there is something to trace, and replaced by the CPU where a device is lost.

use std::sync::Arc;

use super::{RenderError, Skip, Without};
use crate::gpu::{AdapterChoice, Changed, GpuBackend, GpuDevice, GpuError};
use crate::packed::PackedScene;
use crate::scene::BackendChoice;

pub(super) enum Backend {
    /// The choice is automatic and there has been nothing to trace, so no device was opened.
    Undecided,
    Cpu,
    Gpu(Box<GpuBackend>),
}

impl Backend {
    /// The backend of a scene that has something to trace, and what the user should hear of the choice.
    pub fn open(
        choice: BackendChoice,
        packed: &PackedScene,
        without: Without,
    ) -> Result<(Self, Option<String>), RenderError> {
        let adapter = match choice {
            BackendChoice::Cpu => return Ok((Self::Cpu, None)),
            BackendChoice::Gpu => AdapterChoice::Any,
            BackendChoice::Auto => AdapterChoice::Hardware,
        };
        let specialised = !without.contains(Skip::Specialisation);
        let opened = GpuDevice::open(adapter)
            .and_then(|gpu| GpuBackend::new(Arc::new(gpu), packed, specialised));
        match opened {
            Ok(gpu) => Ok((Self::Gpu(Box::new(gpu)), None)),
            Err(GpuError::NoAdapter(_)) if choice == BackendChoice::Auto => Ok((Self::Cpu, None)),
            Err(error) if choice == BackendChoice::Auto => {
                let note = format!("the CPU renders, for the GPU cannot: {error}");
                Ok((Self::Cpu, Some(note)))
            }
            Err(error) => Err(error.into()),
        }
    }

    pub fn is_undecided(&self) -> bool {
        matches!(self, Self::Undecided)
    }

    pub fn gpu(&self) -> Option<&GpuBackend> {
        match self {
            Self::Undecided | Self::Cpu => None,
            Self::Gpu(gpu) => Some(gpu),
        }
    }

    pub fn gpu_mut(&mut self) -> Option<&mut GpuBackend> {
        match self {
            Self::Undecided | Self::Cpu => None,
            Self::Gpu(gpu) => Some(gpu),
        }
    }

    /// The scene is another one, of which no more than `changed` is new.
    pub fn update(&mut self, packed: &PackedScene, changed: Changed) -> Result<(), GpuError> {
        match self.gpu_mut() {
            Some(gpu) => gpu.update_scene(packed, changed),
            None => Ok(()),
        }
    }

    /// Another seed or number of samples of the same scene.
    pub fn set_frame(&mut self, packed: &PackedScene) {
        if let Some(gpu) = self.gpu_mut() {
            gpu.set_frame(packed);
        }
    }

    /// "cpu" or "gpu".
    pub fn name(&self) -> &'static str {
        match self {
            Self::Undecided | Self::Cpu => "cpu",
            Self::Gpu(_) => "gpu",
        }
    }

    /// The adapter's name, or the number of threads.
    pub fn device_name(&self) -> String {
        match self {
            Self::Undecided | Self::Cpu => {
                format!("{} CPU threads", rayon::current_num_threads())
            }
            Self::Gpu(gpu) => gpu.device_name(),
        }
    }
}
