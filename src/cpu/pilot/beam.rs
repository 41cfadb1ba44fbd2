//! All rays of one pixel at once, to prove what they cannot meet.

use glam::Vec3;

use crate::camera::lens::{camera_ray_from, is_wide, lens_undistort};
use crate::camera::shutter::{CameraPose, camera_pose, camera_pose_at};
use crate::packed::{FRAME_SHUTTER, Frame, PackedScene, SHUTTER_POSES};

/// All rays of a pixel, or of a square of pixels: at axis depth z they lie within `radius(z)` of the pinhole ray through its centre.
pub struct Beam {
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// View axis, unit.
    axis: Vec3,
    /// Of the square at axis depth 1, metres.
    footprint: f32,
    aperture_radius: f32,
    inv_focus_distance: f32,
    /// How far the camera moves from where it is in the middle of the row's exposure, metres.
    shake: f32,
    /// Of a fisheye without an aperture, whose rays may look back: the half-angle of the cone that holds them, radians.
    cone: Option<f32>,
}

/// Rounding and the curvature of the distortion inside one pixel.
const FOOTPRINT_MARGIN: f32 = 1.1;
/// A square of half-width 1 reaches this far.
const SQUARE_REACH: f32 = std::f32::consts::SQRT_2;

/// Of unit vectors, radians; precise where it is small.
fn angle_between(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Where the camera is in the middle, at the ends and at the corners of its way while a row is exposed.
struct RowPoses {
    all: [CameraPose; SHUTTER_POSES + 3],
    count: usize,
}

impl RowPoses {
    fn of(frame: &Frame, row: u32) -> Self {
        let mut poses = Self {
            all: [camera_pose(frame); SHUTTER_POSES + 3],
            count: 1,
        };
        if frame.flags & FRAME_SHUTTER == 0 {
            return poses;
        }
        let opens = row as f32 * frame.shutter_row;
        let closes = opens + frame.shutter_open;
        poses.all[0] = camera_pose_at(frame, 0.5 * (opens + closes));
        let corners = (0..SHUTTER_POSES).map(|i| i as f32 / (SHUTTER_POSES - 1) as f32);
        let inside = corners.filter(|share| (opens..=closes).contains(share));
        for share in [opens, closes].into_iter().chain(inside) {
            poses.all[poses.count] = camera_pose_at(frame, share);
            poses.count += 1;
        }
        poses
    }
}

impl Beam {
    pub fn of_pixel(frame: &Frame, pinhole: &Frame, pixel: u32) -> Self {
        Self::of_square(frame, pinhole, pixel, 1)
    }

    /// Of the pixels of a square, the first of which is `pixel`; of more than one while the camera rests.
    pub fn of_square(frame: &Frame, pinhole: &Frame, pixel: u32, side_px: u32) -> Self {
        let side = side_px as f32;
        let (row, column) = (pixel / frame.width, pixel % frame.width);
        let (x, y) = (column as f32, row as f32);
        let poses = RowPoses::of(frame, row);
        let middle = poses.all[0];
        let axis = -middle.back;
        let centre = camera_ray_from(pinhole, &middle, x + 0.5 * side, y + 0.5 * side, 0.5, 0.5);
        let at_depth_1 = |d: Vec3| d / d.dot(axis).max(1e-6);
        let ahead = at_depth_1(centre.direction);
        let [fx, fy, cx, cy] = frame.intrinsics;
        // The distortion is the same wherever the camera is.
        let corners = [(0.0, 0.0), (side, 0.0), (0.0, side), (side, side)]
            .map(|(dx, dy)| lens_undistort(frame, (x + dx - cx) / fx, (y + dy - cy) / fy));
        let (mut footprint, mut shake) = (0.0f32, 0.0f32);
        for pose in &poses.all[..poses.count] {
            // What a step of the camera does to the ray at a given depth, and what the lens's plane does that turns with it.
            let step = pose.position.distance(middle.position);
            let turn = 2.0 * frame.aperture_radius * pose.back.distance(middle.back);
            for ideal in corners.iter().filter(|_| !is_wide(frame)) {
                let direction =
                    at_depth_1(pose.right * ideal[0] - (pose.up * ideal[1] + pose.back));
                footprint = footprint.max(direction.distance(ahead));
                shake = shake.max((step + turn) * (1.0 + direction.length()));
            }
        }
        let cone = is_wide(frame).then(|| {
            let mut half_angle = 0.0f32;
            for pose in &poses.all[..poses.count] {
                shake = shake.max(pose.position.distance(middle.position));
                for (dx, dy) in [(0.0, 0.0), (side, 0.0), (0.0, side), (side, side)] {
                    let ray = camera_ray_from(pinhole, pose, x + dx, y + dy, 0.5, 0.5);
                    half_angle = half_angle.max(angle_between(ray.direction, centre.direction));
                }
            }
            half_angle * FOOTPRINT_MARGIN
        });
        Self {
            origin: centre.origin,
            direction: centre.direction,
            axis,
            footprint: footprint * FOOTPRINT_MARGIN,
            aperture_radius: frame.aperture_radius * SQUARE_REACH,
            inv_focus_distance: frame.inv_focus_distance,
            shake: shake * FOOTPRINT_MARGIN,
            cone,
        }
    }

    /// Largest distance from the centre ray over the axis depths z0..z1; convex in z, so the ends decide.
    fn radius(&self, z0: f32, z1: f32) -> f32 {
        let blur = |z: f32| {
            self.aperture_radius * (1.0 - z * self.inv_focus_distance).abs()
                + self.footprint * z.max(0.0)
                + self.shake
        };
        blur(z0.max(0.0)).max(blur(z1.max(0.0)))
    }

    fn may_meet_sphere(&self, centre: Vec3, radius: f32) -> bool {
        let to = centre - self.origin;
        if let Some(half_angle) = self.cone {
            let reach = (radius + self.shake) * 1.001;
            let distance = to.length();
            return distance <= reach || {
                let wide = half_angle + (reach / distance).asin();
                angle_between(to / distance, self.direction) <= wide * 1.001 + 1e-4
            };
        }
        let z = to.dot(self.axis);
        if z + radius < 0.0 {
            return false;
        }
        let off_ray = (to - self.direction * to.dot(self.direction)).length();
        off_ray <= (radius + self.radius(z - radius, z + radius)) * 1.001
    }

    pub fn may_meet_virtual(&self, scene: &PackedScene) -> bool {
        let spheres = match scene.swept_spheres.as_slice() {
            [] => &scene.frame.spheres[..scene.frame.sphere_count as usize],
            swept => swept,
        };
        spheres
            .iter()
            .any(|s| self.may_meet_sphere(Vec3::new(s[0], s[1], s[2]), s[3]))
    }

    pub fn may_meet_real(&self, scene: &PackedScene) -> bool {
        match scene.real_bvh.bounds() {
            None => false,
            Some((lo, hi)) => self.may_meet_sphere((lo + hi) * 0.5, (hi - lo).length() * 0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distortion::Distortion;
    use crate::math::{hash_u32, uniform_from_bits};
    use crate::pack::camera::frame_camera;
    use crate::scene::{Camera, Lens};
    use bytemuck::Zeroable;
    use glam::{DMat4, DVec3};

    fn frame(aperture_radius_m: f64) -> Frame {
        let camera = Camera {
            width: 64,
            height: 48,
            fx: 27.0,
            fy: 27.0,
            cx: 32.0,
            cy: 24.0,
            distortion: Distortion::fisheye([0.02, -0.003, 0.0, 0.0]),
            world_from_camera: DMat4::IDENTITY,
        };
        let lens = Lens {
            aperture_radius_m,
            focus_distance_m: 1.5,
            ..Lens::PINHOLE
        };
        let mut frame = Frame::zeroed();
        frame_camera(&camera, &lens, DVec3::ZERO, &mut frame);
        frame
    }

    /// Of pixels that are wide in angle and end 85 degrees off the axis.
    #[test]
    fn rays_of_a_fisheyes_pixel_stay_in_its_beam() {
        let random = |i: u32| uniform_from_bits(hash_u32(i));
        for aperture_radius_m in [0.0, 0.02] {
            let (frame, pinhole) = (frame(aperture_radius_m), frame(0.0));
            let (mut worst, mut control) = (0.0f32, 0.0f32);
            for i in 0..20_000 {
                let pixel = hash_u32(i) % (64 * 48);
                let beam = Beam::of_pixel(&frame, &pinhole, pixel);
                let (x, y) = ((pixel % 64) as f32, (pixel / 64) as f32);
                let [dx, dy, u, v] = [1, 2, 3, 4].map(|n| random(4 * i + n));
                let ray = camera_ray_from(&frame, &camera_pose(&frame), x + dx, y + dy, u, v);
                let depth = 0.1 + 5.0 * random(i + 77);
                let at = |origin: Vec3, direction: Vec3| {
                    origin
                        + direction * ((depth - origin.dot(beam.axis)) / direction.dot(beam.axis))
                };
                let (off, bound) = match beam.cone {
                    Some(half_angle) => (angle_between(ray.direction, beam.direction), half_angle),
                    None => {
                        let off = at(ray.origin, ray.direction);
                        let off = off.distance(at(beam.origin, beam.direction));
                        (off, beam.radius(depth, depth))
                    }
                };
                worst = worst.max(off / bound);
                control = control.max(off / (0.5 * bound));
            }
            assert!(worst <= 1.0, "{worst}");
            assert!(control > 1.0, "control: half the radius is too little");
        }
    }
}
