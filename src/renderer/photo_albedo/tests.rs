use super::*;
use crate::pack::{test_mesh, test_scene};
use crate::scene::{
    EncodedPhoto, Environment, EnvironmentMap, Light, LightKind, Material, Object, Scene, Side,
};
use crate::work::Watcher;

/// A square that faces the camera from 1 m, with corners at x = `from` and x = `to`.
fn wall(from: f32, to: f32) -> Object {
    let corners = [
        [from, -0.5, -1.0],
        [to, -0.5, -1.0],
        [to, 0.5, -1.0],
        [from, 0.5, -1.0],
    ];
    let mut wall = test_mesh(
        Side::Real,
        &corners,
        &[[0, 1, 2], [0, 2, 3]],
        Material::default(),
    );
    wall.albedo_from_photo = true;
    wall
}

/// In a white furnace without bounces a surface shows its albedo. Two walls share the view, one a quarter and one three quarters of it,
/// and reach beyond it; a third is behind the camera.
fn scene() -> (Scene, Photo) {
    let mut scene = test_scene();
    let camera = &mut scene.camera;
    (camera.width, camera.height) = (32, 32);
    (camera.fx, camera.fy, camera.cx, camera.cy) = (32.0, 32.0, 16.0, 16.0);
    scene.settings.max_bounces = 1;
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    let mut behind = wall(-0.5, 0.5);
    behind.world_from_object = glam::DMat4::from_translation(glam::DVec3::Z * 5.0);
    scene.objects = vec![wall(-2.0, -0.25), wall(-0.25, 2.0), behind];
    let linear = (0..32 * 32)
        .map(|i| {
            if i % 32 < 8 {
                [0.8, 0.2, 0.1]
            } else {
                [0.1, 0.2, 0.6]
            }
        })
        .collect();
    let photo = Photo {
        width: 32,
        height: 32,
        linear,
        encoded: EncodedPhoto::Linear,
        tags: Default::default(),
    };
    (scene, photo)
}

fn close(found: &[f32; 4], expected: [f32; 3]) -> bool {
    (0..3).all(|c| (found[c] - expected[c]).abs() < 0.015)
}

/// Whichever came first, the savings to do without or the estimate.
#[test]
fn savings_left_out_do_not_change_the_estimate() {
    let (mut scene, photo) = scene();
    scene.environment = None;
    scene.lights = vec![Light {
        side: Side::Real,
        kind: LightKind::Quad {
            corner: [-0.5, -0.5, 0.5],
            edge_u: [0.0, 1.0, 0.0],
            edge_v: [1.0, 0.0, 0.0],
            radiance: [4.0; 3],
        },
    }];
    let estimate = |flags: u32| {
        let mut packed = PackedScene::build(&scene, &Watcher::none()).expect("packs");
        packed.frame.flags |= flags;
        estimate_photo_albedo(&mut packed, &photo, &Watcher::none());
        assert_eq!(packed.frame.flags & flags, flags, "the renders keep theirs");
        let seen: f32 = (0..64)
            .map(|i| render_first_hit(&packed, 16 * 33, i).0.x)
            .sum();
        (seen, packed.photo_albedo)
    };
    let (with, without) = (estimate(0), estimate(FRAME_NO_LAST_VERTEX));
    assert!(with.0 > 0.0);
    assert_ne!(with.0, without.0, "control: other samples");
    assert_eq!(with.1, without.1);
}

#[test]
fn each_object_has_the_means_of_its_own_pixels() {
    let (scene, photo) = scene();
    let mut packed = PackedScene::build(&scene, &Watcher::none()).expect("packs");
    estimate_photo_albedo(&mut packed, &photo, &Watcher::none());
    let of_objects = &packed.photo_albedo[32 * 32..];
    let (red, blue) = ([0.8, 0.2, 0.1], [0.1, 0.2, 0.6]);
    let patches = 2 * PHOTO_PATCHES as usize;
    assert_eq!(of_objects.len(), 3 * patches);
    let seen = |object: usize| -> Vec<[f32; 4]> {
        let pairs = of_objects[object * patches..][..patches].chunks(2);
        let albedos = pairs.map(|pair| pair[0]);
        albedos.filter(|albedo| albedo[3] > 0.0).collect()
    };
    let all = |object: usize, color: [f32; 3]| seen(object).iter().all(|a| close(a, color));
    assert!(seen(0).len() >= 4 && all(0, red), "{of_objects:?}");
    assert!(seen(1).len() >= 8 && all(1, blue), "{of_objects:?}");
    // Seen by no pixel: what the picture shows.
    let pixels = |color: [f32; 3]| -> f32 {
        let patches = seen(2).into_iter().filter(|a| close(a, color));
        patches.map(|albedo| albedo[3]).sum()
    };
    assert_eq!(pixels(red) + pixels(blue), 1024.0);
    assert_eq!(pixels(red), 256.0);
    assert!(!all(0, blue), "control");
}

