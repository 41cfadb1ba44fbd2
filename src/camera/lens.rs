//! Camera rays through a thin lens, and the projection that inverts them.
//!
//! WGSL twin: `shaders/camera/lens.wgsl`, with the same function names and operations. A ray from a point of the lens
//! passes through the point of the focus plane that the pinhole ray of its pixel meets: focus lies on a plane across the view axis.

use glam::Vec3;

use super::shutter::{CameraPose, camera_pose};
use crate::distortion::{
    Coefficients, LENS_FISHEYE, distort, distortion_area, fisheye_angle_fast, fisheye_direction,
    fisheye_radius, undistort_fast,
};
use crate::math::{INV_TAU, atan2_, dot3, floor_, normalize3, sincos_2pi};
use crate::packed::{APERTURE_DISC, APERTURE_SQUARE, Frame};
use crate::shared::shared;

shared! {
    /// Anchor-relative origin in metres, unit direction.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct CameraRay {
        pub origin: Vec3,
        pub direction: Vec3,
    }

    /// Where the pinhole camera sees a point.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct Projection {
        /// Photograph pixels, corner origin.
        pub px: f32,
        pub py: f32,
        /// Metres along the view axis.
        pub depth: f32,
        /// In front of the camera, inside the photograph, and on the lens model's usable side of its fold.
        pub valid: bool,
    }
}

/// A point of the aperture, metres to the camera's right and up, uniform in area over (u, v) in [0, 1)^2 and continuous where the
/// shape allows, so that strata stay together. A polygon has a corner at `blade_rotation` from the right axis, towards up.
pub fn sample_lens(frame: &Frame, u: f32, v: f32) -> [f32; 2] {
    let radius = frame.aperture_radius;
    let a = 2.0 * u - 1.0;
    let b = 2.0 * v - 1.0;
    if frame.aperture_shape == APERTURE_DISC {
        // Shirley and Chiu's concentric map: squares become rings.
        if a == 0.0 && b == 0.0 {
            return [0.0, 0.0];
        }
        let wide = a.abs() > b.abs();
        let r = if wide { a } else { b };
        let turns = if wide {
            0.125 * (b / a)
        } else {
            0.25 - 0.125 * (a / b)
        };
        let (s, c) = sincos_2pi(turns);
        return [radius * r * c, radius * r * s];
    }
    let rotation = frame.blade_rotation * INV_TAU;
    if frame.aperture_shape == APERTURE_SQUARE {
        let (s, c) = sincos_2pi(rotation);
        return [radius * (a * c - b * s), radius * (a * s + b * c)];
    }
    // One triangle a blade, from the centre to two corners.
    let blades = frame.aperture_shape as f32;
    let blade = floor_(u * blades).min(blades - 1.0);
    let along = (u * blades - blade).max(0.0).sqrt() * radius;
    let (half_s, half_c) = sincos_2pi(0.5 / blades);
    let x = along * half_c;
    let y = along * half_s * b;
    let (s, c) = sincos_2pi((blade + 0.5) / blades + rotation);
    [x * c - y * s, x * s + y * c]
}

/// The ray of photograph position (px, py), pixels from the top left corner, through the lens point of (lens_u, lens_v).
/// With an aperture radius of 0 the lens numbers are not looked at.
pub fn camera_ray(frame: &Frame, px: f32, py: f32, lens_u: f32, lens_v: f32) -> CameraRay {
    camera_ray_from(frame, &camera_pose(frame), px, py, lens_u, lens_v)
}

/// [`camera_ray`] of a camera that stands at `pose`.
pub fn camera_ray_from(
    frame: &Frame,
    pose: &CameraPose,
    px: f32,
    py: f32,
    lens_u: f32,
    lens_v: f32,
) -> CameraRay {
    let [fx, fy, cx, cy] = frame.intrinsics;
    if is_wide(frame) {
        let d = fisheye_direction(&coefficients(frame), [(px - cx) / fx, (py - cy) / fy]);
        return CameraRay {
            origin: pose.position,
            direction: normalize3(pose.right * d[0] - (pose.up * d[1] + pose.back * d[2])),
        };
    }
    let ideal = lens_undistort(frame, (px - cx) / fx, (py - cy) / fy);
    // At depth 1 along the view axis; pixel y runs down. Grouped: a shader compiler regroups a - b - c as it likes.
    let d = pose.right * ideal[0] - (pose.up * ideal[1] + pose.back);
    if frame.aperture_radius == 0.0 {
        return CameraRay {
            origin: pose.position,
            direction: normalize3(d),
        };
    }
    let at = sample_lens(frame, lens_u, lens_v);
    let offset = pose.right * at[0] + pose.up * at[1];
    CameraRay {
        origin: pose.position + offset,
        direction: normalize3(d - offset * frame.inv_focus_distance),
    }
}

