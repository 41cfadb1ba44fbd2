//! The estimator on wgpu: device, buffers, specialised pipelines, passes.
//!
//! Shaders are composed at run time from the modules in `shaders/` ([`compose`]), one entry point a kernel, with whatever the scene
//! does not need left out ([`Features`]); what a kernel binds is read off its own code ([`kernel`]). [`GpuBackend`] runs paths as a
//! wavefront ([`wavefront`]).

pub mod buffers;
pub mod compose;
mod course;
pub mod device;
pub mod harness;
pub mod kernel;
mod lanes;
mod pacer;
mod photons;
mod portion;
mod profile;
mod recording;
mod slots;
mod traffic;
pub mod wavefront;

pub use buffers::{Changed, SceneBuffers, SceneParts};
pub use compose::{Composer, Features};
pub use device::{AdapterChoice, AdapterReport, GpuDevice, list_adapters};
pub use photons::PHOTON_KERNEL;
pub use profile::{KERNELS, KernelSeconds};
pub use traffic::Traffic;
pub use wavefront::GpuBackend;

/// What can go wrong on the GPU, in the words the user gets.
#[derive(Clone, Debug, thiserror::Error)]
pub enum GpuError {
    #[error("no usable graphics device: {0}")]
    NoAdapter(String),
    #[error("{adapter} cannot be opened: {reason}")]
    Open { adapter: String, reason: String },
    #[error("{what} needs {needed}, more than the {available} that {adapter} allows: {advice}")]
    Limit {
        what: String,
        needed: String,
        available: String,
        adapter: String,
        advice: &'static str,
    },
    /// A shader module that does not compose or compile: a defect of this program, not of the scene.
    #[error("shader {entry_point} does not compile: {message}")]
    Shader {
        entry_point: String,
        message: String,
    },
    #[error("shader {entry_point} binds {name}, which was not given")]
    Unbound { entry_point: String, name: String },
    /// A sample asked for more rays than any sample can: a defect of this program.
    #[error("samples did not end after {0} steps on the graphics device")]
    Endless(u32),
    /// The device is gone or has refused a command; nothing of what it held can be read any more.
    #[error("the graphics device was lost: {0}")]
    Lost(String),
}

#[cfg(test)]
pub(crate) mod tests;
