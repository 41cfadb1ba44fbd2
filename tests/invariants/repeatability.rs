//! Invariant 8: the same seed gives the same picture, whatever the threads, the passes and the ranges.

use mixray::renderer::{Budget, RenderError, Renderer, RendererOptions, Watcher};
use mixray::scene::{BackendChoice, SamplerKind, Scene};

use super::support::*;

const RAYS: u32 = 20;

/// Defocused edges in front of a wall, so that edge pixels are replayed, and a mirror, so that photons are traced.
fn defocused() -> Scene {
    let mut scene = scene(&format!(
        r#"{CAMERA}{TABLE}{LAMP}
[environment]
radiance = [0.2, 0.3, 0.4]

[lens]
aperture_radius_m = 0.08
focus_distance_m = 2.2

[[virtual]]
shape = "sphere"
segments = 24
scale = 0.35
translation = [0.1, 0.35, 0]
material = {{ base_color = [0.8, 0.5, 0.3], roughness = 0.3 }}

[[virtual]]
shape = "sphere"
segments = 24
scale = 0.15
translation = [-0.4, 0.15, 0.3]
material = {{ metallic = 1.0, roughness = 0.0 }}
"#
    ));
    scene.settings.rays_per_pixel = RAYS;
    scene
}

fn advance_by(renderer: &mut Renderer, rays_per_pixel: u64) {
    let pixels = u64::from(renderer.film().width) * u64::from(renderer.film().height);
    renderer
        .advance(Budget::Rays(rays_per_pixel * pixels), &Watcher::none())
        .expect("the render goes on");
}

fn threads_do_not_matter(backend: BackendChoice) {
    let scene = defocused();
    let with_threads = |scene: &Scene, threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a thread pool")
            .install(|| bits(&render(scene, backend).delivered().picture))
    };
    let one = with_threads(&scene, 1);
    assert_eq!(one, with_threads(&scene, 2));
    assert_eq!(one, with_threads(&scene, 5));
    let mut other = scene.clone();
    other.settings.seed += 1;
    assert_ne!(one, with_threads(&other, 1), "control: the seed shows");
}

fn passes_do_not_matter(backend: BackendChoice) {
    for sampler in [SamplerKind::Sobol, SamplerKind::Jittered, SamplerKind::Cmj] {
        let mut scene = defocused();
        scene.settings.sampler = sampler;
        let whole = bits(&render(&scene, backend).delivered().picture);
        for step in [1, 3, 7] {
            let mut renderer = renderer(&scene, backend, RendererOptions::default());
            while renderer.samples() < RAYS {
                advance_by(&mut renderer, step);
            }
            assert_eq!(
                whole,
                bits(&renderer.delivered().picture),
                "{sampler:?}, {step} rays a pixel at a time"
            );
        }
        let mut unfinished = renderer(&scene, backend, RendererOptions::default());
        advance_by(&mut unfinished, u64::from(RAYS) - 1);
        assert_ne!(
            whole,
            bits(&unfinished.delivered().picture),
            "control: a ray fewer shows"
        );
    }
}

/// Units in the last place between two finite numbers.
fn ulps(a: f32, b: f32) -> u64 {
    let ordered = |x: f32| {
        let bits = i64::from(x.to_bits() as i32);
        if bits < 0 {
            i64::from(i32::MIN) - bits
        } else {
            bits
        }
    };
    (ordered(a) - ordered(b)).unsigned_abs()
}

fn largest_ulps(a: &Renderer, b: &Renderer) -> u64 {
    a.picture()
        .linear
        .as_flattened()
        .iter()
        .zip(b.picture().linear.as_flattened())
        .map(|(&a, &b)| ulps(a, b))
        .max()
        .unwrap_or(0)
}

fn largest_difference(a: &Renderer, b: &Renderer) -> f32 {
    let [a, b] = [a, b].map(|renderer| renderer.delivered().picture.linear);
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn ranges_merge_to_the_whole(backend: BackendChoice) {
    for sampler in [SamplerKind::Sobol, SamplerKind::Jittered, SamplerKind::Cmj] {
        let mut scene = defocused();
        scene.settings.sampler = sampler;
        let whole = render(&scene, backend);
        let range = |from, to| {
            let options = RendererOptions {
                sample_range: Some((from, to)),
                ..RendererOptions::default()
            };
            let mut part = renderer(&scene, backend, options);
            complete(&mut part);
            part
        };
        for [first, second] in [[1, 12], [7, 13], [10, 19]] {
            let mut merged = range(first, second);
            // Later, then earlier.
            merged
                .merge(range(second, RAYS).film())
                .expect("the next range fits");
            merged
                .merge(range(0, first).film())
                .expect("the range before fits");
            assert_eq!(merged.samples(), RAYS);
            assert!((0..whole.film().pixels.len()).all(|i| !merged.film().needs_real(i)));
            let worst = largest_ulps(&whole, &merged);
            println!("{sampler:?}, cut at {first} and {second}: {worst} ulp");
            assert!(worst <= 2, "{worst} ulp");
            let apart = largest_difference(&whole, &merged);
            assert!(apart < 1e-6, "{apart} in what is delivered");
        }
        let part = range(0, RAYS - 1);
        assert!(
            largest_ulps(&whole, &part) > 1000 && largest_difference(&whole, &part) > 1e-4,
            "control: a ray fewer shows"
        );
    }
}

fn ranges_that_do_not_fit_are_refused(backend: BackendChoice) {
    let scene = defocused();
    let range = |from, to| RendererOptions {
        sample_range: Some((from, to)),
        ..RendererOptions::default()
    };
    for (from, to) in [(3, 3), (4, 2), (0, RAYS + 1)] {
        let refused = Renderer::new(scene.clone(), range(from, to), &Watcher::none());
        assert!(matches!(refused, Err(RenderError::SampleRange(..))));
    }
    let mut first = renderer(&scene, backend, range(0, 2));
    complete(&mut first);
    let mut third = renderer(&scene, backend, range(3, 4));
    complete(&mut third);
    assert!(matches!(
        first.merge(third.film()),
        Err(RenderError::Merge(_))
    ));
}

on_the_cpu!(
    threads_do_not_matter,
    passes_do_not_matter,
    ranges_merge_to_the_whole,
    ranges_that_do_not_fit_are_refused,
);
