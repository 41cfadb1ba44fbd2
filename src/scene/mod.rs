//! The validated scene: world space, metres, f64 transforms, linear Rec.709 colours.
//!
//! [`load`] turns a scene file into a [`Scene`]; everything a file can get wrong is refused there, with file, line and column.
//! What leaves this module is finite, in range and refers only to things that exist.

pub mod animation;
mod camera;
pub mod check;
mod coarser;
pub mod deformation;
mod environment;
pub(crate) mod error;
mod file;
pub(crate) mod fingerprint;
mod focus_path;
pub mod gltf;
mod light;
mod material;
mod object;
mod photo;
pub mod placing;
mod pose;
pub mod projection;
pub mod ray;
pub(crate) mod reader;
pub(crate) mod sandbox;
mod scan;
pub(crate) mod scanned;
mod settings;
pub(crate) mod shape;
mod shutter;
pub mod smooth;
pub mod srgb;
#[cfg(test)]
mod tests;
pub mod trajectory;

// What a scene asks of the camera stages; each declares its own.
pub use crate::decode::{ColourProfile, Tags};
pub use crate::distortion::Distortion;
pub use crate::stages::settings::*;
pub use error::SceneError;
pub use file::{Given, load, load_text, load_text_with, load_with};
pub use fingerprint::{Content, ContentHash};
pub use focus_path::FocusPath;
pub use material::Material;
pub use photo::{LayerPicture, read_codes, read_coverage, read_layer};
pub use reader::Choice;
pub use settings::Overrides;
pub use shutter::{MotionKey, ObjectMotion, Shutter};

use std::path::PathBuf;
use std::sync::Arc;

use glam::DMat4;

/// Which world a thing belongs to: the proxy of what the camera saw, or what was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    Real,
    Virtual,
}

/// Everything a render needs, checked.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the folder that holds the scene file; the default picture name.
    pub name: String,
    pub path: PathBuf,
    pub photo: Option<Photo>,
    /// The file that it was read from.
    pub photo_file: Option<PathBuf>,
    pub camera: Camera,
    pub lens: Lens,
    /// Of the lens, where the file says it.
    pub focal_length_mm: Option<f64>,
    pub environment: Option<Environment>,
    pub lights: Vec<Light>,
    pub objects: Vec<Object>,
    /// `None`: nothing moves while a picture is taken.
    pub shutter: Option<Shutter>,
    /// The camera's way in time; empty: it stands still.
    pub camera_path: trajectory::CameraPath,
    /// Where the lens is focused in time; empty: it stays.
    pub focus_path: FocusPath,
    pub settings: Settings,
    /// The files that the scene is made of, its own included.
    pub inputs: Vec<PathBuf>,
    pub stages: Stages,
    /// Warnings that `[check] allow` silences.
    pub allowed: Vec<check::Check>,
    /// Things worth telling the user that are not errors (dropped triangles, ignored gamma chunks).
    pub warnings: Vec<String>,
}

/// The camera image, decoded to linear Rec.709, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Photo {
    pub width: u32,
    pub height: u32,
    pub linear: Vec<[f32; 3]>,
    /// The encoded samples as read, so that untouched pixels are written back bit for bit.
    pub encoded: EncodedPhoto,
    /// Written back with them.
    pub tags: Tags,
}

#[derive(Clone, Debug)]
pub enum EncodedPhoto {
    /// 8 bits a channel, sRGB unless the tags bring a profile.
    Codes8(Vec<[u8; 3]>),
    /// 16 bits a channel.
    Codes16(Vec<[u16; 3]>),
    /// Linear EXR or HDR: `Photo::linear` is the file's own content.
    Linear,
}

/// Pinhole intrinsics with OpenCV distortion and a rigid pose.
#[derive(Clone, Debug)]
pub struct Camera {
    pub width: u32,
    pub height: u32,
    /// Pixels.
    pub fx: f64,
    pub fy: f64,
    /// Pixels, corner origin: the centre of the first pixel is (0.5, 0.5).
    pub cx: f64,
    pub cy: f64,
    /// Ideal to photograph coordinates.
    pub distortion: Distortion,
    /// Rigid; the camera looks along its -Z, +Y up.
    pub world_from_camera: DMat4,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// 0 is the pinhole.
    pub aperture_radius_m: f64,
    /// Along the view axis; infinity is legal.
    pub focus_distance_m: f64,
    pub aperture: Aperture,
    pub blade_rotation_deg: f64,
    /// Of the glass, 0 where it is not told: nothing as near as this can be in focus.
    pub focal_length_m: f64,
}

impl Lens {
    /// Everything is sharp.
    pub const PINHOLE: Self = Self {
        aperture_radius_m: 0.0,
        focus_distance_m: f64::INFINITY,
        aperture: Aperture::Disc,
        blade_rotation_deg: 0.0,
        focal_length_m: 0.0,
    };

    /// Why the lens cannot be focused at this distance; `None`: it can.
    pub(crate) fn focus_problem(&self, focus_distance_m: f64) -> Option<String> {
        (focus_distance_m <= self.focal_length_m).then(|| {
            format!(
                "`focus_distance_m` is {focus_distance_m}, nearer than the focal length of {} m",
                self.focal_length_m
            )
        })
    }
}

/// What a lens is expected to be focused at.
pub(crate) const EXPECTED_FOCUS: &str =
    "a distance beyond the focal length: no lens makes a picture of what is nearer";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aperture {
    Disc,
    /// The 2012 paper's: half-width = aperture radius.
    Square,
    /// Regular polygon of at least 3 blades; the aperture radius is its circumradius.
    Blades(u32),
}

