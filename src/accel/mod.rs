//! Acceleration structures: one over the real, one over the virtual triangles.

/// Placeholder type replaced by the accel work package.
pub struct WorldBvh;
