use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use super::*;
use crate::scene::load_text;

const SCENE: &str = r#"
[camera]
width = 400
height = 200
fx = 500
fy = 250
cx = 180
cy = 110
position = [1, 2, 3]
look_at = [1, 2, 0]

[lens]
aperture_radius_m = 0.02
focus_distance_m = 3.0
aperture = 5
blade_rotation_deg = 46

[environment]
radiance = [1, 2, 3]
scale = 0.5

[photo]
exposure_ev = 1.0

[[light]]
kind = "quad"
corner = [0, 4, 0]
edge_u = [2, 0, 0]
edge_v = [0, 0, 0.5]
radiance = [10, 5, 0]

[[light]]
kind = "spot"
position = [0, 3, 0]
direction = [0, -1, 0]
intensity = [2, 2, 2]
inner_deg = 20
outer_deg = 30
side = "virtual"

[[light]]
kind = "directional"
direction = [1, 0, 0]
irradiance = [4, 4, 4]

[[real]]
shape = "quad"
corner = [-1, 0, -1]
edge_u = [0, 0, 2]
edge_v = [2, 0, 0]
material = { base_color = [0.5, 0.5, 0.5] }

[[virtual]]
name = "it's a \"box\""
shape = "box"
translation = [0, 1, -2]

[[virtual]]
shape = "box"
motion = [{ time_secs = 0.0, translation = [1, 0, 0] }]

[render]
rays_per_pixel = 9
max_bounces = 6
"#;

fn written() -> BlenderScene {
    let scene = load_text(Path::new("scene.toml"), SCENE).unwrap();
    script(&scene, "scene.numbers")
}

/// What the script builds.
fn description() -> Value {
    let script = written().script;
    let json = script.split("r'''").nth(1).unwrap();
    serde_json::from_str(json.split("'''").next().unwrap()).unwrap()
}

fn assert_near(value: &Value, expected: &[f64]) {
    let values: Vec<f64> = match value.as_array() {
        Some(values) => values.iter().map(|v| v.as_f64().unwrap()).collect(),
        None => vec![value.as_f64().unwrap()],
    };
    assert_eq!(values.len(), expected.len());
    for (value, expected) in values.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-6, "{values:?} {expected}");
    }
}

/// `None`: Python is not here.
fn compiles(text: &str) -> Option<bool> {
    let mut python = Command::new("python3")
        .args(["-c", "import ast, sys; ast.parse(sys.stdin.read())"])
        .stdin(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    (python.stdin.take().unwrap())
        .write_all(text.as_bytes())
        .unwrap();
    Some(python.wait().unwrap().success())
}

#[test]
fn the_script_is_python() {
    let script = written().script;
    let Some(is_python) = compiles(&script) else {
        eprintln!("SKIPPED: `python3` is not here");
        return;
    };
    assert!(is_python, "{script}");
    assert_eq!(compiles(&script.replacen("r'''", "r''", 1)), Some(false));
}

#[test]
fn cameras_keep_their_pixels() {
    let camera = &description()["camera"];
    // fx = lens / sensor * width, and pixels are fx / fy times as high as wide.
    let fx = camera["lens_mm"].as_f64().unwrap() / 36.0 * 400.0;
    assert!((fx - 500.0).abs() < 1e-9);
    assert_near(&camera["pixel_aspect"], &[2.0]);
    assert_near(&camera["shift"], &[20.0 / 400.0, 10.0 * 2.0 / 400.0]);
    // It looks along mixray's -Z, Blender's +Y, from (1, 2, 3).
    let column = |j: usize| -> Vec<f64> {
        let rows = camera["matrix"].as_array().unwrap();
        rows[..3]
            .iter()
            .map(|row| row[j].as_f64().unwrap())
            .collect()
    };
    assert_near(&json!(column(2)), &[0.0, -1.0, 0.0]);
    assert_near(&json!(column(1)), &[0.0, 0.0, 1.0]);
    assert_near(&json!(column(3)), &[1.0, -3.0, 2.0]);
    let focus = &camera["depth_of_field"];
    assert_near(&focus["f_number"], &[45.0 / 40.0]);
    assert_near(&focus["focus_distance_m"], &[3.0]);
    assert_near(&focus["rotation_deg"], &[10.0]);
    assert_eq!(focus["blades"], 5);
}

#[test]
fn lights_keep_their_power() {
    let description = description();
    let lights = description["lights"].as_array().unwrap();
    // Exposed by one stop: power = 2 pi area radiance.
    assert_near(&lights[0]["power_w"], &[2.0 * std::f64::consts::PI * 10.0]);
    assert_near(&lights[0]["color"], &[1.0, 0.5, 0.0]);
    assert_near(&lights[0]["size"], &[2.0, 0.5]);
    // It shines up, in Blender to +Z, along its own -Z; its middle is (1, 4, 0.25).
    let column = |light: &Value, j: usize| {
        let row = |i: usize| light["matrix"][i][j].as_f64().unwrap();
        json!([row(0), row(1), row(2)])
    };
    assert_near(&column(&lights[0], 2), &[0.0, 0.0, 1.0]);
    assert_near(&column(&lights[0], 3), &[1.0, -0.25, 4.0]);
    assert_near(
        &lights[1]["power_w"],
        &[2.0 * 4.0 * std::f64::consts::PI * 2.0],
    );
    assert_near(&lights[1]["angle_deg"], &[60.0]);
    assert_eq!(lights[1]["is_added"], true);
    assert_near(&lights[2]["power_w"], &[8.0]);
    assert_near(&column(&lights[2], 2), &[-1.0, 0.0, 0.0]);
    assert_near(&description["environment"]["strength"], &[1.0]);
    assert_eq!(
        description["settings"],
        json!({ "samples": 9, "max_bounces": 5, "seed": 0, "clamp_indirect": 0.0 })
    );
}

#[test]
fn meshes_are_in_the_file_of_numbers() {
    let (written, description) = (written(), description());
    let geometry = &description["geometry"];
    let objects = geometry["objects"].as_array().unwrap();
    let real: Vec<bool> = objects.iter().map(|o| o["is_real"] == true).collect();
    assert_eq!(real, [true, false, false]);
    assert_eq!(objects[1]["name"], "it's a \"box\"");
    let place = &geometry["meshes"][0]["positions"];
    let [offset, count] = [0, 1].map(|i| place[i].as_u64().unwrap() as usize);
    let bytes = &written.numbers[offset..offset + 4 * count];
    let positions: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
    assert_eq!(count, 12);
    assert_eq!(positions[..3], [-1.0, 0.0, -1.0]);
    // What moves is told.
    assert!(
        written.notes.iter().any(|note| note.starts_with("motion")),
        "{:?}",
        written.notes
    );
    assert!(!written.notes.iter().any(|note| note.contains("distortion")));
}
