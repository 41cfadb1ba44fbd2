//! Directional albedos against furnaces, independent f64 integrals of the specification's formulas, and Fresnel's.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec3};

use super::kinds::*;
use super::{Random, around};
use crate::material::{Surface, bsdf_albedo, bsdf_directional_albedo_bound, bsdf_sample};

/// Mean weight of samples: the directional albedo, and its standard error.
fn albedo(s: &Surface, wo: Vec3, count: u32, seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let x = f64::from(bsdf_sample(s, wo, random.triple()).weight.x);
        sum += x;
        squares += x * x;
    }
    let mean = sum / f64::from(count);
    let variance = (squares / f64::from(count) - mean * mean).max(0.0);
    (mean, (variance / f64::from(count)).sqrt())
}

#[test]
fn white_bodies_vanish_in_a_furnace() {
    let mut random = Random::new(11);
    let mut tilted = lambertian();
    tilted.ns = around(tilted.ng, 0.5, 2.0);
    let tinted = Surface {
        base_color: Vec3::splat(0.9),
        ..metal(0.0)
    };
    for _ in 0..20_000 {
        let wo = around(
            lambertian().ng,
            f64::from(random.range(0.0, 1.57)),
            f64::from(random.range(0.0, 6.2)),
        );
        let u = random.triple();
        for s in [
            lambertian(),
            metal(0.0),
            glass(0.0, true),
            glass(0.0, false),
            sheet(0.0),
        ] {
            let sample = bsdf_sample(&s, wo, u);
            assert!(sample.valid, "{s:?} {wo}");
            assert_eq!(sample.weight, Vec3::ONE, "{s:?} {wo}");
        }
        for ior in [1.0, 1.000_1, 2.4] {
            let sample = bsdf_sample(
                &Surface {
                    ior,
                    ..glass(0.0, true)
                },
                wo,
                u,
            );
            assert_eq!(sample.weight, Vec3::ONE);
            if ior == 1.0 {
                assert_eq!(sample.wi, -wo);
            }
        }
        // What a tilted normal sends under the surface is lost, and nothing is gained.
        assert!(bsdf_sample(&tilted, wo, u).weight.max_element() <= 1.0);
        // Negative control.
        assert!(bsdf_sample(&tinted, wo, u).weight.x < 1.0);
    }
}

/// glTF 2.0, appendix B, in f64 from the formulas as printed: D, separable G, Schlick.
fn spec_brdf(s: &Surface, no: f64, ni: f64, nh: f64, oh: f64) -> f64 {
    let a2 = f64::from(s.ggx_alpha).powi(2);
    let d = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
    let g1 = |c: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
    let specular = d * g1(no) * g1(ni) / (4.0 * no * ni);
    let schlick = |f0: f64| f0 + (1.0 - f0) * (1.0 - oh).powi(5);
    let base = f64::from(s.base_color.x);
    let f0 = ((f64::from(s.ior) - 1.0) / (f64::from(s.ior) + 1.0)).powi(2);
    let f_max = schlick(f0);
    let dielectric = (1.0 - f_max) * base / PI + f_max * specular;
    let m = f64::from(s.metallic);
    m * schlick(base) * specular + (1.0 - m) * dielectric
}

/// Integral of `spec_brdf` times cosine over the hemisphere, in half-vector coordinates so that narrow lobes are resolved.
fn spec_albedo(s: &Surface, theta_o: f64) -> f64 {
    let wo = DVec3::new(theta_o.sin(), 0.0, theta_o.cos());
    let a = f64::from(s.ggx_alpha);
    let (rings, azimuths) = (2000, 500);
    let mut sum = 0.0;
    for i in 0..rings {
        // tan^2 = a^2 x / (1 - x): GGX's own distribution of angles; the weight below undoes it.
        let x = (f64::from(i) + 0.5) / f64::from(rings);
        let tan2 = a * a * x / (1.0 - x);
        let nh = 1.0 / (1.0 + tan2).sqrt();
        let sh = (1.0 - nh * nh).max(0.0).sqrt();
        let density = a * a / (PI * (nh * nh * (a * a - 1.0) + 1.0).powi(2)) * nh;
        for j in 0..azimuths {
            let phi = TAU * (f64::from(j) + 0.5) / f64::from(azimuths);
            let h = DVec3::new(sh * phi.cos(), sh * phi.sin(), nh);
            let oh = wo.dot(h);
            let wi = h * (2.0 * oh) - wo;
            if oh <= 0.0 || wi.z <= 0.0 {
                continue;
            }
            sum += spec_brdf(s, wo.z, wi.z, nh, oh) * wi.z * 4.0 * oh / density;
        }
    }
    sum / f64::from(rings * azimuths)
}

