//! Scenes that are hard, and the same scene at another size and place.

use glam::{DMat4, DVec3};

use super::Effort;
use crate::bench::scenes::{camera, colored, matt, object, place, scene};
use crate::scene::shape::{cuboid, quad};
use crate::scene::{Light, LightKind, Material, Object, Primitive, Scene, Side};

pub(super) fn mirror(color: [f32; 3], roughness: f32) -> Material {
    Material {
        metallic: 1.0,
        roughness,
        ..colored(color)
    }
}

pub(super) fn glowing(color: [f32; 3]) -> Material {
    Material {
        unlit: true,
        ..colored(color)
    }
}

pub(super) fn clear(ior: f32) -> Material {
    Material {
        transmission: 1.0,
        roughness: 0.0,
        ior,
        ..Material::default()
    }
}

/// A triangle with flat normals.
pub(super) fn triangle(corners: [DVec3; 3]) -> Primitive {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize().as_vec3().to_array();
    Primitive {
        name: "triangle".to_owned(),
        positions: corners.map(|corner| corner.as_vec3().to_array()).to_vec(),
        normals: vec![normal; 3],
        triangles: vec![[0, 1, 2]],
        ..Primitive::default()
    }
}

/// The square of this half-size in the plane y = 0, facing up.
pub(super) fn square(half: f64) -> Primitive {
    quad(
        DVec3::new(-half, 0.0, half),
        DVec3::new(2.0 * half, 0.0, 0.0),
        DVec3::new(0.0, 0.0, -2.0 * half),
    )
}

pub(super) fn point_light(position: DVec3, intensity: f32) -> Light {
    Light {
        kind: LightKind::Point {
            position: position.to_array(),
            intensity: [intensity, 0.9 * intensity, 0.8 * intensity],
        },
        side: Side::Real,
    }
}

/// Picture size and rays per pixel.
pub(super) fn size(effort: Effort) -> ([u32; 2], u32) {
    match effort {
        Effort::Quick => ([40, 30], 16),
        Effort::Full => ([80, 60], 36),
    }
}

/// A matt table, a box on it exactly, one in the air, a lamp, a lens wide open.
pub(super) fn contact(effort: Effort) -> Scene {
    let (pixels, rays_per_pixel) = size(effort);
    let camera = camera(
        pixels,
        2.0 * f64::from(pixels[1]),
        DVec3::new(0.0, 1.2, 3.0),
        DVec3::new(0.0, 0.2, 0.0),
        DVec3::Y,
    );
    let tilted = place(DVec3::new(0.4, 0.45, 0.2), 50.0) * DMat4::from_rotation_x(0.6);
    let mut scene = scene(
        camera,
        rays_per_pixel,
        vec![
            object(
                Side::Real,
                "table",
                square(2.0),
                matt([0.7, 0.6, 0.5]),
                DMat4::IDENTITY,
            ),
            object(
                Side::Virtual,
                "box",
                cuboid(DVec3::new(0.4, 0.3, 0.4)),
                matt([0.8, 0.3, 0.2]),
                place(DVec3::new(-0.3, 0.15, 0.0), 25.0),
            ),
            object(
                Side::Virtual,
                "tilted box",
                cuboid(DVec3::new(0.3, 0.2, 0.25)),
                matt([0.2, 0.5, 0.8]),
                tilted,
            ),
        ],
    );
    scene.lights = vec![point_light(DVec3::new(1.2, 2.0, 1.0), 12.0)];
    scene.lens.aperture_radius_m = 0.02;
    scene.lens.focus_distance_m = 3.0;
    scene
}

/// The object of this name.
pub(super) fn named<'a>(scene: &'a mut Scene, name: &str) -> Option<&'a mut Object> {
    scene.objects.iter_mut().find(|object| object.name == name)
}

/// The same picture at another size and place, composed in f64. Point lights grow by the square of the scale, quads keep their radiance.
pub fn placed(scene: &Scene, scale: f64, translation: DVec3) -> Scene {
    let mut scene = scene.clone();
    let to = DMat4::from_translation(translation) * DMat4::from_scale(DVec3::splat(scale));
    for object in &mut scene.objects {
        object.world_from_object = to * object.world_from_object;
    }
    let position = scene.camera.world_from_camera.w_axis.truncate();
    scene.camera.world_from_camera.w_axis = to.transform_point3(position).extend(1.0);
    scene.lens.aperture_radius_m *= scale;
    scene.lens.focus_distance_m *= scale;
    let moved = |p: [f64; 3]| to.transform_point3(DVec3::from(p)).to_array();
    let scaled = |v: [f64; 3]| (DVec3::from(v) * scale).to_array();
    let brighter = |c: [f32; 3]| c.map(|c| (f64::from(c) * scale * scale) as f32);
    for light in &mut scene.lights {
        match &mut light.kind {
            LightKind::Point {
                position,
                intensity,
            }
            | LightKind::Spot {
                position,
                intensity,
                ..
            } => {
                *position = moved(*position);
                *intensity = brighter(*intensity);
            }
            LightKind::Quad {
                corner,
                edge_u,
                edge_v,
                ..
            } => {
                *corner = moved(*corner);
                *edge_u = scaled(*edge_u);
                *edge_v = scaled(*edge_v);
            }
            LightKind::Directional { .. } => {}
        }
    }
    scene
}
