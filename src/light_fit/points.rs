//! Where the photograph is compared with the proxy: a grid of cells, each with the point that its centre shows.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::{Hit, Ray};
use crate::camera::lens::{camera_project, camera_ray};
use crate::material::{Surface, surface_at};
use crate::math::luminance;
use crate::packed::{
    Frame, MATERIAL_PHOTO_ALBEDO, MATERIAL_QUAD_LIGHT, MATERIAL_UNLIT, NONE, PackedScene,
};
use crate::scene::Photo;

/// Cells of the grid, about.
const CELLS: f64 = 12_000.0;
/// Linear values of a photograph between which its pixels are taken to tell the light: above is clipped, below is noise.
const LEAST_SHOWN: f32 = 0.003;
const MOST_SHOWN: f32 = 0.95;
/// Relative difference in depth, and cosine between normals, across a cell beyond which it shows an edge of the proxy.
const DEPTH_STEP: f32 = 0.04;
const LEAST_AGREEMENT: f32 = 0.7;
/// Half-width in cells of the neighbourhood whose normals are averaged: scans have noisy ones.
const NORMAL_RADIUS: usize = 1;
/// What the camera sees is as deep as the proxy, relative.
const SEEN_DEPTH: f32 = 0.03;

/// A point of the proxy and what the photograph shows there.
#[derive(Clone, Debug)]
pub struct Point {
    /// Column and row of its cell.
    pub cell: [usize; 2],
    /// Anchor-relative, metres: where rays to the light begin.
    pub origin: Vec3,
    /// Rays begin this far from there, metres.
    pub t_min: f32,
    /// Geometric, towards the camera.
    pub facing: Vec3,
    /// Shading normal, unit.
    pub normal: Vec3,
    /// Mean of the cell, linear.
    pub shown: [f32; 3],
    /// Luminance of the albedo, where the scene tells it.
    pub albedo: Option<f32>,
    /// Of the scene as it is packed.
    pub material: u32,
}

/// The grid over the photograph.
pub struct Grid {
    pub pitch_px: usize,
    pub width: usize,
    pub height: usize,
    /// By cell: metres along the view axis, 0 without proxy.
    depth_m: Vec<f32>,
    /// By cell: mean of its pixels, linear.
    pub shown: Vec<[f32; 3]>,
    pub points: Vec<Point>,
    /// Index of a cell's point.
    pub point_of_cell: Vec<Option<u32>>,
    /// Mean luminance of what is shown over the proxy.
    pub mean_luminance: f32,
    /// Cells with proxy that are clipped, too dark, or at an edge of it.
    pub left_out: usize,
}

/// What the centre of a cell shows, before its neighbours are asked.
struct Seen {
    depth_m: f32,
    normal: Vec3,
    point: Option<Point>,
}

impl Grid {
    pub fn of(scene: &PackedScene, photo: &Photo) -> Self {
        let (photo_width, photo_height) = (photo.width as usize, photo.height as usize);
        let pitch_px = ((photo_width * photo_height) as f64 / CELLS).sqrt().round() as usize;
        let pitch_px = pitch_px.max(1);
        let (width, height) = (photo_width / pitch_px, photo_height / pitch_px);
        let cells: Vec<(Seen, [f32; 3])> = (0..width * height)
            .into_par_iter()
            .map(|cell| {
                let at = [cell % width, cell / width];
                let pixels = pixels_of(photo, at, pitch_px);
                (see(scene, at, pitch_px, &pixels), mean(&pixels))
            })
            .collect();
        let normals: Vec<Vec3> = (0..cells.len())
            .map(|cell| smooth_normal(&cells, width, cell))
            .collect();
        let mut grid = Self {
            pitch_px,
            width,
            height,
            depth_m: cells.iter().map(|(seen, _)| seen.depth_m).collect(),
            shown: cells.iter().map(|(_, shown)| *shown).collect(),
            points: Vec::new(),
            point_of_cell: vec![None; cells.len()],
            mean_luminance: 0.0,
            left_out: 0,
        };
        let (mut sum, mut count) = (0.0, 0);
        for (cell, (seen, shown)) in cells.into_iter().enumerate() {
            if seen.depth_m > 0.0 {
                sum += f64::from(luminance(shown.into()));
                count += 1;
            }
            match seen.point {
                Some(point) => {
                    grid.point_of_cell[cell] = Some(grid.points.len() as u32);
                    let normal = normals[cell];
                    grid.points.push(Point { normal, ..point });
                }
                None => grid.left_out += usize::from(seen.depth_m > 0.0),
            }
        }
        grid.mean_luminance = (sum / f64::from(count.max(1))) as f32;
        grid
    }

    /// Luminance that leaves a point of the proxy, in the photograph's units; `None`: the camera does not see it.
    pub fn luminance_at(&self, frame: &Frame, position: Vec3) -> Option<f32> {
        let seen = camera_project(frame, position);
        if !seen.valid {
            return None;
        }
        let cell = |at: f32, count: usize| (at as usize / self.pitch_px).min(count - 1);
        let cell = cell(seen.py, self.height) * self.width + cell(seen.px, self.width);
        let depth_m = self.depth_m[cell];
        let is_seen = (depth_m - seen.depth).abs() <= SEEN_DEPTH * seen.depth;
        is_seen.then(|| luminance(self.shown[cell].into()))
    }
}

