//! Albedo of the proxy estimated from the photograph, and the exposure that fits the proxy's light to it.
//!
//! A Lambertian point of albedo A under irradiance E shows A E / pi. E changes slowly, so it is estimated on a coarse grid with path tracing
//! through the real world, smoothed and spread to all pixels (`smoothing`), and A = Ic / (E / pi). Light between real surfaces depends on A, so
//! this is repeated.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::accel::{Hit, Ray};
use crate::camera::lens::{camera_project, camera_ray};
use crate::cpu::render::render_first_hit;
use crate::packed::{
    ESTIMATOR_DIRECT, FRAME_AOVS, FRAME_BOTH_SHADOWS, FRAME_NO_CONES, FRAME_NO_LAST_VERTEX, Frame,
    MATERIAL_PHOTO_ALBEDO, NONE, PHOTO_PATCHES, PackedScene,
};
use crate::scene::Photo;
use crate::work::{Meter, Phase, Watcher};
use smoothing::light_on_surfaces;

mod smoothing;
mod unoccluded;

/// How many rays are traced where.
#[derive(Clone, Copy)]
struct GridSpec {
    pitch_px: usize,
    /// Per grid point.
    rays: u32,
}

/// Largest albedo: above it paths would hardly end, and no diffuse surface is whiter.
const MAX_ALBEDO: f32 = 0.98;
/// Albedo of the first round.
const FIRST_ALBEDO: f32 = 0.5;
/// Grid of the exposure's fit.
const GRID: GridSpec = GridSpec {
    pitch_px: 4,
    rays: 32,
};
/// Grids of the irradiance estimate, round by round. The first only tells what light the surfaces send to each other. A deep shadow is a small
/// difference of large numbers, in which an error of 1% of the last one's light shows as 10 of 255 codes.
const ROUNDS: [GridSpec; 2] = [GridSpec { rays: 8, ..GRID }, GridSpec { rays: 128, ..GRID }];
/// Least grid pitch of an exposure that is only told, its grid points at the most, and its rays per grid point.
const ROUGH_PITCH_PX: usize = 24;
const ROUGH_POINTS: usize = 200;
const ROUGH_RAYS: u32 = 8;
/// Relative difference in depth up to which two places are one surface.
const DEPTH_TOLERANCE: f32 = 0.02;
/// Of a grid point's rays, whose differences tell how sure its light is.
const GROUPS: usize = 4;

/// One pixel's first real surface along its pinhole ray.
#[derive(Clone, Copy)]
struct Seen {
    /// Metres along the view axis; 0: nothing, or nothing whose albedo is wanted.
    depth_m: f32,
    /// Anchor-relative.
    position: Vec3,
    normal: Vec3,
    object: u32,
}

impl Seen {
    const NOTHING: Self = Self {
        depth_m: 0.0,
        position: Vec3::ZERO,
        normal: Vec3::ZERO,
        object: NONE,
    };
}

/// What the photograph shows of the proxy, and the light on it: what a photograph's albedo follows from.
pub struct PhotoLight {
    /// The camera that sees it, relative to the anchor.
    frame: Frame,
    anchor_m: [f64; 3],
    /// By pixel.
    seen: Vec<Seen>,
    /// Radiance per unit of albedo, by pixel.
    light: Vec<Vec3>,
}

/// Fills `scene.photo_albedo` so that the converged Ir reproduces the photograph; the light that was found, and the share of its pixels whose albedo
/// had to be limited, because the proxy's light and the photograph differ by more than any surface does.
pub fn estimate_photo_albedo(
    scene: &mut PackedScene,
    photo: &Photo,
    watcher: &Watcher<'_>,
) -> (PhotoLight, f64) {
    let seen = first_surfaces(scene, 1, |flags| flags & MATERIAL_PHOTO_ALBEDO != 0);
    scene.photo_albedo = unknown_albedo(scene, &seen);
    let mut estimate = PhotoLight {
        frame: scene.frame,
        anchor_m: scene.anchor_m,
        seen,
        light: Vec::new(),
    };
    let rays = ROUNDS.iter().map(|round| grid_rays(scene, round)).sum();
    let meter = Meter::begin(watcher, Phase::Albedo, rays);
    let mut limited = 0;
    for round in ROUNDS {
        let grid = trace_grid(scene, &estimate.seen, round, &meter);
        estimate.light = light_on_surfaces(scene, &estimate.seen, &grid, round.pitch_px);
        limited = estimate.set_albedo(scene, photo);
    }
    meter.end();
    let known = estimate.seen.iter().filter(|s| s.depth_m > 0.0).count();
    (estimate, limited as f64 / known.max(1) as f64)
}

