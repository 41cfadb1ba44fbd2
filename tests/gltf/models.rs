//! The sample models: each loads clean, and shows what it was made to show.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use mixray::scene::gltf::{GltfScene, load_gltf};
use mixray::scene::{AlphaMode, Material, Wrap};
use serde_json::Value;

use super::{check_scene, corners};
use crate::support::{gltf_files, shared_data};

fn model(name: &str) -> Option<GltfScene> {
    let root = shared_data("gltf_models")?;
    Some(load_gltf(&root.join(name)).unwrap())
}

fn material<'a>(scene: &'a GltfScene, name: &str) -> &'a Material {
    scene
        .instances
        .iter()
        .map(|instance| &*instance.material)
        .find(|material| material.name == name)
        .unwrap_or_else(|| panic!("no material {name}"))
}

fn triangles(scene: &GltfScene) -> usize {
    scene
        .instances
        .iter()
        .map(|instance| instance.primitive.triangles.len())
        .sum()
}

#[test]
fn every_model_loads_clean() {
    for folder in ["gltf_models", "tum_desk_rgbd", "kinect_basket_rgbd"] {
        let Some(root) = shared_data(folder) else {
            continue;
        };
        for path in gltf_files(&root) {
            let scene = load_gltf(&path).unwrap();
            check_scene(&scene).unwrap_or_else(|reason| panic!("{}: {reason}", path.display()));
            let lines_only = scene.warnings.iter().any(|line| line.contains("lines"));
            assert!(
                lines_only || scene.warnings.is_empty(),
                "{:?}",
                scene.warnings
            );
        }
    }
}

/// The JSON of a .gltf or .glb, read without mixray.
fn document(path: &Path) -> Value {
    let bytes = std::fs::read(path).unwrap();
    let text = if bytes.starts_with(b"glTF") {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        &bytes[20..20 + length]
    } else {
        &bytes
    };
    serde_json::from_slice(text).unwrap()
}

fn bounds(positions: &[[f32; 3]]) -> [Vec3; 2] {
    positions
        .iter()
        .map(|position| Vec3::from(*position))
        .fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| {
            [low.min(p), high.max(p)]
        })
}

/// The file states the bounds of each position accessor; they are those of what was read.
#[test]
fn positions_fill_the_bounds_that_the_files_state() {
    let Some(root) = shared_data("gltf_models") else {
        return;
    };
    let mut compared = 0;
    for path in gltf_files(&root) {
        let json = document(&path);
        let scene = load_gltf(&path).unwrap();
        for instance in &scene.instances {
            let name = &instance.primitive.name;
            let (mesh, number) = name.rsplit_once(" / primitive ").unwrap();
            let meshes = json["meshes"].as_array().unwrap();
            let same_name: Vec<_> = meshes
                .iter()
                .enumerate()
                .filter(|(index, json)| json["name"] == mesh || format!("mesh {index}") == mesh)
                .collect();
            let [(_, mesh)] = same_name[..] else { continue };
            let number: usize = number.parse().unwrap();
            let source = &mesh["primitives"][number];
            let accessor = source["attributes"]["POSITION"].as_u64().unwrap() as usize;
            let accessor = &json["accessors"][accessor];
            // Primitives without normals keep only the vertices that triangles use.
            if accessor["min"].is_null() || source["attributes"]["NORMAL"].is_null() {
                continue;
            }
            let stated = ["min", "max"].map(|key| {
                let values: Vec<f32> = serde_json::from_value(accessor[key].clone()).unwrap();
                Vec3::from_slice(&values)
            });
            let close = |a: [Vec3; 2]| {
                a[0].abs_diff_eq(stated[0], 1e-4 * stated[0].length().max(1e-3))
                    && a[1].abs_diff_eq(stated[1], 1e-4 * stated[1].length().max(1e-3))
            };
            let mut positions = instance.primitive.positions.clone();
            assert!(close(bounds(&positions)), "{name}");
            positions[0][0] += 10.0 * (stated[1] - stated[0]).length();
            assert!(!close(bounds(&positions)), "negative control");
            compared += 1;
        }
    }
    assert!(compared > 30);
}

#[test]
fn an_interleaved_box_has_its_faces_where_its_normals_point() {
    let Some(scene) = model("BoxInterleaved.glb") else {
        return;
    };
    let primitive = &scene.instances[0].primitive;
    assert_eq!(primitive.triangles.len(), 12);
    for triangle in &primitive.triangles {
        let [a, b, c] = corners(primitive, triangle);
        let normal = Vec3::from(primitive.normals[triangle[0] as usize]).as_dvec3();
        assert!((b - a).cross(c - a).normalize().dot(normal) > 0.999_999);
        // The box is centred on the origin, half a unit to each side.
        assert!(((a + b + c) / 3.0).dot(normal) - 0.5 < 1e-6);
        assert!(
            [a, b, c]
                .iter()
                .all(|p| (p.abs() - DVec3::splat(0.5)).length() < 1e-6)
        );
    }
}

