//! A tree over a bumpy sphere of 1e3 to 1e6 triangles, on one thread: from corners to what the CPU traverses.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};
use mixray::accel::WorldBvh;
use mixray::bench::stress::meshes::bumpy_sphere;

use crate::processor_time::ProcessorTime;

/// Rings and segments; twice their product is the number of triangles.
const GRIDS: [(usize, usize); 4] = [(16, 32), (50, 100), (160, 316), (500, 1002)];

pub fn builds(criterion: &mut Criterion<ProcessorTime>) {
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("build");
    group.sampling_mode(SamplingMode::Flat);
    for (rings, segments) in GRIDS {
        let triangles = bumpy_sphere(rings, segments);
        let count = triangles.len();
        group.throughput(Throughput::Elements(count as u64));
        group.bench_with_input(BenchmarkId::from_parameter(count), &triangles, |b, t| {
            one_thread.install(|| b.iter(|| WorldBvh::build(black_box(t), 0).expect("finite")));
        });
    }
    group.finish();
}