impl PhotoLight {
    /// The albedo of another exposure or camera, without a ray of light: for a draft. Light that comes from one part of the proxy to another stays
    /// what it was, and what the first camera did not see lies in the mean light. What this camera sees; `None` if the anchor is another.
    pub fn take_up(&self, scene: &mut PackedScene, photo: &Photo) -> Option<Self> {
        if self.anchor_m != scene.anchor_m {
            return None;
        }
        let seen = first_surfaces(scene, 1, |flags| flags & MATERIAL_PHOTO_ALBEDO != 0);
        scene.photo_albedo = unknown_albedo(scene, &seen);
        let known = self.seen.iter().zip(&self.light);
        let (sum, count) = known
            .filter(|(s, _)| s.depth_m > 0.0)
            .fold((Vec3::ZERO, 0.0), |(sum, count), (_, light)| {
                (sum + *light, count + 1.0)
            });
        let mean = sum / f32::max(count, 1.0);
        let light = seen.par_iter().map(|s| self.light_at(s).unwrap_or(mean));
        let light = light.collect();
        let moved = Self {
            frame: scene.frame,
            anchor_m: scene.anchor_m,
            seen,
            light,
        };
        moved.set_albedo(scene, photo);
        Some(moved)
    }

    /// `None` where the camera did not see the point.
    fn light_at(&self, point: &Seen) -> Option<Vec3> {
        if point.depth_m <= 0.0 {
            return None;
        }
        let at = camera_project(&self.frame, point.position);
        if !at.valid {
            return None;
        }
        let pixel = at.py as usize * self.frame.width as usize + at.px as usize;
        let there = self.seen[pixel].depth_m;
        ((there - at.depth).abs() < DEPTH_TOLERANCE * at.depth).then(|| self.light[pixel])
    }

    /// The albedo at the scene's exposure; how many pixels' had to be limited.
    pub fn set_albedo(&self, scene: &mut PackedScene, photo: &Photo) -> usize {
        let mut limited = 0;
        let scale = scene.frame.exposure_scale;
        let records = scene.photo_albedo.iter_mut().zip(&self.seen);
        for ((entry, s), (light, ic)) in records.zip(self.light.iter().zip(&photo.linear)) {
            if s.depth_m > 0.0 {
                let wanted = wanted_albedo(*ic, *light * scale);
                limited += usize::from(is_limited(wanted));
                let albedo = wanted.clamp(Vec3::ZERO, Vec3::splat(MAX_ALBEDO));
                entry[..3].copy_from_slice(&albedo.to_array());
            }
        }
        let (of_pixels, of_objects) = scene.photo_albedo.split_at_mut(self.seen.len());
        set_patches(scene.frame.width, of_pixels, &self.seen, of_objects);
        limited
    }
}

fn wanted_albedo(shown: [f32; 3], light: Vec3) -> Vec3 {
    Vec3::from(shown) / light.max(Vec3::splat(1e-12))
}

fn is_limited(wanted: Vec3) -> bool {
    wanted.max_element() > MAX_ALBEDO || wanted == Vec3::ZERO
}

/// The share of [`estimate_photo_albedo`] from so few rays that it costs next to nothing.
pub fn roughly_limited_share(scene: &mut PackedScene, photo: &Photo) -> f64 {
    let grid = rough_grid(scene);
    let from_photo = |flags| flags & MATERIAL_PHOTO_ALBEDO != 0;
    let seen = first_surfaces(scene, grid.pitch_px, from_photo);
    scene.photo_albedo = unknown_albedo(scene, &seen);
    let rays = grid_rays(scene, &grid);
    let meter = Meter::begin(&Watcher::none(), Phase::Albedo, rays);
    let grid = trace_grid(scene, &seen, grid, &meter);
    meter.end();
    let (width, scale) = (scene.frame.width as usize, scene.frame.exposure_scale);
    let wanted: Vec<Vec3> = (grid.points.iter().flatten())
        .map(|p| wanted_albedo(photo.linear[p.y * width + p.x], p.light * scale))
        .collect();
    let limited = wanted.iter().filter(|wanted| is_limited(**wanted)).count();
    limited as f64 / wanted.len().max(1) as f64
}

/// log2 of the factor that fits the real radiance to the photograph over the proxy: the median of Ic / Ir in luminance.
pub fn fit_exposure_ev(
    scene: &mut PackedScene,
    photo: &Photo,
    watcher: &Watcher<'_>,
) -> Option<f64> {
    let seen = first_surfaces(scene, 1, |_| true);
    fit_exposure_on(scene, photo, &seen, GRID, watcher)
}

