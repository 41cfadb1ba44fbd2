//! Acceleration structures: one over the real, one over the virtual triangles.

mod hit;

pub use hit::Hit;

/// Placeholder type replaced by the accel work package.
pub struct WorldBvh;
