//! Photons on both backends: the same splats, up to rounding.

use mixray::cpu::photons::render::render;
use mixray::film::Film;
use mixray::gpu::harness::test_device;
use mixray::packed::PackedScene;
use mixray::renderer::{RayCounts, Watcher};
use mixray::work::PhotonWork;

use super::agreement::{backend_for, empty_film, load, renderer};
use super::scenes::CASES;

/// Several a pixel, some past the first.
const FIRST: u64 = 1000;
const PHOTONS: u64 = 8000;
const RELATIVE: f64 = 1e-4;
/// Of a photon's usual splat, in steps of the sums.
const ABSOLUTE: f64 = 64.0;
/// Share of the pixels in which a photon may have gone another way.
const OUTLIERS: f64 = 2e-3;

/// Sums of each pixel that photons may reach.
fn sums(film: &Film) -> Vec<[f64; 6]> {
    let sums = |i: usize| {
        let [a, b] = [film.splats[i].diff, film.splats[i].m_im];
        [a[0], a[1], a[2], b[0], b[1], b[2]].map(|sum| sum as f64)
    };
    (0..film.splats.len()).map(sums).collect()
}

fn differing(a: &[[f64; 6]], b: &[[f64; 6]]) -> usize {
    let far = |(a, b): (&f64, &f64)| (a - b).abs() > RELATIVE * a.abs() + ABSOLUTE;
    let pixels = a.iter().zip(b);
    pixels.filter(|(a, b)| a.iter().zip(*b).any(far)).count()
}

fn on_cpu(scene: &PackedScene, mut film: Film, work: &PhotonWork) -> (Film, RayCounts) {
    let rays = render(scene, &mut film, work, &Watcher::none());
    (film, rays)
}

#[test]
fn photons_are_the_same_on_both_backends() {
    let Some(gpu) = test_device() else { return };
    let (mut kinds, mut lit_in_all) = (0, 0);
    for case in CASES {
        let built = renderer(load(&case.text()), false);
        if built.packed().photons_per_ray == 0 {
            continue;
        }
        kinds += 1;
        let mut empty = empty_film(&built, 0, false);
        empty.set_photons(true);
        let work = PhotonWork {
            first: FIRST,
            end: FIRST + PHOTONS,
            window: [0.0, 1.0],
        };
        let (expected, cpu_rays) = on_cpu(built.packed(), empty.clone(), &work);
        let mut found = empty.clone();
        let mut gpu_rays = RayCounts::default();
        backend_for(gpu, &built)
            .trace_photons(&mut found, &work, &mut gpu_rays, &Watcher::none())
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(found.photons(), PHOTONS);
        let (a, b) = (sums(&expected), sums(&found));
        let lit = a.iter().filter(|sums| **sums != [0.0; 6]).count();
        let wrong = differing(&a, &b);
        eprintln!(
            "{}: {wrong} of {lit} lit pixels differ; rays {cpu_rays:?}, {gpu_rays:?}",
            case.name
        );
        lit_in_all += lit;
        assert!(
            wrong as f64 <= OUTLIERS * a.len() as f64,
            "{}: {wrong}",
            case.name
        );
        let (cpu_total, gpu_total) = (cpu_rays.traced() as f64, gpu_rays.traced() as f64);
        assert!((gpu_total / cpu_total - 1.0).abs() < 1e-2, "{}", case.name);

        if lit < 20 {
            continue;
        }
        let others = PhotonWork {
            first: work.first + PHOTONS / 8,
            end: work.end + PHOTONS / 8,
            ..work
        };
        let (later, _) = on_cpu(built.packed(), empty, &others);
        let control = differing(&a, &sums(&later));
        assert!(control > 0, "control: other photons are noticed");
    }
    assert!(kinds >= 4, "{kinds} scenes trace photons");
    assert!(lit_in_all > 150, "{lit_in_all} lit pixels");
}