#[derive(Clone, Debug)]
pub struct Environment {
    pub map: EnvironmentMap,
    /// About +Y; at 0 the centre column looks along -Z, at 90 along -X.
    pub rotation_deg: f64,
    pub scale: f64,
}

#[derive(Clone, Debug)]
pub enum EnvironmentMap {
    Constant([f32; 3]),
    LatLong {
        width: u32,
        height: u32,
        texels: Arc<Vec<[f32; 3]>>,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    pub kind: LightKind,
    pub side: Side,
}

/// Positions and directions in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Intensity in W/sr a channel.
    Point {
        position: [f64; 3],
        intensity: [f32; 3],
    },
    /// Half-angles from the axis: full intensity inside `inner_deg`, none outside `outer_deg`, smooth between (glTF's fall-off).
    Spot {
        position: [f64; 3],
        direction: [f64; 3],
        intensity: [f32; 3],
        inner_deg: f64,
        outer_deg: f64,
    },
    /// `direction` is the direction of travel, irradiance on a plane across it.
    Directional {
        direction: [f64; 3],
        irradiance: [f32; 3],
    },
    /// Emits to the side of edge_u x edge_v; a black surface that rays can see.
    Quad {
        corner: [f64; 3],
        edge_u: [f64; 3],
        edge_v: [f64; 3],
        radiance: [f32; 3],
    },
}

/// One `[[real]]` or `[[virtual]]` entry: a set of placed primitives.
#[derive(Clone, Debug)]
pub struct Object {
    pub name: String,
    pub side: Side,
    /// At the picture's time.
    pub world_from_object: DMat4,
    /// Virtual objects only; `None`: it rests.
    pub motion: Option<ObjectMotion>,
    pub instances: Vec<Instance>,
    /// Real rays that leave this proxy do not meet the real world closer than this. 0: off.
    pub self_shadow_bias_m: f32,
    /// The albedo is estimated from the photograph (real objects only); the materials' own colour is not used.
    pub albedo_from_photo: bool,
}

#[derive(Clone, Debug)]
pub struct Instance {
    /// At the picture's time.
    pub object_from_local: DMat4,
    /// What moves it within its object, if anything does.
    pub animation: Option<animation::InstanceAnimation>,
    /// What shapes its primitive, if anything does.
    pub deformation: Option<deformation::Deformation>,
    pub primitive: Arc<Primitive>,
    pub material: Arc<Material>,
}

/// Indexed triangles in local space. Finite, no degenerate triangle. Attribute arrays are empty or as long as `positions`;
/// `normals` is never empty. Primitives without `tangents` get them derived from uv at hit time.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// "mesh name / primitive 0": for messages.
    pub name: String,
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// xyz and handedness in w.
    pub tangents: Vec<[f32; 4]>,
    /// Two texture coordinate sets.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Linear, multiplies the base colour.
    pub colors: Vec<[f32; 4]>,
    pub triangles: Vec<[u32; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    Opaque,
    /// Cut-off.
    Mask(f32),
    Blend,
}

#[derive(Clone, Debug)]
pub struct TextureRef {
    pub texture: Arc<Texture>,
    /// 0 or 1.
    pub uv_set: u32,
    /// KHR_texture_transform as rows: u' = m[0]*u + m[1]*v + m[2], v' = m[3]*u + m[4]*v + m[5].
    pub transform: [f32; 6],
}

#[derive(Clone, Debug)]
pub struct Texture {
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// As stored in the file; whether it is sRGB depends on the slot it is used in.
    pub rgba8: Vec<[u8; 4]>,
    pub wrap_u: Wrap,
    pub wrap_v: Wrap,
    /// Nearest instead of bilinear.
    pub nearest: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    Repeat,
    Mirror,
    Clamp,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    Direct,
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplerKind {
    Jittered,
    Cmj,
    Sobol,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Composite {
    Additive,
    Quotient,
}

/// How the samples of the difference become the picture that is delivered. Films, layers and stated errors are means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combine {
    /// Their mean.
    Mean,
    /// In real pixels rare bright samples are weighted down and spread over their neighbourhood.
    Robust,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendChoice {
    Auto,
    Cpu,
    Gpu,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Scene radiance times 2^ev.
    Ev(f64),
    /// Fits Ir to Ic over the proxy.
    Auto,
}

/// What lies behind virtual objects where nothing is modelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backdrop {
    Environment,
    /// The photograph, where the camera shows it, on a plane across the view axis at this distance, metres, which may be infinite; `None`: that of
    /// the proxy, in the median over the picture.
    Photograph(Option<f64>),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub rays_per_pixel: u32,
    /// Surface interactions before the light: 1 is direct light only.
    pub max_bounces: u32,
    /// Largest radiance that light arriving after a scattering bounce may add, in the scene's units; infinity: off. It takes the speckles
    /// of caustics away and is a bias, so it is off unless asked for.
    pub clamp_indirect: f32,
    pub seed: u32,
    pub estimator: Estimator,
    pub sampler: SamplerKind,
    pub composite: Composite,
    pub combine: Combine,
    pub backend: BackendChoice,
    /// Facets of rough metal and glass send light to each other, so that none is lost; false: as glTF defines its lobes.
    pub multiple_scattering: bool,
    pub exposure: Exposure,
    /// Means nothing without a photograph.
    pub backdrop: Backdrop,
    /// Photographs are turned as their tags say.
    pub upright_photo: bool,
}
