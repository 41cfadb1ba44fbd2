//! Shading normals apart from the geometric one: Lambert's law where it is defined, and how it ends.

use std::f64::consts::PI;

use glam::Vec3;

use super::around;
use super::kinds::*;
use crate::material::{Surface, bsdf_eval};
use crate::packed::MATERIAL_NORMAL_MAPPED;

/// Tilted by an angle, in the plane of azimuth 0.
fn tilted(tilt: f64, flags: u32) -> Surface {
    let mut s = lambertian();
    s.ns = around(s.ng, tilt, 0.0);
    s.flags |= flags;
    s
}

/// The response to a light at that elevation over the surface, in the same plane.
fn response(s: &Surface, elevation: f64) -> (f64, f64) {
    let wi = around(s.ng, PI / 2.0 - elevation, 0.0);
    let f = f64::from(bsdf_eval(s, s.ng, wi).f_cos.x);
    (f, f64::from(s.ns.dot(wi)).max(0.0) / PI)
}

#[test]
fn normal_maps_follow_lamberts_law_as_far_as_the_surface_is_lit() {
    for tilt in [0.1, 0.5, PI / 4.0, 1.2] {
        let s = tilted(tilt, MATERIAL_NORMAL_MAPPED);
        for elevation in [0.05, 14.0_f64.to_radians(), 0.8, 1.5] {
            let (found, expected) = response(&s, elevation);
            assert!(
                (found - expected).abs() < 1e-6,
                "{tilt} {elevation}: {found} {expected}"
            );
        }
        assert_eq!(response(&s, -0.01).0, 0.0);
    }
    // The case that a picture was wrong by: 45 degrees, light at 14.
    let (found, _) = response(
        &tilted(PI / 4.0, MATERIAL_NORMAL_MAPPED),
        14.0_f64.to_radians(),
    );
    assert!((found - 0.2728).abs() < 1e-4, "{found}");
    assert!((found - 0.4368).abs() > 0.1, "control");
}

#[test]
fn facets_of_smooth_meshes_fade_towards_their_horizon() {
    let s = tilted(0.2, 0);
    let (mut before, mut largest_step) = (0.0, 0.0f64);
    for i in 0..=1000 {
        let elevation = -0.01 + 0.5 * f64::from(i) / 1000.0;
        let (found, lambert) = response(&s, elevation);
        assert!(found <= lambert + 1e-7, "no more than Lambert's law");
        largest_step = largest_step.max((found - before).abs());
        before = found;
    }
    // Lambert's law begins with a step of sin(0.2) / pi there.
    assert!(largest_step < 0.002, "{largest_step}");
    let mapped = tilted(0.2, MATERIAL_NORMAL_MAPPED);
    let step = response(&mapped, 1e-3).0 - response(&mapped, -1e-3).0;
    assert!(step > 0.05, "control: {step}");
    // From its own side of the normal the facet is higher than the smooth surface, and keeps all.
    let wi = around(s.ng, 1.0, PI);
    let kept = f64::from(bsdf_eval(&s, s.ng, wi).f_cos.x) * PI / f64::from(s.ns.dot(wi));
    assert!((kept - 1.0).abs() < 1e-6, "{kept}");
    let flat = lambertian();
    assert_eq!(
        bsdf_eval(&flat, flat.ng, wi).f_cos,
        Vec3::splat(flat.ns.dot(wi).max(0.0) * std::f32::consts::FRAC_1_PI)
    );
}

/// Light from all around in the plane of the tilts, which are those of the facets of a sphere of 160 segments.
#[test]
fn fading_keeps_the_light_of_a_fine_mesh() {
    let half_facet = PI / 160.0;
    let (mut kept, mut all, mut by_chiang) = (0.0, 0.0, 0.0);
    for tilt in (-20..=20).map(|i| half_facet * f64::from(i) / 20.0) {
        let s = tilted(tilt, 0);
        for elevation in (0..4000).map(|i| PI * (f64::from(i) + 0.5) / 4000.0) {
            let (found, lambert) = response(&s, elevation);
            kept += found;
            all += lambert;
            let g = (elevation.sin() / (elevation + tilt).sin() / tilt.cos()).min(1.0);
            by_chiang += lambert * (g + g * g - g * g * g);
        }
    }
    assert!(
        (kept / all - 1.0).abs() < 1e-4,
        "lost {:e}",
        1.0 - kept / all
    );
    let lost = 1.0 - by_chiang / all;
    assert!(lost > 4e-4, "control: {lost:e}");
}
