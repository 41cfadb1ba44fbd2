//! Rays alone: none may slip through a closed mesh, and every hit is the one that brute force in f64 finds.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::backend::{Backend, StressError};
use super::brute_force::judge;
use super::meshes::{Random, cuboid, random_ray, ray, slivers, soup, sphere};
use super::{At, Effort, Measured};
use crate::accel::{Ray, WorldBvh};

/// Rays made and traced at once.
const BATCH: usize = 1 << 20;
/// Rays from one random stream.
const STREAM: usize = 1 << 12;

/// A closed mesh, a point in its middle, and the half-sizes of a box about it that is wholly inside.
struct Closed {
    triangles: Vec<[Vec3; 3]>,
    middle: Vec3,
    inside: Vec3,
}

impl Closed {
    /// Moved and scaled vertex by vertex, so that neighbours still share their vertices bit for bit.
    fn new(triangles: Vec<[Vec3; 3]>, size: Vec3, middle: Vec3, inside: f32) -> Self {
        Self {
            triangles: triangles
                .into_iter()
                .map(|t| t.map(|v| v * size + middle))
                .collect(),
            middle,
            inside: size * inside,
        }
    }
}

/// Closed convex meshes: round, tiny, huge, far away, and with slivers of 1000:1.
fn closed_meshes() -> Vec<Closed> {
    let ball = || sphere(60, 120, 1.0);
    let one = Vec3::ONE;
    vec![
        Closed::new(ball(), one, Vec3::ZERO, 0.5),
        Closed::new(ball(), one * 1e-4, Vec3::ZERO, 0.5),
        Closed::new(ball(), one * 1e6, Vec3::ZERO, 0.5),
        Closed::new(ball(), one, Vec3::new(900.0, -300.0, 500.0), 0.5),
        Closed::new(ball(), Vec3::new(1.0, 1e-3, 1.0), Vec3::ZERO, 0.5),
        Closed::new(cuboid(one), Vec3::new(1e3, 1.0, 1.0), Vec3::ZERO, 0.5),
    ]
}

/// A ray from inside at a vertex, at the middle of an edge, or at any of its points.
fn edge_ray(mesh: &Closed, random: &mut Random) -> Ray {
    let triangle = &mesh.triangles[random.bits() as usize % mesh.triangles.len()];
    let corner = random.bits() as usize % 3;
    let (p, q) = (triangle[corner], triangle[(corner + 1) % 3]);
    let target = match random.bits() % 3 {
        0 => p,
        1 => 0.5 * (p + q),
        _ => p.lerp(q, random.unit()),
    };
    let origin = if random.bits().is_multiple_of(3) {
        mesh.middle
    } else {
        mesh.middle + random.cube() * mesh.inside
    };
    ray(origin, (target - origin).normalize())
}

/// Rays aimed exactly at shared edges and vertices that miss; half of them as closest, half as any-hit queries. Control: one triangle of each
/// mesh is missing.
pub(super) fn shared_edges(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let meshes = closed_meshes();
    let per_mesh = at.value as usize / meshes.len();
    let mut missed = 0;
    for (number, mesh) in meshes.iter().enumerate() {
        let mut built = mesh.triangles.clone();
        if at.control {
            built.swap_remove(built.len() / 2);
        }
        let world = WorldBvh::build(&built, 0)?;
        let mut done = 0;
        while done < per_mesh {
            let count = BATCH.min(per_mesh - done);
            let stream = |k: usize| {
                let seed = (number * 1_000_003 + done / STREAM + k) as u64;
                let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
                let rays = STREAM.min(count - k * STREAM);
                (0..rays)
                    .map(|_| edge_ray(mesh, &mut random))
                    .collect::<Vec<_>>()
            };
            let rays: Vec<Ray> = (0..count.div_ceil(STREAM))
                .into_par_iter()
                .flat_map_iter(stream)
                .collect();
            for (rays, any) in rays.chunks(rays.len().div_ceil(2)).zip([false, true]) {
                let hits = backend.hits(&world, rays, any)?;
                missed += hits.iter().filter(|hit| !hit.is_hit()).count();
            }
            done += count;
        }
    }
    Ok(Measured::figure(missed as f64))
}

