//! The table: small scenes that between them use everything the estimator does. Scenes with the same features share compiled kernels,
//! which are most of what a test costs on a software device.

/// Pixels.
pub const WIDTH: u32 = 48;
pub const HEIGHT: u32 = 36;
/// Rays a pixel.
pub const RAYS: u32 = 6;

/// One scene: pieces of a scene file, and lines of its `[render]` table.
#[derive(Clone, Copy)]
pub struct Case {
    pub name: &'static str,
    pub parts: &'static [&'static str],
    pub settings: &'static str,
    /// Depth, normal and albedo too.
    pub all_planes: bool,
}

impl Case {
    /// The scene file.
    pub fn text(&self) -> String {
        format!(
            "{}\n[render]\nrays_per_pixel = {RAYS}\nbackend = \"cpu\"\n{}\n",
            self.parts.concat(),
            self.settings
        )
    }
}

pub fn case(name: &str) -> &'static Case {
    CASES
        .iter()
        .find(|case| case.name == name)
        .unwrap_or_else(|| panic!("there is no scene {name}"))
}

const CAMERA: &str = "
[camera]
width = 48
height = 36
vertical_fov_deg = 40
position = [0, 0.5, 2.2]
look_at = [0, 0.25, 0]
up = [0, 1, 0]
";

/// A photograph taken through a lens that bends.
const PHOTO_CAMERA: &str = "
[photo]
image = \"photo.png\"
exposure_ev = 0.3
[camera]
fx = 46.0
fy = 47.0
cx = 24.7
cy = 17.6
distortion = [-0.12, 0.03, 0.002, -0.003, 0.01]
position = [0, 0.5, 2.2]
look_at = [0, 0.25, 0]
up = [0, 1, 0]
";

const FLAT_SKY: &str = "
[environment]
radiance = [0.5, 0.6, 0.8]
";
const SUNNY_SKY: &str = "
[environment]
image = \"sky.hdr\"
rotation_deg = 35
scale = 0.8
";

const DISC_LENS: &str = "
[lens]
aperture_radius_m = 0.03
focus_distance_m = 2.0
";
const SQUARE_LENS: &str = "
[lens]
aperture_radius_m = 0.02
focus_distance_m = 1.8
aperture = \"square\"
blade_rotation_deg = 20
";
const BLADED_LENS: &str = "
[lens]
f_number = 1.4
focal_length_mm = 80
focus_distance_m = 2.3
aperture = 5
blade_rotation_deg = 11
";

/// It sees what lies behind it in its corners.
const FISHEYE_CAMERA: &str = "
[camera]
width = 48
height = 36
fx = 17.0
lens_model = \"fisheye\"
distortion = [0.02, -0.01, 0.003, -0.0001]
position = [0.1, 0.6, 1.2]
look_at = [0, 0.2, 0]
";
/// With thin prisms.
const RATIONAL_CAMERA: &str = "
[camera]
width = 48
height = 36
fx = 46.0
lens_model = \"opencv\"
distortion = [0.3, 0.1, 0.002, -0.003, 0.01, 0.4, 0.15, 0.02, 0.001, -0.002, 0.0015, 0.001]
position = [0, 0.5, 2.2]
look_at = [0, 0.25, 0]
";

/// Steps, turns, and reads its rows one after the other.
const MOVING_CAMERA: &str = "
[camera]
width = 48
height = 36
fx = 46.0
distortion = [-0.12, 0.03, 0.002, -0.003, 0.01]
[[camera.motion]]
time_secs = -0.1
position = [-0.1, 0.5, 2.2]
look_at = [0, 0.2, 0]
[[camera.motion]]
time_secs = 0.1
position = [0.1, 0.55, 2.1]
look_at = [0.1, 0.3, 0]
up = [0.1, 1, 0]
[shutter]
exposure_secs = 0.1
readout_secs = 0.05
";

