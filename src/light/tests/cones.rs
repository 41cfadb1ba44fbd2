//! The cones of the virtual geometry's bounding spheres.

use std::f64::consts::{PI, TAU};

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::{Random, fit, pearson};
use crate::light::blocking::light_may_be_blocked;
use crate::light::cones::{
    cone_pdf, cone_sample, cone_solid_angle_fraction, cones_at, direction_meets_spheres,
};
use crate::packed::{Frame, LIGHT_QUAD, Light};

fn frame(spheres: &[[f32; 4]]) -> Frame {
    let mut frame = Frame::zeroed();
    frame.sphere_count = spheres.len() as u32;
    frame.spheres[..spheres.len()].copy_from_slice(spheres);
    frame
}

#[test]
fn samples_follow_the_mixture() {
    let n = Vec3::Y;
    let cases: [(&str, Vec<[f32; 4]>); 6] = [
        ("one", vec![[0.5, 2.0, 0.3, 0.8]]),
        (
            "overlapping",
            vec![
                [0.5, 2.0, 0.3, 0.8],
                [0.0, 1.5, 0.0, 0.7],
                [-2.0, 1.0, 1.0, 1.0],
            ],
        ),
        (
            "on the horizon",
            vec![[3.0, -0.3, 0.0, 1.0], [0.0, 0.1, -4.0, 1.5]],
        ),
        (
            "wide and narrow",
            vec![[0.0, 1.0, 0.0, 0.99], [4.0, 1.0, 0.0, 1.0]],
        ),
        ("around the point", vec![[0.0, 0.2, 0.0, 0.9]]),
        (
            "one below",
            vec![[0.0, -3.0, 0.0, 1.0], [2.0, 2.0, 0.0, 1.0]],
        ),
    ];
    for (name, spheres) in cases {
        let frame = frame(&spheres);
        let mut random = Random::new(21);
        let mut draw = || {
            let s = cone_sample(
                &cones_at(&frame, Vec3::ZERO, n),
                random.uniform(),
                random.uniforms(),
            );
            assert!(s.pdf > 0.0 && (s.direction.length() - 1.0).abs() < 1e-6);
            assert_eq!(
                s.pdf,
                cone_pdf(&cones_at(&frame, Vec3::ZERO, n), s.direction)
            );
            Some(s.direction)
        };
        let pdf = |d: Vec3| f64::from(cone_pdf(&cones_at(&frame, Vec3::ZERO, n), d));
        let result = fit(100_000, &mut draw, pdf);
        assert!(
            (result.integral - 1.0).abs() < 0.01,
            "{name}: {}",
            result.integral
        );
        assert!(
            result.holds(),
            "{name}: {} {}",
            result.statistic,
            result.limit
        );
        // Negative control: a tenth more on one side.
        let skewed = fit(100_000, &mut draw, |d| {
            pdf(d) * if d.x > 0.2 * d.z { 1.1 } else { 0.9 }
        });
        assert!(
            !skewed.holds(),
            "{name}: {} {}",
            skewed.statistic,
            skewed.limit
        );
    }
}

#[test]
fn tiny_cones_keep_their_distribution() {
    for radius in [3e-3_f32, 1e-3, 3e-4] {
        let frame = frame(&[[0.6, 0.8, 0.0, radius]]);
        let axis = Vec3::new(0.6, 0.8, 0.0).as_dvec3();
        let one_minus_cos = 1.0 - (1.0 - f64::from(radius).powi(2)).sqrt();
        let mut random = Random::new(22);
        let mut counts = vec![0.0; 64];
        for _ in 0..64_000 {
            let s = cone_sample(
                &cones_at(&frame, Vec3::ZERO, Vec3::Y),
                random.uniform(),
                random.uniforms(),
            );
            let want = 1.0 / (TAU * one_minus_cos);
            assert!(
                (f64::from(s.pdf) / want - 1.0).abs() < 1e-4,
                "{} {want}",
                s.pdf
            );
            let off = s.direction.as_dvec3().cross(axis).length_squared() / 2.0;
            let ring = (off / one_minus_cos * 8.0).min(7.0) as usize;
            // (0.8, -0.6, 0) and Z span the plane across the axis.
            let side = s.direction.as_dvec3().dot(DVec3::new(0.8, -0.6, 0.0));
            let turns = f64::from(s.direction.z).atan2(side) / TAU;
            let turn = ((turns + 0.5) * 8.0).min(7.0) as usize;
            counts[ring * 8 + turn] += 1.0;
        }
        let (statistic, limit) = pearson(&counts, &[1000.0; 64]);
        // Rounding of the direction moves samples between rings of the narrowest.
        assert!(statistic < 1.5 * limit, "{radius}: {statistic} {limit}");
        let skewed: Vec<f64> = (0..64)
            .map(|i| if i < 32 { 1060.0 } else { 940.0 })
            .collect();
        assert!(pearson(&counts, &skewed).0 > 1.5 * limit);
    }
}

