//! Files made here, for what no sample model shows.

use std::path::PathBuf;

use glam::{DVec3, Vec3};
use mixray::scene::gltf::{GltfError, GltfScene, PunctualLight, load_gltf};
use serde_json::{Value, json};

use super::check_scene;

/// A document under construction: JSON and one buffer as a data URI.
struct Builder {
    json: Value,
    bytes: Vec<u8>,
}

const FLOAT: u32 = 5126;

impl Builder {
    fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "buffers": [], "bufferViews": [], "accessors": [], "nodes": [], "meshes": [],
        });
        let bytes = Vec::new();
        Self { json, bytes }
    }

    fn push(&mut self, key: &str, item: Value) -> usize {
        let list = self.json[key].as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push(
            "bufferViews",
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }),
        )
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }),
        )
    }

    fn floats(&mut self, values: &[f32], kind: &str, count: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, kind, count)
    }

    /// The triangle (0,0,0) (1,0,0) (0,1,0) with the attributes given, in one node.
    fn triangle(&mut self, mut primitive: Value) {
        let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let position = self.floats(&corners, "VEC3", 3);
        primitive["attributes"]["POSITION"] = json!(position);
        let mesh = self.push(
            "meshes",
            json!({ "name": "tri", "primitives": [primitive] }),
        );
        self.push("nodes", json!({ "mesh": mesh }));
    }

    fn load(&self) -> Result<GltfScene, GltfError> {
        let mut json = self.json.clone();
        let hex: String = self.bytes.iter().map(|b| format!("%{b:02x}")).collect();
        json["buffers"] =
            json!([{ "byteLength": self.bytes.len(), "uri": format!("data:,{hex}") }]);
        load_json(&json)
    }
}

fn load_json(json: &Value) -> Result<GltfScene, GltfError> {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("made.gltf");
    std::fs::write(&path, serde_json::to_vec(json).unwrap()).unwrap();
    let scene = load_gltf(&path)?;
    check_scene(&scene).unwrap();
    Ok(scene)
}

fn message(outcome: Result<GltfScene, GltfError>) -> String {
    outcome.unwrap_err().to_string()
}

#[test]
fn sparse_positions_replace_their_base() {
    let mut builder = Builder::new();
    let base = builder.floats(
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 1.0, 0.0],
        "VEC3",
        4,
    );
    let indices = builder.view(&[2, 0]);
    let values: Vec<u8> = [1.0f32, 1.0, 0.5]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let values = builder.view(&values);
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values },
    });
    builder.json["accessors"][base]["sparse"] = sparse;
    let order = builder.accessor(&[0, 1, 2, 0, 2, 3], 5121, "SCALAR", 6);
    let primitive = json!({ "attributes": { "POSITION": base }, "indices": order });
    builder.push("meshes", json!({ "primitives": [primitive] }));
    builder.push("nodes", json!({ "mesh": 0 }));
    let positions = builder.load().unwrap().instances[0]
        .primitive
        .positions
        .clone();
    assert!(positions.contains(&[1.0, 1.0, 0.5]));
    assert!(!positions.contains(&[9.0; 3]));

    builder.json["accessors"][base]["sparse"]["indices"]["byteOffset"] = json!(1);
    let moved = builder.load().unwrap().instances[0]
        .primitive
        .positions
        .clone();
    assert!(moved.contains(&[9.0; 3]), "negative control");
    builder.json["accessors"][base]["sparse"]["count"] = json!(3);
    assert!(message(builder.load()).contains("sparse part"));
}

