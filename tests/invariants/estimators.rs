//! `direct` and `paper` estimate the same picture.

use std::sync::Arc;

use mixray::scene::{
    AlphaMode, BackendChoice, Environment, EnvironmentMap, Estimator, Material, Scene, Texture,
    TextureRef, Wrap,
};

use super::support::*;

/// Independent renders a side.
const SEEDS: u32 = 16;

const RED_BOX: &str = r#"
[[virtual]]
name = "box"
shape = "box"
size = [0.5, 0.5, 0.5]
translation = [-0.4, 0.25, 0]
rotation_deg = [0, 30, 0]
material = { base_color = [0.7, 0.2, 0.2], specular = 0.0 }
"#;

const METAL_BALL: &str = r#"
[[virtual]]
name = "ball"
shape = "sphere"
segments = 32
scale = 0.3
translation = [0.45, 0.3, 0.2]
material = { base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4 }
"#;

const WALL: &str = r#"
[[real]]
name = "wall"
shape = "quad"
corner = [-2, 0, -1]
edge_u = [4, 0, 0]
edge_v = [0, 3, 0]
material = { base_color = [0.3, 0.5, 0.7], specular = 0.0 }
"#;

const SKY: &str = "[environment]\nradiance = [0.5, 0.6, 0.8]\n";

fn room(rest: &str) -> Scene {
    let mut scene = scene(&format!("{CAMERA}{rest}"));
    scene.settings.rays_per_pixel = 24;
    scene
}

fn table_of(material: &str) -> String {
    TABLE.replace("base_color = [0.7, 0.6, 0.5], specular = 0.0", material)
}

fn difference(scene: &Scene, other: &Scene, backend: BackendChoice) -> Difference {
    let mut direct = scene.clone();
    direct.settings.estimator = Estimator::Direct;
    let mut paper = other.clone();
    paper.settings.estimator = Estimator::Paper;
    Difference::between(
        &over_seeds(&direct, backend, 0..SEEDS),
        &over_seeds(&paper, backend, 1000..1000 + SEEDS),
    )
}

/// Compares the two at several path depths.
fn agree(name: &str, scene: &Scene, bounces: &[u32], backend: BackendChoice) {
    let mut failed = Vec::new();
    for &max_bounces in bounces {
        let mut scene = scene.clone();
        scene.settings.max_bounces = max_bounces;
        let difference = difference(&scene, &scene, backend);
        println!("{name}, {max_bounces} bounces: {difference}");
        if !difference.is_none() {
            failed.push(max_bounces);
        }
    }
    assert!(failed.is_empty(), "{name}: at {failed:?} bounces");
}

fn diffuse_under_a_quad(backend: BackendChoice) {
    let scene = room(&format!("{TABLE}{WALL}{LAMP}{RED_BOX}"));
    agree("diffuse under a quad", &scene, &[1, 2, 4], backend);
}

fn glossy_table(backend: BackendChoice) {
    let table = table_of("base_color = [0.8, 0.8, 0.8], metallic = 1.0, roughness = 0.3");
    let scene = room(&format!("{table}{WALL}{LAMP}{RED_BOX}"));
    agree("glossy table", &scene, &[1, 2, 4], backend);
}

fn coated_table(backend: BackendChoice) {
    let table = table_of(
        "base_color = [0.6, 0.5, 0.4], roughness = 0.2, clearcoat = 0.5, clearcoat_roughness = 0.0",
    );
    let scene = room(&format!("{table}{WALL}{LAMP}{SKY}{RED_BOX}"));
    agree("coated table", &scene, &[1, 2, 4], backend);
}

fn mirror_table(backend: BackendChoice) {
    let table = table_of("base_color = [0.8, 0.8, 0.8], metallic = 1.0, roughness = 0.0");
    let scene = room(&format!("{table}{WALL}{LAMP}{RED_BOX}"));
    agree("mirror table", &scene, &[1, 2, 4], backend);
}

/// A sky with a small sun at 45 degrees, to the left behind the camera.
fn sunny() -> Environment {
    let (width, height) = (64, 32);
    let texels = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| {
            if (x, y) == (56, 8) {
                [400.0, 380.0, 300.0]
            } else if y < height / 2 {
                [0.3, 0.4, 0.7 + 0.01 * x as f32]
            } else {
                [0.1, 0.08, 0.05]
            }
        })
        .collect();
    Environment {
        map: EnvironmentMap::LatLong {
            width,
            height,
            texels: Arc::new(texels),
        },
        rotation_deg: 20.0,
        scale: 0.8,
    }
}

fn sunny_environment(backend: BackendChoice) {
    for (name, material) in [
        (
            "sun, diffuse",
            "base_color = [0.7, 0.6, 0.5], specular = 0.0",
        ),
        (
            "sun, semi-gloss",
            "base_color = [0.7, 0.6, 0.5], roughness = 0.4",
        ),
    ] {
        let mut scene = room(&format!("{}{RED_BOX}{METAL_BALL}", table_of(material)));
        scene.environment = Some(sunny());
        agree(name, &scene, &[1, 2, 4], backend);
    }
}

