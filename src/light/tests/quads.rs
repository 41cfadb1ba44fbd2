//! Quads: by solid angle where they are rectangles, by area else.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::{Random, fit, lit_by};
use crate::light::lights::{light_pdf_hit, light_sample};
use crate::packed::PackedScene;
use crate::scene::LightKind;

#[derive(Clone, Copy)]
struct Quad {
    corner: DVec3,
    u: DVec3,
    v: DVec3,
}

impl Quad {
    fn new(corner: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Self {
        Self {
            corner: corner.into(),
            u: u.into(),
            v: v.into(),
        }
    }

    fn scene(&self) -> PackedScene {
        let kind = LightKind::Quad {
            corner: self.corner.to_array(),
            edge_u: self.u.to_array(),
            edge_v: self.v.to_array(),
            radiance: [2.0; 3],
        };
        lit_by(None, &[kind])
    }

    /// Distance along `d` from `from` to the bright side, in f64.
    fn meet(&self, from: DVec3, d: DVec3) -> Option<f64> {
        let n = self.u.cross(self.v);
        let cos = -d.dot(n);
        if cos <= 0.0 {
            return None;
        }
        let t = (from - self.corner).dot(n) / cos;
        let at = from + d * t - self.corner;
        let a = at.cross(self.v).dot(n) / n.length_squared();
        let b = self.u.cross(at).dot(n) / n.length_squared();
        (t > 0.0 && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b)).then_some(t)
    }

    /// Lambert's formula for the irradiance over radiance of a polygon above the horizon of the unit vector `n`.
    fn form_factor(&self, from: DVec3, n: DVec3) -> f64 {
        let corners = [
            self.corner,
            self.corner + self.u,
            self.corner + self.u + self.v,
            self.corner + self.v,
        ]
        .map(|c| (c - from).normalize());
        let sum: f64 = (0..4)
            .map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % 4]);
                a.cross(b).normalize().dot(n) * a.dot(b).clamp(-1.0, 1.0).acos()
            })
            .sum();
        0.5 * sum.abs()
    }
}

