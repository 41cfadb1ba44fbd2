//! Batches that take more or fewer steps than was learnt, on the toy of [`crate::gpu::tests::wavefront`].

use std::time::Duration;

use super::*;
use crate::film::PixelSums;
use crate::gpu::Traffic;
use crate::gpu::harness::test_device;
use crate::gpu::lanes::{BatchRecord, records_bytes};
use crate::gpu::pacer::Load;
use crate::gpu::portion::Cursor;
use crate::gpu::tests::wavefront::{HEIGHT, WIDTH, toy_backend, toy_render, work_to};

/// Lanes of a batch.
const LANES: usize = 4096;

/// That batches of the main pass took so many steps, in which all lanes were alive.
fn course(steps: u32) -> Course {
    let mut course = Course::default();
    let record = BatchRecord {
        steps,
        alive: [LANES as u32; 32],
        ..BatchRecord::default()
    };
    course.learn(std::iter::once((LANES as u32, record)));
    course
}

/// A device whose speed is known, and which takes small batches alone: how they are cut does not depend on the clock.
fn of_known_speed(gpu: &Arc<GpuDevice>) -> GpuBackend {
    let mut backend = toy_backend(gpu, 7);
    backend.warm = true;
    backend.pacer = Pacer::new(LANES, false);
    let load = Load {
        lane_steps: 1e9,
        dispatches: 3,
    };
    backend.pacer.record(Duration::from_millis(1), load);
    backend
}

/// Renders with small batches and this course, and holds the film to the twin; returns what went to the device and back, and how many batches it took.
fn rendered(backend: &mut GpuBackend, course: Course) -> (Traffic, usize) {
    backend.courses[0] = course;
    let mut expected = Film::new(WIDTH, HEIGHT, 0, false);
    let work = work_to(&expected, 9);
    toy_render(7, &mut expected, &work);
    let mut film = Film::new(WIDTH, HEIGHT, 0, false);
    let before = backend.gpu.traffic();
    let mut rays = RayCounts::default();
    backend
        .render(&mut film, &work, &mut rays, &Watcher::none())
        .expect("renders");
    assert_eq!(film, expected);
    let taken: u64 = expected.pixels.iter().map(|p| u64::from(p.n)).sum();
    assert_eq!(rays.primary, taken);
    let mut cursor = Cursor::default();
    let pixels = in_order(WIDTH, &work.pixels);
    let batches = std::iter::from_fn(|| cursor.next(&pixels, LANES)).count();
    (backend.gpu.traffic() - before, batches)
}

#[test]
fn batches_longer_than_was_learnt_go_on_in_the_place_of_the_next() {
    let Some(gpu) = test_device() else { return };
    let mut backend = of_known_speed(gpu);
    let (short, batches) = rendered(&mut backend, course(1));
    assert!(batches > 3, "{batches}");
    let (known, _) = rendered(&mut backend, course(150));
    let sums = (size_of::<PixelSums>() * (WIDTH * HEIGHT / 2) as usize) as u64;
    let once = records_bytes(batches) + sums;
    assert_eq!(known.bytes_down, once, "one read-back");
    assert_eq!(known.steps, 151 * batches as u64);
    assert!(known.idle_steps > 40 * batches as u64, "{known:?}");
    assert_eq!(known.dispatches, 3 * known.steps + 4 * batches as u64 + 2);
    assert!(
        short.bytes_down > once,
        "control: it took more than one recording"
    );
    assert_eq!(
        short.steps - short.idle_steps,
        known.steps - known.idle_steps,
        "steps in which a lane was alive"
    );
}

/// Whatever round a batch ends in: in the last of a recording too, after which the next is opened.
#[test]
fn batches_end_in_any_round() {
    let Some(gpu) = test_device() else { return };
    let mut backend = of_known_speed(gpu);
    for steps in 18..60 {
        rendered(&mut backend, course(steps));
    }
}
