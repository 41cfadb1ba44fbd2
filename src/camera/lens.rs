//! Camera rays through a thin lens, and the projection that inverts them.
//!
//! The f32 half has a WGSL twin, `shaders/camera/lens.wgsl`, with the same function names and operations. A ray from a point of the lens
//! passes through the point of the focus plane that the pinhole ray of its pixel meets: focus lies on a plane across the view axis.

use glam::{DVec3, Vec3};

use super::distortion;
use super::shutter::{CameraPose, camera_pose};
use crate::math::{INV_TAU, dot3, normalize3, sincos_2pi};
use crate::packed::{APERTURE_DISC, APERTURE_SQUARE, Frame};
use crate::scene::{Aperture, Camera, Lens};
use crate::shared::shared;

shared! {
    /// Newton steps that a ray spends on the distortion; [`check_distortion`] proves them enough for a camera.
    const UNDISTORT_STEPS: u32 = 8;
}

/// What a camera's distortion makes impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LensError {
    /// No ray belongs to this photograph position (pixels, corner origin).
    #[error(
        "the distortion cannot be inverted at pixel ({x:.1}, {y:.1}): it folds before reaching that distance from the centre"
    )]
    NotInvertible { x: f64, y: f64 },
}

/// Anchor-relative origin in metres, unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    pub origin: Vec3,
    pub direction: Vec3,
}

/// Where the pinhole camera sees a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Photograph pixels, corner origin.
    pub px: f32,
    pub py: f32,
    /// Metres along the view axis.
    pub depth: f32,
    /// In front of the camera, inside the photograph, and on the lens model's usable side of its fold.
    pub valid: bool,
}

/// Fills the camera and lens fields of `frame`. Positions become relative to `anchor` (world, metres), subtracted in f64.
pub fn frame_camera(camera: &Camera, lens: &Lens, anchor: DVec3, frame: &mut Frame) {
    let pose = camera.world_from_camera;
    let axis = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    frame.camera_position = axis(pose.w_axis.truncate() - anchor);
    frame.camera_right = axis(pose.x_axis.truncate());
    frame.camera_up = axis(pose.y_axis.truncate());
    frame.camera_back = axis(pose.z_axis.truncate());
    frame.intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32);
    let [k1, k2, p1, p2, k3] = camera.distortion.map(|v| v as f32);
    frame.distortion = [k1, k2, p1, p2];
    frame.distortion_k3 = k3;
    frame.aperture_radius = lens.aperture_radius_m as f32;
    frame.inv_focus_distance = (1.0 / lens.focus_distance_m) as f32;
    frame.blade_rotation = lens.blade_rotation_deg.to_radians() as f32;
    frame.aperture_shape = match lens.aperture {
        Aperture::Disc => APERTURE_DISC,
        Aperture::Square => APERTURE_SQUARE,
        Aperture::Blades(count) => count,
    };
    frame.width = camera.width;
    frame.height = camera.height;
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
    let blade = (u * blades).floor().min(blades - 1.0);
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

