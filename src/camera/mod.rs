//! The camera: intrinsics with lens distortion, the thin lens, and the sampler that drives both.

pub mod lens;
pub mod sampler;
pub mod shutter;
pub mod splat;

#[cfg(test)]
pub mod chi_squared;