/// Hits that brute force refuses. Control: every second triangle is missing.
fn judged(
    backend: &mut Backend,
    at: At,
    triangles: &[[Vec3; 3]],
    mut next_ray: impl FnMut(&mut Random) -> Ray,
) -> Result<Measured, StressError> {
    let count = match at.effort {
        Effort::Quick => 400,
        Effort::Full => 10_000,
    };
    let mut random = Random(99);
    let rays: Vec<Ray> = (0..count).map(|_| next_ray(&mut random)).collect();
    let mut built = triangles.to_vec();
    if at.control {
        // Their places stay taken, so that the others keep their numbers.
        for triangle in built.iter_mut().skip(1).step_by(2) {
            *triangle = triangle.map(|v| v + Vec3::splat(0.37));
        }
    }
    let world = WorldBvh::build(&built, 0)?;
    let hits = backend.hits(&world, &rays, false)?;
    let wrong = rays
        .par_iter()
        .zip(&hits)
        .filter(|(ray, hit)| judge(triangles, 0, ray, hit).is_err())
        .count();
    Ok(Measured::figure(wrong as f64))
}

fn scaled(mut triangles: Vec<[Vec3; 3]>, scale: f32) -> Vec<[Vec3; 3]> {
    triangles.iter_mut().flatten().for_each(|v| *v *= scale);
    triangles
}

pub(super) fn soup_at_scale(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scale = at.value as f32;
    let triangles = scaled(soup(1000, 0.2, 5), scale);
    judged(backend, at, &triangles, |random| {
        random_ray(random, Vec3::ZERO, scale)
    })
}

pub(super) fn soup_beside_an_outlier(
    backend: &mut Backend,
    at: At,
) -> Result<Measured, StressError> {
    let scale = at.value as f32;
    let mut triangles = scaled(soup(1000, 0.2, 6), scale);
    let far = 1e6 * scale;
    triangles.push([
        Vec3::new(-far, -3.0 * scale, -far),
        Vec3::new(far, -3.0 * scale, -far),
        Vec3::new(0.3 * far, -3.0 * scale, far),
    ]);
    triangles.push([far, 1.01 * far, 1.02 * far].map(|x| Vec3::new(x, far, 0.5 * x * x / far)));
    judged(backend, at, &triangles, |random| {
        random_ray(random, Vec3::ZERO, scale)
    })
}

/// Triangles as many times longer than wide as the setting says.
pub(super) fn sliver_soup(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let triangles = slivers(1000, 4, 1.0 / at.value as f32);
    judged(backend, at, &triangles, |random| {
        // Half of them at the slivers themselves, which few others meet.
        let any = random_ray(random, Vec3::ZERO, 1.0);
        let [a, b, _] = triangles[random.bits() as usize % triangles.len()];
        let target = a.lerp(b, random.unit());
        if random.bits().is_multiple_of(2) {
            ray(any.origin, (target - any.origin).normalize())
        } else {
            any
        }
    })
}

/// Rays that meet a tilted sheet of many triangles at this angle.
pub(super) fn grazing_rays(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.4, 0.9, 0.2);
    let side = 24;
    let corner = |i: i32, j: i32| {
        turn * (Vec3::new(i as f32, 0.0, j as f32) * (2.0 / side as f32) - Vec3::new(1.0, 0.0, 1.0))
    };
    let mut triangles = Vec::new();
    for i in 0..side {
        for j in 0..side {
            let [a, b, c, d] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| corner(i, j));
            triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    let angle = at.value as f32;
    judged(backend, at, &triangles, |random| {
        let target = Vec3::new(random.unit() - 0.5, 0.0, random.unit() - 0.5);
        let (sin, cos) = (std::f32::consts::TAU * random.unit()).sin_cos();
        let from = target + Vec3::new(cos, angle, sin) * (0.1 + random.unit());
        ray(turn * from, (turn * (target - from)).normalize())
    })
}
