//! Albedo of the proxy estimated from the photograph, and the exposure that fits the proxy's light to it.
//!
//! A Lambertian point of albedo A under irradiance E shows A E / pi. E changes slowly, so it is estimated on a coarse grid with path tracing
//! through the real world, spread to all pixels by a filter that respects depth and normal, and A = Ic / (E / pi). Light between real surfaces
//! depends on A, so this is repeated.

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::{Hit, Ray};
use crate::camera::lens::camera_ray;
use crate::cpu::contribution::ESTIMATOR_DIRECT;
use crate::cpu::render::render_first_hit;
use crate::packed::{FRAME_AOVS, Frame, MATERIAL_PHOTO_ALBEDO, NONE, PackedScene};
use crate::scene::Photo;

/// Largest albedo: above it paths would hardly end, and no diffuse surface is whiter.
const MAX_ALBEDO: f32 = 0.98;
/// Albedo of the first round.
const FIRST_ALBEDO: f32 = 0.5;
/// Grid pitch of the irradiance estimate in pixels, and its rays per grid point.
const GRID_PITCH_PX: usize = 4;
const GRID_RAYS: u32 = 32;
const ROUNDS: usize = 2;
/// Half-width of the spreading filter in grid points; relative depth and normal tolerances.
const FILTER_RADIUS: isize = 3;
const DEPTH_TOLERANCE: f32 = 0.02;
const NORMAL_POWER: i32 = 16;

/// One pixel's first real surface along its pinhole ray.
#[derive(Clone, Copy)]
struct Seen {
    /// Metres along the view axis; 0: nothing, or nothing whose albedo is wanted.
    depth_m: f32,
    normal: Vec3,
}

/// Fills `scene.photo_albedo` and its median so that the converged Ir reproduces the photograph.
pub fn estimate_photo_albedo(scene: &mut PackedScene, photo: &Photo) {
    let seen = first_surfaces(scene, |flags| flags & MATERIAL_PHOTO_ALBEDO != 0);
    scene.photo_albedo = seen
        .iter()
        .map(|s| [FIRST_ALBEDO, FIRST_ALBEDO, FIRST_ALBEDO, s.depth_m])
        .collect();
    scene.frame.photo_albedo_median = [FIRST_ALBEDO, FIRST_ALBEDO, FIRST_ALBEDO, 0.0];
    let scale = scene.frame.exposure_scale;
    for _ in 0..ROUNDS {
        let light = light_on_surfaces(scene, &seen);
        for ((entry, s), (light, ic)) in scene
            .photo_albedo
            .iter_mut()
            .zip(&seen)
            .zip(light.iter().zip(&photo.linear))
        {
            if s.depth_m > 0.0 {
                for c in 0..3 {
                    entry[c] = (ic[c] / (light[c] * scale).max(1e-12)).clamp(0.0, MAX_ALBEDO);
                }
            }
        }
        scene.frame.photo_albedo_median = median(&scene.photo_albedo);
    }
}

/// log2 of the factor that fits the real radiance to the photograph over the proxy: the median of Ic / Ir in luminance.
pub fn fit_exposure_ev(scene: &mut PackedScene, photo: &Photo) -> Option<f64> {
    let seen = first_surfaces(scene, |_| true);
    // Nothing is known of the albedo yet: every point takes the median.
    scene.photo_albedo = vec![[0.0; 4]; seen.len()];
    scene.frame.photo_albedo_median = [FIRST_ALBEDO, FIRST_ALBEDO, FIRST_ALBEDO, 0.0];
    let grid = trace_grid(scene, &seen);
    let width = scene.frame.width as usize;
    let mut ratios: Vec<f64> = grid
        .points
        .iter()
        .filter_map(|p| {
            let point = p.as_ref()?;
            let ic = crate::math::luminance(Vec3::from(photo.linear[point.y * width + point.x]));
            let ir = crate::math::luminance(point.radiance);
            (ic > 0.0 && ir > 0.0).then(|| f64::from(ic) / f64::from(ir))
        })
        .collect();
    if ratios.is_empty() {
        return None;
    }
    let middle = ratios.len() / 2;
    let (_, ratio, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
    Some(ratio.log2())
}

fn first_surfaces(scene: &PackedScene, wanted: impl Fn(u32) -> bool + Sync) -> Vec<Seen> {
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let back = Vec3::from_slice(&scene.frame.camera_back[..3]);
    (0..scene.frame.width * scene.frame.height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (
                (pixel % pinhole.width) as f32 + 0.5,
                (pixel / pinhole.width) as f32 + 0.5,
            );
            let ray = camera_ray(&pinhole, x, y, 0.5, 0.5);
            let hit = scene.real_bvh.closest(&Ray {
                origin: ray.origin,
                direction: ray.direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
                skip: NONE,
            });
            if hit.triangle == NONE || !wanted(material_flags(scene, hit)) {
                return Seen {
                    depth_m: 0.0,
                    normal: Vec3::ZERO,
                };
            }
            Seen {
                depth_m: hit.t * -ray.direction.dot(back),
                normal: interpolated_normal(scene, hit),
            }
        })
        .collect()
}

