//! How far a render goes at a call.

use std::time::Duration;

/// How far [`super::Renderer::advance`] goes; it never goes beyond the rays per pixel of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Until every pixel has its rays.
    Complete,
    /// About this many primary rays, at least one pass of one ray a pixel.
    Rays(u64),
    /// About this long.
    Time(Duration),
}
