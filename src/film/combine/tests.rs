use super::*;
use crate::film::{Splat, group_add};

const WIDTH: usize = 200;

/// A film of 200 x 200 real pixels of `samples` differences each, `value(pixel, sample)`.
fn film(samples: u32, value: impl Fn(usize, u32) -> Vec3) -> Film {
    let mut film = Film::new(WIDTH as u32, WIDTH as u32, 0, false);
    film.set_groups(true);
    for pixel in 0..film.pixels.len() {
        for sample in 0..samples {
            let difference = value(pixel, sample);
            film.add_difference(pixel, sample, difference);
        }
    }
    film
}

fn combined(film: &Film) -> Vec<DVec3> {
    let n = film.pixels[0].n;
    let out = combine_robustly(film, None, |_| group_counts(0, n));
    assert!(out.film.groups.is_empty());
    means(&out.film)
}

fn means(film: &Film) -> Vec<DVec3> {
    (0..film.pixels.len())
        .map(|pixel| {
            let sums = film.sums(pixel);
            sums.diff.value() / f64::from(sums.n)
        })
        .collect()
}

/// A number of 0..1 for each pixel and sample.
fn random(pixel: usize, sample: u32) -> f32 {
    hash_u32(pixel as u32 * 977 + hash_u32(sample)) as f32 / 4_294_967_296.0
}

/// Of 8 bits, about mid grey.
const CODE: f64 = 0.004;

/// A shadow of one code that one sample in five finds, five codes deep: it becomes even, and none of it is lost.
#[test]
fn a_soft_shadow_of_one_code_keeps_its_mean() {
    let rare = |pixel, sample| match random(pixel, sample) < 0.2 {
        true => Vec3::splat(-5.0 * CODE as f32),
        false => Vec3::ZERO,
    };
    let film = film(9, rare);
    let (before, after) = (means(&film), combined(&film));
    let spread = |of: &[DVec3]| {
        let squares = of.iter().map(|d| (d.x + CODE) * (d.x + CODE));
        (squares.sum::<f64>() / of.len() as f64).sqrt() / CODE
    };
    let [noise, left] = [&before, &after].map(|of| spread(of));
    assert!(left < 0.4 * noise, "{left} {noise}");
    let window = |of: &[DVec3], x: usize, y: usize| {
        let pixels = (0..32 * 32).map(|i| of[(y + i / 32) * WIDTH + x + i % 32].x);
        pixels.sum::<f64>() / 1024.0 / CODE
    };
    let over_a_code = |d: &DVec3| if d.x.abs() < CODE { DVec3::ZERO } else { *d };
    let kept: Vec<DVec3> = before.iter().map(over_a_code).collect();
    let mut lost_by_threshold = 0.0f64;
    for (x, y) in (0..49).map(|i| (i % 7 * 28, i / 7 * 28)) {
        let mean = window(&after, x, y);
        assert!((mean + 1.0).abs() < 0.1, "{mean} at {x} {y}");
        lost_by_threshold = lost_by_threshold.max((window(&kept, x, y) + 1.0).abs());
    }
    assert!(lost_by_threshold > 0.1, "control: a threshold loses light");
}

/// A speckle goes, as much light in every sample stays, and nothing is lost.
#[test]
fn rare_light_is_spread_and_what_every_sample_finds_stays() {
    let middle = 100 * WIDTH + 100;
    let noise = |pixel, sample| Vec3::splat(0.01 * (random(pixel, sample) - 0.5));
    let speckle = film(25, |pixel, sample| {
        let bright = pixel == middle && sample == 7;
        noise(pixel, sample) + if bright { 25.0 } else { 0.0 }
    });
    let line = film(25, |pixel, sample| {
        noise(pixel, sample) + if pixel == middle { 1.0 } else { 0.0 }
    });
    let sum = |of: &[DVec3]| of.iter().map(|d| d.x).sum::<f64>();
    let [speckle_after, line_after] = [&speckle, &line].map(combined);
    assert!((means(&speckle)[middle].x - 1.0).abs() < 0.01);
    assert!(speckle_after[middle].x < 0.1, "{}", speckle_after[middle]);
    assert!((sum(&speckle_after) / sum(&means(&speckle)) - 1.0).abs() < 0.02);
    assert!(line_after[middle].x > 0.95, "{}", line_after[middle]);
}

/// With more samples the combination comes to the mean.
#[test]
fn it_is_consistent() {
    let distance = |samples| {
        let film = film(samples, |pixel, sample| {
            let edge = if pixel % WIDTH < 100 { 0.1 } else { 0.0 };
            Vec3::splat(edge + 0.05 * (random(pixel, sample) - 0.5))
        });
        let pairs = combined(&film).into_iter().zip(means(&film));
        let squares = pairs.map(|(a, b)| (a - b).length_squared());
        (squares.sum::<f64>() / film.pixels.len() as f64).sqrt()
    };
    let [few, many] = [10, 160].map(distance);
    assert!(many < 0.3 * few, "{few} {many}");
}

#[test]
fn photons_are_spread_where_few_land_and_pixels_without_samples_stay() {
    let mut film = film(5, |_, _| Vec3::ZERO);
    film.set_photons(true);
    let lone = 50 * WIDTH + 50;
    let crowded = 150 * WIDTH + 150;
    let splat = |pixel: usize, value: f32| Splat {
        pixel: pixel as u32,
        is_virtual: false,
        value: Vec3::splat(value),
    };
    let photons = film.pixels.len() as u64;
    let splats = (0..1000).map(|_| splat(crowded, 0.001));
    film.add_splats(photons, splats.chain([splat(lone, 1.0)]));
    film.pixels[lone + 1] = PixelSums::default();
    let before = means(&film);
    assert!((before[lone].x - 1.0).abs() < 1e-6 && (before[crowded].x - 1.0).abs() < 1e-3);
    let after = combined(&film);
    assert!(after[lone].x < 0.2, "{}", after[lone]);
    assert!(after[crowded].x > 0.8, "{}", after[crowded]);
    let out = combine_robustly(&film, None, |_| group_counts(0, 5)).film;
    assert_eq!(out.pixels[lone + 1], PixelSums::default());
}

#[test]
fn evaluations_are_counted_by_group() {
    for (first, end) in [(0, 0), (0, 1), (0, 7), (3, 4), (4, 23)] {
        let mut counts = [0; DEVIATIONS];
        for evaluation in first..end {
            counts[(evaluation % GROUPS) as usize] += 1;
        }
        assert_eq!(group_counts(first, end), counts);
    }
}

/// The last group is what the others leave of the sum.
#[test]
fn groups_add_up() {
    let mut groups = GroupSums::default();
    let mut sums = PixelSums::default();
    for index in 0..23 {
        let difference = Vec3::splat(index as f32);
        crate::film::pixel_add(&mut sums, index, false, difference);
        group_add(&mut groups, index, difference);
    }
    let values = groups.values(sums.diff.value());
    assert_eq!(values.map(|v| v.y), [50.0, 55.0, 60.0, 42.0, 46.0]);
}
