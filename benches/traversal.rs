//! Rays a second on one CPU thread, closest and any hit, beside obvhs' own traversals of the same kind of tree.

#[path = "support/obvhs_peer.rs"]
mod obvhs_peer;
#[path = "support/workloads.rs"]
mod workloads;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mixray::accel::Ray;
use obvhs_peer::ObvhsPeer;

fn traversal(criterion: &mut Criterion) {
    for work in workloads::workloads() {
        let peer = ObvhsPeer::new(&work.triangles);
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
                peer.binary_closest(ray).is_some()
            });
            time("obvhs-cwbvh", "closest", &|ray| {
                peer.wide_closest(ray).is_some()
            });
            time("mixray", "any", &|ray| work.world.any(ray));
            time("obvhs-bvh2", "any", &|ray| peer.binary_any(ray));
            time("obvhs-cwbvh", "any", &|ray| peer.wide_any(ray));
            group.finish();
        }
    }
}

criterion_group!(benches, traversal);
criterion_main!(benches);
