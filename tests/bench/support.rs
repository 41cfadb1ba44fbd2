//! A small scene in a folder.

use crate::support::Folder;

/// A ball over a textured floor, out of focus: background, edge and virtual pixels.
pub const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
position = [0, 0.6, 2]
look_at = [0, 0.2, 0]
[lens]
aperture_radius_m = 0.05
focus_distance_m = 1.2
[environment]
radiance = [0.8, 0.9, 1.0]
[[light]]
kind = \"quad\"
corner = [-0.5, 2, -0.5]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [3, 3, 3]
[[real]]
shape = \"quad\"
corner = [-3, 0, 3]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
material = { base_color = [0.5, 0.4, 0.3] }
[[virtual]]
shape = \"sphere\"
scale = 0.3
segments = 32
translation = [0, 0.31, 0]
material = { base_color = [0.3, 0.5, 0.7] }
[render]
max_bounces = 2
backend = \"cpu\"
";

pub fn folder() -> Folder {
    Folder::with_scene(SCENE)
}

pub const QUICK: &str =
    "bench scene.toml --backends cpu --rpp 1,4 --repeats 2 --reference-error 0.5 -o out";