const MATT_FLOOR: &str = "
[[real]]
shape = \"quad\"
corner = [-3, 0, -3]
edge_u = [0, 0, 6]
edge_v = [6, 0, 0]
material = { base_color = [0.6, 0.5, 0.4], roughness = 1.0, specular = 0.0 }
";
const MATT_BALL: &str = "
[[virtual]]
shape = \"sphere\"
segments = 24
scale = 0.3
translation = [0.1, 0.3, 0]
material = { base_color = [0.7, 0.6, 0.3], specular = 0.0 }
";
/// In front of the ball, and beside it.
const OCCLUDER: &str = "
[[real]]
shape = \"box\"
size = [0.3, 0.4, 0.2]
translation = [-0.1, 0.2, 0.6]
rotation_deg = [0, 30, 0]
material = { base_color = [0.3, 0.5, 0.7], specular = 0.0 }
";
const GLOSSY_FLOOR: &str = "
[[real]]
shape = \"quad\"
corner = [-3, 0, -3]
edge_u = [0, 0, 6]
edge_v = [6, 0, 0]
self_shadow_bias_m = 0.004
material = { base_color = [0.6, 0.5, 0.4], roughness = 0.35, specular = 0.8 }
";
const MIRROR: &str = "
[[real]]
shape = \"quad\"
corner = [-0.9, 0, -0.7]
edge_u = [1.4, 0, -0.2]
edge_v = [0, 1.2, 0]
material = { base_color = [0.9, 0.9, 0.9], metallic = 1.0, roughness = 0.0 }
";
const METAL_BALL: &str = "
[[virtual]]
shape = \"sphere\"
segments = 24
scale = 0.3
translation = [0.1, 0.3, 0]
material = { base_color = [0.9, 0.7, 0.4], metallic = 1.0, roughness = 0.3 }
";
const COATED_BALL: &str = "
[[virtual]]
shape = \"sphere\"
segments = 24
scale = 0.25
translation = [-0.5, 0.25, 0.3]
material = { base_color = [0.6, 0.1, 0.1], roughness = 0.6, clearcoat = 0.8, clearcoat_roughness = 0.1 }
";
const GLASS_BALL: &str = "
[[virtual]]
shape = \"sphere\"
segments = 24
scale = 0.2
translation = [0.6, 0.2, 0.3]
material = { transmission = 1.0, roughness = 0.0, ior = 1.5, attenuation_color = [0.4, 0.8, 0.6], attenuation_distance_m = 0.2 }
";
const FROSTED_BALL: &str = "
[[virtual]]
shape = \"sphere\"
segments = 24
scale = 0.22
translation = [-0.1, 0.22, 0.7]
material = { base_color = [0.9, 0.95, 1.0], transmission = 0.9, roughness = 0.4, ior = 1.4, attenuation_color = [0.9, 0.5, 0.3], attenuation_distance_m = 0.3 }
";
const PANE: &str = "
[[virtual]]
shape = \"quad\"
corner = [-0.8, 0.01, 0.5]
edge_u = [0.6, 0, 0.2]
edge_v = [0, 0.6, 0]
material = { base_color = [0.8, 0.9, 0.7], transmission = 1.0, roughness = 0.0, thin_walled = true }
";
/// A real thin wall, a body of index 1, and a pane whose tint and clearness a picture gives.
const WINDOW: &str = "
[[real]]
shape = \"quad\"
corner = [-0.9, 0, 0.5]
edge_u = [0.7, 0, 0.1]
edge_v = [0, 0.6, 0]
material = { base_color = [0.7, 0.9, 0.8], transmission = 1.0, roughness = 0.0, thin_walled = true }
";
const FOG: &str = "
[[virtual]]
shape = \"box\"
size = [0.4, 0.3, 0.3]
translation = [0.3, 0.15, 0.4]
material = { transmission = 1.0, roughness = 0.5, ior = 1.0, attenuation_color = [0.4, 0.8, 0.6], attenuation_distance_m = 0.3 }
";
const TEXTURED_PANE: &str = "
[[virtual]]
shape = \"quad\"
corner = [-0.6, 0.5, -0.3]
edge_u = [1.2, 0, 0]
edge_v = [0, 0.1, 0.8]
material = { base_color = [0.9, 0.7, 0.9], transmission = 0.9, roughness = 0.0, thin_walled = true, clearcoat = 0.5, clearcoat_roughness = 0.3 }
";
const VEIL: &str = "
[[real]]
shape = \"quad\"
corner = [0.2, 0, 0.8]
edge_u = [0.5, 0, -0.1]
edge_v = [0, 0.5, 0]
material = { base_color = [0.3, 0.3, 0.8, 0.4], specular = 0.0 }
";
const SIGN: &str = "
[[virtual]]
shape = \"box\"
size = [0.25, 0.25, 0.25]
translation = [0.65, 0.125, -0.2]
material = { base_color = [0.2, 0.9, 0.3], unlit = true }
";
const TEXTURED_FLOOR: &str = "
[[real]]
mesh = \"textured.gltf\"
rotation_deg = [-90, 0, 0]
scale = 2.0
translation = [0, -0.6, 0]
";
const TEXTURED_SHEET: &str = "
[[virtual]]
mesh = \"textured.gltf\"
rotation_deg = [-20, 25, 0]
scale = 0.35
translation = [0.3, 0.5, 0]
";
const MASKED_SHEET: &str = "
[[virtual]]
mesh = \"masked.gltf\"
rotation_deg = [0, 25, 0]
scale = 0.35
translation = [-0.3, 0.4, 0.2]
";
const BLENDED_SHEET: &str = "
[[virtual]]
mesh = \"blended.gltf\"
rotation_deg = [0, -15, 0]
scale = 0.3
translation = [0.4, 0.35, -0.2]
";
const GLOWING_SHEET: &str = "
[[virtual]]
mesh = \"glowing.gltf\"
rotation_deg = [0, 40, 0]
scale = 0.25
translation = [-0.5, 0.4, 0.2]
";
const GLOWING_WALL: &str = "
[[real]]
mesh = \"glowing.gltf\"
scale = 0.4
translation = [0.7, 0.9, -1.2]
";
const COATED_SHEET: &str = "
[[virtual]]
mesh = \"coated.gltf\"
rotation_deg = [-30, 0, 10]
scale = 0.35
translation = [0.4, 0.4, 0]
";