/// [`fit_exposure_ev`] from so few rays that it costs next to nothing.
pub fn roughly_fit_exposure_ev(scene: &mut PackedScene, photo: &Photo) -> Option<f64> {
    let grid = rough_grid(scene);
    let seen = first_surfaces(scene, grid.pitch_px, |_| true);
    fit_exposure_on(scene, photo, &seen, grid, &Watcher::none())
}

fn rough_grid(scene: &PackedScene) -> GridSpec {
    let pixels = scene.frame.width as usize * scene.frame.height as usize;
    GridSpec {
        pitch_px: pixels.div_ceil(ROUGH_POINTS).isqrt().max(ROUGH_PITCH_PX),
        rays: ROUGH_RAYS,
    }
}

fn fit_exposure_on(
    scene: &mut PackedScene,
    photo: &Photo,
    seen: &[Seen],
    grid: GridSpec,
    watcher: &Watcher<'_>,
) -> Option<f64> {
    scene.photo_albedo = unknown_albedo(scene, seen);
    let meter = Meter::begin(watcher, Phase::Exposure, grid_rays(scene, &grid));
    let grid = trace_grid(scene, seen, grid, &meter);
    meter.end();
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

/// Of every pixel that a grid of that pitch may ask for; of the others nothing.
fn first_surfaces(
    scene: &PackedScene,
    pitch_px: usize,
    wanted: impl Fn(u32) -> bool + Sync,
) -> Vec<Seen> {
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let back = Vec3::from_slice(&scene.frame.camera_back[..3]);
    (0..scene.frame.width * scene.frame.height)
        .into_par_iter()
        .map(|pixel| {
            let (column, row) = (pixel % pinhole.width, pixel / pinhole.width);
            let on_grid = |at: u32| at as usize % pitch_px == pitch_px / 2;
            if !(on_grid(column) && on_grid(row)) {
                return Seen::NOTHING;
            }
            let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
            let ray = camera_ray(&pinhole, x, y, 0.5, 0.5);
            let hit = scene.real_bvh.closest(&Ray {
                origin: ray.origin,
                direction: ray.direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
                skip: NONE,
            });
            if hit.triangle == NONE || !wanted(material_flags(scene, hit)) {
                return Seen::NOTHING;
            }
            Seen {
                depth_m: hit.t * -ray.direction.dot(back),
                position: ray.origin + ray.direction * hit.t,
                normal: interpolated_normal(scene, hit),
                object: scene.triangles[hit.triangle as usize].object,
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
    /// The same from each group of the rays.
    groups: [Vec3; GROUPS],
}

struct Grid {
    width: usize,
    height: usize,
    points: Vec<Option<GridPoint>>,
}

impl Grid {
    /// Places of the grid up to `reach` to either side of one.
    fn around(&self, x: usize, y: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let range =
            move |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
        range(y, height).flat_map(move |row| range(x, width).map(move |x| row * width + x))
    }

    /// Places at the same offset, up to `reach` to either side, from two of them.
    fn pairs(&self, a: usize, b: usize, reach: isize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let place = |at: usize, dx: isize, dy: isize| {
            let (x, y) = (
                (at % self.width) as isize + dx,
                (at / self.width) as isize + dy,
            );
            let inside = x >= 0 && y >= 0 && x < self.width as isize && y < self.height as isize;
            inside.then(|| y as usize * self.width + x as usize)
        };
        (-reach..=reach).flat_map(move |dy| {
            (-reach..=reach).filter_map(move |dx| Some((place(a, dx, dy)?, place(b, dx, dy)?)))
        })
    }
}

fn grid_size(scene: &PackedScene, pitch_px: usize) -> (usize, usize) {
    let points = |pixels: u32| (pixels as usize).div_ceil(pitch_px);
    (points(scene.frame.width), points(scene.frame.height))
}

fn grid_rays(scene: &PackedScene, spec: &GridSpec) -> u64 {
    let (width, height) = grid_size(scene, spec.pitch_px);
    width as u64 * height as u64 * u64::from(spec.rays)
}

/// Path traces the real world on the grid, with a pinhole.
fn trace_grid(scene: &mut PackedScene, seen: &[Seen], spec: GridSpec, meter: &Meter<'_>) -> Grid {
    let GridSpec { pitch_px, rays } = spec;
    let kept = scene.frame;
    scene.frame.aperture_radius = 0.0;
    // Savings left out do not change the estimate, whichever came first.
    scene.frame.flags &= !(FRAME_BOTH_SHADOWS | FRAME_NO_CONES | FRAME_NO_LAST_VERTEX);
    scene.frame.flags |= FRAME_AOVS;
    scene.frame.rays_total = rays;
    scene.frame.estimator = ESTIMATOR_DIRECT;
    let (frame_width, frame_height) = (kept.width as usize, kept.height as usize);
    let (width, height) = grid_size(scene, pitch_px);
    let shared: &PackedScene = scene;
    let points = (0..width * height)
        .into_par_iter()
        .map(|i| {
            meter.add(u64::from(rays));
            let x = ((i % width) * pitch_px + pitch_px / 2).min(frame_width - 1);
            let y = ((i / width) * pitch_px + pitch_px / 2).min(frame_height - 1);
            let pixel = y * frame_width + x;
            if seen[pixel].depth_m <= 0.0 {
                return None;
            }
            let mut sums = [(Vec3::ZERO, Vec3::ZERO); GROUPS];
            for index in 0..rays {
                let (ir, a) = render_first_hit(shared, pixel as u32, index);
                let (radiance, albedo) = &mut sums[index as usize * GROUPS / rays as usize];
                *radiance += ir;
                *albedo += a;
            }
            let per_albedo =
                |(radiance, albedo): (Vec3, Vec3)| radiance / albedo.max(Vec3::splat(1e-6));
            let all = (sums.iter()).fold((Vec3::ZERO, Vec3::ZERO), |all, sum| {
                (all.0 + sum.0, all.1 + sum.1)
            });
            Some(GridPoint {
                x,
                y,
                radiance: all.0 / rays as f32,
                light: per_albedo(all),
                groups: sums.map(per_albedo),
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

/// [`FIRST_ALBEDO`] for every pixel and every object.
fn unknown_albedo(scene: &PackedScene, seen: &[Seen]) -> Vec<[f32; 4]> {
    let first = |w: f32| [FIRST_ALBEDO, FIRST_ALBEDO, FIRST_ALBEDO, w];
    let objects = (scene.triangles.iter())
        .filter(|t| t.object != NONE)
        .map(|t| t.object + 1)
        .max()
        .unwrap_or(0);
    let of_pixels = seen.iter().map(|s| first(s.depth_m));
    let patches = (0..objects * PHOTO_PATCHES).flat_map(|_| [first(1.0), [0.0; 4]]);
    of_pixels.chain(patches).collect()
}

/// Pixels that see a part of an object.
#[derive(Clone, Copy, Default)]
struct Patch {
    pixels: f64,
    albedo: DVec3,
    position: DVec3,
    squared_position: f64,
}

impl Patch {
    fn add(&mut self, albedo: &[f32; 4], position: Vec3) {
        let position = position.as_dvec3();
        self.pixels += 1.0;
        self.albedo += Vec3::from_slice(&albedo[..3]).as_dvec3();
        self.position += position;
        self.squared_position += position.length_squared();
    }

    /// As in [`PackedScene::photo_albedo`].
    fn records(&self) -> [[f32; 4]; 2] {
        if self.pixels == 0.0 {
            return [[0.0; 4]; 2];
        }
        let inv = 1.0 / self.pixels;
        let (albedo, position) = (self.albedo * inv, self.position * inv);
        let spread = (self.squared_position * inv - position.length_squared()).max(0.0);
        [(albedo, self.pixels), (position, spread)]
            .map(|(v, w)| v.as_vec3().extend(w as f32).to_array())
    }
}

/// Means, all channels together so that no colour is invented, over a grid of [`PHOTO_PATCHES`] cells of the photograph; an object that no pixel
/// sees takes what is seen of all.
fn set_patches(width: u32, of_pixels: &[[f32; 4]], seen: &[Seen], of_objects: &mut [[f32; 4]]) {
    let side = PHOTO_PATCHES.isqrt() as usize;
    let width = width as usize;
    let height = of_pixels.len() / width;
    let per_object = PHOTO_PATCHES as usize;
    let mut all = vec![Patch::default(); per_object];
    let mut by_object = vec![Patch::default(); of_objects.len() / 2];
    for (pixel, (albedo, s)) in of_pixels.iter().zip(seen).enumerate() {
        if s.depth_m > 0.0 {
            let cell = pixel / width * side / height * side + pixel % width * side / width;
            all[cell].add(albedo, s.position);
            by_object[s.object as usize * per_object + cell].add(albedo, s.position);
        }
    }
    if all.iter().all(|patch| patch.pixels == 0.0) {
        return;
    }
    let records = of_objects.chunks_mut(2 * per_object);
    for (records, patches) in records.zip(by_object.chunks(per_object)) {
        let is_seen = patches.iter().any(|patch| patch.pixels > 0.0);
        let patches = if is_seen { patches } else { &all };
        let new = patches.iter().flat_map(Patch::records);
        records
            .iter_mut()
            .zip(new)
            .for_each(|(old, new)| *old = new);
    }
}

#[cfg(test)]
mod tests;
