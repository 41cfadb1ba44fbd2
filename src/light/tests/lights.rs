//! The choice of a light, delta lights and emissive triangles.

use crate::work::Watcher;
use glam::Vec3;

use super::{Random, fit, lit_by};
use crate::light::lights::{env_arriving, light_pdf_hit, light_sample, light_select};
use crate::material::{surface_at, triangle_emission};
use crate::pack::{test_mesh, test_scene};
use crate::packed::{LIGHT_TRIANGLE, PackedScene};
use crate::scene::{
    AlphaMode, Environment, EnvironmentMap, LightKind, Material, Side, Texture, TextureRef, Wrap,
};

fn point(intensity: f32) -> LightKind {
    LightKind::Point {
        position: [0.0, 2.0, 0.0],
        intensity: [intensity; 3],
    }
}

#[test]
fn the_alias_table_has_the_stated_probabilities() {
    for count in [1, 2, 7, 100] {
        let lights: Vec<LightKind> = (0..count)
            .map(|i| point(if i == 3 { 1e6 } else { i as f32 * i as f32 }))
            .collect();
        let environment = Environment {
            map: EnvironmentMap::Constant([1.0; 3]),
            rotation_deg: 0.0,
            scale: 1.0,
        };
        let scene = lit_by(Some(environment), &lights);
        let n = scene.lights.len();
        assert_eq!(n, count + 1);
        let mut found = vec![0.0; n];
        for (i, light) in scene.lights.iter().enumerate() {
            let stays = f64::from(light.alias_threshold);
            found[i] += stays / n as f64;
            found[light.alias_light as usize] += (1.0 - stays) / n as f64;
        }
        let stated: Vec<f64> = scene.lights.iter().map(|l| l.select_pdf.into()).collect();
        assert!((stated.iter().sum::<f64>() - 1.0).abs() < 1e-6);
        for (found, stated) in found.iter().zip(&stated) {
            assert!((found - stated).abs() < 1e-7, "{found} {stated}");
            // However dim, a light keeps its uniform share.
            assert!(*stated > 0.199_999 / n as f64);
        }
        // What is drawn is what the table says, and is not uniform.
        let mut random = Random::new(2);
        let mut counts = vec![0.0; n];
        for _ in 0..200_000 {
            let [u, coin] = random.uniforms();
            counts[light_select(&scene, u, coin) as usize] += 1.0;
        }
        let expect = |p: &dyn Fn(usize) -> f64| (0..n).map(|i| 200_000.0 * p(i)).collect();
        let expected: Vec<f64> = expect(&|i| stated[i]);
        let (statistic, limit) = super::pearson(&counts, &expected);
        assert!(statistic < limit, "{statistic} {limit}");
        if count >= 7 {
            let uniform: Vec<f64> = expect(&|_| 1.0 / n as f64);
            let (statistic, limit) = super::pearson(&counts, &uniform);
            assert!(statistic > limit);
        }
        assert!(
            (env_arriving(&scene, Vec3::X).1 * 4.0 * std::f32::consts::PI
                / scene.lights[count].select_pdf
                - 1.0)
                .abs()
                < 1e-6
        );
    }
}

#[test]
fn delta_lights_carry_their_irradiance() {
    let u = [0.3, 0.6];
    let s = light_sample(&lit_by(None, &[point(8.0)]), 0, Vec3::ZERO, u);
    assert_eq!((s.direction, s.distance, s.pdf), (Vec3::Y, 2.0, 1.0));
    assert!(s.delta);
    assert_eq!(s.radiance, Vec3::splat(2.0));
    // In the light itself nothing is drawn.
    assert_eq!(
        light_sample(&lit_by(None, &[point(8.0)]), 0, Vec3::Y * 2.0, u).pdf,
        0.0
    );

    let sun = LightKind::Directional {
        direction: [0.0, -3.0, 0.0],
        irradiance: [1.0, 2.0, 3.0],
    };
    let s = light_sample(&lit_by(None, &[sun]), 0, Vec3::splat(5.0), u);
    assert_eq!((s.direction, s.distance), (Vec3::Y, f32::INFINITY));
    assert_eq!(s.radiance, Vec3::new(1.0, 2.0, 3.0));

    let spot = LightKind::Spot {
        position: [0.0, 1.0, 0.0],
        direction: [0.0, -1.0, 0.0],
        intensity: [1.0; 3],
        inner_deg: 20.0,
        outer_deg: 40.0,
    };
    let scene = lit_by(None, &[spot]);
    let at = |deg: f32| {
        let s = light_sample(&scene, 0, Vec3::new(deg.to_radians().tan(), 0.0, 0.0), u);
        s.radiance.x * s.distance * s.distance
    };
    let ramp = |deg: f32| {
        let cos = |d: f32| d.to_radians().cos();
        ((cos(deg) - cos(40.0)) / (cos(20.0) - cos(40.0))).powi(2)
    };
    for (deg, want) in [
        (0.0, 1.0),
        (19.0, 1.0),
        (30.0, ramp(30.0)),
        (35.0, ramp(35.0)),
        (41.0, 0.0),
    ] {
        assert!((at(deg) - want).abs() < 1e-5, "{deg}: {} {want}", at(deg));
    }
}