/// A photograph of two colours in fine stripes: what it does not show has a mixture of them, never a colour that is in neither.
#[test]
fn what_is_not_seen_has_the_mean_colour_of_what_is_near() {
    let (scene, mut photo) = scene();
    for (i, pixel) in photo.linear.iter_mut().enumerate() {
        *pixel = if i % 2 == 0 {
            [0.8, 0.1, 0.1]
        } else {
            [0.1, 0.1, 0.8]
        };
    }
    let mut packed = PackedScene::build(&scene, &Watcher::none()).expect("packs");
    let (_, limited) = estimate_photo_albedo(&mut packed, &photo, &Watcher::none());
    assert_eq!(limited, 0.0);
    let direction = Vec3::new(0.8, 0.0, -1.0).normalize();
    let hit = packed.real_bvh.closest(&Ray {
        origin: Vec3::ZERO,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    });
    let found = crate::material::surface_at(&packed, hit, direction).base_color;
    assert!(
        (found - Vec3::new(0.45, 0.1, 0.45)).abs().max_element() < 0.02,
        "{found}"
    );
    let median = Vec3::new(0.8, 0.1, 0.8);
    assert!((found - median).abs().max_element() > 0.2, "control");
}

/// Light of an eighth of what the photograph shows cannot be explained by any albedo.
#[test]
fn light_that_does_not_fit_is_counted() {
    let (mut scene, photo) = scene();
    let share = |scene: &Scene| {
        let mut packed = PackedScene::build(scene, &Watcher::none()).expect("packs");
        estimate_photo_albedo(&mut packed, &photo, &Watcher::none()).1
    };
    let rough = |scene: &Scene| {
        let mut packed = PackedScene::build(scene, &Watcher::none()).expect("packs");
        roughly_limited_share(&mut packed, &photo)
    };
    assert_eq!(share(&scene), 0.0, "control");
    assert_eq!(rough(&scene), 0.0, "control");
    scene.environment.as_mut().expect("has one").map = EnvironmentMap::Constant([0.125; 3]);
    assert!(share(&scene) > 0.9);
    assert!(rough(&scene) > 0.9);
}

/// Of a draft: another exposure and camera take the light that was found, and come to the albedo of an estimate of their own. Control: the albedo of
/// before.
#[test]
fn light_that_was_found_serves_another_exposure_and_camera() {
    let (mut scene, photo) = scene();
    let mut packed = PackedScene::build(&scene, &Watcher::none()).expect("packs");
    let (light, _) = estimate_photo_albedo(&mut packed, &photo, &Watcher::none());
    // Mean over pixels and channels: the light was found by few rays.
    let mean_error = |packed: &PackedScene, exact: &PackedScene| {
        let pairs = packed.photo_albedo.iter().zip(&exact.photo_albedo);
        let errors = pairs.take(32 * 32).map(|(a, b)| {
            let off = Vec3::from_slice(a) - Vec3::from_slice(b);
            off.abs().element_sum() / 3.0
        });
        errors.sum::<f32>() / (32.0 * 32.0)
    };
    scene.settings.exposure = crate::scene::Exposure::Ev(1.0);
    scene.camera.world_from_camera =
        glam::DMat4::from_translation(glam::DVec3::new(0.125, 0.0, 0.0));
    packed.set_settings(&scene);
    packed.set_camera(&scene);
    let build = |anchor| PackedScene::build_at(&scene, anchor, &Watcher::none()).expect("packs");
    let mut exact = build(glam::DVec3::ZERO);
    estimate_photo_albedo(&mut exact, &photo, &Watcher::none());
    assert!(mean_error(&packed, &exact) > 0.1, "control");
    let here = light.take_up(&mut packed, &photo).expect("the same anchor");
    let error = mean_error(&packed, &exact);
    assert!(error < 0.02, "{error}");
    let (taken, before) = (packed.photo_albedo.clone(), packed.frame.exposure_scale);
    packed.frame.exposure_scale *= 3.0;
    here.set_albedo(&mut packed, &photo);
    assert_ne!(packed.photo_albedo, taken, "control");
    packed.frame.exposure_scale = before;
    here.set_albedo(&mut packed, &photo);
    assert_eq!(packed.photo_albedo, taken);
    let elsewhere = light.take_up(&mut build(glam::DVec3::X), &photo);
    assert!(elsewhere.is_none(), "another anchor");
}
