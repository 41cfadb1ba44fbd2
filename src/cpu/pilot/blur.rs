//! How far the rays of a pixel lie apart.

use glam::Vec3;

use crate::packed::Frame;

/// Rounding and the curvature of the distortion inside one pixel.
pub const FOOTPRINT_MARGIN: f32 = 1.1;
/// A square of half-width 1 reaches this far.
const SQUARE_REACH: f32 = std::f32::consts::SQRT_2;

/// A centre, and a radius in metres.
pub type Sphere = (Vec3, f32);

/// How far the rays of a pixel lie from the pinhole ray through its centre.
#[derive(Clone, Copy, Debug)]
pub struct Blur {
    /// Pixel footprint at axis depth 1, metres.
    footprint: f32,
    aperture_radius: f32,
    inv_focus_distance: f32,
    /// How far the camera moves from where it is in the middle of the row's exposure, metres.
    pub shake: f32,
}

impl Blur {
    /// Of a camera that rests; `footprint`: at axis depth 1, metres.
    pub fn of(frame: &Frame, footprint: f32) -> Self {
        Self {
            footprint,
            aperture_radius: frame.aperture_radius * SQUARE_REACH,
            inv_focus_distance: frame.inv_focus_distance,
            shake: 0.0,
        }
    }

    /// Of one that moves by that many metres.
    pub fn shaken(self, shake: f32) -> Self {
        Self { shake, ..self }
    }

    /// Largest distance from the centre ray over the axis depths z0..z1; convex in z, so the ends decide.
    pub fn radius(&self, z0: f32, z1: f32) -> f32 {
        let blur = |z: f32| {
            self.aperture_radius * (1.0 - z * self.inv_focus_distance).abs()
                + self.footprint * z.max(0.0)
                + self.shake
        };
        blur(z0.max(0.0)).max(blur(z1.max(0.0)))
    }
}
