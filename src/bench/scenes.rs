//! Small scenes made in code.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use crate::scene::{
    Aperture, Backdrop, BackendChoice, Camera, Combine, Composite, Estimator, Exposure, Instance,
    Lens, Material, Object, Primitive, SamplerKind, Scene, Settings, Side, Stages,
};

/// A scene of these objects, seen by a pinhole, one interaction before the light.
pub(super) fn scene(camera: Camera, rays_per_pixel: u32, objects: Vec<Object>) -> Scene {
    Scene {
        name: "stress".to_owned(),
        path: PathBuf::new(),
        inputs: Vec::new(),
        stages: Stages::default(),
        allowed: Vec::new(),
        focal_length_mm: None,
        photo_file: None,
        photo: None,
        camera,
        lens: Lens {
            aperture_radius_m: 0.0,
            focus_distance_m: f64::INFINITY,
            aperture: Aperture::Disc,
            blade_rotation_deg: 0.0,
            focal_length_m: 0.0,
        },
        environment: None,
        lights: Vec::new(),
        shutter: None,
        camera_path: Default::default(),
        focus_path: Default::default(),
        objects,
        settings: Settings {
            rays_per_pixel,
            max_bounces: 1,
            clamp_indirect: f32::INFINITY,
            seed: 1,
            estimator: Estimator::Direct,
            sampler: SamplerKind::Sobol,
            composite: Composite::Additive,
            combine: Combine::Mean,
            backend: BackendChoice::Cpu,
            multiple_scattering: false,
            exposure: Exposure::Ev(0.0),
            backdrop: Backdrop::Environment,
            upright_photo: false,
        },
        warnings: Vec::new(),
    }
}

/// `focal_px`: focal length in pixels.
pub(super) fn camera(
    [width, height]: [u32; 2],
    focal_px: f64,
    position: DVec3,
    target: DVec3,
    up: DVec3,
) -> Camera {
    let back = (position - target).normalize();
    let right = up.cross(back).normalize();
    let axis = |v: DVec3, w: f64| v.extend(w);
    Camera {
        width,
        height,
        fx: focal_px,
        fy: focal_px,
        cx: f64::from(width) * 0.5,
        cy: f64::from(height) * 0.5,
        distortion: crate::scene::Distortion::NONE,
        world_from_camera: DMat4::from_cols(
            axis(right, 0.0),
            axis(back.cross(right), 0.0),
            axis(back, 0.0),
            axis(position, 1.0),
        ),
    }
}

pub(super) fn object(
    side: Side,
    name: &str,
    primitive: Primitive,
    material: Material,
    world_from_object: DMat4,
) -> Object {
    Object {
        name: name.to_owned(),
        side,
        motion: None,
        world_from_object,
        instances: vec![Instance {
            animation: None,
            deformation: None,
            object_from_local: DMat4::IDENTITY,
            primitive: Arc::new(primitive),
            material: Arc::new(material),
        }],
        self_shadow_bias_m: 0.0,
        albedo_from_photo: false,
    }
}

pub(super) fn colored([r, g, b]: [f32; 3]) -> Material {
    Material {
        base_color: [r, g, b, 1.0],
        ..Material::default()
    }
}

pub(super) fn matt(color: [f32; 3]) -> Material {
    Material {
        specular: 0.0,
        ..colored(color)
    }
}

/// Turned by this angle about Y, then moved.
pub(super) fn place(translation: DVec3, turn_deg: f64) -> DMat4 {
    DMat4::from_translation(translation) * DMat4::from_rotation_y(turn_deg.to_radians())
}
