//! What a device does to a render: batches, loss, limits.

use std::sync::Arc;

use mixray::film::Film;
use mixray::gpu::{AdapterChoice, GpuBackend, GpuDevice, GpuError, harness::test_device};
use mixray::renderer::{Budget, RayCounts, Renderer, Watcher};
use mixray::scene::BackendChoice;
use mixray::work::WorkList;

use super::agreement::{
    Difference, backend_for, cpu_film, empty_film, gpu_film, load, planes, render_all, render_on,
    renderer,
};
use super::scenes::{RAYS, case};
use crate::support::complete;

/// The same samples in other portions.
fn in_portions(backend: &mut GpuBackend, renderer: &Renderer, ends: &[u32]) -> (Film, RayCounts) {
    let mut film = empty_film(renderer, 0, true);
    let mut rays = RayCounts::default();
    let (last, ends) = ends.split_last().expect("portions");
    for &end in ends {
        let work = WorkList::main(&renderer.packed().pixels, &film, |_| end);
        render_on(backend, &mut film, &work, &mut rays);
    }
    render_all(renderer, &mut film, *last, |film, work| {
        render_on(backend, film, work, &mut rays);
    });
    (film, rays)
}

#[test]
fn a_film_does_not_depend_on_how_the_work_is_cut() {
    let Some(gpu) = test_device() else { return };
    let built = renderer(load(&case("matt_under_a_flat_sky").text()), true);
    let mut backend = backend_for(gpu, &built);
    let (film, rays) = gpu_film(&mut backend, &built, true);
    for ends in [&[1, 2, 3, 4, 5, RAYS][..], &[1, 5, RAYS]] {
        let (cut, cut_rays) = in_portions(&mut backend, &built, ends);
        assert_eq!(cut, film, "{ends:?}");
        assert_eq!(cut_rays, rays, "{ends:?}");
    }
    // Negative control: a sample fewer is another film.
    let (short, _) = in_portions(&mut backend, &built, &[RAYS - 1]);
    assert_ne!(short, film);
}

#[test]
fn a_lost_device_is_replaced_by_the_cpu_with_what_was_accumulated() {
    if test_device().is_none() {
        return;
    }
    let mut scene = load(&case("matt_under_a_flat_sky").text());
    let mut reference = renderer(scene.clone(), true);
    complete(&mut reference);
    let expected = planes(&reference, reference.film());

    scene.settings.backend = BackendChoice::Gpu;
    let mut losing = renderer(scene, true);
    assert_eq!(losing.backend_name(), "gpu");
    losing
        .advance(Budget::Rays(1), &Watcher::none())
        .expect("renders");
    assert_eq!(losing.samples(), 1);
    let before = losing.film().clone();
    losing.lose_device_after(0);
    complete(&mut losing);
    assert_eq!(losing.backend_name(), "cpu");
    let notes = losing.notes().join("\n");
    assert!(notes.contains("lost") && notes.contains("CPU"), "{notes}");

    assert_eq!(losing.samples(), RAYS);
    for (found, expected) in losing.film().pixels.iter().zip(&reference.film().pixels) {
        assert_eq!((found.n, found.n_real), (expected.n, expected.n_real));
    }
    let difference = Difference::between(&expected, &planes(&losing, losing.film()));
    eprintln!("after the loss: {difference:?}");
    assert!(difference.agrees(), "{difference:?}");
    assert_eq!(losing.rays().primary, reference.rays().primary);
    // Negative control: without what came after the loss the film is another one.
    assert!(!Difference::between(&expected, &planes(&losing, &before)).agrees());
}

#[test]
fn a_scene_beyond_the_limits_of_the_device_is_refused() {
    if test_device().is_none() {
        return;
    }
    let mut gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    let scene = load(&case("textures_and_normal_maps_in_the_sun").text());
    let built = renderer(scene, false);
    let refused = |gpu: GpuDevice, part: &str| {
        match GpuBackend::new(Arc::new(gpu), built.packed(), true) {
            Err(error @ GpuError::Limit { .. }) => {
                let message = error.to_string();
                assert!(message.contains(part), "{message}");
                assert!(message.contains("--backend cpu"), "{message}");
            }
            Err(error) => panic!("{error}"),
            Ok(_) => panic!("{part} fit"),
        };
    };
    gpu.limits.max_storage_buffer_binding_size = 2048;
    refused(gpu, "triangles");
    let mut gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    gpu.limits.max_storage_buffers_per_shader_stage = 4;
    refused(gpu, "storage buffers");

    // Negative control: the same scene within the limits, and the CPU takes it in any case.
    let gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    assert!(GpuBackend::new(Arc::new(gpu), built.packed(), true).is_ok());
    assert!(cpu_film(&built, false).1.traced() > 0);
}
