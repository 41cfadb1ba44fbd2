//! The CPU backend: the estimator on all cores. It is the reference the shaders are compared with, and the fallback where there is no GPU.

mod backdrop;
mod batch;
pub mod contribution;
pub mod estimator;
mod fetch;
mod in_flight;
pub mod panes;
pub mod photons;
pub mod pilot;
pub mod points;
pub mod render;
pub mod request;
pub mod sharing;
pub mod sharing_tile;
pub mod state;
mod surfaces;
mod tiles;
pub mod vertex;

pub use backdrop::backdrop_share;
pub use pilot::{LensGrid, pilot, pilot_steps};
pub use surfaces::{diffuse_surfaces, diffuse_surfaces_of_pinhole};