/// Distorted normalised coordinates (y down) of ideal ones.
pub fn lens_distort(frame: &Frame, x: f32, y: f32) -> [f32; 2] {
    let [k1, k2, p1, p2] = frame.distortion;
    let k3 = frame.distortion_k3;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

/// Ideal normalised coordinates of distorted ones, by Newton's method; the argument itself where there is no distortion.
pub fn lens_undistort(frame: &Frame, xd: f32, yd: f32) -> [f32; 2] {
    let [k1, k2, p1, p2] = frame.distortion;
    let k3 = frame.distortion_k3;
    if k1 == 0.0 && k2 == 0.0 && p1 == 0.0 && p2 == 0.0 && k3 == 0.0 {
        return [xd, yd];
    }
    let mut x = xd;
    let mut y = yd;
    for _ in 0..UNDISTORT_STEPS {
        let at = lens_distort(frame, x, y);
        let ex = at[0] - xd;
        let ey = at[1] - yd;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let jxx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let jxy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let jyy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        let determinant = jxx * jyy - jxy * jxy;
        // Bounded steps: a pixel that cannot be inverted is refused at load, but must not overflow either.
        let inverse = 1.0 / determinant.max(1e-4);
        x -= ((jyy * ex - jxy * ey) * inverse).clamp(-0.5, 0.5);
        y -= ((jxx * ey - jxy * ex) * inverse).clamp(-0.5, 0.5);
    }
    [x, y]
}

fn xyz(v: [f32; 4]) -> Vec3 {
    Vec3::new(v[0], v[1], v[2])
}

/// Ideal normalised coordinates (x right, y down, depth 1) of a photograph position in pixels, in f64.
pub fn undistort(camera: &Camera, px: f64, py: f64) -> Result<[f64; 2], LensError> {
    let distorted = [(px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy];
    distortion::undistort(&camera.distortion, distorted)
        .ok_or(LensError::NotInvertible { x: px, y: py })
}

/// Photograph position in pixels and depth along the view axis in metres of a world point, in f64. None behind the camera or past the
/// fold of the distortion. May lie outside the photograph.
pub fn project(camera: &Camera, point: DVec3) -> Option<DVec3> {
    let v = camera.world_from_camera.inverse().transform_point3(point);
    let depth = -v.z;
    if depth <= 0.0 {
        return None;
    }
    let ideal = [v.x / depth, -v.y / depth];
    let distorted = distortion::distort(&camera.distortion, ideal);
    let back = distortion::undistort(&camera.distortion, distorted)?;
    let miss = (back[0] - ideal[0]).abs() + (back[1] - ideal[1]).abs();
    let scale = 1.0 + ideal[0].abs() + ideal[1].abs();
    (miss <= 1e-6 * scale).then(|| {
        DVec3::new(
            distorted[0] * camera.fx + camera.cx,
            distorted[1] * camera.fy + camera.cy,
            depth,
        )
    })
}

/// Proves that every position of the photograph has a ray, and that the f32 inverse used while rendering finds it to 0.01 px.
///
/// The f64 inverse walks from the distortion centre to its pixel, and every pixel lies on the way to one of the border, so the border
/// stands for all; the f32 inverse is tried on a lattice of 16 px besides.
pub fn check_distortion(camera: &Camera) -> Result<(), LensError> {
    if camera.distortion.iter().all(|&c| c == 0.0) {
        return Ok(());
    }
    let mut frame: Frame = bytemuck::Zeroable::zeroed();
    let pinhole = Lens {
        aperture_radius_m: 0.0,
        focus_distance_m: 1.0,
        aperture: Aperture::Disc,
        blade_rotation_deg: 0.0,
    };
    frame_camera(camera, &pinhole, DVec3::ZERO, &mut frame);
    let check = |x: u32, y: u32| {
        let (px, py) = (f64::from(x), f64::from(y));
        let want = undistort(camera, px, py)?;
        let [fx, fy, cx, cy] = frame.intrinsics;
        let found = lens_undistort(&frame, (x as f32 - cx) / fx, (y as f32 - cy) / fy);
        let miss_x = (f64::from(found[0]) - want[0]).abs() * camera.fx;
        let miss_y = (f64::from(found[1]) - want[1]).abs() * camera.fy;
        // Written so that a NaN fails.
        if miss_x < 0.01 && miss_y < 0.01 {
            Ok(())
        } else {
            Err(LensError::NotInvertible { x: px, y: py })
        }
    };
    for x in 0..=camera.width {
        check(x, 0)?;
        check(x, camera.height)?;
    }
    for y in 0..=camera.height {
        check(0, y)?;
        check(camera.width, y)?;
    }
    for y in (0..camera.height).step_by(16) {
        for x in (0..camera.width).step_by(16) {
            check(x, y)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
