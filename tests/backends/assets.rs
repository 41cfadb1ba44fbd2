//! Files that the scenes of the table name: textures, meshes that wear them, an environment map, a photograph.

use std::f32::consts::TAU;
use std::path::Path;

use serde_json::{Value, json};

/// The map's cells across; half as many down.
const SKY_WIDTH: u32 = 32;
/// Quads along a side of the mesh.
const SHEET_QUADS: u32 = 4;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// Writes everything the scenes refer to into `folder`.
pub fn write_assets(folder: &Path) {
    write_textures(folder);
    write_sky(&folder.join("sky.hdr"));
    write_photo(&folder.join("photo.png"));
    let colour = json!({ "index": 0 });
    let sheets = [
        ("textured.gltf", textured()),
        (
            "masked.gltf",
            json!({
                "alphaMode": "MASK", "alphaCutoff": 0.45, "doubleSided": true,
                "pbrMetallicRoughness": { "baseColorTexture": colour, "metallicFactor": 0.0, "roughnessFactor": 0.6 },
            }),
        ),
        (
            "blended.gltf",
            json!({
                "alphaMode": "BLEND", "doubleSided": true,
                "pbrMetallicRoughness": { "baseColorTexture": colour, "metallicFactor": 0.0 },
            }),
        ),
        (
            "glowing.gltf",
            json!({
                "emissiveFactor": [1.0, 0.8, 0.6], "emissiveTexture": { "index": 0 }, "doubleSided": true,
                "pbrMetallicRoughness": { "baseColorFactor": [0.2, 0.2, 0.2, 1.0] },
                "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 } },
            }),
        ),
        ("coated.gltf", coated()),
    ];
    for (name, material) in sheets {
        let file = serde_json::to_vec(&sheet(&material)).expect("serialises");
        std::fs::write(folder.join(name), file).expect("writes");
    }
}

/// Colour, metallic-roughness and normal maps, shifted, turned and scaled.
fn textured() -> Value {
    let transform = json!({
        "KHR_texture_transform": { "offset": [0.3, -0.2], "rotation": 0.5, "scale": [1.7, 0.8] }
    });
    json!({
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0, "extensions": transform },
            "metallicRoughnessTexture": { "index": 1 },
        },
        "normalTexture": { "index": 2, "scale": 0.8 },
        "extensions": {
            "KHR_materials_specular": { "specularTexture": { "index": 1 }, "specularColorTexture": { "index": 0 } }
        },
    })
}

/// A coat with a texture and a normal map of its own over a base without one.
fn coated() -> Value {
    json!({
        "doubleSided": true,
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.1, 0.1, 1.0], "metallicFactor": 0.3, "roughnessFactor": 0.7 },
        "extensions": {
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.9, "clearcoatTexture": { "index": 0 },
                "clearcoatRoughnessFactor": 0.5, "clearcoatRoughnessTexture": { "index": 1 },
                "clearcoatNormalTexture": { "index": 2 },
            }
        },
    })
}

