//! Where a pinhole with distortion sees points of the world, in f64, and the proof that its distortion can be rendered.

use glam::DVec3;

use super::Camera;
use crate::distortion::{self, LENS_FISHEYE};

/// What a camera's distortion makes impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LensError {
    /// No ray belongs to this photograph position (pixels, corner origin).
    #[error(
        "the distortion cannot be inverted at pixel ({x:.1}, {y:.1}): it folds, or looks straight back, before reaching that distance from the centre"
    )]
    NotInvertible { x: f64, y: f64 },
    /// A thin lens has no rays so far off its axis.
    #[error("the lens looks 89 degrees off its axis or more at pixel ({x:.1}, {y:.1})")]
    TooWide { x: f64, y: f64 },
}

/// That a lens of this aperture has rays for every pixel: up to 89 degrees off the axis, if it is no pinhole.
pub fn check_reach(camera: &Camera, aperture_radius_m: f64) -> Result<(), LensError> {
    if camera.distortion.model != LENS_FISHEYE || aperture_radius_m == 0.0 {
        return Ok(());
    }
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    for (x, y) in [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)] {
        undistort(camera, x, y).map_err(|_| LensError::TooWide { x, y })?;
    }
    Ok(())
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
    let lens = &camera.distortion;
    if lens.model == LENS_FISHEYE {
        let r = v.x.hypot(v.y);
        let angle = r.atan2(depth);
        let radius = distortion::fisheye_radius(&lens.coefficients, angle);
        let back = distortion::fisheye_angle(&lens.coefficients, radius)?;
        let scale = if r > 0.0 { radius / r } else { 0.0 };
        let seen = DVec3::new(
            v.x * scale * camera.fx + camera.cx,
            -v.y * scale * camera.fy + camera.cy,
            depth,
        );
        return ((back - angle).abs() <= 1e-6).then_some(seen);
    }
    if depth <= 0.0 {
        return None;
    }
    let ideal = [v.x / depth, -v.y / depth];
    let distorted = distortion::distort(lens.model, &lens.coefficients, ideal);
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
    let lens = &camera.distortion;
    if lens.is_none() {
        return Ok(());
    }
    // As a backend has them.
    let coefficients = lens.coefficients.map(|c| c as f32);
    let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32);
    let check = |x: u32, y: u32| {
        let (px, py) = (f64::from(x), f64::from(y));
        if lens.model == LENS_FISHEYE {
            let r = ((px - camera.cx) / camera.fx).hypot((py - camera.cy) / camera.fy);
            let want = distortion::fisheye_angle(&lens.coefficients, r);
            let want = want.ok_or(LensError::NotInvertible { x: px, y: py })?;
            let found = f64::from(distortion::fisheye_angle_fast(&coefficients, r as f32));
            let slope = distortion::fisheye_slope(&lens.coefficients, want);
            return match (found - want).abs() * slope * camera.fx.max(camera.fy) < 0.01 {
                true => Ok(()),
                false => Err(LensError::NotInvertible { x: px, y: py }),
            };
        }
        let want = undistort(camera, px, py)?;
        let distorted = [(x as f32 - cx) / fx, (y as f32 - cy) / fy];
        let found = distortion::undistort_fast(lens.model, &coefficients, distorted);
        let found = found.map(f64::from);
        let miss_x = (found[0] - want[0]).abs() * camera.fx;
        let miss_y = (found[1] - want[1]).abs() * camera.fy;
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
