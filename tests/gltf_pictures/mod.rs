//! glTF files all the way to pictures: every sample model shows what it was made to show, every broken file is refused or rendered clean.

mod bad_inputs;
mod colours;
mod materials;
mod reference;
mod silhouettes;

use std::path::Path;

use glam::{DMat4, DVec3};
use mixray::film::Picture;
use mixray::renderer::{Renderer, RendererOptions, Watcher};
use mixray::scene::{AlphaMode, Instance, Material, Scene};

use crate::support::{complete, gltf_files, mask, shared_data};

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
const FOV_DEG: f64 = 35.0;
const WHITE_SKY: &str = "[environment]\nradiance = [1, 1, 1]\n";
const DARK: &str = "";

/// A scene file of one virtual model; `light` holds its environment, lights and whatever else.
fn scene_text(model: &Path, light: &str) -> String {
    format!(
        "[camera]\nwidth = {WIDTH}\nheight = {HEIGHT}\nvertical_fov_deg = {FOV_DEG}\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n\
         [[virtual]]\nmesh = \"{}\"\n[render]\nbackend = \"cpu\"\nrays_per_pixel = 16\nmax_bounces = 4\n{light}",
        model.display()
    )
}

/// A sample model under some light, seen from the default camera; None where the data is not there.
fn model(name: &str, light: &str) -> Option<Scene> {
    let path = shared_data("gltf_models")?.join(name);
    Some(crate::support::scene(&scene_text(&path, light)))
}

fn is_drawn(scene: &Scene) -> bool {
    scene.objects.iter().any(|o| !o.instances.is_empty())
}

/// Keeps the parts of the model whose material's name passes.
fn keep(scene: &mut Scene, wanted: impl Fn(&Instance) -> bool) {
    scene.objects[0].instances.retain(wanted);
    assert!(!scene.objects[0].instances.is_empty());
}

/// Changes every material of the model.
fn repaint(scene: &mut Scene, paint: impl Fn(&mut Material)) {
    for instance in &mut scene.objects[0].instances {
        let mut material = (*instance.material).clone();
        paint(&mut material);
        instance.material = material.into();
    }
}

/// Opaque, matt and without texture.
fn grey(material: &mut Material) {
    *material = Material {
        base_color: [0.8, 0.8, 0.8, 1.0],
        specular: 0.0,
        alpha_mode: AlphaMode::Opaque,
        ..Material::default()
    };
}

/// World-space corners of every triangle.
fn world_triangles(scene: &Scene) -> impl Iterator<Item = (&Instance, [u32; 3], [DVec3; 3])> {
    scene.objects.iter().flat_map(|object| {
        object.instances.iter().flat_map(|instance| {
            let world = object.world_from_object * instance.object_from_local;
            let primitive = &instance.primitive;
            primitive.triangles.iter().map(move |&triangle| {
                let corner = |v: u32| {
                    let p = primitive.positions[v as usize].map(f64::from);
                    world.transform_point3(DVec3::from_array(p))
                };
                (instance, triangle, triangle.map(corner))
            })
        })
    })
}

fn bounds(scene: &Scene) -> [DVec3; 2] {
    world_triangles(scene)
        .flat_map(|(_, _, corners)| corners)
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
            [low.min(p), high.max(p)]
        })
}

/// Puts the camera where it sees all of the scene from the direction `toward` (from its centre to the camera).
fn frame(scene: &mut Scene, toward: [f64; 3]) {
    let [low, high] = bounds(scene);
    let centre = (low + high) / 2.0;
    let radius = (high - low).length() / 2.0;
    let distance = radius / (FOV_DEG.to_radians() / 2.0).sin();
    look(
        scene,
        centre + DVec3::from_array(toward).normalize() * distance,
        centre,
    );
}

fn look(scene: &mut Scene, from: DVec3, at: DVec3) {
    let back = (from - at).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    scene.camera.world_from_camera = DMat4::from_cols(
        right.extend(0.0),
        up.extend(0.0),
        back.extend(0.0),
        from.extend(1.0),
    );
}

/// Pixel coordinates of a point in front of the camera.
fn project(scene: &Scene, point: DVec3) -> [f64; 2] {
    let camera = &scene.camera;
    let p = camera.world_from_camera.inverse().transform_point3(point);
    assert!(p.z < 0.0, "behind the camera");
    [
        camera.cx - camera.fx * p.x / p.z,
        camera.cy + camera.fy * p.y / p.z,
    ]
}

/// A finished render.
struct Shot {
    picture: Picture,
    /// Fraction of each pixel's rays that met the model first.
    mask: Vec<f64>,
}

fn shoot(scene: Scene) -> Shot {
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none()).unwrap();
    complete(&mut renderer);
    let picture = renderer.picture();
    assert!(picture.linear.as_flattened().iter().all(|x| x.is_finite()));
    let mask = mask(renderer.film());
    Shot { picture, mask }
}

impl Shot {
    fn pixel(&self, x: usize, y: usize) -> DVec3 {
        DVec3::from_array(self.picture.linear[y * WIDTH as usize + x].map(f64::from))
    }

    /// Mean over the pixels whose centres lie within `radius_px` of a point.
    fn mean_around(&self, [x, y]: [f64; 2], radius_px: f64) -> DVec3 {
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for row in 0..HEIGHT as usize {
            for column in 0..WIDTH as usize {
                let (dx, dy) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
                if dx * dx + dy * dy <= radius_px * radius_px {
                    sum += self.pixel(column, row);
                    count += 1.0;
                }
            }
        }
        assert!(count > 0.0, "no pixel at ({x}, {y})");
        sum / count
    }

    /// Mean over the whole picture.
    fn mean(&self) -> DVec3 {
        let sum: DVec3 = self
            .picture
            .linear
            .iter()
            .map(|p| DVec3::from_array(p.map(f64::from)))
            .sum();
        sum / self.picture.linear.len() as f64
    }

    fn covered(&self) -> f64 {
        self.mask.iter().sum::<f64>() / self.mask.len() as f64
    }
}
