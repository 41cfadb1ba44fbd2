use std::sync::Arc;

use super::*;
use crate::pack::test_scene;
use crate::scene::{Environment, EnvironmentMap, Light, LightKind, Side};
use crate::work::Watcher;

fn packed(environment: Option<EnvironmentMap>, lights: Vec<Light>) -> PackedScene {
    let mut scene = test_scene();
    scene.environment = environment.map(|map| Environment {
        map,
        rotation_deg: 0.0,
        scale: 1.0,
    });
    scene.lights = lights;
    PackedScene::build(&scene, &Watcher::none()).expect("packs")
}

fn lamp(side: Side) -> Light {
    Light {
        side,
        kind: LightKind::Quad {
            corner: [-0.05, 1.0, -0.05],
            edge_u: [0.1, 0.0, 0.0],
            edge_v: [0.0, 0.0, 0.1],
            radiance: [100.0; 3],
        },
    }
}

#[test]
fn an_even_sky_lights_every_normal_alike() {
    let scene = packed(Some(EnvironmentMap::Constant([1.0, 2.0, 3.0])), Vec::new());
    let unoccluded = Unoccluded::of(&scene);
    for normal in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
        let light = unoccluded.light(&scene, Vec3::ZERO, normal);
        let off = (light / Vec3::new(1.0, 2.0, 3.0) - 1.0).abs();
        assert!(off.max_element() < 0.01, "{light}");
    }
}

#[test]
fn a_bright_upper_half_lights_by_the_cosine() {
    let texel = |i: u32| [if i / 128 < 32 { 1.0 } else { 0.0 }; 3];
    let map = EnvironmentMap::LatLong {
        width: 128,
        height: 64,
        texels: Arc::new((0..128 * 64).map(texel).collect()),
    };
    let scene = packed(Some(map), Vec::new());
    let unoccluded = Unoccluded::of(&scene);
    for (normal, share) in [(Vec3::Y, 1.0), (Vec3::X, 0.5), (Vec3::NEG_Y, 0.0)] {
        let light = unoccluded.light(&scene, Vec3::ZERO, normal).x;
        assert!((light - share).abs() < 0.02, "{normal} {light}");
    }
}

#[test]
fn a_real_lamp_lights_what_faces_it() {
    let light = |side, normal: Vec3| {
        let scene = packed(None, vec![lamp(side)]);
        let below = Vec3::from(scene.anchor_m.map(|m| -m as f32));
        Unoccluded::of(&scene).light(&scene, below, normal).x
    };
    // A small lamp 1 m above: L A / (pi d^2).
    let expected = 100.0 * 0.01 * INV_PI;
    let found = light(Side::Real, Vec3::Y);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    let tilted = light(Side::Real, Vec3::new(0.8, 0.6, 0.0));
    assert!((tilted / expected - 0.6).abs() < 0.01, "{tilted}");
    assert_eq!(light(Side::Real, Vec3::NEG_Y), 0.0);
    assert_eq!(
        light(Side::Virtual, Vec3::Y),
        0.0,
        "it lights no photograph"
    );
}