/// An emissive triangle of area 2 in the plane z = -2, its texture's left half red and its right half green, half transparent.
fn textured_triangle() -> PackedScene {
    let texture = Texture {
        name: "emission".into(),
        width: 2,
        height: 1,
        rgba8: vec![[255, 0, 0, 255], [0, 255, 0, 255]],
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        nearest: false,
    };
    let material = Material {
        emissive: [3.0; 3],
        emissive_texture: Some(TextureRef {
            texture: texture.into(),
            uv_set: 0,
            transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        }),
        base_color: [1.0, 1.0, 1.0, 0.5],
        alpha_mode: AlphaMode::Blend,
        ..Material::default()
    };
    let mut mesh = test_mesh(
        Side::Virtual,
        &[[-1.0, 0.0, -2.0], [1.0, 0.0, -2.0], [-1.0, 2.0, -2.0]],
        &[[0, 1, 2]],
        material,
    );
    let instance = &mut mesh.instances[0];
    let mut primitive = (*instance.primitive).clone();
    primitive.uvs[0] = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    instance.primitive = primitive.into();
    let mut scene = test_scene();
    scene.objects.push(mesh);
    PackedScene::build(&scene, &Watcher::none()).expect("packs")
}

#[test]
fn emissive_triangles_are_drawn_by_area_with_their_texture() {
    let scene = textured_triangle();
    assert_eq!(scene.lights.len(), 1);
    let light = &scene.lights[0];
    assert_eq!(
        (light.kind, light.side, light.triangle),
        (LIGHT_TRIANGLE, 1, 0)
    );
    assert_eq!(scene.triangles[0].light, 0);
    assert!((light.radiance[3] - 2.0).abs() < 1e-6);
    let mut random = Random::new(4);
    // From both sides.
    for position in [Vec3::ZERO, Vec3::new(0.3, 0.5, -3.0)] {
        let ray = |direction: Vec3| crate::accel::Ray {
            origin: position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
            skip: crate::packed::NONE,
        };
        let mut colours = 0;
        let result = fit(
            100_000,
            || {
                let s = light_sample(&scene, 0, position, random.uniforms());
                let hit = scene.virtual_bvh.closest(&ray(s.direction));
                if hit.is_hit() {
                    // What a ray would see there, times the probability of meeting it.
                    let seen = surface_at(&scene, hit, s.direction);
                    let want = seen.emission * seen.coverage;
                    assert!((s.radiance - want).length() < 1e-3, "{} {want}", s.radiance);
                    colours += usize::from((s.radiance.x - light.radiance[0] * 0.5).abs() > 0.1);
                }
                let pdf = light_pdf_hit(&scene, 0, position, s.direction, s.distance);
                assert!((pdf / s.pdf - 1.0).abs() < 1e-5);
                Some(s.direction)
            },
            |d| {
                let hit = scene.virtual_bvh.closest(&ray(d));
                if !hit.is_hit() {
                    return 0.0;
                }
                light_pdf_hit(&scene, 0, position, d, hit.t).into()
            },
        );
        assert!((result.integral - 1.0).abs() < 0.02, "{}", result.integral);
        assert!(result.holds(), "{} {}", result.statistic, result.limit);
        // Negative control: the mean colour is not what is seen.
        assert!(colours > 50_000, "{colours}");
    }
    assert!((triangle_emission(&scene, 0, 0.0, 0.0) - Vec3::new(1.5, 0.0, 0.0)).length() < 1e-5);
}
