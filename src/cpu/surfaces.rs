//! The diffuse real surface behind each pixel, for the preview filter: a few rays a pixel through the real world, without light.

use glam::Vec3;
use rayon::prelude::*;

use super::pilot::{Certainty, LensGrid, each_patch, in_world, real_sphere};
use crate::accel::Ray;
use crate::camera::lens::{CameraRay, camera_ray};
use crate::camera::shutter::camera_pose;
use crate::film::RealSurface;
use crate::material::{Surface, surface_at};
use crate::math::normalize3;
use crate::packed::{
    MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, NONE, PIXEL_OUT_OF_REACH, PackedScene,
};

/// Pixel x and y, lens u and v.
const RAYS: [[f32; 4]; 4] = [
    [0.375, 0.125, 0.25, 0.25],
    [0.875, 0.375, 0.75, 0.25],
    [0.125, 0.625, 0.25, 0.75],
    [0.625, 0.875, 0.75, 0.75],
];
/// Rougher surfaces reflect smoothly enough (GGX alpha, the square of the roughness).
const LEAST_ALPHA: f32 = 0.25;

/// One a pixel; none where nothing is within reach, or one of the rays meets nothing or no diffuse surface.
pub fn diffuse_surfaces(scene: &PackedScene) -> Vec<Option<RealSurface>> {
    let frame = &scene.frame;
    let pixels = scene.pixels.par_iter().enumerate();
    pixels
        .map(|(pixel, info)| {
            let (x, y) = (pixel as u32 % frame.width, pixel as u32 / frame.width);
            let ray =
                |[dx, dy, u, v]: [f32; 4]| camera_ray(frame, x as f32 + dx, y as f32 + dy, u, v);
            let reached = info.flags & PIXEL_OUT_OF_REACH == 0;
            reached.then(|| behind(scene, &RAYS.map(ray))).flatten()
        })
        .collect()
}

/// The same of one ray through the middle of each pixel and of the lens, wherever virtual objects and the focus are. `grid`: as for the pilot.
pub fn diffuse_surfaces_of_pinhole(
    scene: &PackedScene,
    grid: Option<&LensGrid>,
) -> Vec<Option<RealSurface>> {
    let frame = &scene.frame;
    let pose = camera_pose(frame);
    let found = each_patch(frame, grid, |patch| {
        let meets = |sphere| patch.meets_sphere(frame, &pose, sphere);
        if real_sphere(scene).is_none_or(|sphere| meets(sphere) == Certainty::Never) {
            return Vec::new();
        }
        let pixels = patch.pixels(frame).enumerate();
        pixels
            .map(|(at, pixel)| {
                let (centre, _) = patch.looks(at);
                let ray = CameraRay {
                    origin: pose.position,
                    direction: normalize3(in_world(&pose, centre)),
                };
                (pixel, behind(scene, &[ray]))
            })
            .collect()
    });
    let mut surfaces = vec![None; frame.width as usize * frame.height as usize];
    for (pixel, surface) in found.into_iter().flatten() {
        surfaces[pixel] = surface;
    }
    surfaces
}

fn behind(scene: &PackedScene, rays: &[CameraRay]) -> Option<RealSurface> {
    let frame = &scene.frame;
    let [back_x, back_y, back_z, _] = frame.camera_back;
    let axis = -Vec3::new(back_x, back_y, back_z);
    let [eye_x, eye_y, eye_z, _] = frame.camera_position;
    let eye = Vec3::new(eye_x, eye_y, eye_z);
    let (mut position, mut normal, mut albedo) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    for ray in rays {
        let hit = scene.real_bvh.closest(&Ray {
            origin: ray.origin,
            direction: ray.direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
            skip: NONE,
        });
        if hit.triangle == NONE {
            return None;
        }
        let surface = surface_at(scene, hit, ray.direction);
        if !is_diffuse(&surface) {
            return None;
        }
        position += surface.position;
        normal += surface.ns;
        albedo += surface.base_color;
    }
    let share = 1.0 / rays.len() as f32;
    let position = position * share;
    Some(RealSurface {
        position,
        depth_m: (position - eye).dot(axis),
        normal: normal.normalize_or_zero(),
        albedo: albedo * share,
    })
}

fn is_diffuse(surface: &Surface) -> bool {
    if surface.flags & MATERIAL_QUAD_LIGHT != 0 {
        return false;
    }
    let rough = surface.metallic == 0.0
        && surface.transmission == 0.0
        && surface.clearcoat == 0.0
        && surface.ggx_alpha >= LEAST_ALPHA;
    surface.flags & MATERIAL_LAMBERTIAN != 0 || rough
}