fn pixels_of(photo: &Photo, [column, row]: [usize; 2], pitch_px: usize) -> Vec<[f32; 3]> {
    let width = photo.width as usize;
    (row * pitch_px..(row + 1) * pitch_px)
        .flat_map(|y| {
            let first = y * width + column * pitch_px;
            &photo.linear[first..first + pitch_px]
        })
        .copied()
        .collect()
}

fn mean(pixels: &[[f32; 3]]) -> [f32; 3] {
    [0, 1, 2].map(|c| pixels.iter().map(|p| p[c]).sum::<f32>() / pixels.len() as f32)
}

fn hit_at(scene: &PackedScene, x: f32, y: f32) -> Option<(Hit, Surface, f32)> {
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let ray = camera_ray(&pinhole, x, y, 0.5, 0.5);
    let hit = scene.real_bvh.closest(&Ray {
        origin: ray.origin,
        direction: ray.direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    });
    hit.is_hit().then(|| {
        let back = Vec3::from_slice(&scene.frame.camera_back[..3]);
        let depth_m = hit.t * -ray.direction.dot(back);
        (hit, surface_at(scene, hit, ray.direction), depth_m)
    })
}

fn see(scene: &PackedScene, at: [usize; 2], pitch_px: usize, pixels: &[[f32; 3]]) -> Seen {
    let [left, top] = at.map(|cell| (cell * pitch_px) as f32);
    let pitch = pitch_px as f32;
    let Some((hit, surface, depth_m)) = hit_at(scene, left + 0.5 * pitch, top + 0.5 * pitch) else {
        return Seen {
            depth_m: 0.0,
            normal: Vec3::ZERO,
            point: None,
        };
    };
    let normal = towards(surface.ns, surface.ng);
    let inner = [0.1, 0.9].map(|share| share * pitch);
    let is_whole = inner.iter().all(|dy| {
        inner.iter().all(|dx| {
            hit_at(scene, left + dx, top + dy).is_some_and(|(_, corner, corner_depth_m)| {
                (corner_depth_m - depth_m).abs() < DEPTH_STEP * depth_m
                    && corner.ng.dot(surface.ng) > LEAST_AGREEMENT
            })
        })
    });
    let luminance_shown = luminance(mean(pixels).into());
    let is_exposed = luminance_shown > LEAST_SHOWN
        && pixels
            .as_flattened()
            .iter()
            .all(|value| *value < MOST_SHOWN);
    let material = &scene.materials[surface.material as usize];
    let from_photo = material.flags & MATERIAL_PHOTO_ALBEDO != 0;
    let usable = (is_whole && is_exposed && is_matt(&surface, from_photo)).then(|| Point {
        cell: at,
        origin: surface.position + surface.ng * surface.error,
        t_min: scene.materials[scene.triangles[hit.triangle as usize].material as usize]
            .self_shadow_bias,
        facing: surface.ng,
        normal,
        shown: mean(pixels),
        albedo: (!from_photo).then(|| luminance(surface.base_color)),
        material: surface.material,
    });
    Seen {
        depth_m,
        normal,
        point: usable,
    }
}

/// Its colour follows the light that falls on it, whoever looks.
fn is_matt(surface: &Surface, from_photo: bool) -> bool {
    let shines = surface.emission != Vec3::ZERO
        || surface.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT) != 0;
    let is_lambertian = surface.metallic < 0.1
        && surface.transmission == 0.0
        && surface.coverage >= 1.0
        && luminance(surface.base_color) > 0.01;
    !shines && (from_photo || is_lambertian)
}

fn towards(normal: Vec3, facing: Vec3) -> Vec3 {
    if normal.dot(facing) < 0.0 {
        -normal
    } else {
        normal
    }
}

fn smooth_normal(cells: &[(Seen, [f32; 3])], width: usize, cell: usize) -> Vec3 {
    let height = cells.len() / width;
    let (x, y) = (cell % width, cell / width);
    let around = |at: usize, count: usize| {
        at.saturating_sub(NORMAL_RADIUS)..(at + NORMAL_RADIUS + 1).min(count)
    };
    let own = &cells[cell].0;
    let mut sum = Vec3::ZERO;
    for row in around(y, height) {
        for column in around(x, width) {
            let there = &cells[row * width + column].0;
            let near = (there.depth_m - own.depth_m).abs() < DEPTH_STEP * own.depth_m;
            if near && there.normal.dot(own.normal) > LEAST_AGREEMENT {
                sum += there.normal;
            }
        }
    }
    sum.try_normalize().unwrap_or(own.normal)
}

impl Point {
    /// ln of the luminance shown, times pi over the albedo where it is known: of the irradiance then, in the photograph's units.
    pub fn log_shown(&self) -> f64 {
        let shown = f64::from(luminance(self.shown.into()));
        match self.albedo {
            Some(albedo) => (shown * f64::from(PI / albedo)).ln(),
            None => shown.ln(),
        }
    }

    /// ln of red over green and of blue over green.
    pub fn chromaticity(&self) -> [f32; 2] {
        let [r, g, b] = self.shown.map(|value| value.max(1e-4));
        [(r / g).ln(), (b / g).ln()]
    }
}