fn material_flags(scene: &PackedScene, hit: Hit) -> u32 {
    scene.materials[scene.triangles[hit.triangle as usize].material as usize].flags
}

fn interpolated_normal(scene: &PackedScene, hit: Hit) -> Vec3 {
    let [a, b, c] = scene.triangles[hit.triangle as usize]
        .vertices
        .map(|v| Vec3::from_slice(&scene.vertices[v as usize].normal_v0[..3]));
    (a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v).normalize_or_zero()
}

/// One traced grid point.
struct GridPoint {
    x: usize,
    y: usize,
    radiance: Vec3,
    /// Radiance per unit of albedo: E / pi.
    light: Vec3,
}

struct Grid {
    width: usize,
    height: usize,
    points: Vec<Option<GridPoint>>,
}

/// Path traces the real world on the grid, with a pinhole.
fn trace_grid(scene: &mut PackedScene, seen: &[Seen]) -> Grid {
    let kept = scene.frame;
    scene.frame.aperture_radius = 0.0;
    scene.frame.flags |= FRAME_AOVS;
    scene.frame.rays_total = GRID_RAYS;
    scene.frame.estimator = ESTIMATOR_DIRECT;
    let (frame_width, frame_height) = (kept.width as usize, kept.height as usize);
    let (width, height) = (
        frame_width.div_ceil(GRID_PITCH_PX),
        frame_height.div_ceil(GRID_PITCH_PX),
    );
    let shared: &PackedScene = scene;
    let points = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let x = ((i % width) * GRID_PITCH_PX + GRID_PITCH_PX / 2).min(frame_width - 1);
            let y = ((i / width) * GRID_PITCH_PX + GRID_PITCH_PX / 2).min(frame_height - 1);
            let pixel = y * frame_width + x;
            if seen[pixel].depth_m <= 0.0 {
                return None;
            }
            let (mut radiance, mut albedo) = (Vec3::ZERO, Vec3::ZERO);
            for index in 0..GRID_RAYS {
                let (ir, a) = render_first_hit(shared, pixel as u32, index);
                radiance += ir;
                albedo += a;
            }
            let n = GRID_RAYS as f32;
            Some(GridPoint {
                x,
                y,
                radiance: radiance / n,
                light: radiance / albedo.max(Vec3::splat(1e-6)),
            })
        })
        .collect();
    scene.frame = kept;
    Grid {
        width,
        height,
        points,
    }
}

/// E / pi of every pixel with a wanted surface: the grid's estimates, weighted by distance, depth and normal.
fn light_on_surfaces(scene: &mut PackedScene, seen: &[Seen]) -> Vec<Vec3> {
    let grid = trace_grid(scene, seen);
    let width = scene.frame.width as usize;
    seen.par_iter()
        .enumerate()
        .map(|(pixel, s)| {
            if s.depth_m <= 0.0 {
                return Vec3::ZERO;
            }
            let (x, y) = (pixel % width, pixel / width);
            let (gx, gy) = ((x / GRID_PITCH_PX) as isize, (y / GRID_PITCH_PX) as isize);
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for dy in -FILTER_RADIUS..=FILTER_RADIUS {
                for dx in -FILTER_RADIUS..=FILTER_RADIUS {
                    let (cx, cy) = (gx + dx, gy + dy);
                    if cx < 0 || cy < 0 || cx >= grid.width as isize || cy >= grid.height as isize {
                        continue;
                    }
                    let Some(point) = &grid.points[cy as usize * grid.width + cx as usize] else {
                        continue;
                    };
                    let there = &seen[point.y * width + point.x];
                    let away =
                        (point.x as f32 - x as f32).powi(2) + (point.y as f32 - y as f32).powi(2);
                    let pitch = GRID_PITCH_PX as f32;
                    let depth_step = (there.depth_m - s.depth_m)
                        / (s.depth_m * DEPTH_TOLERANCE * (1.0 + away.sqrt() / pitch));
                    let weight = (-away / (2.0 * pitch * pitch)).exp()
                        * (-depth_step * depth_step).exp()
                        * there.normal.dot(s.normal).max(0.0).powi(NORMAL_POWER);
                    // Keeps a pixel whose neighbours are all unlike it defined.
                    let weight = weight + 1e-9;
                    sum += point.light * weight;
                    weights += weight;
                }
            }
            if weights > 0.0 {
                sum / weights
            } else {
                Vec3::ZERO
            }
        })
        .collect()
}

/// Channel by channel over the pixels that have an albedo.
fn median(entries: &[[f32; 4]]) -> [f32; 4] {
    let mut result = [FIRST_ALBEDO, FIRST_ALBEDO, FIRST_ALBEDO, 0.0];
    for (c, result) in result.iter_mut().enumerate().take(3) {
        let mut values: Vec<f32> = entries
            .iter()
            .filter(|e| e[3] > 0.0)
            .map(|e| e[c])
            .collect();
        if !values.is_empty() {
            let middle = values.len() / 2;
            *result = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
    }
    result
}