fn virtual_quad_light(backend: BackendChoice) {
    let lamp = LAMP
        .replace("[-0.4, 2, -0.6]", "[0.2, 0.9, -0.6]")
        .replace("kind", "side = \"virtual\"\nkind");
    let scene = room(&format!("{TABLE}{WALL}{lamp}{SKY}{RED_BOX}"));
    agree("virtual quad light", &scene, &[1, 2, 4], backend);
    let table = table_of("base_color = [0.8, 0.8, 0.8], metallic = 1.0, roughness = 0.3");
    let scene = room(&format!("{table}{WALL}{lamp}{SKY}{RED_BOX}"));
    agree("virtual quad light, glossy", &scene, &[1, 2, 4], backend);
}

fn virtual_delta_lights(backend: BackendChoice) {
    let lights = r#"
[[light]]
kind = "point"
side = "virtual"
position = [0.5, 0.8, 0.5]
intensity = [0.5, 0.4, 0.3]

[[light]]
kind = "spot"
position = [-1, 1.5, 0.5]
direction = [0.6, -1, -0.4]
intensity = [2, 2, 3]
outer_deg = 30

[[light]]
kind = "directional"
direction = [0.4, -1, -0.3]
irradiance = [0.5, 0.6, 0.7]
"#;
    let scene = room(&format!("{TABLE}{WALL}{lights}{RED_BOX}"));
    agree("delta lights", &scene, &[1, 2, 4], backend);
    let table = table_of("base_color = [0.8, 0.8, 0.8], metallic = 1.0, roughness = 0.3");
    let scene = room(&format!("{table}{WALL}{lights}"));
    agree("delta lights, glossy", &scene, &[1, 2], backend);
}

/// A checkerboard of opacity on the only object's base colour.
fn checker_alpha(scene: &mut Scene, object: &str, mode: AlphaMode) {
    let texture = Arc::new(Texture {
        name: "checker".into(),
        width: 4,
        height: 4,
        rgba8: (0..16)
            .map(|i| [255, 200, 150, if (i + i / 4) % 2 == 0 { 230 } else { 40 }])
            .collect(),
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        nearest: true,
    });
    for o in scene.objects.iter_mut().filter(|o| o.name == object) {
        for instance in &mut o.instances {
            instance.material = Arc::new(Material {
                alpha_mode: mode,
                base_color_texture: Some(TextureRef {
                    texture: texture.clone(),
                    uv_set: 0,
                    transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                }),
                ..(*instance.material).clone()
            });
        }
    }
}

fn transparency_by_alpha(backend: BackendChoice) {
    for (name, mode) in [
        ("alpha mask", AlphaMode::Mask(0.5)),
        ("alpha blend", AlphaMode::Blend),
    ] {
        let mut scene = room(&format!("{TABLE}{WALL}{LAMP}{SKY}{RED_BOX}"));
        checker_alpha(&mut scene, "box", mode);
        agree(name, &scene, &[1, 2, 4], backend);
    }
    let mut scene = room(&format!("{TABLE}{WALL}{LAMP}{SKY}{RED_BOX}"));
    checker_alpha(&mut scene, "wall", AlphaMode::Blend);
    agree("alpha blend of the real wall", &scene, &[1, 4], backend);
}

fn real_things_occlude(backend: BackendChoice) {
    let post = r#"
[[real]]
shape = "box"
size = [0.2, 0.8, 0.2]
translation = [-0.25, 0.4, 0.5]
material = { base_color = [0.4, 0.6, 0.3], roughness = 0.5 }
"#;
    let mut scene = room(&format!(
        "{TABLE}{WALL}{post}{LAMP}{SKY}{RED_BOX}{METAL_BALL}"
    ));
    scene.lens.aperture_radius_m = 0.05;
    scene.lens.focus_distance_m = 2.6;
    agree("real post, defocused", &scene, &[1, 2, 4], backend);
}

/// Smooth normals on a coarse mesh: where shading and geometric horizon differ.
fn coarse_smooth_real_ball(backend: BackendChoice) {
    let ball = r#"
[[real]]
shape = "sphere"
segments = 8
scale = 0.5
translation = [0.35, 0.4, 0]
material = { base_color = [0.8, 0.8, 0.8], specular = 0.0 }
"#;
    let scene = room(&format!("{TABLE}{ball}{LAMP}{SKY}{RED_BOX}"));
    agree("coarse smooth real ball", &scene, &[1, 2, 4], backend);
    let glossy = ball.replace("specular = 0.0", "roughness = 0.3");
    let scene = room(&format!("{TABLE}{glossy}{LAMP}{SKY}{RED_BOX}"));
    agree("coarse smooth glossy ball", &scene, &[1, 2], backend);
}