/// Where the pinhole at the lens centre sees an anchor-relative point.
pub fn camera_project(frame: &Frame, position: Vec3) -> Projection {
    if is_wide(frame) {
        return project_wide(frame, position);
    }
    let [fx, fy, cx, cy] = frame.intrinsics;
    let v = position - xyz(frame.camera_position);
    let depth = -dot3(v, xyz(frame.camera_back));
    if depth <= 0.0 {
        return Projection {
            px: 0.0,
            py: 0.0,
            depth,
            valid: false,
        };
    }
    let x = dot3(v, xyz(frame.camera_right)) / depth;
    let y = -dot3(v, xyz(frame.camera_up)) / depth;
    let distorted = lens_distort(frame, x, y);
    let px = distorted[0] * fx + cx;
    let py = distorted[1] * fy + cy;
    let inside = px >= 0.0 && py >= 0.0 && px < frame.width as f32 && py < frame.height as f32;
    // A point past the fold lands inside the photograph, but the ray of that pixel does not go there.
    let back = lens_undistort(frame, distorted[0], distorted[1]);
    let miss = (back[0] - x).abs() + (back[1] - y).abs();
    Projection {
        px,
        py,
        depth,
        valid: inside && miss <= 1e-3 * (1.0 + x.abs() + y.abs()),
    }
}

/// [`camera_project`] of a fisheye without an aperture, which sees what is behind it too.
fn project_wide(frame: &Frame, position: Vec3) -> Projection {
    let [fx, fy, cx, cy] = frame.intrinsics;
    let v = position - xyz(frame.camera_position);
    let depth = -dot3(v, xyz(frame.camera_back));
    let x = dot3(v, xyz(frame.camera_right));
    let y = -dot3(v, xyz(frame.camera_up));
    let k = coefficients(frame);
    let r = (x * x + y * y).sqrt();
    let angle = atan2_(r, depth);
    let radius = fisheye_radius(&k, angle);
    let mut scale = 0.0;
    if r > 0.0 {
        scale = radius / r;
    }
    let px = x * scale * fx + cx;
    let py = y * scale * fy + cy;
    let inside = px >= 0.0 && py >= 0.0 && px < frame.width as f32 && py < frame.height as f32;
    let miss = (fisheye_angle_fast(&k, radius) - angle).abs();
    Projection {
        px,
        py,
        depth,
        valid: inside && miss <= 1e-3 && (r > 0.0 || depth > 0.0),
    }
}

/// Distorted normalised coordinates (y down) of ideal ones.
pub fn lens_distort(frame: &Frame, x: f32, y: f32) -> [f32; 2] {
    distort(frame.lens_model, &coefficients(frame), [x, y])
}

/// Ideal normalised coordinates of distorted ones, by Newton's method; the argument itself where there is no distortion.
pub fn lens_undistort(frame: &Frame, xd: f32, yd: f32) -> [f32; 2] {
    undistort_fast(frame.lens_model, &coefficients(frame), [xd, yd])
}

/// How much larger a small area is in distorted normalised coordinates than in ideal ones.
pub fn lens_area(frame: &Frame, x: f32, y: f32) -> f32 {
    distortion_area(frame.lens_model, &coefficients(frame), [x, y])
}

/// Rays may look sideways and back.
pub fn is_wide(frame: &Frame) -> bool {
    frame.lens_model == LENS_FISHEYE && frame.aperture_radius == 0.0
}

pub fn coefficients(frame: &Frame) -> Coefficients<f32> {
    let [k1, k2, p1, p2] = frame.distortion;
    let [[k4, k5, k6, s1], [s2, s3, s4, _]] = frame.distortion_more;
    [
        k1,
        k2,
        p1,
        p2,
        frame.distortion_k3,
        k4,
        k5,
        k6,
        s1,
        s2,
        s3,
        s4,
    ]
}

fn xyz(v: [f32; 4]) -> Vec3 {
    Vec3::new(v[0], v[1], v[2])
}

#[cfg(test)]
mod model_tests;
#[cfg(test)]
mod tests;
