//! What each part costs, in processor seconds: tree builds, samplers, camera stages, whole frames.
//!
//!     cargo bench --bench components [-- build|samplers|stages|frames]
//!
//! Criterion keeps the last run under `target/criterion` and says whether this one differs from it.

mod builds;
mod frames;
mod processor_time;
mod samplers;
mod stages;

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use processor_time::ProcessorTime;

/// Few samples of a second: enough to see a change of a few percent, and all of it ends in two minutes.
fn quick() -> Criterion<ProcessorTime> {
    Criterion::default()
        .with_measurement(ProcessorTime)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
}

criterion_group! {
    name = components;
    config = quick();
    targets = builds::builds, samplers::samplers, stages::stages, frames::frames
}
criterion_main!(components);
