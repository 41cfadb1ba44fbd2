//! Meshes and rays on which traversal is timed; repeatable.

use std::f32::consts::TAU;

use glam::Vec3;
use mixray::accel::{Ray, WorldBvh};
use mixray::packed::NONE;

use crate::displaced_sphere::displaced_sphere;

pub const SIDE: usize = 256;

pub struct Workload {
    pub name: &'static str,
    pub triangles: Vec<[Vec3; 3]>,
    pub world: WorldBvh,
    /// A pinhole camera's, row by row.
    pub coherent: Vec<Ray>,
    /// Cosine-distributed from the camera's hits, in random order.
    pub incoherent: Vec<Ray>,
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - Vec3::ONE
    }

    fn direction(&mut self) -> Vec3 {
        let (z, phi) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    }
}

/// Thin triangles in all directions in a cube.
fn slivers(count: usize) -> Vec<[Vec3; 3]> {
    let mut random = Random(1);
    (0..count)
        .map(|_| {
            let start = random.cube();
            let along = random.direction() * (0.02 + 0.1 * random.unit());
            [
                start,
                start + along,
                start + 0.5 * along + random.direction() * 0.002,
            ]
        })
        .collect()
}

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    }
}

fn workload(name: &'static str, triangles: Vec<[Vec3; 3]>) -> Workload {
    let world = WorldBvh::build(&triangles, 0).expect("finite");
    let coherent: Vec<Ray> = (0..SIDE * SIDE)
        .map(|pixel| {
            let at = |i: usize| (i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
            let direction = Vec3::new(0.5 * at(pixel % SIDE), 0.5 * at(pixel / SIDE), -1.0);
            ray(Vec3::new(0.1, 0.2, 2.7), direction.normalize())
        })
        .collect();
    let mut random = Random(2);
    let mut incoherent: Vec<Ray> = Vec::new();
    for ray in coherent.iter().cycle() {
        let hit = world.closest(ray);
        if hit.is_hit() {
            let [a, b, c] = triangles[hit.triangle as usize];
            let normal = (b - a).cross(c - a).normalize();
            let facing = if normal.dot(ray.direction) < 0.0 {
                normal
            } else {
                -normal
            };
            let point = ray.origin + ray.direction * hit.t + facing * 1e-4;
            let bounced = (facing + random.direction()).normalize_or(facing);
            incoherent.push(self::ray(point, bounced));
        }
        if incoherent.len() == SIDE * SIDE {
            break;
        }
    }
    for i in (1..incoherent.len()).rev() {
        incoherent.swap(i, random.bits() as usize % (i + 1));
    }
    Workload {
        name,
        triangles,
        world,
        coherent,
        incoherent,
    }
}

pub fn workloads() -> Vec<Workload> {
    vec![
        workload("sphere-100k", displaced_sphere(160, 316)),
        workload("sphere-1M", displaced_sphere(500, 1002)),
        workload("slivers-100k", slivers(100_000)),
    ]
}
