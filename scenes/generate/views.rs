//! Ten photographs of the demo's things and of the room from elsewhere, at fields of view from 25 to 90 degrees: what `mixray new` reads cameras from is
//! measured with them (`examples/measure_lines.rs`). They are no part of the repository.

use std::error::Error;
use std::path::Path;

use serde_json::json;

use crate::photograph::{Sensor, photograph, real_scene_of};
use crate::{demo, folder};

/// Primary rays for each pixel.
const RAYS: u32 = 64;
const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

/// From where a scene is photographed. Metres, y up; degrees.
struct View {
    scene: &'static str,
    fov_deg: f64,
    position: [f64; 3],
    look_at: [f64; 3],
}

const fn view(scene: &'static str, fov_deg: f64, position: [f64; 3], look_at: [f64; 3]) -> View {
    View {
        scene,
        fov_deg,
        position,
        look_at,
    }
}

const VIEWS: [View; 10] = [
    view("demo", 25.0, [0.45, 0.55, 0.98], [0.0, 0.03, 0.0]),
    view("room", 32.0, [1.1, 1.5, 5.2], [-0.2, 0.8, 0.0]),
    view("demo", 40.0, [-0.35, 0.42, 0.60], [0.0, 0.05, -0.03]),
    view("room", 45.0, [-1.2, 1.6, 3.6], [0.4, 0.7, 0.0]),
    view("demo", 55.0, [0.30, 0.36, 0.42], [-0.02, 0.05, -0.10]),
    view("room", 60.0, [1.0, 1.4, 2.6], [0.0, 0.7, 0.0]),
    view("demo", 70.0, [-0.28, 0.30, 0.30], [0.0, 0.06, -0.12]),
    view("room", 75.0, [-0.9, 1.7, 2.4], [0.5, 0.6, 0.0]),
    view("demo", 85.0, [0.22, 0.26, 0.24], [-0.03, 0.06, -0.14]),
    view("room", 90.0, [0.8, 1.3, 2.2], [-0.3, 0.8, 0.0]),
];

/// The photographs, and `views.json` with their cameras' focal lengths and directions of up.
pub fn generate(target: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(target)?;
    let mut list = Vec::new();
    for (index, view) in VIEWS.iter().enumerate() {
        let source = folder(view.scene);
        let text = std::fs::read_to_string(source.join("scene.toml"))?;
        let half = 0.5 * view.fov_deg.to_radians();
        let vertical = 2.0 * (half.tan() * f64::from(HEIGHT) / f64::from(WIDTH)).atan();
        let camera = format!(
            "\n[camera]\nwidth = {WIDTH}\nheight = {HEIGHT}\nvertical_fov_deg = {:?}\nposition = {:?}\nlook_at = {:?}\n",
            vertical.to_degrees(),
            view.position,
            view.look_at
        );
        let mut scene = real_scene_of(&text, &["[photo]", "[camera]", "[lens]"], &camera, &source)?;
        let mut sensor = Sensor::NOISELESS;
        if view.scene == "demo" {
            scene.objects = demo::objects();
            sensor = demo::SENSOR;
        }
        let up = scene
            .camera
            .world_from_camera
            .inverse()
            .transform_vector3(glam::DVec3::Y);
        let name = format!("view_{index}.png");
        list.push(json!({
            "photo": name,
            "field_of_view_deg": view.fov_deg,
            "focal_px": scene.camera.fx,
            "up": up.to_array(),
        }));
        photograph(scene, RAYS, sensor, &target.join(name))?;
    }
    let text = serde_json::to_string_pretty(&list)?;
    Ok(std::fs::write(target.join("views.json"), text + "\n")?)
}
