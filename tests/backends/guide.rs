//! Paths that photons guide, on both backends.

use mixray::cpu::render::render;
use mixray::gpu::Features;
use mixray::gpu::harness::test_device;
use mixray::renderer::{Budget, RayCounts, Renderer, Watcher};

use super::agreement::{
    Difference, backend_for, empty_film, planes, render_all, render_on, renderer,
};
use crate::support::root;

const RAYS: u32 = 1;

/// A scene with mirror and glass once it has looked ahead, with that seed.
fn guided(seed: u32) -> Renderer {
    let path = root().join("scenes/sunny/scene.toml");
    let mut scene = mixray::scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
    scene.settings.seed = seed;
    let mut renderer = renderer(scene, false);
    renderer
        .advance(Budget::Rays(1), &Watcher::none())
        .expect("renders");
    renderer
}

fn on_the_cpu(renderer: &Renderer) -> Vec<Vec<f64>> {
    let mut film = empty_film(renderer, 0, false);
    render_all(renderer, &mut film, RAYS, |film, work| {
        render(renderer.packed(), film, work, &Watcher::none());
    });
    planes(renderer, &film)
}

#[test]
fn guided_paths_are_the_same_on_both_backends() {
    let Some(gpu) = test_device() else { return };
    let built = guided(1);
    assert!(Features::for_scene(built.packed()).guide);
    let expected = on_the_cpu(&built);
    let mut backend = backend_for(gpu, &built);
    let mut film = empty_film(&built, 0, false);
    render_all(&built, &mut film, RAYS, |film, work| {
        render_on(&mut backend, film, work, &mut RayCounts::default());
    });
    let difference = Difference::between(&expected, &planes(&built, &film));
    let outliers = difference.outliers.len();
    eprintln!("{outliers} outliers, averages {:.1e}", difference.average);
    assert!(difference.agrees(), "{outliers}, {}", difference.average);
    let control = Difference::between(&expected, &on_the_cpu(&guided(2)));
    assert!(!control.agrees(), "control: {}", control.average);
}