#[test]
fn directional_albedos_are_the_specifications() {
    let half_metal = Surface {
        metallic: 0.5,
        ..plastic(0.4)
    };
    for (i, s) in [
        metal(0.04),
        metal(0.25),
        metal(1.0),
        plastic(0.25),
        plastic(1.0),
        half_metal,
    ]
    .into_iter()
    .enumerate()
    {
        for theta in [0.2, 1.0, 1.4] {
            let expected = spec_albedo(&s, theta);
            let (mean, error) = albedo(&s, wo_at(&s, theta), 100_000, i as u64);
            let tolerance = 4.5 * error + 3e-4;
            assert!(
                (mean - expected).abs() < tolerance,
                "alpha {} at {theta}: {mean} +- {error}, {expected}",
                s.ggx_alpha
            );
            if s.ggx_alpha >= 0.2 {
                let other = Surface {
                    ggx_alpha: s.ggx_alpha * 0.8,
                    ior: 1.8,
                    ..s
                };
                let wrong = spec_albedo(&other, theta);
                // Negative control wherever roughness or index matters at all.
                if (wrong - expected).abs() > 2.0 * tolerance {
                    assert!((mean - wrong).abs() > tolerance);
                }
            }
        }
    }
}

#[test]
fn no_energy_is_made_by_glass_metal_or_coat() {
    let mut largest: f64 = 0.0;
    for (name, s) in surfaces().into_iter().chain([(
        "white",
        Surface {
            ggx_alpha: 0.0,
            ..plain_surface()
        },
    )]) {
        let conserves = s.transmission == 1.0 || s.metallic == 1.0 || name == "lambertian";
        for theta in [0.1, 1.0, 1.4, 1.55, FRAC_PI_2 - 1e-4] {
            let wo = wo_at(&s, theta);
            let (mean, error) = albedo(&seen_from(&s, wo), wo, 20_000, 3);
            let slack = 1e-5 + 4.0 * error;
            assert!(
                !conserves || mean <= 1.0 + slack,
                "{name} at {theta}: {mean}"
            );
            let bound = f64::from(bsdf_directional_albedo_bound(&s));
            assert!(mean <= bound + slack, "{name} at {theta}: {mean} {bound}");
            largest = largest.max(mean);
        }
    }
    // Negative control: a smooth white dielectric does exceed 1 at grazing angles, as glTF defines it.
    assert!(largest > 1.5, "{largest}");
}

#[test]
fn smooth_plastic_reflects_as_fresnel_says() {
    let s = plastic(0.0);
    let wo = wo_at(&s, 1.0);
    let mut random = Random::new(4);
    let (mut delta, mut diffuse) = (0.0, 0.0);
    let count = 200_000;
    for _ in 0..count {
        let sample = bsdf_sample(&s, wo, random.triple());
        if sample.delta {
            delta += f64::from(sample.weight.x);
        } else {
            diffuse += f64::from(sample.weight.x);
        }
    }
    let expected = 0.04 + 0.96 * (1.0 - 1.0f64.cos()).powi(5);
    assert!((delta / f64::from(count) - expected).abs() < 1e-3);
    // What bsdf_albedo says, to its approximation.
    let total = (delta + diffuse) / f64::from(count);
    assert!((total - f64::from(bsdf_albedo(&s, wo).x)).abs() < 0.03);
}