/// Name, quad, point, whether the solid angle decides.
fn cases() -> Vec<(&'static str, Quad, DVec3, bool)> {
    let ceiling = Quad::new([-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
    let turned = Quad::new([0.3, 1.0, -0.5], [0.6, 0.8, 0.0], [0.8, -0.6, 3.0 * 0.0]);
    let oblique = Quad::new([-1.0, 2.0, -1.0], [2.0, 0.5, 0.0], [1.0, 0.0, 2.0]);
    let at = DVec3::new;
    vec![
        ("above", ceiling, at(0.1, 0.0, 0.2), true),
        ("aside", ceiling, at(3.0, 0.5, -0.4), true),
        ("beyond a corner", ceiling, at(2.0, 1.0, 2.5), true),
        ("close", ceiling, at(0.9, 1.99, 0.4), true),
        ("grazing", ceiling, at(1.3, 1.8, 0.4), true),
        ("turned", turned, at(0.6, 1.0, 1.2), true),
        ("turned, other side", turned, at(0.6, 1.0, -1.7), true),
        ("oblique", oblique, at(0.1, 0.0, 0.2), false),
        ("far", ceiling, at(2.0, -18.0, 3.0), false),
    ]
}

#[test]
fn samples_follow_the_density_and_carry_the_form_factor() {
    for (name, quad, from, by_solid_angle) in cases() {
        let scene = quad.scene();
        let position = from.as_vec3();
        let toward = quad.corner + 0.5 * (quad.u + quad.v) - from;
        let bright = -toward.dot(quad.u.cross(quad.v)) > 0.0;
        let mut random = Random::new(5);
        let mut densities = Vec::new();
        let samples = 100_000;
        let mut energy = 0.0;
        // Faces the quad, so that all of it is above the horizon.
        let normal = -quad.u.cross(quad.v).normalize();
        let result = fit(
            samples,
            || {
                let s = light_sample(&scene, 0, position, random.uniforms());
                if s.pdf == 0.0 {
                    return None;
                }
                let d = s.direction;
                let hit = quad.meet(from, d.as_dvec3());
                // Rounding may put a sample of the rim beside it.
                assert!(hit.is_none_or(|t| (t / f64::from(s.distance) - 1.0).abs() < 1e-4));
                let pdf = light_pdf_hit(&scene, 0, position, d, s.distance);
                assert!((s.pdf / pdf - 1.0).abs() < 1e-4, "{name}: {} {pdf}", s.pdf);
                densities.push(s.pdf);
                energy += normal.dot(d.as_dvec3()) / f64::from(s.pdf) / samples as f64;
                Some(d)
            },
            |d| {
                let hit = quad.meet(from, d.as_dvec3());
                hit.map_or(0.0, |t| {
                    f64::from(light_pdf_hit(&scene, 0, position, d, t as f32))
                })
            },
        );
        if !bright {
            assert!(densities.is_empty(), "{name}");
            continue;
        }
        assert_eq!(densities.len(), samples, "{name}");
        if name != "far" {
            assert!(
                (result.integral - 1.0).abs() < 0.02,
                "{name}: {}",
                result.integral
            );
            assert!(
                result.holds(),
                "{name}: {} {}",
                result.statistic,
                result.limit
            );
        }
        let constant = densities
            .iter()
            .all(|p| (p / densities[0] - 1.0).abs() < 1e-6);
        assert_eq!(constant, by_solid_angle, "{name}");
        let want = quad.form_factor(from, normal);
        assert!(
            (energy / want - 1.0).abs() < 0.02,
            "{name}: {energy} {want}"
        );
        // Negative control: the form factor of another place.
        let elsewhere = quad.form_factor(from + normal * 0.05 * toward.length(), normal);
        assert!((energy / elsewhere - 1.0).abs() > 0.02, "{name}");
    }
}

#[test]
fn the_chi_squared_test_tells_area_from_solid_angle() {
    let (_, quad, from, _) = cases()[4];
    let scene = quad.scene();
    let mut random = Random::new(6);
    let result = fit(
        100_000,
        || Some(light_sample(&scene, 0, from.as_vec3(), random.uniforms()).direction),
        |d| {
            let n = quad.u.cross(quad.v);
            quad.meet(from, d.as_dvec3())
                .map_or(0.0, |t| t * t / -d.as_dvec3().dot(n))
        },
    );
    assert!((result.integral - 1.0).abs() < 0.05, "{}", result.integral);
    assert!(!result.holds(), "{} {}", result.statistic, result.limit);
}

#[test]
fn solid_angles_are_those_of_f64() {
    let mut random = Random::new(9);
    let mut compared = 0;
    for _ in 0..5000 {
        let scale = 10.0_f64.powf(f64::from(random.uniform()) * 8.0 - 4.0);
        let r: [f32; 6] = random.uniforms();
        let [x, y, z, w, h, k] = r.map(f64::from);
        let quad = Quad::new(
            [(x - 0.5) * scale, scale, (y - 0.5) * scale],
            [scale * (0.1 + 2.0 * w), 0.0, 0.0],
            [0.0, 0.0, scale * (0.1 + 2.0 * h)],
        );
        let from = DVec3::new((z - 0.5) * scale, scale * (1.0 - k), 0.0);
        // Eriksson's formula for both triangles.
        let corner = |a: f64, b: f64| (quad.corner + quad.u * a + quad.v * b - from).normalize();
        let triangle = |a: DVec3, b: DVec3, c: DVec3| {
            let above = a.dot(b.cross(c)).abs();
            2.0 * above.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        };
        let want = triangle(corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0))
            + triangle(corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0));
        if !(0.021..6.0).contains(&want) {
            continue;
        }
        compared += 1;
        let scene = quad.scene();
        let s = light_sample(&scene, 0, from.as_vec3(), random.uniforms());
        let found = 1.0 / f64::from(s.pdf);
        assert!((found / want - 1.0).abs() < 2e-4, "{found} {want}");
        assert!((found / (want * 1.001) - 1.0).abs() > 2e-4);
        let at = from + s.direction.as_dvec3() * f64::from(s.distance);
        let away = (at - quad.corner)
            .dot(quad.u.cross(quad.v).normalize())
            .abs();
        assert!(away < 1e-5 * scale, "{away} {scale}");
    }
    assert!(compared > 2000, "{compared}");
}

#[test]
fn a_quad_emits_to_one_side() {
    let quad = Quad::new([-1.0, 2.0, -1.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0]);
    // z cross x is +y: up.
    let scene = quad.scene();
    let u = [0.3, 0.7];
    assert_eq!(light_sample(&scene, 0, Vec3::ZERO, u).pdf, 0.0);
    let above = light_sample(&scene, 0, Vec3::Y * 3.0, u);
    assert!(above.pdf > 0.0 && above.direction.y < 0.0 && !above.delta);
    assert_eq!(above.radiance, Vec3::splat(2.0));
    assert!(f64::from(above.pdf) > 1.0 / (2.0 * PI));
}
