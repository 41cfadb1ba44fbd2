//! Scenes that cannot be meant are told so, things are placed by what they stand on, and files are called by their names.

mod findings;
mod placing;
mod scans;
mod told;

/// A table of 4 m by 4 m at the height 0, looked down upon, under white light.
pub const TABLE: &str = "\
[camera]
width = 64
height = 48
vertical_fov_deg = 40
position = [0, 1.5, 3]
look_at = [0, 0.1, 0]

[environment]
radiance = [1, 1, 1]

[[real]]
name = \"table\"
shape = \"quad\"
corner = [-2, 0, 2]
edge_u = [4, 0, 0]
edge_v = [0, 0, -4]
material = { base_color = [0.5, 0.5, 0.5] }

[render]
rays_per_pixel = 1
backend = \"cpu\"
";

/// A ball of a quarter of a metre on [`TABLE`].
pub const BALL: &str = "
[[virtual]]
name = \"ball\"
shape = \"sphere\"
translation = [0, 0.25, 0]
scale = 0.25
";
