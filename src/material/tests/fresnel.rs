use crate::material::fresnel::{fresnel_dielectric, refract_about, relative_index, schlick};
use glam::Vec3;

use super::{Random, around};

/// Fresnel's equations as in a textbook, f64, by Snell's law.
fn textbook(cos_i: f64, eta: f64) -> f64 {
    let sin_t2 = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin_t2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t2).sqrt();
    let rs = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let rp = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (rs * rs + rp * rp)
}

/// Largest difference over indices, sides and angles, relative to the reflectance but for 1e-7.
fn worst(reference: impl Fn(f64, f64) -> f64) -> f64 {
    let mut worst = 0.0f64;
    for ior in [1.000_1f32, 1.01, 1.33, 1.5, 2.4, 10.0, 0.75] {
        for entering in [true, false] {
            let index = relative_index(ior, entering);
            let eta = if entering {
                f64::from(ior)
            } else {
                1.0 / f64::from(ior)
            };
            for i in 1..=1000 {
                let cos = i as f32 / 1000.0;
                let f = fresnel_dielectric(cos, index);
                let expected = reference(f64::from(cos), eta);
                assert!((0.0..=1.0).contains(&f.reflectance));
                // Next to the critical angle the reflectance has a vertical tangent.
                let g2 = eta * eta - 1.0 + f64::from(cos).powi(2);
                if g2.abs() > 1e-5 {
                    let scale = expected.max(1e-7);
                    worst = worst.max((f64::from(f.reflectance) - expected).abs() / scale);
                }
            }
        }
    }
    worst
}

#[test]
fn dielectric_reflectance_is_fresnels() {
    let error = worst(textbook);
    assert!(error < 2e-3, "{error}");
    // Negative control: one polarisation alone is not the mean of both.
    let error = worst(|cos, eta| textbook(cos, eta * 1.01));
    assert!(error > 0.02, "{error}");
}

#[test]
fn an_index_of_one_reflects_nothing_and_bends_nothing() {
    for entering in [true, false] {
        let index = relative_index(1.0, entering);
        for cos in [0.0, 1e-6, 0.3, 1.0] {
            let f = fresnel_dielectric(cos, index);
            assert_eq!(f.reflectance, 0.0);
            assert!(!f.total);
            let wo = around(Vec3::Z, f64::from(cos).acos(), 1.0);
            assert_eq!(refract_about(wo, Vec3::Z, cos, index, f.g), -wo);
        }
    }
    // Negative control.
    assert!(fresnel_dielectric(0.3, relative_index(1.000_1, true)).reflectance > 0.0);
}

#[test]
fn refraction_follows_snell() {
    let mut random = Random::new(1);
    for _ in 0..10_000 {
        let n = random.direction();
        let wo = random.direction();
        let wo = if wo.dot(n) < 0.0 { -wo } else { wo };
        let ior = random.range(1.0, 2.5);
        let entering = random.bits() & 1 == 0;
        let index = relative_index(ior, entering);
        let cos = wo.dot(n);
        let f = fresnel_dielectric(cos, index);
        if f.total {
            continue;
        }
        let wt = refract_about(wo, n, cos, index, f.g);
        let eta = if entering { ior } else { 1.0 / ior };
        let tangential = (wo - n * cos) + (wt - n * wt.dot(n)) * eta;
        assert!(tangential.length() < 1e-6, "{tangential}");
        assert!((wt.length() - 1.0).abs() < 1e-6 && wt.dot(n) <= 0.0);
    }
}

#[test]
fn schlick_meets_its_ends() {
    assert_eq!(schlick(Vec3::splat(0.04), 1.0), Vec3::splat(0.04));
    assert_eq!(schlick(Vec3::splat(0.04), 0.0), Vec3::ONE);
    assert_eq!(schlick(Vec3::ONE, 0.37), Vec3::ONE);
    let expected = 0.04 + 0.96 * 0.5f64.powi(5);
    assert!((f64::from(schlick(Vec3::splat(0.04), 0.5).x) - expected).abs() < 1e-8);
}
