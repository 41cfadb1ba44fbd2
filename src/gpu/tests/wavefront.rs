//! The wavefront on a toy estimator, bit for bit against the same toy in Rust.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::Zeroable;
use glam::Vec3;

use super::{MIX, mix};
use crate::film::{Film, Sample, group_add, guide_add};
use crate::gpu::harness::test_device;
use crate::gpu::*;
use crate::packed::Frame;
use crate::work::{Pass, PixelWork, RayCounts, Watcher, WorkList};

/// A walk that ends at each step with probability 1/8; what it 'hits' is a hash of where it is.
const ESTIMATOR: &str = "
import package::gpu::buffers::frame;
import package::cpu::state::{PathState, STAGE_DONE, path_first_hits, path_results, path_state};
import package::shared::NONE;
import package::toy::mix_bits;
fn evaluation(pixel: u32, index: u32) -> u32 { return select(index, NONE, (pixel + index) % 3u == 0u); }
fn begin_sample(lane: u32, pixel: u32, index: u32, real_pass: bool) -> PathState {
    var st = path_state(lane, pixel, index);
    st.path.stage = select(1u, 2u, real_pass);
    st.path.medium = mix_bits(pixel * 65537u + index + frame.seed);
    st.ray.depth = st.path.medium ^ st.path.stage;
    st.rays.primary = 1u;
    if st.path.medium % 16u == 3u { st.path.stage = STAGE_DONE; }
    return st;
}
fn advance(st: ptr<function, PathState>) {
    let word = (*st).hits.in_real.triangle;
    let x = f32(word >> 8u) / 16777216.0;
    let lane = (*st).lane;
    (*st).ray.depth = word ^ (*st).path.stage;
    path_results[lane].mask = word & 1u;
    path_results[lane].radiance += vec3<f32>(x, 1.0 - x, x * 0.5);
    path_first_hits[lane].normal = path_results[lane].radiance.xxx;
    path_first_hits[lane].albedo = vec3<f32>(0.0);
    path_first_hits[lane].depth_m = 1.0;
    if word % 8u == 0u { (*st).path.stage = STAGE_DONE; }
}";

const REQUEST: &str = "
import package::cpu::state::PathState;
import package::toy::mix_bits;
fn answer(st: ptr<function, PathState>, thread: u32) {
    (*st).hits.in_real.triangle = mix_bits((*st).ray.depth);
    (*st).rays.mixed += 1u;
}";

pub(super) fn composer() -> Composer {
    Composer::default()
        .with_module("cpu::estimator", ESTIMATOR)
        .with_module("cpu::request", REQUEST)
        .with_module("toy", MIX)
}

/// Twin of the toy: the sample, its rays, and the normal where there are any.
fn toy_sample(seed: u32, pixel: u32, index: u32, real_pass: bool) -> (Sample, u64, Vec3) {
    let stage = if real_pass { 2 } else { 1 };
    let mut word = mix(pixel
        .wrapping_mul(65537)
        .wrapping_add(index)
        .wrapping_add(seed));
    let mut radiance = Vec3::ZERO;
    let mut normal = Vec3::ZERO;
    let mut mask = 0;
    let mut rays = 0;
    if word % 16 != 3 {
        loop {
            word = mix(word ^ stage);
            let x = (word >> 8) as f32 / 16_777_216.0;
            mask = word & 1;
            radiance += Vec3::new(x, 1.0 - x, x * 0.5);
            normal += Vec3::splat(x);
            rays += 1;
            if word.is_multiple_of(8) {
                break;
            }
        }
    }
    let sample = Sample {
        is_virtual: mask != 0,
        contribution: radiance,
        real: None,
    };
    (sample, rays, normal)
}

/// Twin of [`GpuBackend::render`]; returns the mixed rays.
pub(in crate::gpu) fn toy_render(seed: u32, film: &mut Film, work: &WorkList) -> u64 {
    let mut total = 0;
    let real_pass = work.pass == Pass::Real;
    for w in &work.pixels {
        for index in w.first..w.end {
            let (sample, rays, normal) = toy_sample(seed, w.pixel, index, real_pass);
            let pixel = w.pixel as usize;
            if real_pass {
                film.add_real(pixel, sample.is_virtual, sample.contribution);
            } else {
                film.add(pixel, &sample);
                if let Some(groups) = film.groups.get_mut(pixel)
                    && !sample.is_virtual
                    && !(w.pixel + index).is_multiple_of(3)
                {
                    group_add(groups, index, sample.contribution);
                }
                if let Some(guide) = film.guides.get_mut(pixel)
                    && rays > 0
                {
                    guide_add(guide, 1.0, normal, Vec3::ZERO);
                }
            }
            total += rays;
        }
    }
    total
}

