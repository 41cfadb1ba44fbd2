//! Rays a second of processor time on one thread, closest and any hit, beside obvhs' own traversals of the same kind of tree.

#[path = "support/workloads.rs"]
mod workloads;

#[path = "support/cpu_time.rs"]
mod cpu_time;

use std::hint::black_box;
use std::time::Duration;

use cpu_time::thread_cpu_secs;
use glam::Vec3A;
use mixray::accel::Ray;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    rt_triangle::RtTriangle,
    triangle::Triangle,
};

struct Peers {
    binary: Bvh2,
    binary_triangles: Vec<RtTriangle>,
    wide: CwBvh,
    wide_triangles: Vec<RtTriangle>,
}

fn peers(triangles: &[[glam::Vec3; 3]]) -> Peers {
    let triangles: Vec<Triangle> = triangles
        .iter()
        .map(|&[a, b, c]| Triangle {
            v0: a.into(),
            v1: b.into(),
            v2: c.into(),
        })
        .collect();
    let settings = BvhBuildParams::medium_build();
    let mut build_time = Duration::ZERO;
    let binary = build_bvh2_from_tris(&triangles, settings, &mut build_time);
    let wide = build_cwbvh_from_tris(&triangles, settings, &mut build_time);
    let in_order = |indices: &[u32]| -> Vec<RtTriangle> {
        let of = |&i: &u32| RtTriangle::from(&triangles[i as usize]);
        indices.iter().map(of).collect()
    };
    Peers {
        binary_triangles: in_order(&binary.primitive_indices),
        wide_triangles: in_order(&wide.primitive_indices),
        binary,
        wide,
    }
}

fn peer_ray(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(
        Vec3A::from(ray.origin),
        Vec3A::from(ray.direction),
        ray.t_min,
        ray.t_max,
    )
}

/// A name and whether a ray meets anything.
type Tracer<'a> = (&'a str, &'a dyn Fn(&Ray) -> bool);

/// Timed passes over the rays, after one to warm up. The tracers take turns, so that what slows the machine meets all alike.
const PASSES: usize = 11;

/// Prints a table row for each tracer: median, lowest and highest of the passes in Mrays/s, and the median over mixray's.
fn compare(label: &str, rays: &[Ray], tracers: &[Tracer]) {
    let mut speeds = vec![Vec::new(); tracers.len()];
    for pass in 0..=PASSES {
        for ((_, trace), speeds) in tracers.iter().zip(&mut speeds) {
            let start = thread_cpu_secs();
            black_box(rays.iter().filter(|ray| trace(black_box(ray))).count());
            let speed = rays.len() as f64 * 1e-6 / (thread_cpu_secs() - start);
            if pass > 0 {
                speeds.push(speed);
            }
        }
    }
    for speeds in &mut speeds {
        speeds.sort_by(f64::total_cmp);
    }
    let mixray = speeds[0][PASSES / 2];
    for ((name, _), speeds) in tracers.iter().zip(&speeds) {
        let median = speeds[PASSES / 2];
        let (lowest, highest) = (speeds[0], speeds[PASSES - 1]);
        println!(
            "| {label} | {name} | {median:.2} | {lowest:.2} to {highest:.2} | {:.2} |",
            median / mixray
        );
    }
}

fn main() {
    println!("| rays | tracer | Mrays/s | spread | of mixray's |");
    println!("| --- | --- | --- | --- | --- |");
    for work in workloads::workloads() {
        let peers = peers(&work.triangles);
        let binary = |ray: &obvhs::ray::Ray, i: usize| peers.binary_triangles[i].intersect(ray);
        let wide = |ray: &obvhs::ray::Ray, i: usize| peers.wide_triangles[i].intersect(ray);
        for (rays_name, rays) in [
            ("coherent", &work.coherent),
            ("incoherent", &work.incoherent),
        ] {
            compare(
                &format!("{}, {rays_name}, closest", work.name),
                rays,
                &[
                    ("mixray", &|ray| work.world.closest(ray).is_hit()),
                    ("obvhs BVH2", &|ray| {
                        (peers.binary).ray_traverse(peer_ray(ray), &mut RayHit::none(), binary)
                    }),
                    ("obvhs CWBVH", &|ray| {
                        (peers.wide).ray_traverse(peer_ray(ray), &mut RayHit::none(), wide)
                    }),
                ],
            );
            compare(
                &format!("{}, {rays_name}, any", work.name),
                rays,
                &[
                    ("mixray", &|ray| work.world.any(ray)),
                    ("obvhs BVH2", &|ray| {
                        !peers.binary.ray_traverse_miss(peer_ray(ray), binary)
                    }),
                    ("obvhs CWBVH", &|ray| {
                        !peers.wide.ray_traverse_miss(peer_ray(ray), wide)
                    }),
                ],
            );
        }
    }
}