const QUAD: &str = "
[[light]]
kind = \"quad\"
corner = [-1, 2.5, -1]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [6, 6, 6]
";
/// A parallelogram, not a rectangle.
const VIRTUAL_QUAD: &str = "
[[light]]
kind = \"quad\"
corner = [0.5, 0.6, -0.6]
edge_u = [0.1, 0.4, 0]
edge_v = [0.3, 0.2, 0.2]
radiance = [8, 5, 3]
side = \"virtual\"
";
const POINTS: &str = "
[[light]]
kind = \"point\"
position = [1.5, 1.5, 1]
intensity = [2, 2, 2.5]
[[light]]
kind = \"spot\"
position = [-1, 1.5, 1]
direction = [0.6, -0.9, -0.6]
intensity = [4, 3, 2]
inner_deg = 12
outer_deg = 30
[[light]]
kind = \"directional\"
direction = [0.3, -1, -0.5]
irradiance = [0.8, 0.8, 0.7]
";
const VIRTUAL_POINTS: &str = "
[[light]]
kind = \"point\"
position = [0.6, 0.5, 0.8]
intensity = [0.2, 0.3, 0.4]
side = \"virtual\"
[[light]]
kind = \"spot\"
position = [-0.5, 1.2, 0.5]
direction = [0.2, -1, -0.2]
intensity = [1, 1, 1]
outer_deg = 25
side = \"virtual\"
";