pub(in crate::gpu) const WIDTH: u32 = 90;
pub(in crate::gpu) const HEIGHT: u32 = 70;

pub(in crate::gpu) fn toy_backend(gpu: &Arc<GpuDevice>, seed: u32) -> GpuBackend {
    let frame = Frame {
        seed,
        exposure_scale: 1.0,
        ..Frame::zeroed()
    };
    let parts = SceneParts {
        frame,
        ..SceneParts::default()
    };
    let scene = SceneBuffers::from_parts(gpu, &parts).expect("uploads");
    GpuBackend::with_modules(Arc::clone(gpu), &composer(), &Features::default(), scene)
        .expect("compiles")
}

/// The next samples of every other pixel up to `end`, some pixels lagging behind.
pub(in crate::gpu) fn work_to(film: &Film, end: u32) -> WorkList {
    let pixels = (0..WIDTH * HEIGHT)
        .filter(|pixel| pixel % 2 == 0)
        .map(|pixel| {
            let lag = u32::from(pixel % 14 == 0);
            PixelWork::new(pixel, film.pixels[pixel as usize].n..end - lag)
        })
        .collect();
    WorkList {
        pass: Pass::Main,
        pixels,
        is_first: false,
    }
}

fn real_work(pixels: Vec<PixelWork>) -> WorkList {
    WorkList {
        pass: Pass::Real,
        pixels,
        is_first: false,
    }
}

#[test]
fn passes_give_the_bits_of_the_twin_however_they_are_cut() {
    let Some(gpu) = test_device() else { return };
    let mut expected = Film::new(WIDTH, HEIGHT, 0, true);
    expected.set_groups(true);
    let mut rays = 0;
    for end in [9, 30] {
        let work = work_to(&expected, end);
        rays += toy_render(7, &mut expected, &work);
    }

    let mut film = Film::new(WIDTH, HEIGHT, 0, true);
    film.set_groups(true);
    let mut backend = toy_backend(gpu, 7);
    let mut traced = RayCounts::default();
    for end in [2, 9, 30] {
        let work = work_to(&film, end);
        backend
            .render(&mut film, &work, &mut traced, &Watcher::none())
            .expect("renders");
    }
    assert_eq!(film, expected);
    let samples: u64 = expected.pixels.iter().map(|p| u64::from(p.n)).sum();
    let all = RayCounts {
        primary: samples,
        mixed: rays,
        ..RayCounts::default()
    };
    assert_eq!(traced, all);

    // Negative control: another seed gives another film.
    let mut other = Film::new(WIDTH, HEIGHT, 0, true);
    let work = work_to(&other, 30);
    toy_backend(gpu, 8)
        .render(&mut other, &work, &mut traced, &Watcher::none())
        .expect("renders");
    assert_ne!(other.pixels, expected.pixels);
}

#[test]
fn the_real_pass_fills_its_own_sums() {
    let Some(gpu) = test_device() else { return };
    let mut rays = RayCounts::default();
    let start = {
        let mut film = Film::new(WIDTH, HEIGHT, 0, false);
        let work = work_to(&film, 5);
        toy_render(1, &mut film, &work);
        film
    };
    let pixels = (0..40).map(|i| PixelWork::new(2 * i, 0..start.pixels[2 * i as usize].n));
    let work = real_work(pixels.collect());
    let mut expected = start.clone();
    toy_render(1, &mut expected, &work);
    let mut film = start;
    toy_backend(gpu, 1)
        .render(&mut film, &work, &mut rays, &Watcher::none())
        .expect("renders");
    assert_eq!(film, expected);
    assert!(film.pixels[0].n_real == 4 && film.pixels[2].n_real == 5);
}

/// What photons left out of a film without samples stays counted where nothing of it goes to the device. Control: as if it did.
#[test]
fn a_first_list_keeps_what_photons_left_out() {
    let Some(gpu) = test_device() else { return };
    let mut start = Film::new(WIDTH, HEIGHT, 0, false);
    start.pixels[6].non_finite = 2;
    start.pixels[6].sample_factor = 1;
    let rendered = |is_first| {
        let work = WorkList {
            is_first,
            ..work_to(&start, 9)
        };
        let mut film = start.clone();
        toy_backend(gpu, 7)
            .render(
                &mut film,
                &work,
                &mut RayCounts::default(),
                &Watcher::none(),
            )
            .expect("renders");
        film
    };
    let mut expected = start.clone();
    toy_render(7, &mut expected, &work_to(&start, 9));
    assert_eq!(rendered(true), expected);
    assert_eq!(rendered(false), expected, "sent to the device");
    assert_eq!(expected.pixels[6].non_finite, 2, "control");
}

