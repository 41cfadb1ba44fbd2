//! Where light that goes to a point of the lens lands in the photograph. WGSL twin: `shaders/camera/splat.wgsl`.
//!
//! The inverse of [`camera_ray_from`](super::lens::camera_ray_from): of a lens point and a point of the scene it gives the photograph's point whose
//! ray through that lens point meets it, and how much of the light there a pixel receives.

use glam::Vec3;

use super::lens::{coefficients, is_wide, lens_area, lens_distort, lens_undistort, sample_lens};
use super::shutter::CameraPose;
use crate::distortion::{fisheye_angle_fast, fisheye_radius, fisheye_slope};
use crate::math::{atan2_, dot3, length3};
use crate::packed::{Frame, NONE};
use crate::shared::shared;

shared! {
    /// Relative difference up to which a photograph's point is the scene point's own, and not one past the lens model's fold.
    const FOLD_TOLERANCE: f32 = 1e-3;
}

/// The way from a point of the scene through the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensConnection {
    /// Row-major index; [`NONE`] where the photograph does not show the point.
    pub pixel: u32,
    /// Unit, from the point to the lens.
    pub direction: Vec3,
    /// Metres.
    pub distance: f32,
    /// What radiance times solid angle at the lens point is multiplied with to give the pixel's mean radiance, 1/sr.
    pub importance: f32,
}

/// Connects `position` to the lens point of (lens_u, lens_v) of a camera that stands at `pose`.
pub fn lens_connect(
    frame: &Frame,
    pose: &CameraPose,
    position: Vec3,
    lens_u: f32,
    lens_v: f32,
) -> LensConnection {
    let mut at = [0.0, 0.0];
    if frame.aperture_radius != 0.0 {
        at = sample_lens(frame, lens_u, lens_v);
    }
    let to_lens = (pose.position + (pose.right * at[0] + pose.up * at[1])) - position;
    let depth = dot3(to_lens, pose.back);
    let distance = length3(to_lens);
    let mut connection = LensConnection {
        pixel: NONE,
        direction: pose.back,
        distance,
        importance: 0.0,
    };
    if is_wide(frame) {
        return connect_wide(frame, pose, to_lens, distance);
    }
    if depth <= 0.0 {
        return connection;
    }
    connection.direction = to_lens / distance;
    // At depth 1, y down: where the ray from the lens point crosses the focus plane, seen from the lens centre.
    let x = at[0] * frame.inv_focus_distance - dot3(to_lens, pose.right) / depth;
    let y = dot3(to_lens, pose.up) / depth - at[1] * frame.inv_focus_distance;
    let distorted = lens_distort(frame, x, y);
    let [fx, fy, cx, cy] = frame.intrinsics;
    let px = distorted[0] * fx + cx;
    let py = distorted[1] * fy + cy;
    let inside = px >= 0.0 && py >= 0.0 && px < frame.width as f32 && py < frame.height as f32;
    let back = lens_undistort(frame, distorted[0], distorted[1]);
    let miss = (back[0] - x).abs() + (back[1] - y).abs();
    if !inside || miss > FOLD_TOLERANCE * (1.0 + x.abs() + y.abs()) {
        return connection;
    }
    connection.pixel = py as u32 * frame.width + px as u32;
    // Pixels per solid angle at the lens point: cos^3 of the angle to the axis turns solid angle into area at depth 1.
    let secant = distance / depth;
    connection.importance = fx * fy * lens_area(frame, x, y) * (secant * secant * secant);
    connection
}

/// [`lens_connect`] to a fisheye without an aperture.
fn connect_wide(frame: &Frame, pose: &CameraPose, to_lens: Vec3, distance: f32) -> LensConnection {
    let x = -dot3(to_lens, pose.right);
    let y = dot3(to_lens, pose.up);
    let k = coefficients(frame);
    let r = (x * x + y * y).sqrt();
    let angle = atan2_(r, dot3(to_lens, pose.back));
    let radius = fisheye_radius(&k, angle);
    let mut scale = 0.0;
    // Area of the photograph per solid angle.
    let mut density = 1.0;
    if r > 1e-6 * distance {
        scale = radius / r;
        density = scale * fisheye_slope(&k, angle) * distance;
    }
    let [fx, fy, cx, cy] = frame.intrinsics;
    let px = x * scale * fx + cx;
    let py = y * scale * fy + cy;
    let inside = px >= 0.0 && py >= 0.0 && px < frame.width as f32 && py < frame.height as f32;
    let miss = (fisheye_angle_fast(&k, radius) - angle).abs();
    let mut connection = LensConnection {
        pixel: NONE,
        direction: to_lens / distance,
        distance,
        importance: 0.0,
    };
    if inside && miss <= FOLD_TOLERANCE {
        connection.pixel = py as u32 * frame.width + px as u32;
        connection.importance = fx * fy * density;
    }
    connection
}

/// What light of a moment (a share of the shutter's time) counts in a row: 0 while the row's shutter is closed, else more the shorter it is open.
/// A row is open for its share of the readout at the least.
pub fn exposure_weight(frame: &Frame, share: f32, row: u32) -> f32 {
    let height = frame.height as f32;
    let open = frame.shutter_open.max(1.0 / height);
    let since = share - row as f32 * ((1.0 - open) / (height - 1.0).max(1.0));
    if since >= 0.0 && since < open {
        1.0 / open
    } else {
        0.0
    }
}
