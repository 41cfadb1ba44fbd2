//! glTF node animations: where they put things, and their blur.

use base64::Engine;
use glam::{DMat4, DQuat, DVec3};
use mixray::scene::BackendChoice;
use serde_json::json;

use super::support::{CAMERA, mask_row, render};
use crate::support::{Folder, scene};

/// A white square of 0.4 m at z = -1 under two nodes: the parent moves by `output` at the times 0, 1 and 2 s, the child stays.
fn model(folder: &Folder, path: &str, interpolation: &str, output: &[f32], kind: &str) -> String {
    let corners: [f32; 12] = [
        -0.2, -0.4, 0.0, 0.2, -0.4, 0.0, 0.2, 0.4, 0.0, -0.2, 0.4, 0.0,
    ];
    let times = [0.0f32, 1.0, 2.0];
    let indices = [0u32, 1, 2, 0, 2, 3];
    let mut bytes: Vec<u8> = Vec::new();
    bytes.extend(corners.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(indices.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(times.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(output.iter().flat_map(|x| x.to_le_bytes()));
    let components = if kind == "VEC4" { 4 } else { 3 };
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let document = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}") }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 24 },
            { "buffer": 0, "byteOffset": 72, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 84, "byteLength": 4 * output.len() },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4, "min": [-0.2, -0.4, 0.0], "max": [0.2, 0.4, 0.0] },
            { "bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 6 },
            { "bufferView": 2, "componentType": 5126, "type": "SCALAR", "count": 3, "min": [0.0], "max": [2.0] },
            { "bufferView": 3, "componentType": 5126, "type": kind, "count": output.len() / components },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "children": [1] }, { "mesh": 0, "translation": [0.0, 0.0, -1.0] }],
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
        "animations": [
            { "name": "other", "channels": [], "samplers": [] },
            {
                "name": "slide",
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }],
                "samplers": [{ "input": 2, "output": 3, "interpolation": interpolation }],
            },
        ],
    });
    folder.write("model.gltf", document.to_string());
    let mesh = folder.path("model.gltf");
    format!(
        "[[virtual]]\nmesh = {:?}\nmaterial = {{ base_color = [1, 1, 1], unlit = true }}\n",
        mesh.to_string_lossy()
    )
}

/// Where the square's node is at a time.
fn placed(text: &str, time_secs: f64) -> DMat4 {
    let mut scene = scene(&format!("{CAMERA}{text}animation = \"slide\"\n"));
    scene.set_time(time_secs);
    scene.objects[0].world_from_object * scene.objects[0].instances[0].object_from_local
}

fn assert_near(found: DMat4, expected: DMat4) {
    let off = (found - expected).to_cols_array();
    assert!(
        off.iter().all(|x| x.abs() < 1e-6),
        "{found}, not {expected}"
    );
}

#[test]
fn nodes_are_where_the_tracks_put_them() {
    let folder = Folder::new();
    let child = DMat4::from_translation(DVec3::NEG_Z);
    let at = |x: f64| DMat4::from_translation(DVec3::X * x) * child;
    let slide = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0];
    let linear = model(&folder, "translation", "LINEAR", &slide, "VEC3");
    for (time, x) in [
        (0.0, 0.0),
        (0.25, 0.25),
        (1.5, 2.0),
        (2.25, 0.25),
        (-0.5, 2.0),
    ] {
        assert_near(placed(&linear, time), at(x));
    }
    let text = format!("{CAMERA}{linear}");
    let mut still = scene(&text);
    still.set_time(1.5);
    assert_near(still.objects[0].instances[0].object_from_local, child);

    let step = model(&folder, "translation", "STEP", &slide, "VEC3");
    assert_near(placed(&step, 1.9), at(1.0));
    // Tangents of 0: the curve is 3 t^2 - 2 t^3 between two keys.
    let cubic: Vec<f32> = [0.0, 1.0, 3.0]
        .iter()
        .flat_map(|x| [0.0, 0.0, 0.0, *x, 0.0, 0.0, 0.0, 0.0, 0.0])
        .collect();
    let cubic = model(&folder, "translation", "CUBICSPLINE", &cubic, "VEC3");
    assert_near(placed(&cubic, 0.25), at(3.0 * 0.0625 - 2.0 * 0.015625));
    let turn = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians());
    let turns: Vec<f32> = [0.0, 90.0, 180.0]
        .iter()
        .flat_map(|degrees| turn(*degrees).as_quat().to_array())
        .collect();
    let turns = model(&folder, "rotation", "LINEAR", &turns, "VEC4");
    assert_near(placed(&turns, 0.5), DMat4::from_quat(turn(45.0)) * child);
}

#[test]
fn an_animated_square_is_smeared() {
    let folder = Folder::new();
    let slide = [-0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0];
    let slide = model(&folder, "translation", "LINEAR", &slide, "VEC3");
    let shutter = "[shutter]\nexposure_secs = 0.5\ntime_secs = 1\n[render]\nrays_per_pixel = 64\n";
    let text = |more: &str| format!("{CAMERA}{slide}{more}{shutter}");
    let smeared = render(&text("animation = \"slide\"\n"), BackendChoice::Cpu);
    let row = mask_row(&smeared, 12);
    for (x, expected) in [
        (17, 0.0),
        (28, 0.525),
        (22, 0.225),
        (38, 1.0),
        (48, 1.0),
        (72, 0.275),
        (79, 0.0),
    ] {
        assert!(
            (row[x] - expected).abs() < 0.03,
            "{x}: {}, not {expected}",
            row[x]
        );
    }
    let still = mask_row(
        &render(
            &text("animation = 0\n").replace("animation = 0\n", ""),
            BackendChoice::Cpu,
        ),
        12,
    );
    assert_eq!(
        (still[27], still[28]),
        (0.0, 1.0),
        "control: not asked for, not moved"
    );
}

#[test]
fn animations_that_are_not_there_or_broken_are_refused() {
    let folder = Folder::new();
    let refused = |text: &str, part: &str| {
        folder.write("scene.toml", format!("{CAMERA}{text}"));
        folder.refuse("render scene.toml", part);
    };
    let slide = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0];
    let good = model(&folder, "translation", "LINEAR", &slide, "VEC3");
    refused(&format!("{good}animation = \"jump\"\n"), "other, slide");
    refused(&format!("{good}animation = 1\n"), "string");
    let short = model(&folder, "translation", "LINEAR", &slide[..6], "VEC3");
    refused(
        &format!("{short}animation = \"1\"\n"),
        "2 values for 3 times",
    );
    let flat = model(&folder, "rotation", "LINEAR", &[0.0; 12], "VEC4");
    refused(
        &format!("{flat}animation = \"slide\"\n"),
        "rotation without length",
    );
    let nan = model(&folder, "translation", "LINEAR", &[f32::NAN; 9], "VEC3");
    refused(&format!("{nan}animation = \"slide\"\n"), "not finite");
}
