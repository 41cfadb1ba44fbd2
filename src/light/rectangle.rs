//! Rectangular lights by solid angle, after Ureña, Fajardo and King, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013,
//! in a form without their differences of nearly equal angles. WGSL twin: `shaders/light/rectangle.wgsl`.

use glam::{Vec2, Vec3};

use crate::math::{INV_TAU, TAU, atan2_, cross3, dot3, safe_sqrt, sincos_2pi};
use crate::packed::{LIGHT_QUAD, Light, xyz};
use crate::shared::shared;

shared! {
    /// Smaller solid angles (sr) are sampled by area: the angle is a sum of four terms and would lose its precision.
    const MIN_SOLID_ANGLE: f32 = 0.02;
    /// Largest cosine between the edges of a quad that counts as a rectangle.
    const RIGHT_ANGLE: f32 = 1e-5;
    /// Coordinates are bounded by this many heights: beyond, the solid angle changes by less than 1 / FARTHEST.
    const FARTHEST: f32 = 3e4;

    /// A rectangle seen from a point, in axes along its edges.
    pub value struct Rectangle {
        ex: Vec3,
        ey: Vec3,
        /// Normal on the emitting side.
        ez: Vec3,
        x0: f32,
        x1: f32,
        y0: f32,
        y1: f32,
        /// Of the point above the rectangle's plane, on the emitting side.
        height: f32,
        /// Steradians; 0 where it is not to be sampled by solid angle.
        pub solid_angle: f32,
        /// Signed solid angle between the foot of the perpendicular and the side at x0.
        start: f32,
    }
}

/// Whether the unit edges of a quad make a right angle.
pub fn is_right_angle(ex: Vec3, ey: Vec3) -> bool {
    dot3(ex, ey).abs() <= RIGHT_ANGLE
}

/// The quad `light` from `position`; `solid_angle` 0 for other lights, oblique quads, the dark side and small solid angles.
pub fn rectangle_from(light: &Light, position: Vec3) -> Rectangle {
    let (ex, ey) = (xyz(light.unit_u), xyz(light.unit_v));
    let ez = cross3(ex, ey);
    let offset = xyz(light.position) - position;
    let x0 = dot3(offset, ex);
    let y0 = dot3(offset, ey);
    let mut r = Rectangle {
        ex,
        ey,
        ez,
        x0,
        x1: x0 + light.unit_u[3],
        y0,
        y1: y0 + light.unit_v[3],
        height: -dot3(offset, ez),
        solid_angle: 0.0,
        start: 0.0,
    };
    if light.kind != LIGHT_QUAD || !is_right_angle(ex, ey) || r.height <= 0.0 {
        return r;
    }
    let inv_height = 1.0 / r.height;
    let (x0, x1) = (in_heights(r.x0, inv_height), in_heights(r.x1, inv_height));
    let (y0, y1) = (in_heights(r.y0, inv_height), in_heights(r.y1, inv_height));
    let left = between(corner(x0, y1), corner(x0, y0));
    let right = between(corner(x1, y1), corner(x1, y0));
    let whole = between(right, left);
    let mut solid_angle = atan2_(whole.y, whole.x);
    if solid_angle < 0.0 {
        solid_angle += TAU;
    }
    if solid_angle >= MIN_SOLID_ANGLE {
        r.solid_angle = solid_angle;
        r.start = atan2_(left.y, left.x);
    }
    r
}

/// Bounded so that the product of four corners does not overflow.
fn in_heights(x: f32, inv_height: f32) -> f32 {
    (x * inv_height).clamp(-FARTHEST, FARTHEST)
}

/// A complex number whose angle is the signed solid angle of the rectangle from the foot of the perpendicular to (x, y), in heights.
fn corner(x: f32, y: f32) -> Vec2 {
    Vec2::new(safe_sqrt(x * x + y * y + 1.0), x * y)
}

/// A complex number whose angle is that of `a` less that of `b`.
fn between(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y)
}

/// Vector from the point to a place on the rectangle, uniform by solid angle.
pub fn sample_rectangle(r: &Rectangle, u0: f32, u1: f32) -> Vec3 {
    let height_squared = r.height * r.height;
    // The strip from x0 to x has the solid angle asin(c p) + asin(c q) - start, c being the sine of x's azimuth about the y axis.
    let p = r.y1 / safe_sqrt(r.y1 * r.y1 + height_squared);
    let q = -r.y0 / safe_sqrt(r.y0 * r.y0 + height_squared);
    let (half_sin, half_cos) = sincos_2pi((r.start + u0 * r.solid_angle) * (0.5 * INV_TAU));
    // p^2 + q^2 + 2 p q cos of that angle, as whichever sum has no cancellation
    let mut squared = (p + q) * (p + q) - 4.0 * p * q * half_sin * half_sin;
    if p * q > 0.0 {
        squared = (p - q) * (p - q) + 4.0 * p * q * half_cos * half_cos;
    }
    let c = (2.0 * half_sin * half_cos / safe_sqrt(squared.max(1e-20))).clamp(-1.0, 1.0);
    let x = (c * r.height / safe_sqrt((1.0 - c * c).max(1e-12))).clamp(r.x0, r.x1);
    // Along the strip the solid angle is proportional to the sine of the elevation.
    let strip_squared = x * x + height_squared;
    let low = r.y0 / safe_sqrt(strip_squared + r.y0 * r.y0);
    let high = r.y1 / safe_sqrt(strip_squared + r.y1 * r.y1);
    let s = low + (high - low) * u1;
    let y = (s * safe_sqrt(strip_squared) / safe_sqrt((1.0 - s * s).max(1e-12))).clamp(r.y0, r.y1);
    (r.ex * x + r.ey * y) - r.ez * r.height
}
