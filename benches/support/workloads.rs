//! Meshes and rays on which traversal is timed; repeatable.

use glam::Vec3;
use mixray::accel::{Ray, WorldBvh};
use mixray::bench::stress::meshes::{self, Random, bumpy_sphere};

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

fn workload(name: &'static str, triangles: Vec<[Vec3; 3]>) -> Workload {
    let world = WorldBvh::build(&triangles, 0).expect("finite");
    let coherent: Vec<Ray> = (0..SIDE * SIDE)
        .map(|pixel| {
            let at = |i: usize| (i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
            let direction = Vec3::new(0.5 * at(pixel % SIDE), 0.5 * at(pixel / SIDE), -1.0);
            meshes::ray(Vec3::new(0.1, 0.2, 2.7), direction.normalize())
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
            incoherent.push(meshes::ray(point, bounced));
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
        workload("sphere-100k", bumpy_sphere(160, 316)),
        workload("sphere-1M", bumpy_sphere(500, 1002)),
        workload("slivers-100k", slivers(100_000)),
    ]
}
