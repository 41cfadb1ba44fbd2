//! Emissive meshes light as much by the rays that are sent to them as by those that happen on them.

use std::sync::Arc;

use mixray::scene::{AlphaMode, BackendChoice, Material, Scene};

use super::support::*;

/// Independent renders a side.
const SEEDS: u32 = 16;

/// Over the table, out of the camera's sight; it reflects nothing, so that it is known by its light alone.
const PANEL: &str = r#"
[[virtual]]
name = "panel"
shape = "quad"
corner = [-0.6, 1.2, -0.5]
edge_u = [1.2, 0, 0]
edge_v = [0, 0, 0.8]
material = { base_color = [0, 0, 0], specular = 0.0, emissive = [8, 6, 4] }
"#;

const BOX: &str = r#"
[[virtual]]
name = "box"
shape = "box"
size = [0.4, 0.4, 0.4]
translation = [-0.2, 0.2, 0]
material = { base_color = [0.7, 0.2, 0.2], specular = 0.0 }
"#;

fn with_panel(scene: &Scene, change: impl Fn(&mut Material)) -> Scene {
    let mut scene = scene.clone();
    for object in scene.objects.iter_mut().filter(|o| o.name == "panel") {
        for instance in &mut object.instances {
            change(Arc::make_mut(&mut instance.material));
        }
    }
    scene
}

/// A panel of opacity a lights the room as an opaque one does that emits a times as much: by light sampling on the rough table, by BSDF
/// sampling on the glossy one, as part of what was added and as part of the real world.
fn opacity_scales_emission(backend: BackendChoice) {
    let rough = "base_color = [0.7, 0.6, 0.5], specular = 0.0";
    let glossy = "base_color = [0.8, 0.8, 0.8], metallic = 1.0, roughness = 0.2";
    let opacity = 0.25;
    for table in [rough, glossy] {
        for side in ["virtual", "real"] {
            let name = format!("{side} panel, table {table}");
            let table = TABLE.replace(rough, table);
            let panel = PANEL.replace("virtual", side);
            let mut scene = scene(&format!("{CAMERA}{table}{panel}{BOX}"));
            scene.settings.rays_per_pixel = 24;
            scene.settings.max_bounces = 2;
            let see_through = |opacity: f32| {
                let scene = with_panel(&scene, |m| {
                    m.alpha_mode = AlphaMode::Blend;
                    m.base_color[3] = opacity;
                });
                over_seeds(&scene, backend, 0..SEEDS)
            };
            let dimmed = with_panel(&scene, |m| m.emissive = m.emissive.map(|c| c * opacity));
            let dimmed = over_seeds(&dimmed, backend, 1000..1000 + SEEDS);
            let difference = Difference::between(&see_through(opacity), &dimmed);
            println!("{name}: {difference}");
            assert!(difference.is_none(), "{name}: {difference}");
            let control = Difference::between(&see_through(opacity * 1.1), &dimmed);
            assert!(!control.is_none(), "{name}, control: {control}");
        }
    }
}

/// KHR_materials_unlit: the base colour is all that shows, so a factor of emission beside it lights nothing.
fn unlit_surfaces_emit_their_base_colour_alone(backend: BackendChoice) {
    let mut scene = scene(&format!("{CAMERA}{TABLE}{PANEL}{BOX}"));
    scene.settings.rays_per_pixel = 24;
    let unlit = |emissive: f32, grey: f32, seed: u32| {
        let scene = with_panel(&scene, |m| {
            m.unlit = true;
            m.emissive = [emissive; 3];
            m.base_color = [grey, grey, grey, 1.0];
        });
        over_seeds(&scene, backend, seed..seed + SEEDS)
    };
    let expected = unlit(0.0, 0.8, 1000);
    let difference = Difference::between(&unlit(5.0, 0.8, 0), &expected);
    println!("unlit: {difference}");
    assert!(difference.is_none(), "{difference}");
    let control = Difference::between(&unlit(0.0, 0.9, 0), &expected);
    assert!(!control.is_none(), "control: {control}");
}

/// What a lamp does to a virtual thing near it does not depend on which world it belongs to, nor on how far away the camera is. (Real lamps
/// nearer to the thing than the camera used to hide themselves.) Within the 1.4 mm that count as coinciding at this distance.
fn lamps_of_both_worlds_light_far_things_alike(backend: BackendChoice) {
    const LAMP: &str = r#"
[[light]]
kind = "quad"
corner = [-0.4, 0.7, -0.4]
edge_u = [0.8, 0, 0]
edge_v = [0, 0, 0.8]
radiance = [6, 5, 4]
side = "virtual"
"#;
    let camera = "[camera]\nwidth = 32\nheight = 24\nvertical_fov_deg = 0.2\nposition = [0, 20, 140]\nlook_at = [0, 0.4, 0]\n";
    let seen = |lamp: &str| {
        let mut scene = scene(&format!("{camera}{lamp}{BOX}"));
        scene.settings.rays_per_pixel = 1600;
        scene.settings.max_bounces = 1;
        let renderer = render(&scene, backend);
        let picture = renderer.picture();
        let covered = mask(renderer.film()).into_iter().zip(&picture.linear);
        let values: Vec<f64> = (covered.filter(|(m, _)| *m == 1.0))
            .map(|(_, value)| grey(*value))
            .collect();
        assert!(values.len() > 50, "{}", values.len());
        mean(&values)
    };
    for (name, lamp) in [
        ("quad", LAMP.to_owned()),
        ("mesh", PANEL.replace("1.2, -0.5", "0.7, -0.5")),
    ] {
        let of_virtual = seen(&lamp);
        let of_real = seen(&lamp.replace("virtual", "real"));
        let apart = of_real / of_virtual - 1.0;
        println!("{name}: {of_virtual} {of_real}, apart {apart}");
        assert!(of_virtual > 0.1 && apart.abs() < 4e-3, "{name}: {apart}");
        let control = seen(&lamp.replace("0.7, -0", "0.75, -0")) / of_virtual - 1.0;
        assert!(control.abs() > 4e-3, "{name}, control: {control}");
    }
}

on_the_cpu!(
    opacity_scales_emission,
    lamps_of_both_worlds_light_far_things_alike,
    unlit_surfaces_emit_their_base_colour_alone,
);
