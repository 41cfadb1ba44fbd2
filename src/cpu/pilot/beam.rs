//! All rays of one pixel at once, to prove what they cannot meet.

use glam::Vec3;

use crate::camera::lens::camera_ray;
use crate::packed::{Frame, PackedScene};

/// All rays of one pixel: at axis depth z they lie within `radius(z)` of the pinhole ray through the pixel's centre.
pub struct Beam {
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// View axis, unit.
    axis: Vec3,
    /// Pixel footprint at axis depth 1, metres.
    footprint: f32,
    aperture_radius: f32,
    inv_focus_distance: f32,
}

/// Rounding and the curvature of the distortion inside one pixel.
const FOOTPRINT_MARGIN: f32 = 1.1;
/// A square of half-width 1 reaches this far.
const SQUARE_REACH: f32 = std::f32::consts::SQRT_2;

impl Beam {
    pub fn of_pixel(frame: &Frame, pinhole: &Frame, pixel: u32) -> Self {
        let x = (pixel % frame.width) as f32;
        let y = (pixel / frame.width) as f32;
        let axis = -Vec3::new(
            frame.camera_back[0],
            frame.camera_back[1],
            frame.camera_back[2],
        );
        let centre = camera_ray(pinhole, x + 0.5, y + 0.5, 0.5, 0.5);
        let at_depth_1 = |d: Vec3| d / d.dot(axis).max(1e-6);
        let footprint = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .iter()
            .map(|(dx, dy)| {
                at_depth_1(camera_ray(pinhole, x + dx, y + dy, 0.5, 0.5).direction)
                    .distance(at_depth_1(centre.direction))
            })
            .fold(0.0, f32::max);
        Self {
            origin: centre.origin,
            direction: centre.direction,
            axis,
            footprint: footprint * FOOTPRINT_MARGIN,
            aperture_radius: frame.aperture_radius * SQUARE_REACH,
            inv_focus_distance: frame.inv_focus_distance,
        }
    }

    /// Largest distance from the centre ray over the axis depths z0..z1; convex in z, so the ends decide.
    fn radius(&self, z0: f32, z1: f32) -> f32 {
        let blur = |z: f32| {
            self.aperture_radius * (1.0 - z * self.inv_focus_distance).abs()
                + self.footprint * z.max(0.0)
        };
        blur(z0.max(0.0)).max(blur(z1.max(0.0)))
    }

    fn may_meet_sphere(&self, centre: Vec3, radius: f32) -> bool {
        let to = centre - self.origin;
        let z = to.dot(self.axis);
        if z + radius < 0.0 {
            return false;
        }
        let off_ray = (to - self.direction * to.dot(self.direction)).length();
        off_ray <= (radius + self.radius(z - radius, z + radius)) * 1.001
    }

    pub fn may_meet_spheres(&self, frame: &Frame) -> bool {
        frame.spheres[..frame.sphere_count as usize]
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