#[test]
fn a_sphere_covers_its_form_factor() {
    // Irradiance of a unit-radiance sphere wholly above the horizon: pi (r / d)^2 cos.
    for (radius, height, side) in [
        (0.5_f32, 2.0_f32, 0.0_f32),
        (0.7, 1.5, 2.0),
        (1.9, 2.0, 0.5),
        (0.01, 1.0, 5.0),
    ] {
        let frame = frame(&[[side, height, 0.0, radius]]);
        let mut random = Random::new(23);
        let n = 200_000;
        let mut sum = 0.0;
        for _ in 0..n {
            let s = cone_sample(
                &cones_at(&frame, Vec3::ZERO, Vec3::Y),
                random.uniform(),
                random.uniforms(),
            );
            let d = s.direction.as_dvec3();
            let c = DVec3::new(side.into(), height.into(), 0.0);
            let inside = d.cross(c).length() < f64::from(radius) && d.dot(c) > 0.0;
            if inside {
                sum += d.y.max(0.0) / f64::from(s.pdf) / f64::from(n);
            }
        }
        let distance = f64::from(side).hypot(height.into());
        let want = PI * (f64::from(radius) / distance).powi(2) * f64::from(height) / distance;
        assert!((sum / want - 1.0).abs() < 0.01, "{sum} {want}");
        assert!((sum / (want * 1.03) - 1.0).abs() > 0.01);
        let fraction = f64::from(cone_solid_angle_fraction(&cones_at(
            &frame,
            Vec3::ZERO,
            Vec3::Y,
        )));
        assert!(fraction >= want / PI && fraction <= 1.0, "{fraction}");
    }
}

#[test]
fn only_cones_that_reach_above_the_horizon_count() {
    let above = |y: f32| {
        let frame = frame(&[[5.0, y, 0.0, 1.0]]);
        cone_sample(&cones_at(&frame, Vec3::ZERO, Vec3::Y), 0.5, [0.5; 2]).pdf > 0.0
    };
    assert!(above(0.5) && above(-0.999) && !above(-1.01));
    assert_eq!(
        cone_sample(&cones_at(&frame(&[]), Vec3::ZERO, Vec3::Y), 0.5, [0.5; 2]).pdf,
        0.0
    );
    assert_eq!(
        cone_pdf(&cones_at(&frame(&[]), Vec3::ZERO, Vec3::Y), Vec3::Y),
        0.0
    );
}

#[test]
fn no_ray_that_meets_a_sphere_is_turned_away() {
    let mut random = Random::new(24);
    let mut refused = 0;
    for _ in 0..200_000 {
        let distance = 10.0_f32.powf(random.uniform() * 10.0 - 4.0);
        let radius = distance * 10.0_f32.powf(-5.0 * random.uniform());
        let centre = random.direction() * distance;
        let frame = frame(&[[centre.x, centre.y, centre.z, radius]]);
        // A ray past the silhouette, by f64.
        let axis = centre.as_dvec3().normalize();
        let across = axis.any_orthonormal_vector();
        let length = centre.as_dvec3().length();
        let sin = (f64::from(radius) / length).min(1.0);
        let toward = |sin: f64| {
            (axis * (1.0 - sin * sin).max(0.0).sqrt() + across * sin)
                .normalize()
                .as_vec3()
        };
        let met = toward(sin * (1.0 - 1e-6));
        let truly =
            met.as_dvec3().normalize().cross(centre.as_dvec3()).length() <= f64::from(radius);
        if truly {
            assert!(
                direction_meets_spheres(&frame, Vec3::ZERO, met),
                "{centre} {radius}"
            );
        }
        if sin < 0.9 {
            refused += usize::from(!direction_meets_spheres(
                &frame,
                Vec3::ZERO,
                toward(sin * 1.05),
            ));
            assert!(!direction_meets_spheres(&frame, Vec3::ZERO, -met));
        }
    }
    assert!(refused > 100_000, "{refused}");
}

#[test]
fn a_light_counts_as_unblocked_only_where_no_direction_to_it_meets_a_sphere() {
    let mut random = Random::new(77);
    let (mut turned_down, mut near_misses) = (0, 0);
    for _ in 0..4000 {
        let [x, z, width, depth, tilt, skew] = random.uniforms();
        let light = Light {
            position: [x - 0.5, 2.0, z - 0.5, 0.0],
            axis_u: [0.2 + width, tilt - 0.5, 0.0, 0.0],
            axis_v: [skew - 0.5, 0.0, 0.2 + depth, 0.0],
            kind: LIGHT_QUAD,
            ..Light::zeroed()
        };
        let mut spheres = vec![[0.0; 4]; 1 + (random.uniform() * 3.0) as usize];
        for sphere in &mut spheres {
            let [x, y, z, radius] = random.uniforms();
            *sphere = [4.0 * x - 2.0, 2.5 * y, 4.0 * z - 2.0, 0.02 + 0.4 * radius];
        }
        let frame = frame(&spheres);
        let [x, z] = random.uniforms();
        let position = Vec3::new(4.0 * x - 2.0, 0.0, 4.0 * z - 2.0);
        let [corner, u, v] =
            [light.position, light.axis_u, light.axis_v].map(|[x, y, z, _]| Vec3::new(x, y, z));
        if u.cross(v).dot(position - corner) <= 0.0 {
            continue;
        }
        let blocked = (0..256)
            .filter(|_| {
                let [a, b] = random.uniforms();
                let direction = (corner + u * a + v * b - position).normalize();
                direction_meets_spheres(&frame, position, direction)
            })
            .count();
        let may = light_may_be_blocked(&frame, &light, position);
        assert!(may || blocked == 0, "{spheres:?} {light:?} {position}");
        turned_down += usize::from(!may);
        near_misses += usize::from(may && blocked == 0);
    }
    // It is worth its time, and rarely too careful.
    assert!(turned_down > 1000, "{turned_down}");
    assert!(
        near_misses < turned_down / 2,
        "{near_misses} of {turned_down}"
    );
}
