//! Weights, reciprocity and the edges of the range of every lobe.

use std::f64::consts::FRAC_PI_2;

use glam::Vec3;

use super::kinds::*;
use super::{Random, around};
use crate::material::normal::valid_shading_normal;
use crate::material::{Surface, bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_sample};
use crate::packed::{MATERIAL_THIN_WALLED, MATERIAL_UNLIT};

#[test]
fn weights_are_value_over_density_and_bounded() {
    let mut random = Random::new(7);
    let mut largest: f32 = 0.0;
    for (name, surface) in surfaces() {
        for _ in 0..5000 {
            let grazing = 10f64.powf(f64::from(random.range(-6.0, 0.19)));
            let wo = wo_at(&surface, FRAC_PI_2 - grazing);
            if wo.dot(surface.ng) <= 0.0 {
                continue;
            }
            let seen = seen_from(&surface, wo);
            let sample = bsdf_sample(&seen, wo, random.triple());
            if !sample.valid {
                assert_eq!(sample.weight, Vec3::ZERO);
                continue;
            }
            assert!(
                sample.weight.is_finite() && sample.wi.is_finite(),
                "{name} {wo}"
            );
            assert!((sample.wi.length() - 1.0).abs() < 1e-5);
            assert_eq!(sample.transmitted, sample.wi.dot(seen.ng) < 0.0, "{name}");
            largest = largest.max(sample.weight.max_element());
            if sample.delta {
                assert_eq!(sample.pdf, 0.0);
                continue;
            }
            let eval = bsdf_eval(&seen, wo, sample.wi);
            assert!((eval.pdf / sample.pdf - 1.0).abs() < 1e-5, "{name}");
            let product = sample.weight * sample.pdf;
            let error = (eval.f_cos - product).abs().max_element();
            assert!(error <= 2e-6 * eval.f_cos.max_element(), "{name} {error}");
        }
    }
    assert!(largest < 3.0, "{largest}");
}

#[test]
fn nothing_is_ever_non_finite() {
    let mut random = Random::new(8);
    let edge = [0.0f32, 1e-6, 1e-3, 0.5, 0.999, 1.0];
    let pick = |random: &mut Random, list: &[f32]| list[random.bits() as usize % list.len()];
    for _ in 0..200_000 {
        let mut s = plain_surface();
        s.ng = random.direction();
        let wo = around(
            s.ng,
            FRAC_PI_2 - 10f64.powf(f64::from(random.range(-7.0, 0.19))),
            f64::from(random.range(0.0, 6.2)),
        );
        if wo.dot(s.ng) <= 0.0 {
            continue;
        }
        s.ns = valid_shading_normal(s.ng, random.direction(), wo);
        s.coat_ns = valid_shading_normal(s.ng, random.direction(), wo);
        s.base_color = Vec3::new(
            pick(&mut random, &edge),
            pick(&mut random, &edge),
            pick(&mut random, &edge),
        );
        s.metallic = pick(&mut random, &edge);
        s.transmission = pick(&mut random, &edge);
        s.ggx_alpha = pick(&mut random, &edge);
        s.coat_alpha = pick(&mut random, &edge);
        s.clearcoat = pick(&mut random, &edge);
        s.specular = pick(&mut random, &edge);
        s.specular_color = Vec3::new(pick(&mut random, &[0.0, 1.0, 30.0]), 1.0, 0.0);
        s.ior = pick(
            &mut random,
            &[0.0, 0.5, 1.0, 1.000_01, 1.000_1, 1.5, 3.0, 100.0],
        );
        s.front = random.bits() & 1 == 0;
        s.flags = if random.bits() & 1 == 0 {
            MATERIAL_THIN_WALLED
        } else {
            0
        };
        let u = [
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
            pick(&mut random, &[0.0, 0.3, 0.7, 0.999_999_94]),
        ];
        let sample = bsdf_sample(&s, wo, u);
        let ok = sample.weight.is_finite() && sample.wi.is_finite() && sample.pdf.is_finite();
        assert!(
            ok && sample.weight.min_element() >= 0.0,
            "{s:?} {wo} {u:?} {sample:?}"
        );
        assert!(
            sample.weight.max_element() < 110.0,
            "{s:?} {wo} {u:?} {sample:?}"
        );
        for wi in [
            random.direction(),
            -wo,
            wo,
            sample.wi,
            around(s.ng, FRAC_PI_2, 1.0),
        ] {
            let eval = bsdf_eval(&s, wo, wi);
            let ok = eval.f_cos.is_finite() && eval.pdf.is_finite() && eval.pdf >= 0.0;
            assert!(
                ok && eval.f_cos.min_element() >= 0.0,
                "{s:?} {wo} {wi} {eval:?}"
            );
        }
        let albedo = bsdf_albedo(&s, wo);
        assert!(albedo.is_finite() && albedo.max_element() <= 1.0 && albedo.min_element() >= 0.0);
    }
}