/// Two triangles make the square, facing +Z, however they are listed; points and lines make nothing.
#[test]
fn primitive_modes_make_the_same_square() {
    let Some(root) = shared_data("gltf_models/Mesh_PrimitiveMode") else {
        return;
    };
    for number in 0..16 {
        let scene = load_gltf(&root.join(format!("Mesh_PrimitiveMode_{number:02}.gltf"))).unwrap();
        if matches!(number, 0..=3 | 7..=10) {
            assert_eq!(triangles(&scene), 0);
            assert!(scene.warnings[0].contains("points and lines"));
            continue;
        }
        assert_eq!(triangles(&scene), 2, "model {number}");
        assert!(!scene.has_materials);
        let primitive = &scene.instances[0].primitive;
        let mut area = 0.0;
        for triangle in &primitive.triangles {
            let [a, b, c] = corners(primitive, triangle);
            let cross = (b - a).cross(c - a);
            assert!(cross.z > 0.0, "model {number} faces away");
            area += 0.5 * cross.z;
            for &vertex in triangle {
                let normal = Vec3::from(primitive.normals[vertex as usize]).as_dvec3();
                assert!(normal.dot(cross.normalize()) > 0.999_999, "flat normals");
            }
        }
        let [low, high] = bounds(&primitive.positions);
        let square = f64::from((high.x - low.x) * (high.y - low.y));
        assert!((area - square).abs() < 1e-6 * square, "model {number}");
    }
}

#[test]
fn negative_scales_turn_the_determinant() {
    for name in ["01", "12"] {
        let Some(scene) = model(&format!(
            "Node_NegativeScale/Node_NegativeScale_{name}.gltf"
        )) else {
            return;
        };
        let determinants: Vec<f64> = scene
            .instances
            .iter()
            .map(|instance| instance.object_from_local.determinant())
            .collect();
        assert_eq!(determinants, [1.0, -1.0], "{name}");
        let has_tangents = !scene.instances[0].primitive.tangents.is_empty();
        assert_eq!(has_tangents, name == "12");
    }
}

/// Each quad carries markers: the arrow must end at "correct", and does not end at "error" or "not supported". Without any
/// transform it ends at "not supported", so the uv there is the arrow's tip in the picture.
#[test]
fn texture_transforms_move_the_arrow_to_the_marker() {
    let Some(scene) = model("TextureTransformTest/TextureTransformTest.gltf") else {
        return;
    };
    let transform_of = |name: &str| {
        let reference = material(&scene, name).base_color_texture.as_ref().unwrap();
        assert_eq!(reference.uv_set, 0);
        reference.transform
    };
    assert_eq!(
        transform_of("Offset UV"),
        [1.0, 0.0, 0.5, 0.0, 1.0, 0.5],
        "offset"
    );
    // The quad spans -0.5..0.5 with v down.
    let uv_of = |marker: Vec2| Vec2::new(marker.x + 0.5, 0.5 - marker.y);
    let apply = |m: [f32; 6], uv: Vec2| {
        Vec2::new(
            m[0] * uv.x + m[1] * uv.y + m[2],
            m[3] * uv.x + m[4] * uv.y + m[5],
        )
    };
    let not_supported = Vec2::new(0.277_817_46, -0.277_817_46);
    let tip = uv_of(not_supported);
    let miss = |name: &str, marker: Vec2| (apply(transform_of(name), uv_of(marker)) - tip).length();
    let correct = Vec2::new(-0.079_048_224, -0.516_267_5);
    let error = Vec2::new(0.516_267_5, 0.079_048_224);
    assert!(miss("Rotation", correct) < 0.01);
    assert!(miss("Rotation", error) > 0.2, "negative control");
    assert!(miss("Rotation", not_supported) > 0.2, "negative control");
    assert!(miss("Scale", Vec2::new(0.018_544_973, -0.018_544_973)) < 0.01);
    assert!(miss("All", Vec2::new(-0.07, -0.25)) < 0.05);
    let arrow = material(&scene, "Rotation").base_color_texture.as_ref();
    assert_eq!(arrow.unwrap().texture.wrap_u, Wrap::Clamp);
}

#[test]
fn clearcoat_is_read() {
    let Some(scene) = model("ClearcoatTest.glb") else {
        return;
    };
    let plain = material(&scene, "Simple_Base");
    assert_eq!((plain.clearcoat, plain.roughness), (0.0, 0.44));
    let coated = material(&scene, "Simple_Coated");
    assert_eq!((coated.clearcoat, coated.clearcoat_roughness), (1.0, 0.03));
    assert!(coated.clearcoat_texture.is_none());
    assert!(
        material(&scene, "Partial_Coated")
            .clearcoat_texture
            .is_some()
    );
    let rough = material(&scene, "RoughVariations_Coated");
    assert_eq!(rough.clearcoat_roughness, 1.0);
    assert!(rough.clearcoat_roughness_texture.is_some());
    let shared = material(&scene, "SharedNorm_Coated");
    let base = &shared.normal_texture.as_ref().unwrap().texture;
    let coat = &shared.clearcoat_normal_texture.as_ref().unwrap().texture;
    assert!(Arc::ptr_eq(base, coat), "one picture for both");
    assert!(material(&scene, "CoatNorm_Coated").normal_texture.is_none());
}

