//! The composite against Eq. 4 evaluated in f64.

use super::*;
use crate::film::{Sample, guide_add};

struct Rng(u64);

impl Rng {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / 16_777_216.0
    }
}

/// One ray in f64: mask, im, ir of one channel.
struct Ray {
    m: f64,
    im: f64,
    ir: f64,
}

/// Rays of an edge pixel whose mask is correlated with the texture behind it.
fn rays(rng: &mut Rng, n: usize) -> Vec<Ray> {
    (0..n)
        .map(|_| {
            let ir = rng.next();
            let m = f64::from(u8::from(rng.next() < 0.2 + 0.6 * ir));
            let im = if m > 0.0 {
                0.3 + 0.1 * rng.next()
            } else {
                ir * (0.7 + 0.2 * rng.next())
            };
            Ray { m, im, ir }
        })
        .collect()
}

fn film_of(rays: &[Ray]) -> Film {
    let mut film = Film::new(1, 1, 0, false);
    for ray in rays {
        let is_virtual = ray.m > 0.0;
        let contribution = if is_virtual { ray.im } else { ray.im - ray.ir };
        film.add(
            0,
            &Sample {
                is_virtual,
                contribution: Vec3::splat(contribution as f32),
                real: Some(Vec3::splat(ray.ir as f32)),
            },
        );
    }
    film
}

fn mean(rays: &[Ray], f: impl Fn(&Ray) -> f64) -> f64 {
    rays.iter().map(f).sum::<f64>() / rays.len() as f64
}

/// If = M Im + (1-M)(Ic + Im - Ir), in f64, from the rays themselves.
fn eq4(rays: &[Ray], ic: f64) -> f64 {
    let (m, im, ir) = (
        mean(rays, |r| r.m),
        mean(rays, |r| r.im),
        mean(rays, |r| r.ir),
    );
    m * im + (1.0 - m) * (ic + im - ir)
}

fn photo(ic: f32) -> Photo {
    Photo {
        width: 1,
        height: 1,
        linear: vec![[ic; 3]],
        encoded: crate::scene::EncodedPhoto::Linear,
        tags: Default::default(),
    }
}

fn composite_of(film: &Film, ic: f64, mode: Composite) -> f64 {
    f64::from(composite(film, Some(&photo(ic as f32)), mode).linear[0][1])
}

/// The identity holds for any number of rays, and none of the three wrong turns does.
#[test]
fn additive_is_equation_4() {
    let mut rng = Rng(1);
    for n in [2, 3, 16, 49, 1000] {
        for _ in 0..50 {
            let rays = rays(&mut rng, n);
            let film = film_of(&rays);
            let ic = rng.next();
            let truth = eq4(&rays, ic);
            let got = composite_of(&film, ic, Composite::Additive);
            assert!((got - truth).abs() < 3e-7, "{n}: {got} {truth}");
        }
    }
}

#[test]
fn the_three_wrong_turns_differ_from_equation_4() {
    let mut rng = Rng(2);
    let rays = rays(&mut rng, 4000);
    let ic = mean(&rays, |r| r.ir);
    let truth = eq4(&rays, ic);
    assert!(
        (truth - mean(&rays, |r| r.im)).abs() < 1e-12,
        "a perfect proxy gives the mixed image"
    );

    let by_ray = mean(&rays, |r| r.m * r.im + (1.0 - r.m) * (ic + r.im - r.ir));
    let m = mean(&rays, |r| r.m);
    let covariance = mean(&rays, |r| r.m * r.ir) - m * mean(&rays, |r| r.ir);
    assert!(
        (by_ray - truth - covariance).abs() < 1e-12,
        "off by the covariance of mask and Ir"
    );
    assert!((by_ray - truth).abs() > 0.02);

    let im = mean(&rays, |r| r.im);
    let without_real = m * im + (1.0 - m) * (ic + im - mean(&rays, |r| (1.0 - r.m) * r.ir));
    assert!(without_real - truth > 0.05, "a bright halo");

    // Two noisy f32 images subtracted, against the direct difference.
    let (scale, n) = (1e5f32, 49);
    let rays: Vec<Ray> = (0..n)
        .map(|_| {
            let ir = f64::from(scale) * (0.9 + 0.2 * rng.next());
            Ray {
                m: 0.0,
                im: ir - 0.01,
                ir,
            }
        })
        .collect();
    let apart = rays.iter().map(|r| r.im as f32).sum::<f32>() / n as f32
        - rays.iter().map(|r| r.ir as f32).sum::<f32>() / n as f32;
    assert!((apart + 0.01).abs() > 1e-3, "{apart}");
    let got = composite_of(&film_of(&rays), 0.5, Composite::Additive);
    assert!((got - 0.49).abs() < 1e-7, "{got}");
}

