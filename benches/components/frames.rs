//! Whole frames on the CPU, both estimators: 80 x 60 pixels of the room and the far scene at 16 rays per pixel, trees built before.

use std::path::Path;

use criterion::{Criterion, SamplingMode};
use mixray::bench::shrink;
use mixray::film::Picture;
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{BackendChoice, Choice, Estimator, SamplerKind, load};

use crate::processor_time::ProcessorTime;

const RAYS_PER_PIXEL: u32 = 16;
const SHRINK: u32 = 4;

pub fn frames(criterion: &mut Criterion<ProcessorTime>) {
    let mut group = criterion.benchmark_group("frames");
    group.sampling_mode(SamplingMode::Flat);
    for name in ["room", "far"] {
        for (estimator, sampler) in [
            (Estimator::Direct, SamplerKind::Sobol),
            (Estimator::Paper, SamplerKind::Jittered),
        ] {
            let mut renderer = renderer(name, estimator, sampler);
            group.bench_function(format!("{name}, {}", estimator.name()), |b| {
                b.iter(|| frame(&mut renderer));
            });
        }
    }
    group.finish();
}

fn renderer(name: &str, estimator: Estimator, sampler: SamplerKind) -> Renderer {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = load(&scenes.join(name).join("scene.toml")).expect("a scene of this repository");
    let mut scene = shrink(scene, SHRINK);
    scene.settings.backend = BackendChoice::Cpu;
    scene.settings.estimator = estimator;
    scene.settings.sampler = sampler;
    Renderer::new(scene, RendererOptions::default(), &Watcher::none())
        .expect("the CPU renders every scene")
}

/// Pilot, samples, real rays of edge pixels, composite.
fn frame(renderer: &mut Renderer) -> Picture {
    renderer
        .set_samples(RAYS_PER_PIXEL, 1, &Watcher::none())
        .expect("a number of rays in range");
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .expect("the CPU renders every scene");
    renderer.picture()
}