#[test]
fn normalised_integers_become_fractions() {
    let mut builder = Builder::new();
    let colors = builder.accessor(&[255, 0, 51, 0, 102, 255, 1, 2, 3], 5121, "VEC3", 3);
    let uv: Vec<u8> = [32767i16, -32768, 0, 16384, 1, 2]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let uv = builder.accessor(&uv, 5122, "VEC2", 3);
    builder.json["accessors"][uv]["normalized"] = json!(true);
    let normals = builder.floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.5], "VEC3", 3);
    builder.triangle(
        json!({ "attributes": { "COLOR_0": colors, "TEXCOORD_1": uv, "NORMAL": normals } }),
    );
    let scene = builder.load().unwrap();
    let primitive = &scene.instances[0].primitive;
    assert_eq!(primitive.colors[0], [1.0, 0.0, 0.2, 1.0]);
    assert_eq!(primitive.uvs[1][0], [1.0, -1.0]);
    assert!((primitive.uvs[1][1][1] - 16384.0 / 32767.0).abs() < 1e-6);
    assert_eq!(primitive.normals, [[0.0, 0.0, 1.0]; 3]);
    assert!(primitive.uvs[0].is_empty());
}

#[test]
fn bad_numbers_name_mesh_and_primitive() {
    for (semantic, kind, width) in [("NORMAL", "VEC3", 3), ("TEXCOORD_0", "VEC2", 2)] {
        let mut builder = Builder::new();
        let mut values = vec![1.0; 3 * width];
        values[width] = f32::NAN;
        let accessor = builder.floats(&values, kind, 3);
        builder.triangle(json!({ "attributes": { semantic: accessor } }));
        let line = message(builder.load());
        assert!(
            line.contains(&format!("tri / primitive 0, {semantic}: vertex 1")),
            "{line}"
        );
    }
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let mut builder = Builder::new();
    let indices = builder.accessor(&[0, 1, 2, 0, 1, 1, 2, 2, 2, 0], 5121, "SCALAR", 10);
    builder.triangle(json!({ "attributes": {}, "indices": indices }));
    let scene = builder.load().unwrap();
    assert_eq!(scene.instances[0].primitive.triangles.len(), 1);
    let text = scene.warnings.join("\n");
    assert!(text.contains("dropped 2 degenerate triangles in tri / primitive 0"));
    assert!(text.contains("left out 1 indices"));
}

#[test]
fn transforms_are_composed_in_f64() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    // 1e6 + 0.001 is beyond f32.
    builder.push(
        "nodes",
        json!({ "children": [0], "translation": [1e6, 0, 0] }),
    );
    builder.json["nodes"][0]["translation"] = json!([0.001, 0, 0]);
    builder.json["nodes"][0]["scale"] = json!([1, 1, -1]);
    let rotation = json!([0, 0, 0.5f64.sqrt() * 2.0, 0.5f64.sqrt() * 2.0]);
    builder.push("nodes", json!({ "children": [1], "rotation": rotation }));
    let scene = builder.load().unwrap();
    let transform = scene.instances[0].object_from_local;
    // A quarter turn about z; the rotation is normalised.
    let origin = transform.transform_point3(DVec3::ZERO);
    assert!((origin - DVec3::new(0.0, 1_000_000.001, 0.0)).length() < 1e-9);
    assert!((transform.determinant() + 1.0).abs() < 1e-12);
}

#[test]
fn flattened_nodes_are_left_out_and_broken_ones_refused() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    builder.json["nodes"][0]["scale"] = json!([1, 0, 1]);
    let scene = builder.load().unwrap();
    assert!(scene.instances.is_empty());
    assert!(scene.warnings[0].contains("flattens"));
    let skewed = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    for nodes in [
        json!([{ "mesh": 0, "rotation": [0, 0, 0, 0] }]),
        json!([{ "mesh": 0, "matrix": skewed }]),
        json!([{ "translation": [1e300, 0, 0] }, { "scale": [1e300, 1, 1], "children": [0] }]),
    ] {
        builder.json["nodes"] = nodes.clone();
        assert!(message(builder.load()).contains("nodes[0]"), "{nodes}");
    }
}

