//! The photograph as what lies behind virtual objects: what they mirror and let through of a world that is not modelled. WGSL twin:
//! `shaders/light/backdrop.wgsl`.

use glam::Vec3;

use super::environment::env_radiance;
use crate::camera::lens::camera_project;
use crate::packed::{Frame, PackedScene, xyz};
use crate::shared::shared;

shared! {
    /// Share of the photograph's width over which it fades to the environment at its borders.
    const BACKDROP_FADE: f32 = 0.05;
    /// Directions closer to across the view axis than this do not meet the backdrop.
    const LEAST_APPROACH: f32 = 1e-6;
}

/// A point of the backdrop that the ray meets; one in its direction where it is infinitely far, or lies behind the ray's origin.
fn backdrop_point(frame: &Frame, position: Vec3, direction: Vec3) -> Vec3 {
    let camera = xyz(frame.camera_position);
    let back = xyz(frame.camera_back);
    let inv_distance = frame.inv_backdrop_distance;
    // Of the position, in distances of the backdrop.
    let depth = (camera - position).dot(back) * inv_distance;
    let approach = -direction.dot(back);
    if inv_distance == 0.0 || depth >= 1.0 || approach < LEAST_APPROACH {
        return camera + direction;
    }
    position + direction * ((1.0 - depth) / (approach * inv_distance))
}

fn backdrop_texel(scene: &PackedScene, x: i32, y: i32) -> Vec3 {
    let column = x.clamp(0, scene.frame.width as i32 - 1) as u32;
    let row = y.clamp(0, scene.frame.height as i32 - 1) as u32;
    backdrop_of_pixel(scene, row * scene.frame.width + column)
}

/// Radiance of the scene that the photograph's pixel shows.
pub fn backdrop_of_pixel(scene: &PackedScene, pixel: u32) -> Vec3 {
    let at = 3 * pixel as usize;
    let shown = Vec3::new(
        scene.backdrop[at],
        scene.backdrop[at + 1],
        scene.backdrop[at + 2],
    );
    shown / scene.frame.exposure_scale
}

/// Radiance that arrives at `position` from `direction` (unit): what the photograph shows there, else the environment.
pub fn backdrop_radiance(scene: &PackedScene, position: Vec3, direction: Vec3) -> Vec3 {
    let frame = &scene.frame;
    let environment = env_radiance(scene, direction);
    let seen = camera_project(frame, backdrop_point(frame, position, direction));
    if !seen.valid {
        return environment;
    }
    let (width, height) = (frame.width as f32, frame.height as f32);
    let border = seen
        .px
        .min(width - seen.px)
        .min(seen.py.min(height - seen.py));
    let share = (border / (BACKDROP_FADE * width)).min(1.0);
    let (x, y) = (seen.px - 0.5, seen.py - 0.5);
    let (column, row) = (x.floor(), y.floor());
    let (i, j) = (column as i32, row as i32);
    let (fx, fy) = (x - column, y - row);
    let (c00, c10) = (backdrop_texel(scene, i, j), backdrop_texel(scene, i + 1, j));
    let (c01, c11) = (
        backdrop_texel(scene, i, j + 1),
        backdrop_texel(scene, i + 1, j + 1),
    );
    let top = c00 + (c10 - c00) * fx;
    let bottom = c01 + (c11 - c01) * fx;
    let photograph = top + (bottom - top) * fy;
    environment + (photograph - environment) * share
}