#[test]
fn scattering_is_reciprocal() {
    let mut random = Random::new(12);
    let mut checked = 0;
    for _ in 0..20_000 {
        for s in [
            lambertian(),
            metal(0.3),
            plastic(0.3),
            sheet(0.3),
            glass(0.4, true),
        ] {
            let wo = random.direction();
            let wo = if wo.dot(s.ng) < 0.0 { -wo } else { wo };
            let wi = random.direction();
            let (no, ni) = (wo.dot(s.ng), wi.dot(s.ng).abs());
            if no < 1e-2 || ni < 1e-2 {
                continue;
            }
            let forward = bsdf_eval(&s, wo, wi).f_cos / ni;
            let mut turned = s;
            let mut index2 = 1.0;
            if wi.dot(s.ng) < 0.0 {
                turned.ng = -s.ng;
                turned.ns = -s.ns;
                if s.flags & MATERIAL_THIN_WALLED == 0 {
                    turned.front = !s.front;
                    // f / n_i^2 is symmetric.
                    index2 = s.ior * s.ior;
                }
            }
            let backward = bsdf_eval(&turned, wi, wo).f_cos / no * index2;
            if forward.max_element() < 1e-5 {
                continue;
            }
            checked += 1;
            let error = (forward - backward).abs().max_element();
            assert!(
                error < 2e-3 * forward.max_element() + 1e-5,
                "{s:?} {wo} {wi} {forward} {backward}"
            );
        }
    }
    assert!(checked > 20_000);
    // Negative control: a coat, weighted by one direction's Fresnel factor as the extension defines it, is not reciprocal.
    let s = coated(0.5, 0.2);
    let (a, b) = (wo_at(&s, 1.4), around(s.ng, 0.2, 2.0));
    let forward = bsdf_eval(&s, a, b).f_cos.x / b.dot(s.ng);
    let backward = bsdf_eval(&s, b, a).f_cos.x / a.dot(s.ng);
    assert!((forward / backward - 1.0).abs() > 0.05);
}

#[test]
fn kinds_of_surfaces_are_told_apart() {
    assert!(bsdf_is_delta(&metal(0.0)) && bsdf_is_delta(&glass(0.0, true)));
    assert!(bsdf_is_delta(&sheet(0.0)));
    assert!(!bsdf_is_delta(&metal(0.01)) && !bsdf_is_delta(&plastic(0.0)));
    assert!(!bsdf_is_delta(&lambertian()) && !bsdf_is_delta(&coated(0.0, 0.1)));
    let unlit = Surface {
        flags: MATERIAL_UNLIT,
        ..plain_surface()
    };
    assert!(bsdf_is_delta(&unlit));
    assert!(!bsdf_sample(&unlit, unlit.ng, [0.5; 3]).valid);
    assert_eq!(bsdf_eval(&unlit, unlit.ng, unlit.ng).f_cos, Vec3::ZERO);
    assert_eq!(bsdf_albedo(&unlit, unlit.ng), Vec3::ZERO);
}
