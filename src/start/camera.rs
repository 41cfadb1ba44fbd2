//! A camera over the ground y = 0, from focal length, the direction up, and a scale.

use glam::{DMat3, DMat4, DVec2, DVec3};

use crate::distortion::{Distortion, LENS_FISHEYE, LENS_RADIAL};
use crate::scene::Camera;
use crate::scene::projection;

/// A camera of square pixels above the world's origin, heading along -Z. `up` is the world's in camera space (x right, y up, z back), unit length.
pub fn camera_over_ground(size: (u32, u32), focal_px: f64, up: DVec3, height_m: f64) -> Camera {
    // World axes in camera space.
    let back = (DVec3::Z - up * up.z)
        .try_normalize()
        .unwrap_or_else(|| DVec3::Y * -up.z.signum());
    let right = up.cross(back);
    let camera_from_world = DMat3::from_cols(right, up, back);
    let (width, height) = size;
    Camera {
        width,
        height,
        fx: focal_px,
        fy: focal_px,
        cx: 0.5 * f64::from(width),
        cy: 0.5 * f64::from(height),
        distortion: Distortion::NONE,
        world_from_camera: DMat4::from_mat3_translation(
            camera_from_world.transpose(),
            DVec3::new(0.0, height_m, 0.0),
        ),
    }
}

/// Up in camera space of a horizon that crosses the left and right borders at these heights, pixels from the top.
pub fn up_of_horizon((width, height): (u32, u32), focal_px: f64, left: f64, right: f64) -> DVec3 {
    let at = |x: f64, y: f64| {
        DVec3::new(
            x - 0.5 * f64::from(width),
            0.5 * f64::from(height) - y,
            -focal_px,
        )
    };
    let up = at(f64::from(width), right).cross(at(0.0, left)).normalize();
    up * up.y.signum()
}

/// Where the horizon of `up` crosses the left and right borders, pixels from the top; `None`: it is upright.
pub fn horizon_of_up((width, height): (u32, u32), focal_px: f64, up: DVec3) -> Option<[f64; 2]> {
    let half_width = 0.5 * f64::from(width);
    (up.y.abs() > 1e-6).then(|| {
        [-half_width, half_width]
            .map(|x| 0.5 * f64::from(height) - (up.z * focal_px - up.x * x) / up.y)
    })
}

/// Up in camera space of a camera that looks down by this angle and is not rolled.
pub fn up_of_pitch(down_deg: f64) -> DVec3 {
    let (sin, cos) = down_deg.to_radians().sin_cos();
    DVec3::new(0.0, cos, sin)
}

/// Origin and unit direction of the ray through a pixel, world space; `None` where the distortion has none.
pub fn ray(camera: &Camera, pixel: DVec2) -> Option<(DVec3, DVec3)> {
    let [x, y] = projection::undistort(camera, pixel.x, pixel.y).ok()?;
    let pose = camera.world_from_camera;
    let direction = pose.transform_vector3(DVec3::new(x, -y, -1.0));
    Some((pose.w_axis.truncate(), direction.normalize()))
}

/// Where a pixel shows the ground y = 0.
pub fn ground_point(camera: &Camera, pixel: DVec2) -> Option<DVec3> {
    let (origin, direction) = ray(camera, pixel)?;
    (direction.y < -1e-6).then(|| origin - direction * (origin.y / direction.y))
}

/// The factor on the camera's height that makes the ground between two pixels this long; `None`: one shows no ground, or they are one.
pub fn height_factor(camera: &Camera, from: DVec2, to: DVec2, length_m: f64) -> Option<f64> {
    let distance = ground_point(camera, from)?.distance(ground_point(camera, to)?);
    (distance > 0.0).then(|| length_m / distance)
}

/// As many coefficients as scene files and trajectories name of a lens.
pub fn coefficients(lens: &Distortion) -> &[f64] {
    let count = match lens.model {
        LENS_FISHEYE => 4,
        LENS_RADIAL => 5,
        _ => 12,
    };
    &lens.coefficients[..count]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (640, 480);

    #[test]
    fn a_horizon_and_up_are_the_same() {
        for [left, right] in [[100.0, 100.0], [-50.0, 30.0], [240.0, 300.0]] {
            let up = up_of_horizon(SIZE, 500.0, left, right);
            let [l, r] = horizon_of_up(SIZE, 500.0, up).unwrap();
            assert!((l - left).abs() < 1e-9 && (r - right).abs() < 1e-9);
            let camera = camera_over_ground(SIZE, 500.0, up, 1.5);
            // What is far away on the ground is seen at the horizon.
            let far = projection::project(&camera, DVec3::new(0.0, 0.0, -1e7)).unwrap();
            let on_horizon = left + (right - left) * far.x / 640.0;
            assert!((far.y - on_horizon).abs() < 1e-3, "{far}");
            let off = left + 5.0 + (right - left) * far.x / 640.0;
            assert!((far.y - off).abs() > 1.0, "control");
        }
        let level = up_of_pitch(0.0);
        let middle = horizon_of_up(SIZE, 500.0, level).unwrap();
        assert_eq!(middle, [240.0, 240.0]);
        let down = horizon_of_up(SIZE, 500.0, up_of_pitch(10.0)).unwrap();
        let above = 240.0 - 500.0 * 10_f64.to_radians().tan();
        assert!((down[0] - above).abs() < 1e-9, "{down:?}");
    }

    #[test]
    fn a_known_length_gives_the_height() {
        let up = up_of_horizon(SIZE, 500.0, 90.0, 110.0);
        let truth = camera_over_ground(SIZE, 500.0, up, 1.3);
        let ends = [DVec3::new(-0.2, 0.0, -2.0), DVec3::new(0.3, 0.0, -2.4)];
        let [a, b] = ends.map(|p| projection::project(&truth, p).unwrap().truncate());
        let guessed = camera_over_ground(SIZE, 500.0, up, 2.0);
        let factor = height_factor(&guessed, a, b, ends[0].distance(ends[1])).unwrap();
        assert!((2.0 * factor - 1.3).abs() < 1e-9);
        let sky = DVec2::new(300.0, 20.0);
        assert_eq!(height_factor(&guessed, sky, b, 1.0), None);
    }
}
