//! `mixray preview` without a display.

mod composing;
mod desk;
mod files;
mod gizmo;
mod keyframes;
mod layout;
mod random_walk;
mod real_window;
mod stages;
mod timeline;

use std::time::Duration;

use mixray::preview::headless::Window;
use mixray::preview::session::Session;
use mixray::preview::window::App;

use crate::support::{Folder, root};

const FRAME_TIME: Duration = Duration::from_millis(33);

/// A table with a ball on it, seen by a small camera.
const SCENE: &str = "\
[camera]
width = 64
height = 48
vertical_fov_deg = 40
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.0, 0.0]

[lens]
f_number = 1.8 # wide open
focal_length_mm = 50
focus_distance_m = 3.0

[environment]
radiance = [0.5, 0.6, 0.7]

[[real]]
shape = \"quad\"
name = \"table\"
corner = [-2.0, 0.0, 2.0]
edge_u = [4.0, 0.0, 0.0]
edge_v = [0.0, 0.0, -4.0]
material = { base_color = [0.5, 0.4, 0.3] }

[[virtual]]
shape = \"sphere\" # the ball
name = \"ball\"
scale = 0.3
translation = [0.0, 0.3, 0.0]

[render]
rays_per_pixel = 4
max_bounces = 2
";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", SCENE);
    folder
}

/// The demo with few rays, and its photograph, meshes and light.
fn demo() -> Folder {
    let folder = Folder::new();
    let from = root().join("scenes/demo");
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        folder.write(&name, std::fs::read(&path).unwrap());
    }
    let text = folder.read("scene.toml");
    let few = text.replace("rays_per_pixel = 49", "rays_per_pixel = 2");
    assert_ne!(few, text);
    folder.write("scene.toml", few);
    folder
}

/// A window on the scene, which is read.
fn window(folder: &Folder) -> Window {
    let session = Session::open(&folder.path("scene.toml"), FRAME_TIME, || ()).unwrap();
    let mut window = Window::new(App::new(session));
    window.wait_for_scene().unwrap();
    window
}
