//! Which light reaches which point: rays from the points into all directions, and towards a sun.

use glam::Vec3;
use rayon::prelude::*;

use super::directions::{COUNT, SOLID_ANGLE};
use super::points::{Grid, Point};
use crate::accel::Ray;
use crate::packed::{NONE, PackedScene};

/// What rays found, by point.
pub struct Openness {
    /// Bit i: nothing of the proxy is met along direction i, which lies above the surface.
    open: Vec<[u64; COUNT / 64]>,
    /// Irradiance from what of the proxy is met, as the photograph shows it.
    pub from_proxy: Vec<f32>,
    /// The part of it that comes from where the camera does not see, and is taken to be as bright as the rest in the mean.
    pub from_unseen: Vec<f32>,
}

fn ray(point: &Point, direction: Vec3) -> Ray {
    Ray {
        origin: point.origin,
        direction,
        t_min: point.t_min,
        t_max: f32::INFINITY,
        skip: NONE,
    }
}

/// Cosine at the shading normal; 0 for light from below the surface.
fn cosine(point: &Point, direction: Vec3) -> f32 {
    if point.facing.dot(direction) <= 0.0 {
        return 0.0;
    }
    point.normal.dot(direction).max(0.0)
}

impl Openness {
    pub fn of(scene: &PackedScene, grid: &Grid, directions: &[Vec3]) -> Self {
        let found: Vec<([u64; COUNT / 64], [f32; 2])> = (grid.points.par_iter())
            .map(|point| {
                let mut open = [0; COUNT / 64];
                let (mut from_seen, mut from_unseen) = (0.0, 0.0);
                for (i, direction) in directions.iter().enumerate() {
                    let cosine = cosine(point, *direction);
                    if cosine == 0.0 {
                        continue;
                    }
                    let hit = scene.real_bvh.closest(&ray(point, *direction));
                    if hit.is_hit() {
                        let there = point.origin + *direction * hit.t;
                        match grid.luminance_at(&scene.frame, there) {
                            Some(shown) => from_seen += cosine * shown,
                            None => from_unseen += cosine * grid.mean_luminance,
                        }
                    } else {
                        open[i / 64] |= 1 << (i % 64);
                    }
                }
                let from_proxy = from_seen + from_unseen;
                (
                    open,
                    [from_proxy, from_unseen].map(|light| light * SOLID_ANGLE),
                )
            })
            .collect();
        let (open, light): (_, Vec<[f32; 2]>) = found.into_iter().unzip();
        Self {
            open,
            from_proxy: light.iter().map(|[all, _]| *all).collect(),
            from_unseen: light.iter().map(|[_, unseen]| *unseen).collect(),
        }
    }

    fn is_open(&self, point: usize, direction: usize) -> bool {
        self.open[point][direction / 64] & (1 << (direction % 64)) != 0
    }

    /// Irradiance of every point, by rotation of the light that arrives from about each direction.
    pub fn irradiance(
        &self,
        points: &[Point],
        directions: &[Vec3],
        light_by_rotation: &[Vec<f32>],
    ) -> Vec<Vec<f32>> {
        let rotations = light_by_rotation.len();
        // All rotations of a direction side by side.
        let by_direction: Vec<f32> = (0..COUNT)
            .flat_map(|i| light_by_rotation.iter().map(move |light| light[i]))
            .collect();
        let by_point: Vec<Vec<f32>> = (points.par_iter().enumerate())
            .map(|(at, point)| {
                let mut sums = vec![0.0; rotations];
                for (i, direction) in directions.iter().enumerate() {
                    if self.is_open(at, i) {
                        let cosine = cosine(point, *direction);
                        let light = &by_direction[i * rotations..(i + 1) * rotations];
                        for (sum, light) in sums.iter_mut().zip(light) {
                            *sum += cosine * light;
                        }
                    }
                }
                sums
            })
            .collect();
        (0..rotations)
            .map(|rotation| by_point.iter().map(|sums| sums[rotation]).collect())
            .collect()
    }

    /// Irradiance of every point by a sun in direction `index`, of one unit across its light.
    pub fn of_direction(&self, points: &[Point], directions: &[Vec3], index: usize) -> Vec<f32> {
        let direction = directions[index];
        let cosine_if_open = |(at, point)| match self.is_open(at, index) {
            true => cosine(point, direction),
            false => 0.0,
        };
        points.iter().enumerate().map(cosine_if_open).collect()
    }
}

/// Irradiance of every point by a sun of one unit across its light; `direction` leads to it.
pub fn sunlight(scene: &PackedScene, points: &[Point], direction: Vec3) -> Vec<f32> {
    points
        .par_iter()
        .map(|point| {
            let cosine = cosine(point, direction);
            if cosine == 0.0 || scene.real_bvh.any(&ray(point, direction)) {
                return 0.0;
            }
            cosine
        })
        .collect()
}
