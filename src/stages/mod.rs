//! Camera stages: what a camera does to a picture after the composite, or what replaces it.
//!
//! Order: composite, boundary antialiasing, motion blur by copies, sharpness, noise, response and quantisation; or composite, cartoon. A stage knows no ray: it
//! works on the film of a render and on images of other programs alike.
//!
//! A stage is one folder: `settings.rs` (its table in a scene file, and what stands in it), the CPU's side, `gpu.rs` (the host's side of the twin
//! in `shaders/stages/`), and a [`Stage`](finish::Stage) for [`finish`]. A new one is named in three places: below, in [`STAGES`], and in
//! `settings.rs` beside this file.

pub mod antialias;
pub mod calibration;
pub mod cartoon;
pub mod curve;
mod device;
mod encoded;
mod finish;
pub mod motion_blur;
pub mod noise;
pub(crate) mod settings;
pub mod sharpness;
mod table;
#[cfg(test)]
mod test_support;
#[cfg(test)]
mod tests;

pub use device::GpuStages;
pub use encoded::EncodedImage;
pub use finish::{Added, Finished, StageSeconds, finish, finish_in_layers};
pub use motion_blur::{ObjectBlur, PictureMotion};

/// In the order in which a picture goes through them.
const STAGES: &[finish::Stage] = &[
    antialias::STAGE,
    motion_blur::STAGE,
    sharpness::STAGE,
    noise::STAGE,
    cartoon::STAGE,
];
