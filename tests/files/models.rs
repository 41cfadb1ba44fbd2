//! glTF files with skins, morph targets, copies, hidden nodes and more sets of texture coordinates.

use serde_json::{Value, json};

use crate::support::{Folder, stderr};

/// A file in the making: its buffer is a data URI.
struct Model {
    json: Value,
    bytes: Vec<u8>,
}

const FLOAT: u32 = 5126;
const U16: u32 = 5123;

impl Model {
    fn new() -> Self {
        Self {
            json: json!({
                "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
                "bufferViews": [], "accessors": [], "nodes": [], "meshes": [], "materials": [],
            }),
            bytes: Vec::new(),
        }
    }

    fn push(&mut self, list: &str, item: Value) -> usize {
        let items = self.json[list].as_array_mut().expect("a list");
        items.push(item);
        items.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view =
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = self.push("bufferViews", view);
        self.push(
            "accessors",
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }),
        )
    }

    fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let each = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "MAT4" => 16,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, kind, values.len() / each)
    }

    /// A square of this side about the origin, facing +Z, red; more attributes and fields come from `more`.
    fn square(&mut self, side: f32, more: Value, beside: Value) -> usize {
        let h = 0.5 * side;
        let corners = [-h, -h, 0.0, h, -h, 0.0, h, h, 0.0, -h, h, 0.0];
        let position = self.floats(&corners, "VEC3");
        let normal = self.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
        let indices: Vec<u8> = [0u16, 1, 2, 0, 2, 3]
            .iter()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        let indices = self.accessor(&indices, U16, "SCALAR", 6);
        if self.json["materials"].as_array().is_some_and(Vec::is_empty) {
            self.push(
                "materials",
                json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.9, 0.1, 0.1, 1], "metallicFactor": 0 } }),
            );
        }
        let mut primitive = json!({ "attributes": { "POSITION": position, "NORMAL": normal }, "indices": indices, "material": 0 });
        for (key, value) in more.as_object().expect("attributes") {
            primitive["attributes"][key] = value.clone();
        }
        for (key, value) in beside.as_object().expect("fields") {
            primitive[key] = value.clone();
        }
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    fn write(&self, folder: &Folder) {
        let mut json = self.json.clone();
        let hex: String = self.bytes.iter().map(|b| format!("%{b:02x}")).collect();
        json["buffers"] =
            json!([{ "byteLength": self.bytes.len(), "uri": format!("data:,{hex}") }]);
        folder.write("m.gltf", json.to_string());
    }
}

/// The camera stands three metres before the origin; the sky is white and a bounce enough.
fn scene(more: &str) -> String {
    format!(
        "[camera]\nwidth = 96\nheight = 72\nvertical_fov_deg = 40\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n\
         [environment]\nradiance = [1, 1, 1]\n[[virtual]]\nmesh = \"m.gltf\"\n{more}\n[render]\nrays_per_pixel = 16\nbackend = \"cpu\"\n"
    )
}

/// Pixels that are red, and their middle; what the program said.
fn seen(folder: &Folder, more: &str) -> (usize, [f64; 2], String) {
    folder.write("scene.toml", scene(more));
    let output = folder.run("render scene.toml -o out.png");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let picture = folder.open("out.png");
    // Half covered or more.
    let red = picture
        .pixels()
        .filter(|p| i32::from(p[0]) - i32::from(p[1]) > 117)
        .count();
    (red, super::support::centroid(&picture), stderr(&output))
}

/// Pixels a metre, at the origin.
const SCALE: f64 = 72.0 / (2.0 * 3.0 * 0.363_970_23);

fn area(side_m: f64) -> f64 {
    (side_m * SCALE).powi(2)
}

