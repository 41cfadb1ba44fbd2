//! The photograph as what virtual objects show of the world that is not modelled.

use glam::Vec3;

use crate::accel::Ray;
use crate::camera::lens::camera_ray;
use crate::packed::{
    FRAME_BACKDROP, Frame, MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_UNLIT, NONE,
    PackedScene,
};
use crate::scene::{Backdrop, Photo};

/// Between the pixels whose depth is looked at.
const PITCH_PX: usize = 8;

impl PackedScene {
    /// Shows the photograph, of the frame's size, to the paths that may see it. Wants camera and geometry packed.
    pub fn set_backdrop(&mut self, photo: Option<&Photo>, backdrop: Backdrop) {
        self.frame.flags &= !FRAME_BACKDROP;
        self.backdrop.clear();
        let (Some(photo), Backdrop::Photograph(distance_m)) = (photo, backdrop) else {
            return;
        };
        if !self.is_looked_through() {
            return;
        }
        self.frame.flags |= FRAME_BACKDROP;
        (self.backdrop).extend(photo.linear.iter().flatten());
        let distance_m = distance_m.or_else(|| self.median_depth_m());
        self.frame.inv_backdrop_distance = distance_m.map_or(0.0, |m| (1.0 / m) as f32);
    }

    /// Whether something virtual mirrors or lets light through.
    fn is_looked_through(&self) -> bool {
        let plain = MATERIAL_LAMBERTIAN | MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;
        let added = &self.triangles[self.frame.real_triangle_count as usize..];
        (added.iter()).any(|t| self.materials[t.material as usize].flags & plain == 0)
    }

    /// Of the real world along the view axis, over the picture; nothing where none of it is seen.
    fn median_depth_m(&self) -> Option<f64> {
        let pinhole = Frame {
            aperture_radius: 0.0,
            ..self.frame
        };
        let back = Vec3::from_slice(&pinhole.camera_back[..3]);
        let depth_of = |x: u32, y: u32| {
            let ray = camera_ray(&pinhole, x as f32 + 0.5, y as f32 + 0.5, 0.5, 0.5);
            let hit = self.real_bvh.closest(&Ray {
                origin: ray.origin,
                direction: ray.direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
                skip: NONE,
            });
            (hit.triangle != NONE).then(|| -ray.direction.dot(back) * hit.t)
        };
        let rows = (0..pinhole.height).step_by(PITCH_PX);
        let mut depths: Vec<f32> = rows
            .flat_map(|y| (0..pinhole.width).step_by(PITCH_PX).map(move |x| (x, y)))
            .filter_map(|(x, y)| depth_of(x, y))
            .collect();
        if depths.is_empty() {
            return None;
        }
        let middle = depths.len() / 2;
        let (_, median, _) = depths.select_nth_unstable_by(middle, f32::total_cmp);
        Some(f64::from(*median))
    }
}