#[test]
fn virtual_and_background_pixels_need_no_real_ray() {
    let mut rng = Rng(3);
    for m in [0.0, 1.0] {
        let rays: Vec<Ray> = rays(&mut rng, 64)
            .into_iter()
            .map(|r| Ray { m, ..r })
            .collect();
        let mut film = film_of(&rays);
        let with = composite_of(&film, 0.4, Composite::Additive);
        let p = &mut film.pixels[0];
        (p.m_ir, p.r_ir, p.n_real) = Default::default();
        assert_eq!(with, composite_of(&film, 0.4, Composite::Additive));
        assert!((with - eq4(&rays, 0.4)).abs() < 3e-7);
    }
}

#[test]
fn untouched_pixels_keep_the_photograph_bit_for_bit() {
    let ic = [-0.0, f32::MIN_POSITIVE / 4.0, 0.1];
    let mut film = Film::new(1, 1, 0, false);
    let sample = |x: f32| Sample {
        is_virtual: false,
        contribution: Vec3::new(0.0, -0.0, x),
        real: Some(Vec3::splat(0.3)),
    };
    for _ in 0..7 {
        film.add(0, &sample(0.0));
    }
    for mode in [Composite::Additive, Composite::Quotient] {
        assert_eq!(
            composite_pixel(&film.pixels[0], ic, mode).map(f32::to_bits),
            ic.map(f32::to_bits)
        );
        assert_eq!(
            composite_pixel(&PixelSums::default(), ic, mode).map(f32::to_bits),
            ic.map(f32::to_bits)
        );
    }
    film.add(0, &sample(1e-3));
    assert_ne!(
        composite_pixel(&film.pixels[0], ic, Composite::Additive),
        ic,
        "control"
    );
}

/// The quotient cancels a proxy albedo that is wrong by any factor; the additive composite does not.
#[test]
fn quotient_cancels_a_wrong_albedo() {
    let mut rng = Rng(4);
    let shadow = 0.6;
    let with_albedo = |factor: f64, rng: &mut Rng| {
        let rays: Vec<Ray> = (0..32)
            .map(|_| {
                let ir = factor * (0.3 + 0.2 * rng.next());
                Ray {
                    m: 0.0,
                    im: ir * shadow,
                    ir,
                }
            })
            .collect();
        film_of(&rays)
    };
    for factor in [0.5, 1.0, 2.0] {
        let film = with_albedo(factor, &mut rng);
        assert!((composite_of(&film, 0.4, Composite::Quotient) - 0.24).abs() < 1e-6);
    }
    let film = with_albedo(2.0, &mut rng);
    assert!(
        (composite_of(&film, 0.4, Composite::Additive) - 0.24).abs() > 0.05,
        "control"
    );
}

#[test]
fn quotient_is_its_formula_in_edge_pixels() {
    let mut rng = Rng(5);
    let rays = rays(&mut rng, 49);
    let ic = 0.37;
    let a = mean(&rays, |r| r.m);
    let ratio = mean(&rays, |r| (1.0 - r.m) * (r.im - r.ir)) / mean(&rays, |r| (1.0 - r.m) * r.ir);
    let truth = (1.0 - a) * ic * (1.0 + ratio) + mean(&rays, |r| r.m * r.im);
    let got = composite_of(&film_of(&rays), ic, Composite::Quotient);
    assert!((got - truth).abs() < 3e-7);
    assert!(
        (got - eq4(&rays, ic)).abs() > 1e-3,
        "control: it is not Eq. 4"
    );
}