/// Thirty nodes with two children each would be 2^30 instances.
#[test]
fn diamonds_and_cycles_are_refused() {
    let diamond: Vec<Value> = (0..30)
        .map(|n| json!({ "children": [n + 1, n + 1] }))
        .collect();
    let mut json = json!({ "asset": { "version": "2.0" }, "nodes": diamond });
    json["nodes"].as_array_mut().unwrap().push(json!({}));
    assert!(message(load_json(&json)).contains("two parents"));
    let hanging = json!([{ "children": [1] }, { "children": [2] }, { "children": [1] }]);
    json["nodes"] = hanging;
    assert!(message(load_json(&json)).contains("two parents"));
    json["nodes"] = json!([{}, { "children": [2] }, { "children": [3] }, { "children": [1] }]);
    let line = message(load_json(&json));
    assert!(
        line.contains("is its own ancestor") && !line.contains("nodes[0]"),
        "{line}"
    );
    // A long chain is no cycle.
    let chain: Vec<Value> = (0..100_000)
        .map(|n| json!({ "children": [n + 1] }))
        .collect();
    json["nodes"] = Value::Array(chain);
    json["nodes"].as_array_mut().unwrap().push(json!({}));
    assert!(load_json(&json).is_ok());
}

#[test]
fn sizes_that_lie_are_refused_before_anything_is_allocated() {
    let huge = [json!(1u64 << 40), json!(4_000_000_000u64), json!(1e30)];
    for count in huge {
        let mut builder = Builder::new();
        builder.triangle(json!({ "attributes": {} }));
        builder.json["accessors"][0]["count"] = count.clone();
        assert!(builder.load().is_err());
        builder.json["accessors"][0]["bufferView"].take();
        let accessor = builder.json["accessors"][0].as_object_mut().unwrap();
        accessor.remove("bufferView");
        assert!(builder.load().is_err(), "no bytes at all, {count}");
        let mut builder = Builder::new();
        builder.triangle(json!({ "attributes": {} }));
        builder.json["bufferViews"][0]["byteOffset"] = count;
        assert!(builder.load().is_err());
    }
    // A small file that asks for the same large accessor again and again.
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    let zeros = json!({ "componentType": FLOAT, "type": "VEC4", "count": 1 << 24 });
    let zeros = builder.push("accessors", zeros);
    let primitive = json!({ "attributes": { "POSITION": 0, "COLOR_0": zeros } });
    builder.json["meshes"][0]["primitives"] = Value::Array(vec![primitive; 1000]);
    assert!(builder.load().is_err());
}

#[test]
fn extensions_without_support_are_named() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    builder.json["extensionsUsed"] = json!(["KHR_materials_sheen"]);
    let scene = builder.load().unwrap();
    assert!(scene.warnings[0].contains("KHR_materials_sheen"));
    builder.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    let line = message(builder.load());
    assert!(line.contains("KHR_texture_basisu") && line.contains("gltf-transform"));
    builder.json["extensionsRequired"] = json!(["KHR_materials_ior", "KHR_mesh_quantization"]);
    assert!(builder.load().is_ok());
}

/// A compressed mesh that carries the plain one as well can be drawn.
#[test]
fn fallback_data_beside_a_compressed_mesh_is_used() {
    let mut builder = Builder::new();
    let draco = json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": {} } });
    builder.triangle(json!({ "attributes": {}, "extensions": draco }));
    builder.json["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": {} });
    assert_eq!(builder.load().unwrap().instances.len(), 1);
    let accessor = builder.json["accessors"][0].as_object_mut().unwrap();
    accessor.remove("bufferView");
    assert!(message(builder.load()).contains("KHR_draco_mesh_compression"));
}

#[test]
fn lights_stand_in_their_nodes() {
    let spot = json!({ "type": "spot", "color": [1, 0.5, 0], "intensity": 10, "spot": {
        "innerConeAngle": 0.1, "outerConeAngle": std::f64::consts::FRAC_PI_2 } });
    let lights = json!([spot, { "type": "point" }, { "type": "directional", "intensity": 3 }]);
    let mut json = json!({
        "asset": { "version": "2.0" },
        "extensions": { "KHR_lights_punctual": { "lights": lights } },
        "nodes": [],
    });
    let node = |light: usize| {
        json!({
            "translation": [0, light, 0],
            "extensions": { "KHR_lights_punctual": { "light": light } },
        })
    };
    json["nodes"] = json!([node(0), node(1), node(2)]);
    let scene = load_json(&json).unwrap();
    let PunctualLight::Spot {
        intensity,
        inner_deg,
        outer_deg,
    } = scene.lights[0].kind
    else {
        panic!("not a spot");
    };
    assert_eq!(intensity, [10.0, 5.0, 0.0]);
    assert!((inner_deg - 0.1f64.to_degrees()).abs() < 1e-5 && outer_deg <= 90.0);
    assert_eq!(
        scene.lights[1].kind,
        PunctualLight::Point {
            intensity: [1.0; 3]
        }
    );
    assert_eq!(scene.lights[1].object_from_light.w_axis.y, 1.0);
    assert_eq!(
        scene.lights[2].kind,
        PunctualLight::Directional {
            irradiance: [3.0; 3]
        }
    );
    json["nodes"] = json!([node(3)]);
    assert!(message(load_json(&json)).contains("lights[3]"));
    json["nodes"] = json!([node(0)]);
    json["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"]["innerConeAngle"] = json!(1.6);
    assert!(message(load_json(&json)).contains("cone angles"));
}

