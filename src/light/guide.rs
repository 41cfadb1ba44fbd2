//! Where light comes from by way of smooth virtual objects, learnt from photons (after Jensen 1995). WGSL twin: `shaders/light/guide.wgsl`.
//!
//! What a mirror or a glass shows is lit by the same glass, and no path from the camera finds such light but by chance. Photons that landed in a
//! cell of space tell by which points of smooth surfaces they came; directions are then drawn in lobes about those points. Which lobes a place has
//! steers work, not the result: the density of the drawn directions is known exactly.

use glam::Vec3;

use crate::math::{INV_PI, dot3, hash_combine, length3, orthonormal_basis, safe_sqrt, sincos_2pi};
use crate::packed::PackedScene;
use crate::shared::shared;

shared! {
    /// Lobes of a cell, at most.
    pub const GUIDE_LOBES: u32 = 8;
    /// A cell is at most this many of its sides away from the smooth objects, squared; the widest have 2^levels times the narrowest's.
    const GUIDE_CELLS_AWAY: f32 = 64.0;
    const GUIDE_LEVELS: u32 = 16;
    const FARTHEST: f32 = f32::MAX;
    const LEAST_LENGTH: f32 = f32::MIN_POSITIVE;
    /// Share of the directions that are drawn in lobes, where there are any.
    pub const GUIDE_SHARE: f32 = 0.5;
}

/// The cell that holds a position, as level and place. Its side doubles with the distance from the smooth objects, for so light spreads.
pub fn guide_place(scene: &PackedScene, position: Vec3) -> [u32; 4] {
    let frame = &scene.frame;
    let mut nearest = FARTHEST;
    for i in 0..frame.photon_sphere_count {
        let sphere = frame.photon_spheres[i as usize];
        let apart = position - Vec3::new(sphere[0], sphere[1], sphere[2]);
        nearest = nearest.min(dot3(apart, apart));
    }
    let mut cells_per_m = frame.guide_cells_per_m;
    let mut level = 0;
    while level < GUIDE_LEVELS && nearest * cells_per_m * cells_per_m > GUIDE_CELLS_AWAY {
        cells_per_m *= 0.5;
        level += 1;
    }
    let [x, y, z] = (position * cells_per_m).floor().to_array();
    [level, x as i32 as u32, y as i32 as u32, z as i32 as u32]
}

/// First lobe of the cell that holds a position; cells of equal hash share their lobes.
pub fn guide_cell(scene: &PackedScene, position: Vec3) -> u32 {
    let [level, x, y, z] = guide_place(scene, position);
    let hash = hash_combine(hash_combine(hash_combine(level, x), y), z);
    (hash & (scene.frame.guide_cell_count - 1)) * GUIDE_LOBES
}

/// Lobes of a cell; they come first, the rest of its places is empty.
pub fn guide_count(scene: &PackedScene, cell: u32) -> u32 {
    let mut count = 0;
    while count < GUIDE_LOBES && scene.guide[(cell + count) as usize][3] > 0.0 {
        count += 1;
    }
    count
}

/// Unit, from a position to the point that a lobe is about.
fn lobe_axis(lobe: [f32; 4], position: Vec3) -> Vec3 {
    let to = Vec3::new(lobe[0], lobe[1], lobe[2]) - position;
    to / length3(to).max(LEAST_LENGTH)
}

/// Density, per solid angle, of the directions that a position's lobes give.
pub fn guide_pdf(scene: &PackedScene, cell: u32, position: Vec3, direction: Vec3) -> f32 {
    let count = guide_count(scene, cell);
    let mut sum = 0.0;
    for i in 0..count {
        let lobe = scene.guide[(cell + i) as usize];
        let apart = direction - lobe_axis(lobe, position);
        // 1 - cos of the angle between, without cancellation.
        if 0.5 * dot3(apart, apart) <= lobe[3] {
            sum += 1.0 / lobe[3];
        }
    }
    sum * (0.5 * INV_PI) / count.max(1) as f32
}

/// A direction in one of a position's lobes, of which there is at least one.
pub fn guide_sample(
    scene: &PackedScene,
    cell: u32,
    position: Vec3,
    choice: f32,
    u: [f32; 2],
) -> Vec3 {
    let count = guide_count(scene, cell);
    let chosen = ((choice * count as f32) as u32).min(count - 1);
    let lobe = scene.guide[(cell + chosen) as usize];
    let axis = lobe_axis(lobe, position);
    let drop = u[0] * lobe[3];
    let sin = safe_sqrt(drop * (2.0 - drop));
    let (sin_phi, cos_phi) = sincos_2pi(u[1]);
    let (tangent, bitangent) = orthonormal_basis(axis);
    tangent * (sin * cos_phi) + bitangent * (sin * sin_phi) + axis * (1.0 - drop)
}