pub const CASES: &[Case] = &[
    Case {
        name: "matt_under_a_flat_sky",
        parts: &[CAMERA, FLAT_SKY, MATT_FLOOR, MATT_BALL],
        settings: "max_bounces = 1",
        all_planes: false,
    },
    Case {
        name: "matt_with_an_occluder_under_a_quad",
        parts: &[CAMERA, DISC_LENS, MATT_FLOOR, OCCLUDER, MATT_BALL, QUAD],
        settings: "max_bounces = 2\nsampler = \"jittered\"",
        all_planes: true,
    },
    Case {
        name: "textures_and_normal_maps_in_the_sun",
        parts: &[CAMERA, SUNNY_SKY, TEXTURED_FLOOR, TEXTURED_SHEET, MATT_BALL],
        settings: "max_bounces = 2",
        all_planes: true,
    },
    Case {
        name: "alpha_under_lights_without_size",
        parts: &[
            CAMERA,
            MATT_FLOOR,
            VEIL,
            MASKED_SHEET,
            BLENDED_SHEET,
            POINTS,
        ],
        settings: "max_bounces = 2\nsampler = \"cmj\"",
        all_planes: true,
    },
    Case {
        name: "smooth_glass_in_the_sun",
        parts: &[
            CAMERA, DISC_LENS, SUNNY_SKY, MATT_FLOOR, OCCLUDER, GLASS_BALL, MATT_BALL, QUAD,
        ],
        settings: "max_bounces = 6",
        all_planes: true,
    },
    Case {
        name: "rough_and_thin_glass",
        parts: &[
            CAMERA,
            DISC_LENS,
            SUNNY_SKY,
            MATT_FLOOR,
            FROSTED_BALL,
            PANE,
            QUAD,
        ],
        settings: "max_bounces = 6\nsampler = \"cmj\"",
        all_planes: true,
    },
    Case {
        name: "windows_and_fog",
        parts: &[
            CAMERA,
            DISC_LENS,
            SUNNY_SKY,
            MATT_FLOOR,
            WINDOW,
            FOG,
            TEXTURED_PANE,
            GLASS_BALL,
            MATT_BALL,
            QUAD,
            POINTS,
            VIRTUAL_POINTS,
        ],
        settings: "max_bounces = 4",
        all_planes: true,
    },
    Case {
        name: "clearcoat",
        parts: &[CAMERA, SUNNY_SKY, GLOSSY_FLOOR, COATED_BALL, COATED_SHEET],
        settings: "max_bounces = 1",
        all_planes: true,
    },
    Case {
        name: "virtual_lights",
        parts: &[
            CAMERA,
            MATT_FLOOR,
            OCCLUDER,
            METAL_BALL,
            GLOWING_SHEET,
            VIRTUAL_QUAD,
            VIRTUAL_POINTS,
            QUAD,
        ],
        settings: "max_bounces = 2",
        all_planes: true,
    },
    Case {
        name: "glowing_real_wall",
        parts: &[CAMERA, GLOSSY_FLOOR, GLOWING_WALL, MATT_BALL, SIGN, POINTS],
        settings: "max_bounces = 2\nsampler = \"jittered\"",
        all_planes: true,
    },
    Case {
        name: "albedo_from_a_distorted_photograph",
        parts: &[
            PHOTO_CAMERA,
            SQUARE_LENS,
            FLAT_SKY,
            PHOTO_FLOOR,
            METAL_BALL,
            QUAD,
        ],
        settings: "max_bounces = 2\ncomposite = \"quotient\"",
        all_planes: false,
    },
    Case {
        name: "mirrors_and_gloss",
        parts: &[
            CAMERA,
            BLADED_LENS,
            SUNNY_SKY,
            GLOSSY_FLOOR,
            MIRROR,
            METAL_BALL,
            SIGN,
        ],
        settings: "max_bounces = 4",
        all_planes: true,
    },
    Case {
        name: "paper_plain",
        parts: &[
            CAMERA,
            SQUARE_LENS,
            FLAT_SKY,
            MATT_FLOOR,
            OCCLUDER,
            MATT_BALL,
        ],
        settings: "max_bounces = 1\nestimator = \"paper\"\nsampler = \"jittered\"",
        all_planes: false,
    },
    Case {
        name: "paper_with_everything",
        parts: &[
            PHOTO_CAMERA,
            BLADED_LENS,
            SUNNY_SKY,
            PHOTO_FLOOR,
            VEIL,
            GLASS_BALL,
            FROSTED_BALL,
            MASKED_SHEET,
            COATED_SHEET,
            TEXTURED_SHEET,
            QUAD,
            VIRTUAL_QUAD,
            POINTS,
        ],
        settings: "max_bounces = 3\nestimator = \"paper\"",
        all_planes: true,
    },
    Case {
        name: "camera_in_motion",
        parts: &[
            MOVING_CAMERA,
            BLADED_LENS,
            FLAT_SKY,
            MATT_FLOOR,
            OCCLUDER,
            MATT_BALL,
        ],
        settings: "max_bounces = 1\nsampler = \"cmj\"",
        all_planes: false,
    },
    Case {
        name: "fisheye",
        parts: &[FISHEYE_CAMERA, FLAT_SKY, GLOSSY_FLOOR, METAL_BALL, QUAD],
        settings: "max_bounces = 2",
        all_planes: true,
    },
    Case {
        name: "a_rational_lens_wide_open",
        parts: &[RATIONAL_CAMERA, DISC_LENS, FLAT_SKY, MATT_FLOOR, MATT_BALL],
        settings: "max_bounces = 2",
        all_planes: true,
    },
    Case {
        name: "direct_with_everything",
        parts: &[
            PHOTO_CAMERA,
            BLADED_LENS,
            SUNNY_SKY,
            PHOTO_FLOOR,
            VEIL,
            GLASS_BALL,
            FROSTED_BALL,
            MASKED_SHEET,
            COATED_SHEET,
            TEXTURED_SHEET,
            GLOWING_SHEET,
            MIRROR,
            QUAD,
            VIRTUAL_QUAD,
            POINTS,
            VIRTUAL_POINTS,
        ],
        settings: "max_bounces = 3",
        all_planes: true,
    },
];

const PHOTO_FLOOR: &str = "
[[real]]
shape = \"quad\"
corner = [-3, 0, -3]
edge_u = [0, 0, 6]
edge_v = [6, 0, 0]
albedo = \"from-photo\"
";