/// A 2 x 1 PNG, 16 bits a channel, grey: 0x8000 and 0xffff.
fn grey16_png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0x8000u16, 0xffff])
        .unwrap()
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

fn textured() -> Builder {
    let mut builder = Builder::new();
    let view = builder.view(&grey16_png());
    builder.json["images"] =
        json!([{ "bufferView": view, "mimeType": "image/png", "name": "grey" }]);
    builder.json["samplers"] = json!([{ "wrapS": 33648, "magFilter": 9728 }]);
    builder.json["textures"] = json!([{ "source": 0, "sampler": 0 }, {}]);
    let uv = builder.floats(&[0.0; 6], "VEC2", 3);
    builder.triangle(json!({ "attributes": { "TEXCOORD_1": uv }, "material": 0 }));
    let transform = json!({ "offset": [0.25, 0], "scale": [2, 2], "texCoord": 1 });
    let extensions = json!({ "KHR_texture_transform": transform });
    builder.json["materials"] = json!([{
        "normalTexture": { "index": 0, "scale": 0.5, "extensions": extensions },
        "emissiveTexture": { "index": 1 },
    }]);
    builder
}

#[test]
fn textures_bring_sampling_and_transforms() {
    use mixray::scene::Wrap;
    let mut builder = textured();
    let scene = builder.load().unwrap();
    let material = &scene.instances[0].material;
    let normal = material.normal_texture.as_ref().unwrap();
    assert_eq!((normal.uv_set, material.normal_scale), (1, 0.5));
    assert_eq!(normal.transform, [2.0, 0.0, 0.25, 0.0, 2.0, 0.0]);
    let texture = &normal.texture;
    assert_eq!(
        (texture.wrap_u, texture.wrap_v),
        (Wrap::Mirror, Wrap::Repeat)
    );
    assert!(texture.nearest);
    assert_eq!(texture.rgba8, [[128, 128, 128, 255], [255; 4]]);
    // The texture without an image is left out, aloud.
    assert!(material.emissive_texture.is_none());
    assert!(scene.warnings[0].contains("textures[1]"));

    builder.json["materials"][0]["normalTexture"]["extensions"]["KHR_texture_transform"]["texCoord"] =
        json!(0);
    let warnings = builder.load().unwrap().warnings.join("\n");
    assert!(
        warnings.contains("texture coordinates that the mesh lacks"),
        "{warnings}"
    );
    builder.json["materials"][0]["emissiveTexture"] = json!({ "index": 0, "texCoord": 2 });
    let warnings = builder.load().unwrap().warnings.join("\n");
    assert!(
        warnings.contains("texture coordinates that the mesh lacks"),
        "{warnings}"
    );
}

#[test]
fn a_broken_image_is_named() {
    let mut builder = textured();
    builder.json["bufferViews"][0]["byteLength"] = json!(40);
    let line = message(builder.load());
    assert!(
        line.contains("images[0] (grey): it cannot be decoded"),
        "{line}"
    );
    builder.json["bufferViews"][0]["byteOffset"] = json!(1);
    let line = message(builder.load());
    assert!(
        line.contains("images[0] (grey): its format is not known; expected PNG, JPEG or WebP"),
        "{line}"
    );
}

