//! All rays of one pixel at once, to prove what they cannot meet.

use glam::Vec3;

use super::blur::{Blur, FOOTPRINT_MARGIN, Sphere};
use super::patch::{Patch, in_world};
use crate::camera::lens::is_wide;
use crate::camera::shutter::{CameraPose, camera_pose, camera_pose_at};
use crate::math::normalize3;
use crate::packed::{FRAME_SHUTTER, Frame, SHUTTER_POSES};

/// All rays of one pixel: at axis depth z they lie within `blur.radius(z)` of the pinhole ray through the pixel's centre.
pub struct Beam {
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// View axis, unit.
    axis: Vec3,
    blur: Blur,
    /// Of a fisheye without an aperture, whose rays may look back: the half-angle of the cone that holds them, radians.
    cone: Option<f32>,
}

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
    /// `at`: the pixel's place in the patch.
    pub fn of_pixel(frame: &Frame, patch: &Patch, at: usize) -> Self {
        let poses = RowPoses::of(frame, patch.row_px(at));
        let middle = poses.all[0];
        let axis = -middle.back;
        let (look, corners) = patch.looks(at);
        let direction = normalize3(in_world(&middle, look));
        let at_depth_1 = |d: Vec3| d / d.dot(axis).max(1e-6);
        let ahead = at_depth_1(direction);
        let (mut footprint, mut shake) = (0.0f32, 0.0f32);
        for pose in &poses.all[..poses.count] {
            // What a step of the camera does to the ray at a given depth, and what the lens's plane does that turns with it.
            let step = pose.position.distance(middle.position);
            let turn = 2.0 * frame.aperture_radius * pose.back.distance(middle.back);
            for corner in corners.iter().filter(|_| !is_wide(frame)) {
                let direction = at_depth_1(in_world(pose, *corner));
                footprint = footprint.max(direction.distance(ahead));
                shake = shake.max((step + turn) * (1.0 + direction.length()));
            }
        }
        let cone = is_wide(frame).then(|| {
            let mut half_angle = 0.0f32;
            for pose in &poses.all[..poses.count] {
                shake = shake.max(pose.position.distance(middle.position));
                for corner in corners {
                    let corner = normalize3(in_world(pose, corner));
                    half_angle = half_angle.max(angle_between(corner, direction));
                }
            }
            half_angle * FOOTPRINT_MARGIN
        });
        Self {
            origin: middle.position,
            direction,
            axis,
            blur: Blur::of(frame, footprint * FOOTPRINT_MARGIN).shaken(shake * FOOTPRINT_MARGIN),
            cone,
        }
    }

    fn may_meet_sphere(&self, centre: Vec3, radius: f32) -> bool {
        let to = centre - self.origin;
        if let Some(half_angle) = self.cone {
            let reach = (radius + self.blur.shake) * 1.001;
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
        off_ray <= (radius + self.blur.radius(z - radius, z + radius)) * 1.001
    }

    pub fn may_meet_any(&self, spheres: &[Sphere]) -> bool {
        (spheres.iter()).any(|&(centre, radius)| self.may_meet_sphere(centre, radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::lens::camera_ray_from;
    use crate::cpu::pilot::patch::LensGrid;
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
            let frame = frame(aperture_radius_m);
            let grid = LensGrid::of(&frame);
            let (mut worst, mut control) = (0.0f32, 0.0f32);
            for i in 0..20_000 {
                let pixel = hash_u32(i) % (64 * 48);
                let (patch, at) = grid.place(&frame, pixel as usize);
                let beam = Beam::of_pixel(&frame, patch, at);
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
                        (off, beam.blur.radius(depth, depth))
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