/// A software device ends loops silently after 65,535 rounds of one invocation.
#[test]
fn one_pixel_takes_more_samples_than_a_loop_may_have_rounds() {
    let Some(gpu) = test_device() else { return };
    let mut rays = RayCounts::default();
    let mut expected = Film::new(WIDTH, HEIGHT, 0, false);
    let work = WorkList {
        pass: Pass::Main,
        pixels: vec![PixelWork::new(11, 0..70_000)],
        is_first: true,
    };
    toy_render(3, &mut expected, &work);
    let mut film = Film::new(WIDTH, HEIGHT, 0, false);
    toy_backend(gpu, 3)
        .render(&mut film, &work, &mut rays, &Watcher::none())
        .expect("renders");
    assert_eq!(film, expected);
}

#[test]
fn after_a_loss_another_backend_goes_on_with_whole_pixels() {
    if test_device().is_none() {
        return;
    }
    let own = Arc::new(GpuDevice::open(AdapterChoice::Any).expect("opens twice"));
    let mut film = Film::new(WIDTH, HEIGHT, 0, true);
    let mut backend = toy_backend(&own, 5);
    backend.lose_device_after(1);
    let mut rays = RayCounts::default();
    // A batch of the least size, then the loss.
    let work = work_to(&film, 8);
    let error = backend
        .render(&mut film, &work, &mut rays, &Watcher::none())
        .expect_err("the device is lost");
    assert!(matches!(error, GpuError::Lost(_)), "{error}");
    let again = backend.render(&mut film, &work, &mut rays, &Watcher::none());
    assert!(again.is_err(), "a lost device stays lost");

    let done = film.pixels.iter().filter(|p| p.n > 0).count();
    assert!(
        done > 0 && done < work.pixels.len(),
        "{done} pixels of {}",
        work.pixels.len()
    );
    assert!(film.pixels.iter().all(|p| [0, 7, 8].contains(&p.n)));
    let taken: u64 = film.pixels.iter().map(|p| u64::from(p.n)).sum();
    assert_eq!(rays.primary, taken, "rays of what was finished are counted");

    let mut expected = Film::new(WIDTH, HEIGHT, 0, true);
    toy_render(5, &mut expected, &work);
    assert_ne!(film, expected, "control: something was missing");
    let rest = work.left(&film);
    assert!(!rest.is_empty() && rest.pixels.len() + done == work.pixels.len());
    toy_render(5, &mut film, &rest);
    assert_eq!(film, expected);
}

#[test]
fn a_stopped_pass_leaves_whole_pixels() {
    let Some(gpu) = test_device() else { return };
    let mut rays = RayCounts::default();
    let mut film = Film::new(WIDTH, HEIGHT, 0, false);
    let work = work_to(&film, 20);
    let asked = AtomicU32::new(0);
    let after_one_batch = || asked.fetch_add(1, Ordering::Relaxed) > 0;
    toy_backend(gpu, 2)
        .render(
            &mut film,
            &work,
            &mut rays,
            &Watcher::none().cancelled_by(&after_one_batch),
        )
        .expect("stops");
    let done = film.pixels.iter().filter(|p| p.n > 0).count();
    assert!(done > 0 && done < work.pixels.len(), "{done}");
    assert!(film.pixels.iter().all(|p| [0, 19, 20].contains(&p.n)));
}

#[test]
fn kernels_are_timed_where_the_device_can() {
    let Some(gpu) = test_device() else { return };
    let mut rays = RayCounts::default();
    let mut backend = toy_backend(gpu, 2);
    if !backend.profile() {
        eprintln!("skipped: {} takes no timestamps", gpu.name());
        return;
    }
    let mut film = Film::new(WIDTH, HEIGHT, 0, false);
    let work = work_to(&film, 2);
    backend
        .render(&mut film, &work, &mut rays, &Watcher::none())
        .expect("renders");
    let seconds = backend.kernel_seconds().expect("profiled");
    assert!(
        seconds.generate > 0.0 && seconds.advance > 0.0 && seconds.accumulate > 0.0,
        "{seconds:?}"
    );
}
