//! Textures and normals where they belong: unlit pictures against the texture, matt ones against Lambert's law.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;
use mixray::scene::Scene;

use super::reference::{Met, picture, rms};
use super::*;

fn distance(a: &[(DVec3, f64)], b: &Shot) -> f64 {
    let a = a.iter().flat_map(|(c, _)| c.to_array());
    let b = b
        .picture
        .linear
        .as_flattened()
        .iter()
        .map(|&x| f64::from(x));
    rms(a, b)
}

fn base_color(met: &Met, _: DVec3) -> DVec3 {
    let [r, g, b, _] = met.base_color();
    DVec3::new(r, g, b)
}

/// Without light and unlit, a model shows its base colour, where texture coordinates, their transform and the wrap modes put it.
#[test]
fn unlit_models_show_their_texture_in_its_place() {
    for (name, toward) in [
        ("BoxTextured.glb", [0.55, 0.35, 1.0]),
        ("Duck.glb", [0.55, 0.35, 1.0]),
        ("CesiumMilkTruck.glb", [0.55, 0.35, 1.0]),
        (
            "TextureTransformTest/TextureTransformTest.gltf",
            [0.0, 0.0, 1.0],
        ),
    ] {
        let Some(mut scene) = model(name, DARK) else {
            return;
        };
        frame(&mut scene, toward);
        repaint(&mut scene, |m| m.unlit = true);
        let mut flipped = scene.clone();
        for instance in &mut flipped.objects[0].instances {
            let mut primitive = (*instance.primitive).clone();
            for uv in &mut primitive.uvs[0] {
                uv[1] = 1.0 - uv[1];
            }
            instance.primitive = primitive.into();
        }
        let expected = picture(&scene, base_color);
        let shot = shoot(scene);
        let far = distance(&expected, &shot);
        assert!(far < 0.03, "{name}: {far}");
        let control = distance(&picture(&flipped, base_color), &shot);
        assert!(control > 0.05, "{name}: negative control {control}");
    }
}

/// The tick of each upper quad and the arrow of each lower one, by the colours that the test's author chose: each image shows
/// another one where its transform is left out.
#[test]
fn texture_transforms_show_the_ticks() {
    let Some(mut scene) = model("TextureTransformTest/TextureTransformTest.gltf", DARK) else {
        return;
    };
    frame(&mut scene, [0.0, 0.0, 1.0]);
    repaint(&mut scene, |m| m.unlit = true);
    let corner = |x: f64| project(&scene, DVec3::new(x - 0.35, 0.9, 0.0));
    let places = [-1.1, 0.0, 1.1].map(corner);
    let untransformed = {
        let mut scene = scene.clone();
        repaint(&mut scene, |m| {
            if let Some(texture) = &mut m.base_color_texture {
                texture.transform = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
            }
        });
        shoot(scene)
    };
    let shot = shoot(scene);
    let [u, v, uv] = places.map(|at| shot.mean_around(at, 1.5));
    assert!(u.y > 2.0 * u.x && u.y > 2.0 * u.z, "green: {u}");
    assert!(v.z > 2.0 * v.x && v.z > 2.0 * v.y, "blue: {v}");
    assert!(uv.y > 2.0 * uv.x && uv.z > 2.0 * uv.x, "cyan: {uv}");
    let control = untransformed.mean_around(places[0], 1.5);
    assert!(control.y < 1.1 * control.x, "negative control: {control}");
}

/// Matt grey under a light from the camera's side: radiance = albedo / pi * irradiance * cos, the cosine that of the vertex normals.
/// A mirrored node whose normals or winding were turned inside out would be black.
fn lambert_error(scene: &mut Scene, sign: f64) -> (f64, f64) {
    repaint(scene, grey);
    scene.settings.max_bounces = 1;
    let toward_light = -DVec3::new(-0.55, -0.35, -1.0).normalize();
    let expected = picture(scene, |met, direction| {
        // Both sides reflect, by the normal on the camera's side.
        let normal = if met.normal.dot(direction) > 0.0 {
            -met.normal
        } else {
            met.normal
        };
        DVec3::splat((sign * normal.dot(toward_light)).max(0.0) * 0.8 * FRAC_1_PI * 3.0)
    });
    let shot = shoot(scene.clone());
    (distance(&expected, &shot), shot.mean().x)
}

#[test]
fn mirrored_nodes_are_lit_from_outside() {
    let light = "[[light]]\nkind = \"directional\"\ndirection = [-0.55, -0.35, -1.0]\nirradiance = [3, 3, 3]\n";
    for name in [
        "Node_NegativeScale/Node_NegativeScale_01.gltf",
        "Node_NegativeScale/Node_NegativeScale_12.gltf",
        "Duck.glb",
    ] {
        let Some(mut scene) = model(name, light) else {
            return;
        };
        frame(&mut scene, [0.55, 0.35, 1.0]);
        let (far, mean) = lambert_error(&mut scene, 1.0);
        assert!(mean > 0.02, "{name}: {mean}");
        assert!(far < 0.04, "{name}: {far}");
        let (control, _) = lambert_error(&mut scene, -1.0);
        assert!(control > 0.1, "{name}: negative control {control}");
    }
}

/// The red wall tints the floor on its side, the green one on the other: only by the second bounce.
#[test]
fn the_cornell_box_bleeds_its_walls_colours() {
    let Some(mut scene) = model("cornellBox.glb", WHITE_SKY) else {
        return;
    };
    scene.camera.fx *= 0.53;
    scene.camera.fy *= 0.53;
    look(
        &mut scene,
        DVec3::new(0.0, 1.5, 4.5),
        DVec3::new(0.0, 1.5, 0.0),
    );
    scene.settings.rays_per_pixel = 64;
    let wall_x = |name: &str| {
        let points: Vec<DVec3> = world_triangles(&scene)
            .filter(|(instance, ..)| instance.material.name == name)
            .flat_map(|(_, _, corners)| corners)
            .collect();
        points.iter().map(|p| p.x).sum::<f64>() / points.len() as f64
    };
    let (red_x, green_x) = (wall_x("cornellBox.red.000"), wall_x("cornellBox.green.000"));
    assert!(red_x * green_x < 0.0);
    let on_wall = |x: f64| project(&scene, DVec3::new(x, 1.5, 0.0));
    let on_floor = |x: f64| project(&scene, DVec3::new(0.6 * x, 0.0, 0.0));
    let (red_wall, green_wall) = (on_wall(red_x), on_wall(green_x));
    let floor = [red_x, green_x].map(on_floor);
    let tint = |shot: &Shot| {
        let [by_red, by_green] = floor.map(|at| shot.mean_around(at, 2.0));
        (by_red.x / by_red.y) / (by_green.x / by_green.y)
    };
    let mut direct = scene.clone();
    direct.settings.max_bounces = 1;
    let shot = shoot(scene);
    let (red, green) = (
        shot.mean_around(red_wall, 2.0),
        shot.mean_around(green_wall, 2.0),
    );
    assert!(
        red.x > 5.0 * red.y && green.y > 3.0 * green.x,
        "{red} {green}"
    );
    assert!(tint(&shot) > 1.1, "{}", tint(&shot));
    let control = tint(&shoot(direct));
    assert!((control - 1.0).abs() < 0.05, "negative control: {control}");
}