#[test]
fn material_extensions_are_read() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {}, "material": 0 }));
    builder.json["materials"] = json!([{
        "emissiveFactor": [0.5, 0, 1],
        "extensions": {
            "KHR_materials_emissive_strength": { "emissiveStrength": 8 },
            "KHR_materials_ior": { "ior": 1.33 },
            "KHR_materials_specular": { "specularFactor": 0.25, "specularColorFactor": [1, 0.5, 0] },
            "KHR_materials_transmission": { "transmissionFactor": 0.75 },
            "KHR_materials_volume": { "thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [1, 0.9, 0.8] },
            "KHR_materials_unlit": {},
        },
    }]);
    let scene = builder.load().unwrap();
    let material = &scene.instances[0].material;
    assert_eq!(material.emissive, [4.0, 0.0, 8.0]);
    assert_eq!(
        (material.ior, material.specular, material.transmission),
        (1.33, 0.25, 0.75)
    );
    assert_eq!(material.specular_color, [1.0, 0.5, 0.0]);
    assert_eq!(
        (material.thin_walled, material.attenuation_distance_m),
        (false, 2.0)
    );
    assert_eq!(material.attenuation_color, [1.0, 0.9, 0.8]);
    assert!(material.unlit);

    let volume = &mut builder.json["materials"][0]["extensions"]["KHR_materials_volume"];
    volume["thicknessFactor"] = json!(0);
    assert!(builder.load().unwrap().instances[0].material.thin_walled);
    builder.json["materials"][0]["pbrMetallicRoughness"] = json!({ "roughnessFactor": 7 });
    let scene = builder.load().unwrap();
    assert_eq!(scene.instances[0].material.roughness, 1.0);
    assert!(scene.warnings[0].contains("clamped 1 material factors"));
}

/// glTF 2.0 section 3.9.1: without a material a primitive is white, metallic and rough.
#[test]
fn the_default_material_is_that_of_gltf() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    let scene = builder.load().unwrap();
    let material = &scene.instances[0].material;
    assert!(!scene.has_materials);
    assert_eq!(
        (material.base_color, material.metallic, material.roughness),
        ([1.0; 4], 1.0, 1.0)
    );
    let normal = Vec3::from(scene.instances[0].primitive.normals[2]);
    assert_eq!(normal, Vec3::Z);
}

#[test]
fn external_files_are_found_by_escaped_names_and_devices_refused() {
    let folder = tempfile::tempdir().unwrap();
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("a b.bin"), bytes).unwrap();
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    let path = folder.path().join("made.gltf");
    let mut load = |uri: &str| {
        builder.json["buffers"] = json!([{ "byteLength": 36, "uri": uri }]);
        let bom = [
            b"\xef\xbb\xbf",
            serde_json::to_vec(&builder.json).unwrap().as_slice(),
        ]
        .concat();
        std::fs::write(&path, bom).unwrap();
        load_gltf(&path)
    };
    assert_eq!(load("a%20b.bin").unwrap().instances.len(), 1);
    assert!(message(load("c.bin")).contains("c.bin"));
    assert!(message(load("/dev/zero")).contains("not a regular file"));
    assert!(message(load("https://example.com/a.bin")).contains("https"));
}

#[test]
fn only_the_default_scene_is_drawn() {
    let mut builder = Builder::new();
    builder.triangle(json!({ "attributes": {} }));
    builder.push("nodes", json!({ "mesh": 0, "name": "second" }));
    assert_eq!(
        builder.load().unwrap().instances.len(),
        2,
        "no scenes: all roots"
    );
    builder.json["scenes"] = json!([{ "nodes": [0] }, { "nodes": [0, 1] }]);
    let scene = builder.load().unwrap();
    assert_eq!(scene.instances.len(), 1);
    assert!(scene.warnings[0].contains("no default scene"));
    builder.json["scene"] = json!(1);
    assert_eq!(builder.load().unwrap().instances.len(), 2);
    builder.json["scenes"][1]["nodes"] = json!([0, 0]);
    assert!(message(builder.load()).contains("reached twice"));
}
