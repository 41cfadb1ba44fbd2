use glam::Vec3;

use super::*;
use crate::film::test_support::noise;
use crate::film::{Sample, guide_add};

fn sample(pixel: u32, index: u32) -> Sample {
    let at = |d| noise(pixel * 7919 + index * 13 + d);
    Sample {
        is_virtual: at(0) < 0.4 + 0.2 * pixel as f32,
        contribution: Vec3::new(at(1), at(2) * 100.0, at(3) - 0.5),
        real: Some(Vec3::new(at(4), at(5), at(6))),
    }
}

fn render(range: std::ops::Range<u32>) -> Film {
    let mut film = Film::new(3, 1, range.start, true);
    for pixel in 0..3 {
        for index in range.clone() {
            film.add(pixel, &sample(pixel as u32, index));
            let at = |d| noise(pixel as u32 * 7919 + index * 13 + d);
            if at(7) < 0.9 {
                guide_add(
                    &mut film.guides[pixel],
                    1.0 + at(8),
                    Vec3::Y,
                    Vec3::splat(at(9)),
                );
            }
        }
    }
    film
}

/// Means of every channel as f32, to be compared in units in the last place.
fn means(film: &Film) -> Vec<f32> {
    let mut out = Vec::new();
    for (p, g) in film.pixels.iter().zip(&film.guides) {
        for sum in [p.m_im, p.diff, p.m_ir, p.r_ir, p.sq, g.normal, g.albedo] {
            out.extend((sum.value() / f64::from(p.n)).as_vec3().to_array());
        }
        out.push((g.depth() / f64::from(g.hits)) as f32);
    }
    out
}

fn worst_ulp(a: &[f32], b: &[f32]) -> u32 {
    let key = |x: f32| {
        let bits = x.to_bits() as i32;
        i64::from(if bits < 0 { i32::MIN - bits } else { bits })
    };
    a.iter()
        .zip(b)
        .map(|(&a, &b)| (key(a) - key(b)).unsigned_abs() as u32)
        .max()
        .unwrap_or(0)
}

#[test]
fn a_renewed_film_is_a_new_one() {
    let mut film = render(0..4);
    let new = Film::new(3, 1, 0, true);
    assert_ne!(film, new, "control");
    film.set_groups(true);
    film.set_sample_factors([2, 3, 4].into_iter());
    film.renew([0; 3].into_iter());
    film.set_groups(false);
    assert_eq!(film, new);
}

#[test]
fn ranges_merged_equal_one_run_within_2_ulp() {
    let whole = render(0..20_000);
    for cuts in [vec![0, 1, 20_000], vec![0, 7_001, 13_333, 20_000]] {
        let parts: Vec<Film> = cuts.windows(2).map(|w| render(w[0]..w[1])).collect();
        let mut merged = parts[parts.len() - 1].clone();
        for part in parts[..parts.len() - 1].iter().rev() {
            merged.merge(part).unwrap();
        }
        assert!(worst_ulp(&means(&whole), &means(&merged)) <= 2);
        for (a, b) in whole.pixels.iter().zip(&merged.pixels) {
            assert_eq!((a.n, a.m, a.n_real), (b.n, b.m, b.n_real));
        }
    }
    let other = render(0..19_999);
    assert!(
        worst_ulp(&means(&whole), &means(&other)) > 2,
        "control: one sample fewer shows"
    );
}

#[test]
fn a_gap_in_the_real_pass_is_replayed() {
    let mut early = render(0..8);
    for p in &mut early.pixels {
        (p.m_ir, p.r_ir, p.n_real) = Default::default();
    }
    early.merge(&render(8..16)).unwrap();
    for pixel in 0..3 {
        assert!(early.needs_real(pixel));
        assert_eq!(early.pixels[pixel].n_real, 0);
        for index in 0..16 {
            let s = sample(pixel as u32, index);
            early.add_real(pixel, s.is_virtual, s.real.unwrap());
        }
        assert!(!early.needs_real(pixel));
    }
    assert!(worst_ulp(&means(&early), &means(&render(0..16))) <= 2);
}

#[test]
fn ranges_that_do_not_fit_are_refused() {
    let mut film = render(0..4);
    let before = film.clone();
    assert!(matches!(
        film.merge(&render(5..8)),
        Err(MergeError::NotAdjacent { pixel: 0, .. })
    ));
    assert!(film.merge(&render(3..8)).is_err());
    assert!(matches!(
        film.merge(&Film::new(1, 3, 4, true)),
        Err(MergeError::Size(..))
    ));
    assert_eq!(
        film.merge(&Film::new(3, 1, 4, false)),
        Err(MergeError::Guides)
    );
    let mut with_photons = Film::new(3, 1, 4, true);
    with_photons.set_photons(true);
    assert_eq!(film.merge(&with_photons), Err(MergeError::Photons));
    let mut with_groups = Film::new(3, 1, 4, true);
    with_groups.set_groups(true);
    assert_eq!(film.merge(&with_groups), Err(MergeError::Groups));
    assert_eq!(film, before);
}

#[test]
fn kinds_follow_the_mask() {
    let mut film = Film::new(4, 1, 0, false);
    for (pixel, mask) in [(0, [false, false]), (1, [false, true]), (2, [true, true])] {
        for is_virtual in mask {
            let s = Sample {
                is_virtual,
                ..sample(0, 0)
            };
            film.add(pixel, &s);
        }
    }
    let expected = PixelCounts {
        background: 1,
        edge: 1,
        virtual_: 1,
        skipped: 1,
    };
    assert_eq!(film.counts(), expected);
    assert_eq!(film.kind(3), PixelKind::Skipped);
}