#[test]
fn the_damaged_helmet_has_its_four_textures() {
    let Some(scene) = model("DamagedHelmet.glb") else {
        return;
    };
    assert_eq!(triangles(&scene), 15_452);
    assert!(scene.has_materials);
    let helmet = &scene.instances[0].material;
    // Colour, metallic-roughness, normal, emission; the occlusion texture is not used.
    assert_eq!(helmet.textures().count(), 4);
    assert!(
        helmet
            .textures()
            .all(|t| (t.texture.width, t.texture.height) == (2048, 2048))
    );
    assert_eq!(helmet.emissive, [1.0; 3]);
    let mean = |reference: &mixray::scene::TextureRef| {
        let texels = &reference.texture.rgba8;
        let sum = texels.iter().fold([0u64; 3], |sum, texel| {
            [0, 1, 2].map(|channel| sum[channel] + u64::from(texel[channel]))
        });
        sum.map(|channel| channel as f64 / texels.len() as f64)
    };
    // A tangent-space normal map is blue; the emission is mostly black.
    let [x, y, z] = mean(helmet.normal_texture.as_ref().unwrap());
    assert!((x - 127.0).abs() < 8.0 && (y - 127.0).abs() < 8.0 && z > 220.0);
    assert!(mean(helmet.emissive_texture.as_ref().unwrap())[2] < 40.0);
}

#[test]
fn glass_with_volume_is_not_thin() {
    let Some(scene) = model("IridescentDishWithOlives.glb") else {
        return;
    };
    let dish = material(&scene, "glassDish");
    assert_eq!((dish.transmission, dish.thin_walled), (1.0, false));
    assert_eq!((dish.ior, dish.metallic), (1.5, 0.0));
    assert_eq!(dish.specular_color, [2.0; 3]);
    assert!(dish.specular_color_texture.is_some());
    let cover = material(&scene, "glassCover");
    assert_eq!((cover.normal_scale, cover.thin_walled), (2.0, false));
    assert_eq!(
        material(&scene, "goldLeaf").alpha_mode,
        AlphaMode::Mask(0.5)
    );
    assert_eq!(material(&scene, "olives").transmission, 0.0);
}

#[test]
fn alpha_modes_and_cutoffs_are_read() {
    let Some(scene) = model("AlphaBlendModeTest.glb") else {
        return;
    };
    let mode = |name| material(&scene, name).alpha_mode;
    assert_eq!(mode("MatOpaque"), AlphaMode::Opaque);
    assert_eq!(mode("MatBlend"), AlphaMode::Blend);
    assert_eq!(mode("MatCutoff25"), AlphaMode::Mask(0.25));
    assert_eq!(mode("MatCutoffDefault"), AlphaMode::Mask(0.5));
}

#[test]
fn instances_share_their_mesh_and_pictures() {
    let Some(scene) = model("CesiumMilkTruck.glb") else {
        return;
    };
    let wheels: Vec<_> = scene
        .instances
        .iter()
        .filter(|instance| instance.primitive.name == "Wheels / primitive 0")
        .collect();
    assert_eq!(wheels.len(), 2);
    assert!(Arc::ptr_eq(&wheels[0].primitive, &wheels[1].primitive));
    assert!(Arc::ptr_eq(&wheels[0].material, &wheels[1].material));
    // The axles are 2.78 m apart, by the nodes' translations.
    let along = |index: usize| wheels[index].object_from_local.w_axis;
    assert!(((along(0) - along(1)).truncate().length() - 2.7803).abs() < 0.02);
}

#[test]
fn counts_of_the_other_models() {
    for (name, count, instances) in [
        ("stanford_bunny.glb", 144_046, 1),
        ("PBR_Spheres.glb", 100_320, 12),
        ("cornellBox.glb", 4_006, 7),
        ("Duck.glb", 4_212, 1),
        ("BoxTextured.glb", 12, 1),
        ("box_sparse.glb", 12, 1),
    ] {
        let Some(scene) = model(name) else { return };
        assert_eq!(
            (triangles(&scene), scene.instances.len()),
            (count, instances)
        );
    }
    let Some(cornell) = model("cornellBox.glb") else {
        return;
    };
    assert!(
        cornell
            .instances
            .iter()
            .any(|i| !i.primitive.uvs[1].is_empty())
    );
}
