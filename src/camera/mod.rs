//! The camera: intrinsics with lens distortion, the thin lens, and the sampler that drives both.

pub mod distortion;
pub mod lens;
pub mod sampler;

#[cfg(test)]
mod chi_squared;