/// Shading normals far from the geometric one, where Lambert's cosine is mirrored up at the surface.
fn tilted_normals(backend: BackendChoice) {
    let mut scene = room(&format!("{TABLE}{LAMP}{SKY}{RED_BOX}"));
    for object in scene.objects.iter_mut().filter(|o| o.name == "table") {
        for instance in &mut object.instances {
            let mut primitive = (*instance.primitive).clone();
            primitive.normals.fill([-0.8, 0.6, 0.0]);
            instance.primitive = Arc::new(primitive);
        }
    }
    agree("tilted normals", &scene, &[1, 2], backend);
}

fn virtual_glass(backend: BackendChoice) {
    for (name, material) in [
        ("smooth glass", "roughness = 0.0, transmission = 1.0"),
        (
            "rough tinted glass",
            "roughness = 0.3, transmission = 1.0, attenuation_color = [0.5, 0.9, 0.7], attenuation_distance_m = 0.2",
        ),
        (
            "thin glass",
            "roughness = 0.0, transmission = 0.9, thin_walled = true",
        ),
    ] {
        let ball = METAL_BALL.replace(
            "base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4",
            material,
        );
        let scene = room(&format!("{TABLE}{WALL}{SKY}{ball}"));
        agree(name, &scene, &[1, 2, 6], backend);
    }
}

/// Panes of both worlds, one behind the other, tinted, and a body of index 1.
fn panes(backend: BackendChoice) {
    let pane = |side: &str, z: f64, tint: &str| {
        format!(
            r#"
[[{side}]]
shape = "quad"
corner = [-0.8, 0, {z}]
edge_u = [1.2, 0, 0.2]
edge_v = [0, 0.8, -0.3]
material = {{ base_color = {tint}, transmission = 1.0, roughness = 0.0, thin_walled = true }}
"#
        )
    };
    let fog = r#"
[[virtual]]
shape = "box"
size = [0.4, 0.5, 0.4]
translation = [0.5, 0.25, 0.1]
material = { transmission = 1.0, ior = 1.0, attenuation_color = [0.4, 0.8, 0.6], attenuation_distance_m = 0.3 }
"#;
    let (real, added) = (
        pane("real", 0.5, "[0.7, 0.9, 0.8]"),
        pane("virtual", 0.3, "[0.9, 0.4, 0.6]"),
    );
    let glow = LAMP.replace("radiance", "side = \"virtual\"\nradiance");
    for (name, world) in [
        ("added panes", format!("{added}{fog}")),
        ("panes of both worlds", format!("{real}{added}{RED_BOX}")),
    ] {
        let scene = room(&format!("{TABLE}{WALL}{LAMP}{SKY}{world}"));
        agree(name, &scene, &[1, 2, 4], backend);
    }
    let scene = room(&format!("{TABLE}{WALL}{glow}{real}{added}{RED_BOX}"));
    agree("a virtual lamp past panes", &scene, &[1, 2, 4], backend);
}

fn real_glass(backend: BackendChoice) {
    for (name, material) in [
        ("real smooth glass", "roughness = 0.0, transmission = 1.0"),
        (
            "real rough tinted glass",
            "roughness = 0.3, transmission = 1.0, attenuation_color = [0.5, 0.9, 0.7], attenuation_distance_m = 0.2",
        ),
    ] {
        let ball = METAL_BALL.replace("virtual", "real").replace(
            "base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4",
            material,
        );
        let scene = room(&format!("{TABLE}{WALL}{SKY}{ball}{RED_BOX}"));
        agree(name, &scene, &[1, 2, 6], backend);
    }
}

fn emissive_meshes(backend: BackendChoice) {
    let glowing = RED_BOX.replace("specular = 0.0", "specular = 0.0, emissive = [2, 1, 0.5]");
    let lamp = METAL_BALL.replace("virtual", "real").replace(
        "base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4",
        "specular = 0.0, emissive = [3, 3, 3]",
    );
    let scene = room(&format!("{TABLE}{WALL}{lamp}{glowing}"));
    agree("emissive meshes", &scene, &[1, 2, 4], backend);
}

/// Control: the check notices a tenth more albedo of the table.
fn control_notices_an_albedo(backend: BackendChoice) {
    let mut scene = room(&format!("{TABLE}{WALL}{LAMP}{RED_BOX}"));
    scene.settings.max_bounces = 2;
    let mut other = scene.clone();
    for object in other.objects.iter_mut().filter(|o| o.name == "table") {
        for instance in &mut object.instances {
            let mut material = (*instance.material).clone();
            for c in &mut material.base_color[..3] {
                *c *= 1.1;
            }
            instance.material = Arc::new(material);
        }
    }
    let difference = difference(&scene, &other, backend);
    println!("control: {difference}");
    assert!(!difference.is_none(), "{difference}");
}

on_the_cpu!(
    diffuse_under_a_quad,
    glossy_table,
    coated_table,
    mirror_table,
    sunny_environment,
    virtual_quad_light,
    virtual_delta_lights,
    transparency_by_alpha,
    real_things_occlude,
    coarse_smooth_real_ball,
    tilted_normals,
    virtual_glass,
    real_glass,
    panes,
    emissive_meshes,
    control_notices_an_albedo,
);
