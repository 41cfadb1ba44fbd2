use super::*;
use crate::film::test_support::noise;
use crate::film::{Film, Sample, variance};

const PIXELS: u32 = 4;
const PHOTONS: u64 = 1000;

fn splat(i: u32) -> Splat {
    Splat {
        pixel: i % 3,
        is_virtual: noise(i) < 0.3,
        value: Vec3::new(noise(i + 7), 1e4 * noise(i + 9), 1e-3 * noise(i + 11)),
    }
}

fn film(splats: impl Iterator<Item = Splat>) -> Film {
    let mut film = Film::new(PIXELS, 1, 0, false);
    film.set_photons(true);
    film.add_splats(PHOTONS, splats);
    film
}

#[test]
fn the_order_of_photons_leaves_no_trace() {
    let all: Vec<Splat> = (0..500).map(splat).collect();
    let forwards = film(all.iter().copied());
    assert_eq!(forwards, film(all.iter().rev().copied()));
    let mut parts = film(std::iter::empty());
    parts.add_splats(0, all[..200].iter().copied());
    parts.add_splats(0, all[200..].iter().copied());
    assert_eq!(forwards, parts);
    assert_ne!(forwards, film(all[1..].iter().copied()), "control");
}

#[test]
fn what_is_not_usable_is_counted_and_left_out() {
    let of = |value: f32| Splat {
        pixel: 0,
        is_virtual: false,
        value: Vec3::new(0.5, value, 0.5),
    };
    let values = [1.0, f32::NAN, f32::INFINITY, -1.0, 2e7, 1e7];
    let film = film(values.into_iter().map(of));
    assert_eq!(film.non_finite_samples(), 4);
    assert_eq!(film.splats[0].diff[0], 1 << 28, "two halves");
}

/// Means and their variance, against plain f64.
#[test]
fn a_pixel_shows_what_its_photons_bring() {
    let mut film = film((0..500).map(splat));
    let samples = 8;
    for index in 0..samples {
        let sample = Sample {
            is_virtual: index % 4 == 0,
            contribution: Vec3::splat(noise(index)),
            real: None,
        };
        film.add(0, &sample);
    }
    let of_first = || (0..500).map(splat).filter(|splat| splat.pixel == 0);
    let scale = f64::from(PIXELS) / PHOTONS as f64;
    let brought = |is_virtual: bool| -> f64 {
        let values = of_first().filter(|splat| splat.is_virtual == is_virtual);
        scale * values.map(|splat| f64::from(splat.value.y)).sum::<f64>()
    };
    let (before, after) = (film.pixels[0], film.sums(0));
    let mean = |sum: &Sum3| sum.value().y / f64::from(samples);
    for (is_virtual, before, after) in [
        (false, mean(&before.diff), mean(&after.diff)),
        (true, mean(&before.m_im), mean(&after.m_im)),
    ] {
        let expected = before + brought(is_virtual);
        assert!((after / expected - 1.0).abs() < 1e-6, "{after} {expected}");
        assert!(brought(is_virtual) > 0.01 * before, "control: it shows");
    }
    // Each real sample has its share of what reached real surfaces, each virtual one of the rest.
    let shares = [brought(false) * 8.0 / 6.0, brought(true) * 8.0 / 2.0];
    let values: Vec<f64> = (0..samples)
        .map(|i| f64::from(noise(i)) + shares[usize::from(i % 4 == 0)])
        .collect();
    let mean = values.iter().sum::<f64>() / 8.0;
    let spread = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 8.0 / 7.0;
    let squares: f64 = of_first().map(|s| f64::from(s.value.y).powi(2)).sum();
    let expected = spread + scale * scale * squares;
    let found = f64::from(variance(&film, None)[0][1]);
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    assert!(
        (found / spread - 1.0).abs() > 1e-2,
        "control: theirs counts"
    );
    assert_eq!(film.sums(3), film.pixels[3], "no sample, no light");
}
