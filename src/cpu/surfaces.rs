//! The diffuse real surface behind each pixel, for the preview filter: a few rays a pixel through the real world, without light.

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::Ray;
use crate::camera::lens::camera_ray;
use crate::film::RealSurface;
use crate::material::{Surface, surface_at};
use crate::packed::{
    Frame, MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, NONE, PIXEL_OUT_OF_REACH, PackedScene,
};

/// Pixel x and y, lens u and v.
type LensRay = [f32; 4];

const RAYS: [LensRay; 4] = [
    [0.375, 0.125, 0.25, 0.25],
    [0.875, 0.375, 0.75, 0.25],
    [0.125, 0.625, 0.25, 0.75],
    [0.625, 0.875, 0.75, 0.75],
];
/// The middles of both.
const MIDDLE: [LensRay; 1] = [[0.5; 4]];
/// Rougher surfaces reflect smoothly enough (GGX alpha, the square of the roughness).
const LEAST_ALPHA: f32 = 0.25;

/// One a pixel; none where nothing is within reach, or one of the rays meets nothing or no diffuse surface.
pub fn diffuse_surfaces(scene: &PackedScene) -> Vec<Option<RealSurface>> {
    let pixels = scene.pixels.par_iter().enumerate();
    pixels
        .map(|(pixel, info)| {
            let reached = info.flags & PIXEL_OUT_OF_REACH == 0;
            let surface = || behind(scene, &scene.frame, &RAYS, pixel as u32);
            reached.then(surface).flatten()
        })
        .collect()
}

/// The same of one ray through the middle of each pixel and of the lens, wherever virtual objects and the focus are.
pub fn diffuse_surfaces_of_pinhole(scene: &PackedScene) -> Vec<Option<RealSurface>> {
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let pixels = (0..scene.pixels.len() as u32).into_par_iter();
    pixels
        .map(|pixel| behind(scene, &pinhole, &MIDDLE, pixel))
        .collect()
}

fn behind(scene: &PackedScene, frame: &Frame, rays: &[LensRay], pixel: u32) -> Option<RealSurface> {
    let (x, y) = ((pixel % frame.width) as f32, (pixel / frame.width) as f32);
    let [back_x, back_y, back_z, _] = frame.camera_back;
    let axis = -Vec3::new(back_x, back_y, back_z);
    let [eye_x, eye_y, eye_z, _] = frame.camera_position;
    let eye = Vec3::new(eye_x, eye_y, eye_z);
    let (mut position, mut normal, mut albedo) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    for &[dx, dy, u, v] in rays {
        let ray = camera_ray(frame, x + dx, y + dy, u, v);
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
