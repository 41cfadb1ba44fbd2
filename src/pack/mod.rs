//! From a scene, f64, to what backends read ([`PackedScene`](crate::packed::PackedScene)), f32.

mod backdrop;
mod bounds;
mod build;
pub mod camera;
mod facets;
mod lights;
mod moves;
mod panes;
mod photons;
mod shadows;
mod shutter;
#[cfg(test)]
mod test_support;
#[cfg(test)]
mod tests;

pub use build::{PackError, next_anchor};
#[cfg(feature = "bench")]
pub(crate) use lights::FEW_LIGHTS;
pub use shutter::{Instant, instants, row_ends, traced_shutter};
#[cfg(test)]
pub use test_support::{test_mesh, test_scene};