/// The square from (-1, -1, 0) to (1, 1, 0), slightly bulged so that normals differ, with this material.
fn sheet(material: &Value) -> Value {
    let mut floats: [Vec<f32>; 3] = Default::default();
    let n = SHEET_QUADS;
    for j in 0..=n {
        for i in 0..=n {
            let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
            let (x, y) = (2.0 * u - 1.0, 1.0 - 2.0 * v);
            floats[0].extend([x, y, 0.3 * (1.0 - x * x) * (1.0 - y * y)]);
            let slope = glam::Vec3::new(0.6 * x * (1.0 - y * y), 0.6 * y * (1.0 - x * x), 1.0);
            floats[1].extend(slope.normalize().to_array());
            floats[2].extend([u, v]);
        }
    }
    let mut indices: Vec<u32> = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let at = j * (n + 1) + i;
            indices.extend([at, at + n + 1, at + 1, at + 1, at + n + 1, at + n + 2]);
        }
    }
    let mut bytes: Vec<u8> = Vec::new();
    let mut views = Vec::new();
    let mut accessors = Vec::new();
    let mut push = |data: Vec<u8>, component: u32, kind: &str, count: usize| {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len() }));
        accessors.push(json!({
            "bufferView": views.len() - 1, "componentType": component, "type": kind, "count": count,
        }));
        bytes.extend(data);
    };
    let vertices = ((n + 1) * (n + 1)) as usize;
    for (values, kind) in floats.iter().zip(["VEC3", "VEC3", "VEC2"]) {
        let data = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        push(data, FLOAT, kind, vertices);
    }
    let data = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    push(data, UNSIGNED_INT, "SCALAR", indices.len());
    accessors[0]["min"] = json!([-1.0, -1.0, 0.0]);
    accessors[0]["max"] = json!([1.0, 1.0, 0.3]);
    let hex: String = bytes.iter().map(|b| format!("%{b:02x}")).collect();
    json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": [
            "KHR_texture_transform", "KHR_materials_clearcoat", "KHR_materials_specular", "KHR_materials_emissive_strength",
        ],
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:,{hex}") }],
        "bufferViews": views,
        "accessors": accessors,
        "images": [{ "uri": "colour.png" }, { "uri": "metallic_roughness.png" }, { "uri": "normal.png" }],
        "textures": [{ "source": 0 }, { "source": 1 }, { "source": 2 }],
        "materials": [material],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "indices": 3, "material": 0,
        }] }],
        "nodes": [{ "mesh": 0 }],
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
    })
}

fn write_textures(folder: &Path) {
    let save = |name: &str, colour: &dyn Fn(f32, f32) -> [f32; 4]| {
        let image = image::RgbaImage::from_fn(16, 16, |x, y| {
            let at = colour((x as f32 + 0.5) / 16.0, (y as f32 + 0.5) / 16.0);
            image::Rgba(at.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8))
        });
        image.save(folder.join(name)).expect("writes");
    };
    let wave = |x: f32, k: f32| 0.5 + 0.5 * (x * k * TAU).sin();
    save("colour.png", &|u, v| {
        [
            wave(u, 2.0),
            0.3 + 0.5 * wave(v, 1.0),
            0.8 - 0.6 * u,
            wave(u + v, 1.5),
        ]
    });
    save("metallic_roughness.png", &|u, v| {
        [0.0, 0.2 + 0.7 * wave(v, 1.0), wave(u, 1.0), 0.3 + 0.7 * u]
    });
    save("normal.png", &|u, v| {
        let n =
            glam::Vec3::new(0.4 * (u * 2.0 * TAU).cos(), 0.4 * (v * TAU).sin(), 1.0).normalize();
        [0.5 + 0.5 * n.x, 0.5 + 0.5 * n.y, 0.5 + 0.5 * n.z, 1.0]
    });
}

/// A gradient with a sun of a single cell.
fn write_sky(path: &Path) {
    let (width, height) = (SKY_WIDTH, SKY_WIDTH / 2);
    let texels: Vec<image::Rgb<f32>> = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            if (x, y) == (20, 4) {
                return image::Rgb([400.0, 380.0, 350.0]);
            }
            let up = 1.0 - y as f32 / height as f32;
            let around = 0.2 * (x as f32 / width as f32 * TAU).sin();
            image::Rgb([0.4 + 0.3 * up + around, 0.4 + 0.4 * up, 0.4 + 0.7 * up])
        })
        .collect();
    let file = std::fs::File::create(path).expect("creates");
    image::codecs::hdr::HdrEncoder::new(file)
        .encode(&texels, width as usize, height as usize)
        .expect("writes");
}

/// As large as the scenes' picture.
fn write_photo(path: &Path) {
    let photo = image::RgbImage::from_fn(super::scenes::WIDTH, super::scenes::HEIGHT, |x, y| {
        image::Rgb([
            (90 + 3 * (x % 16)) as u8,
            (80 + 2 * y) as u8,
            (150 - 2 * (x ^ y) % 64) as u8,
        ])
    });
    photo.save(path).expect("writes");
}
