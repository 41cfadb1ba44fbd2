//! mixray renders virtual objects into photographs and video so that they look as if the same camera had taken them.
//!
//! Data flows one way:
//!
//! ```text
//! scene.toml, photo, glTF ──> scene::Scene         validated, world space, f64
//!                              │
//!                              ├─> accel::WorldBvh  one over the real, one over the virtual triangles
//!                              └─> packed::PackedScene   flat records relative to an anchor, f32; what both backends read
//!                                    │
//!                     cpu / gpu      │   one estimator, written twice, same random numbers
//!                                    v
//!                              film::Film           per-pixel sums: mask, M*Im, difference, real radiance
//!                                    │
//!                                    v
//!                              film::composite ──> stages: antialiasing, noise, or cartoon ──> output: PNG, EXR
//! ```
//!
//! [`renderer::Renderer`] drives all of it: built once from a scene, advanced by a budget, asked for its film at any moment.
//! A backend knows no file format, and nothing below `cli` prints.

pub mod accel;
pub mod bench;
pub mod camera;
pub mod cli;
mod clock;
pub mod cpu;
mod decode;
pub mod files;
pub mod film;
pub mod gpu;
pub mod light;
pub mod material;
pub mod math;
pub mod memory;
pub mod output;
pub mod packed;
pub mod renderer;
pub mod scene;
pub mod sequence;
pub mod shared;
pub mod stages;

pub mod video;
pub mod work;
