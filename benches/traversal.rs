//! Rays a second on one CPU thread, closest and any hit, beside obvhs' own traversals of the same kind of tree.

#[path = "support/workloads.rs"]
mod workloads;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
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

fn traversal(criterion: &mut Criterion) {
    for work in workloads::workloads() {
        let peers = peers(&work.triangles);
        for (rays_name, rays) in [
            ("coherent", &work.coherent),
            ("incoherent", &work.incoherent),
        ] {
            let mut group = criterion.benchmark_group(format!("{}/{rays_name}", work.name));
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.sample_size(10);
            group.warm_up_time(Duration::from_millis(500));
            group.measurement_time(Duration::from_secs(1));
            let mut time = |name: &str, kind: &str, trace: &dyn Fn(&Ray) -> bool| {
                group.bench_function(BenchmarkId::new(kind, name), |bencher| {
                    bencher.iter(|| rays.iter().filter(|ray| trace(black_box(ray))).count());
                });
            };
            time("mixray", "closest", &|ray| work.world.closest(ray).is_hit());
            time("obvhs-bvh2", "closest", &|ray| {
                let mut hit = RayHit::none();
                let test =
                    |ray: &obvhs::ray::Ray, i: usize| peers.binary_triangles[i].intersect(ray);
                peers.binary.ray_traverse(peer_ray(ray), &mut hit, test)
            });
            time("obvhs-cwbvh", "closest", &|ray| {
                let mut hit = RayHit::none();
                let test = |ray: &obvhs::ray::Ray, i: usize| peers.wide_triangles[i].intersect(ray);
                peers.wide.ray_traverse(peer_ray(ray), &mut hit, test)
            });
            time("mixray", "any", &|ray| work.world.any(ray));
            time("obvhs-bvh2", "any", &|ray| {
                let test =
                    |ray: &obvhs::ray::Ray, i: usize| peers.binary_triangles[i].intersect(ray);
                !peers.binary.ray_traverse_miss(peer_ray(ray), test)
            });
            time("obvhs-cwbvh", "any", &|ray| {
                let test = |ray: &obvhs::ray::Ray, i: usize| peers.wide_triangles[i].intersect(ray);
                !peers.wide.ray_traverse_miss(peer_ray(ray), test)
            });
            group.finish();
        }
    }
}

criterion_group!(benches, traversal);
criterion_main!(benches);
