//! The CPU backend: the estimator on all cores. It is the reference the shaders are compared with, and the fallback where there is no GPU.

pub mod contribution;
pub mod estimator;
pub mod photons;
pub mod pilot;
pub mod render;
pub mod request;
pub mod state;
mod surfaces;
pub mod vertex;

pub use pilot::pilot;
pub use surfaces::diffuse_surfaces;
