//! What covers which pixel: geometry, primitive modes, cut-outs and transparency.

use glam::DVec3;
use mixray::scene::{AlphaMode, Scene};

use super::reference::{picture, rms};
use super::*;

/// The fraction of each pixel that the reference finds covered.
fn expected_mask(scene: &Scene) -> Vec<f64> {
    let pixels = picture(scene, |_, _| DVec3::ZERO);
    pixels.into_iter().map(|(_, coverage)| coverage).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    rms(a.iter().copied(), b.iter().copied())
}

/// A picture moved by one pixel.
fn shifted(mask: &[f64]) -> Vec<f64> {
    let mut moved = mask.to_vec();
    moved.rotate_right(1);
    moved
}

/// Every model is framed by what it covers: its vertices reach to the edges of the mask, and no further.
#[test]
fn every_model_fills_the_bounds_of_its_vertices() {
    let Some(root) = shared_data("gltf_models") else {
        return;
    };
    let mut rendered = 0;
    for path in gltf_files(&root) {
        let name = path.strip_prefix(&root).unwrap().to_str().unwrap();
        let mut scene = model(name, WHITE_SKY).unwrap();
        if !is_drawn(&scene) {
            let shot = shoot(scene);
            assert_eq!(shot.covered(), 0.0, "{name}");
            assert_eq!(shot.mean(), DVec3::ZERO, "{name}");
            continue;
        }
        frame(&mut scene, [0.55, 0.35, 1.0]);
        scene.settings.rays_per_pixel = 4;
        scene.settings.max_bounces = 2;
        let transparent = |m: &Material| m.alpha_mode != AlphaMode::Opaque;
        let opaque = !scene.objects[0]
            .instances
            .iter()
            .any(|i| transparent(&i.material));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (_, _, corners) in world_triangles(&scene) {
            for corner in corners {
                let at = project(&scene, corner);
                for c in 0..2 {
                    low[c] = low[c].min(at[c]);
                    high[c] = high[c].max(at[c]);
                }
            }
        }
        let shot = shoot(scene);
        assert!(shot.covered() > 0.02, "{name}: nothing to see");
        assert!(shot.mean().min_element() > 0.0, "{name}: black");
        let met: Vec<[f64; 2]> = (0..shot.mask.len())
            .filter(|&i| shot.mask[i] > 0.0)
            .map(|i| [i % WIDTH as usize, i / WIDTH as usize].map(|x| x as f64))
            .collect();
        for c in 0..2 {
            let first = met.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
            let last = met.iter().map(|p| p[c] + 1.0).fold(0.0, f64::max);
            assert!(
                first >= low[c].floor() && last <= high[c].ceil(),
                "{name}: outside its vertices"
            );
            // Four rays can miss a thin tip.
            let slack = if opaque { 3.0 } else { 8.0 };
            assert!(
                first <= low[c] + slack && last >= high[c] - slack,
                "{name}: does not reach its vertices"
            );
        }
        rendered += 1;
    }
    assert_eq!(rendered, 23);
}

#[test]
fn small_models_cover_what_the_reference_finds() {
    for name in [
        "BoxInterleaved.glb",
        "BoxTextured.glb",
        "box_sparse.glb",
        "CesiumMilkTruck.glb",
        "Duck.glb",
        "Node_NegativeScale/Node_NegativeScale_01.gltf",
        "Node_NegativeScale/Node_NegativeScale_12.gltf",
        "TextureTransformTest/TextureTransformTest.gltf",
    ] {
        let Some(mut scene) = model(name, DARK) else {
            return;
        };
        frame(&mut scene, [0.55, 0.35, 1.0]);
        let expected = expected_mask(&scene);
        let found = shoot(scene).mask;
        let far = distance(&expected, &found);
        assert!(far < 0.03, "{name}: {far}");
        let control = distance(&shifted(&expected), &found);
        assert!(control > 0.08, "{name}: negative control {control}");
    }
}

/// Lists, strips and fans, indexed or not, are one square; points and lines are nothing.
#[test]
fn primitive_modes_cover_the_same_pixels() {
    let mut first: Option<Vec<f64>> = None;
    for number in 0..16 {
        let name = format!("Mesh_PrimitiveMode/Mesh_PrimitiveMode_{number:02}.gltf");
        let Some(mut scene) = model(&name, WHITE_SKY) else {
            return;
        };
        if matches!(number, 0..=3 | 7..=10) {
            assert!(scene.warnings[0].contains("points and lines"), "{name}");
            assert_eq!(shoot(scene).covered(), 0.0, "{name}");
            continue;
        }
        frame(&mut scene, [0.2, 0.1, 1.0]);
        let expected = expected_mask(&scene);
        let shot = shoot(scene);
        assert!(distance(&expected, &shot.mask) < 0.03, "{name}");
        let list = first.get_or_insert_with(|| shot.mask.clone());
        assert!(distance(list, &shot.mask) < 1e-3, "{name}");
        assert!(
            distance(&shifted(list), &shot.mask) > 0.05,
            "negative control"
        );
    }
}

/// The panels of each alpha mode alone, without what stands behind them: a pixel is covered as far as its texels are opaque.
#[test]
fn alpha_modes_cover_as_their_texels_say() {
    for (material, other) in [
        ("MatOpaque", AlphaMode::Blend),
        ("MatBlend", AlphaMode::Opaque),
        ("MatCutoff25", AlphaMode::Mask(0.75)),
        ("MatCutoffDefault", AlphaMode::Mask(0.25)),
        ("MatCutoff75", AlphaMode::Blend),
    ] {
        let Some(mut scene) = model("AlphaBlendModeTest.glb", WHITE_SKY) else {
            return;
        };
        keep(&mut scene, |i| i.material.name == material);
        frame(&mut scene, [0.0, 0.0, 1.0]);
        scene.settings.rays_per_pixel = 64;
        scene.settings.max_bounces = 1;
        let expected = expected_mask(&scene);
        let mut control = scene.clone();
        repaint(&mut control, |m| m.alpha_mode = other);
        let shot = shoot(scene);
        let far = distance(&expected, &shot.mask);
        assert!(far < 0.035, "{material}: {far}");
        let control = distance(&expected_mask(&control), &shot.mask);
        assert!(control > 0.08, "{material}: negative control {control}");
        let partly = |mask: &f64| *mask > 0.2 && *mask < 0.8;
        if material == "MatBlend" {
            assert!(shot.mask.iter().filter(|m| partly(m)).count() > 100);
        }
    }
}
