//! One pair of sample values of each sampler: every sample of a pixel at 16 rays per pixel, pixel and lens.

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use mixray::camera::sampler::{SampleKey, sample_4d};
use mixray::packed::{SAMPLER_CMJ, SAMPLER_JITTERED, SAMPLER_SOBOL};

use crate::processor_time::ProcessorTime;

const SAMPLERS: [(&str, u32); 3] = [
    ("jittered", SAMPLER_JITTERED),
    ("cmj", SAMPLER_CMJ),
    ("sobol", SAMPLER_SOBOL),
];
const PIXELS: u32 = 1024;
const RAYS_PER_PIXEL: u32 = 16;

pub fn samplers(criterion: &mut Criterion<ProcessorTime>) {
    let mut group = criterion.benchmark_group("samplers");
    // A sample is two pairs.
    let pairs = 2 * u64::from(PIXELS) * u64::from(RAYS_PER_PIXEL);
    group.throughput(Throughput::Elements(pairs));
    for (name, sampler) in SAMPLERS {
        group.bench_function(name, |b| b.iter(|| sum_of(black_box(sampler))));
    }
    group.finish();
}

fn sum_of(sampler: u32) -> f32 {
    let keys = (0..PIXELS).flat_map(|pixel| {
        (0..RAYS_PER_PIXEL).map(move |index| SampleKey {
            pixel,
            index,
            total: RAYS_PER_PIXEL,
            seed: 1,
            sampler,
        })
    });
    keys.map(|key| sample_4d(key, 0).iter().sum::<f32>()).sum()
}
