//! Small scenes in memory.

use glam::DMat4;

use crate::scene::{
    Aperture, Backdrop, BackendChoice, Camera, Combine, Composite, Estimator, Exposure, Instance,
    Lens, Material, Object, Primitive, SamplerKind, Scene, Settings, Side, Stages,
};

/// A camera of 4 x 3 pixels at the origin that looks along -Z, and nothing else.
pub fn test_scene() -> Scene {
    Scene {
        name: "test".into(),
        path: "test".into(),
        photo: None,
        camera: Camera {
            width: 4,
            height: 3,
            fx: 4.0,
            fy: 4.0,
            cx: 2.0,
            cy: 1.5,
            distortion: crate::scene::Distortion::NONE,
            world_from_camera: DMat4::IDENTITY,
        },
        lens: Lens {
            aperture_radius_m: 0.0,
            focus_distance_m: 1.0,
            aperture: Aperture::Disc,
            blade_rotation_deg: 0.0,
            focal_length_m: 0.0,
        },
        environment: None,
        lights: Vec::new(),
        objects: Vec::new(),
        shutter: None,
        camera_path: Default::default(),
        focus_path: Default::default(),
        settings: Settings {
            rays_per_pixel: 4,
            max_bounces: 2,
            clamp_indirect: f32::INFINITY,
            seed: 0,
            estimator: Estimator::Direct,
            sampler: SamplerKind::Sobol,
            composite: Composite::Additive,
            combine: Combine::Robust,
            backend: BackendChoice::Cpu,
            multiple_scattering: false,
            exposure: Exposure::Ev(0.0),
            backdrop: Backdrop::Environment,
            upright_photo: false,
        },
        inputs: Vec::new(),
        stages: Stages::default(),
        allowed: Vec::new(),
        focal_length_mm: None,
        photo_file: None,
        warnings: Vec::new(),
    }
}

/// One object of one primitive, normals those of the vertices' last triangle.
pub fn test_mesh(
    side: Side,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    material: Material,
) -> Object {
    let mut normals = vec![[0.0, 1.0, 0.0]; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| glam::Vec3::from(positions[i as usize]));
        for &i in triangle {
            normals[i as usize] = (b - a).cross(c - a).normalize_or_zero().to_array();
        }
    }
    let primitive = Primitive {
        name: "mesh / primitive 0".into(),
        positions: positions.to_vec(),
        normals,
        triangles: triangles.to_vec(),
        ..Primitive::default()
    };
    Object {
        name: "object".into(),
        side,
        world_from_object: DMat4::IDENTITY,
        motion: None,
        instances: vec![Instance {
            animation: None,
            deformation: None,
            object_from_local: DMat4::IDENTITY,
            primitive: primitive.into(),
            material: material.into(),
        }],
        self_shadow_bias_m: 0.0,
        albedo_from_photo: false,
    }
}
