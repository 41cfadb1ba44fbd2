//! Shaders against what the host knows of them, and the wavefront with a toy in the estimator's place.

pub(crate) mod layout;
mod traffic;
mod twins;
mod variants;
pub(in crate::gpu) mod wavefront;

/// A toy's hash; its WGSL twin is [`MIX`].
pub(super) fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^ (x >> 15)
}

pub(super) const MIX: &str = "fn mix_bits(word: u32) -> u32 { var x = word; x ^= x >> 16u; x *= 0x7feb352du; return x ^ (x >> 15u); }";