/// A card of 120 cm bound to a joint under an armature of scale 0.01, and an animation that moves and turns it.
fn skinned() -> Model {
    let mut model = Model::new();
    let joints = model.accessor(&[0u8; 16], 5121, "VEC4", 4);
    let weights = model.floats(&[1.0, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let mesh = model.square(
        120.0,
        json!({ "JOINTS_0": joints, "WEIGHTS_0": weights }),
        json!({}),
    );
    // The joint was bound where it is: mesh space is that of the armature, in centimetres.
    let bind = model.floats(
        &[
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
        ],
        "MAT4",
    );
    model.push(
        "nodes",
        json!({ "scale": [0.01, 0.01, 0.01], "children": [1, 2] }),
    );
    model.push("nodes", json!({}));
    // Its own transform has no effect.
    model.push(
        "nodes",
        json!({ "mesh": mesh, "skin": 0, "translation": [500, 0, 0] }),
    );
    model.json["skins"] = json!([{ "joints": [1], "inverseBindMatrices": bind }]);
    let times = model.floats(&[0.0, 1.0, 2.0], "SCALAR");
    let places = model.floats(&[0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 30.0, 0.0, 0.0], "VEC3");
    model.json["animations"] = json!([{ "name": "walk",
        "samplers": [{ "input": times, "output": places }],
        "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }] }]);
    model
}

#[test]
fn gltf_skin_cm() {
    let folder = Folder::new();
    skinned().write(&folder);
    let (red, middle, said) = seen(&folder, "");
    assert!(
        (red as f64 / area(1.2) - 1.0).abs() < 0.06,
        "{red} {}",
        area(1.2)
    );
    assert!((middle[0] - 48.0).abs() < 0.3, "{middle:?}");
    assert!(!said.contains("skin"), "{said}");
    let mut unbound = skinned();
    unbound.json["nodes"][2]["skin"] = Value::Null;
    unbound.write(&folder);
    let (red, ..) = seen(&folder, "translation = [-5, 0, 0]");
    assert!(
        (red as f64 / area(1.2) - 1.0).abs() < 0.06,
        "control: without a skin the node counts"
    );
    let mut broken = skinned();
    broken.json["skins"][0]["joints"] = json!([9]);
    broken.write(&folder);
    folder.refuse("render scene.toml -o out.png", "refers to node 9");
}

#[test]
fn skins_move_in_sequences() {
    let folder = Folder::new();
    skinned().write(&folder);
    folder.write("scene.toml", scene("animation = \"walk\""));
    folder.grey_frames(&["f_0.png", "f_1.png", "f_2.png"]);
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]";
    let entries = [0.0, 0.5, 1.0].iter().enumerate().map(|(frame, time)| {
        format!(r#"{{"frame": {frame}, "time_secs": {time}, "world_from_camera": {pose}}}"#)
    });
    let entries = entries.collect::<Vec<_>>().join(", ");
    folder.write("t.json", format!(r#"{{"frames": [{entries}]}}"#));
    let scene = folder
        .read("scene.toml")
        .replace("width = 96\nheight = 72\n", "");
    folder.write("scene.toml", scene);
    for backend in ["cpu", "gpu"] {
        folder.sequence_of("frames", "t.json", &format!("--backend {backend}"));
        let x = [0, 1, 2].map(|frame| folder.ball_at(&format!("f_{frame}.png"))[0]);
        // 48 rows in place of 72: two thirds of the pixels a metre.
        let step = 0.15 * SCALE * 48.0 / 72.0;
        assert!((x[1] - x[0] - step).abs() < 0.3, "{backend}: {x:?}");
        assert!((x[2] - x[1] - step).abs() < 0.3, "{backend}: {x:?}");
    }
    let still = folder
        .read("scene.toml")
        .replace("animation = \"walk\"", "");
    folder.write("scene.toml", still);
    folder.sequence_of("frames", "t.json", "");
    let x = [0, 2].map(|frame| folder.ball_at(&format!("f_{frame}.png"))[0]);
    assert!((x[1] - x[0]).abs() < 0.3, "control: {x:?}");
}

#[test]
fn gltf_morph_targets() {
    let mut model = Model::new();
    let wider = model.floats(
        &[-0.4, 0.0, 0.0, 0.4, 0.0, 0.0, 0.4, 0.0, 0.0, -0.4, 0.0, 0.0],
        "VEC3",
    );
    let mesh = model.square(
        0.8,
        json!({}),
        json!({ "targets": [{ "POSITION": wider }] }),
    );
    model.push("nodes", json!({ "mesh": mesh }));
    let times = model.floats(&[0.0, 1.0], "SCALAR");
    let weights = model.floats(&[0.0, 1.0], "SCALAR");
    model.json["animations"] = json!([{
        "samplers": [{ "input": times, "output": weights }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }] }]);
    let folder = Folder::new();
    let areas = |model: &Model, more: &str| {
        model.write(&folder);
        seen(&folder, more).0 as f64 / area(0.8)
    };
    assert!((areas(&model, "") - 1.0).abs() < 0.06, "control: weight 0");
    model.json["meshes"][0]["weights"] = json!([0.5]);
    assert!((areas(&model, "") - 1.5).abs() < 0.08, "the mesh's weight");
    model.json["nodes"][0]["weights"] = json!([1.0]);
    assert!((areas(&model, "") - 2.0).abs() < 0.1, "the node's weight");
    let moving = "animation = \"0\"\n[shutter]\nexposure_secs = 0\ntime_secs = 0.25";
    assert!(
        (areas(&model, moving) - 1.25).abs() < 0.08,
        "a quarter of the way"
    );
}

#[test]
fn gltf_gpu_instancing_used() {
    let mut model = Model::new();
    let mesh = model.square(0.4, json!({}), json!({}));
    let places = model.floats(&[-0.5, 0.0, 0.0, 0.5, 0.0, 0.0], "VEC3");
    let scales = model.floats(&[1.0, 1.0, 1.0, 2.0, 1.0, 1.0], "VEC3");
    let copies = json!({ "attributes": { "TRANSLATION": places, "SCALE": scales } });
    model.push(
        "nodes",
        json!({ "mesh": mesh, "extensions": { "EXT_mesh_gpu_instancing": copies } }),
    );
    model.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let folder = Folder::new();
    model.write(&folder);
    let (red, _, said) = seen(&folder, "");
    assert!(!said.contains("instancing"), "{said}");
    assert!((red as f64 / (3.0 * area(0.4)) - 1.0).abs() < 0.12, "{red}");
    let out = folder.open("out.png");
    let is_red = |x: u32| out.get_pixel(x, 36)[0] > 100;
    assert!(
        is_red(48 - 16) && is_red(48 + 16) && !is_red(48),
        "left and right, not the middle"
    );
    model.json["nodes"][0]["extensions"] = json!({});
    model.write(&folder);
    seen(&folder, "");
    assert!(folder.open("out.png").get_pixel(48, 36)[0] > 100, "control");
}

#[test]
fn gltf_node_visibility() {
    let mut model = Model::new();
    let mesh = model.square(0.4, json!({}), json!({}));
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    model.json["scenes"][0]["nodes"] = json!([0, 1]);
    model.push(
        "nodes",
        json!({ "mesh": mesh, "translation": [-0.5, 0, 0] }),
    );
    model.push("nodes", json!({ "children": [2], "extensions": hidden }));
    model.push("nodes", json!({ "mesh": mesh, "translation": [0.5, 0, 0] }));
    let folder = Folder::new();
    model.write(&folder);
    let (red, middle, _) = seen(&folder, "");
    assert!(
        (red as f64 / area(0.4) - 1.0).abs() < 0.12 && middle[0] < 40.0,
        "{red} {middle:?}"
    );
    model.json["nodes"][1]["extensions"] = json!({});
    model.write(&folder);
    let (both, ..) = seen(&folder, "");
    assert!(both as f64 > 1.8 * red as f64, "control: {both}");
}

/// A texture that is red on the left and blue on the right, at the right half by set 2 and at the left one by set 0.
#[test]
fn gltf_uv_set2() {
    let mut png = Vec::new();
    let texture = image::RgbImage::from_fn(2, 1, |x, _| match x {
        0 => image::Rgb([230, 20, 20]),
        _ => image::Rgb([20, 20, 230]),
    });
    let mut cursor = std::io::Cursor::new(&mut png);
    texture
        .write_to(&mut cursor, image::ImageFormat::Png)
        .expect("encodes");
    let hex: String = png.iter().map(|b| format!("%{b:02x}")).collect();
    let folder = Folder::new();
    let colour = |set: u32| {
        let mut model = Model::new();
        model.json["images"] = json!([{ "uri": format!("data:image/png,{hex}") }]);
        model.json["textures"] = json!([{ "source": 0 }]);
        model.push(
            "materials",
            json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": set }, "metallicFactor": 0 } }),
        );
        let left = model.floats(&[0.25, 0.5].repeat(4), "VEC2");
        let right = model.floats(&[0.75, 0.5].repeat(4), "VEC2");
        let sets = json!({ "TEXCOORD_0": left, "TEXCOORD_1": left, "TEXCOORD_2": right });
        let mesh = model.square(0.8, sets, json!({}));
        model.push("nodes", json!({ "mesh": mesh }));
        model.write(&folder);
        folder.write("scene.toml", scene(""));
        folder.succeed("render scene.toml -o out.png");
        folder.open("out.png").get_pixel(48, 36).0
    };
    assert!(colour(2)[2] > 150, "blue");
    assert!(colour(0)[0] > 150, "control: red");
}

/// A matt red with a green reflection of full gloss becomes as much; of no gloss it does not mirror.
#[test]
fn gltf_specular_glossiness() {
    let folder = Folder::new();
    let colour = |diffuse: f32, specular: f32| {
        let mut model = Model::new();
        let extension = json!({ "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [diffuse, 0, 0, 1], "specularFactor": [0, specular, 0], "glossinessFactor": 1 } });
        model.push("materials", json!({ "extensions": extension }));
        model.json["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
        let mesh = model.square(0.8, json!({}), json!({}));
        model.push("nodes", json!({ "mesh": mesh }));
        model.write(&folder);
        folder.write("scene.toml", scene(""));
        folder.succeed("render scene.toml -o out.png");
        let code = folder.open("out.png").get_pixel(48, 36).0;
        code.map(|code| mixray::scene::srgb::decode(f64::from(code) / 255.0))
    };
    // Under a white sky a mirror shows its colour, and so does what scatters.
    let mirror = colour(0.0, 0.6);
    assert!(
        (mirror[1] - 0.6).abs() < 0.03 && mirror[0] < 0.03,
        "{mirror:?}"
    );
    let matt = colour(0.6, 0.0);
    assert!((matt[0] - 0.6).abs() < 0.06 && matt[1] < 0.06, "{matt:?}");
    assert!((mirror[1] - matt[1]).abs() > 0.4, "control");
}
