//! Camera stages: what a camera does to a picture after the composite, or what replaces it.
//!
//! Order: composite, boundary antialiasing, motion blur by copies, noise, response and quantisation; or composite, cartoon. A stage knows no ray: it
//! works on the film of a render and on images of other programs alike.

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
#[cfg(test)]
mod tests;

pub use device::GpuStages;
pub use encoded::EncodedImage;
pub use finish::{Finished, StageSeconds, finish};
pub use motion_blur::{ObjectBlur, PictureMotion};