/// The planes of one pixel give its composite again, real rays or none.
#[test]
fn the_composite_can_be_redone_from_the_planes() {
    let mut rng = Rng(6);
    for (m, drop_real) in [(None, false), (Some(0.0), true), (Some(1.0), true)] {
        let rays: Vec<Ray> = rays(&mut rng, 49)
            .into_iter()
            .map(|r| Ray {
                m: m.unwrap_or(r.m),
                ..r
            })
            .collect();
        let mut film = film_of(&rays);
        if drop_real {
            let p = &mut film.pixels[0];
            (p.m_ir, p.r_ir, p.n_real) = Default::default();
        }
        let p = planes(&film, None);
        let (mask, mixed, difference) = (p.mask[0], p.mixed[0][0], p.difference[0][0]);
        let again = mask * mixed + (1.0 - mask) * (0.4 + difference);
        assert!((f64::from(again) - eq4(&rays, 0.4)).abs() < 1e-6);
        assert!((p.mixed[0][0] - p.real[0][0] - difference).abs() < 1e-6);
        if !drop_real {
            assert!((f64::from(mixed) - mean(&rays, |r| r.im)).abs() < 1e-6);
            assert!((f64::from(p.real[0][0]) - mean(&rays, |r| r.ir)).abs() < 1e-6);
        }
    }
}

/// Against the variance of the per-sample composite in f64, and against the scatter of many independent pixels.
#[test]
fn variance_of_the_mean_is_that_of_independent_samples() {
    let mut rng = Rng(7);
    let (ic, n, trials) = (0.45, 16, 4000);
    let (mut stated, mut without_photo, mut sum, mut sum_sq) = (0.0, 0.0, 0.0, 0.0);
    for _ in 0..trials {
        let rays = rays(&mut rng, n);
        let film = film_of(&rays);
        let y = |r: &Ray| r.m * r.im + (1.0 - r.m) * (r.im - r.ir + ic);
        let mu = mean(&rays, y);
        let truth = mean(&rays, |r| (y(r) - mu).powi(2)) / (n as f64 - 1.0);
        let got = f64::from(planes(&film, Some(&photo(ic as f32))).variance[0][2]);
        assert!((got - truth).abs() < 1e-6 * truth + 1e-9, "{got} {truth}");
        without_photo += f64::from(planes(&film, None).variance[0][2]) / f64::from(trials);
        stated += got / f64::from(trials);
        sum += mu / f64::from(trials);
        sum_sq += mu * mu / f64::from(trials);
    }
    let scatter = sum_sq - sum * sum;
    assert!((stated / scatter - 1.0).abs() < 0.1, "{stated} {scatter}");
    assert!(
        (without_photo / scatter - 1.0).abs() > 0.2,
        "control: the photograph's share counts"
    );
}

#[test]
fn guides_are_means_over_hits() {
    let mut film = Film::new(2, 1, 0, true);
    let sample = Sample {
        is_virtual: false,
        contribution: Vec3::ZERO,
        real: None,
    };
    for (depth_m, normal) in [(1.0, Vec3::X), (2.0, Vec3::Y)] {
        let albedo = Vec3::splat(0.5);
        film.add(0, &sample);
        guide_add(&mut film.guides[0], depth_m, normal, albedo);
    }
    film.add(0, &sample);
    film.add(1, &sample);
    let p = planes(&film, None);
    assert_eq!(p.depth, [1.5, f32::INFINITY]);
    assert_eq!(p.albedo, [[0.5; 3], [0.0; 3]]);
    assert!((p.normal[0][0] - 0.5f32.sqrt()).abs() < 1e-7);
    assert_eq!(p.normal[1], [0.0; 3]);
    assert_eq!(p.samples, [3.0, 1.0]);
}
