mod bsdf;
mod density;
mod energy;
mod fresnel;
mod kinds;
mod surface;
mod terminator;
mod texture;
mod twins;

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use crate::packed::{Material, NONE, PackedScene, Triangle, Vertex};

/// PCG-XSH-RR 32 (O'Neill 2014): test inputs that share nothing with the renderer's own numbers.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        random.bits();
        random
    }

    pub fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let word = (((old >> 18) ^ old) >> 27) as u32;
        word.rotate_right((old >> 59) as u32)
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.uniform()
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
            );
            if v.length() > 0.1 && v.length() <= 1.0 {
                return v.normalize();
            }
        }
    }

    pub fn triple(&mut self) -> [f32; 3] {
        [self.uniform(), self.uniform(), self.uniform()]
    }
}

/// A material with every extension off and no texture: white, fully rough dielectric.
pub fn plain_material() -> Material {
    Material {
        base_color: [1.0; 4],
        normal_scale: 1.0,
        roughness: 1.0,
        ior: 1.5,
        specular: 1.0,
        specular_color: [1.0; 3],
        clearcoat_normal_scale: 1.0,
        facet_table: NONE,
        base_color_texture: NONE,
        metallic_roughness_texture: NONE,
        normal_texture: NONE,
        emissive_texture: NONE,
        specular_texture: NONE,
        specular_color_texture: NONE,
        transmission_texture: NONE,
        clearcoat_texture: NONE,
        clearcoat_roughness_texture: NONE,
        clearcoat_normal_texture: NONE,
        ..Material::zeroed()
    }
}

/// One triangle of one material, with corners that are (u, v) of both sets: (0,0), (1,0), (0,1).
pub fn one_triangle(corners: [[f32; 3]; 3], material: Material) -> PackedScene {
    let [p0, p1, p2] = corners.map(Vec3::from);
    let normal = (p1 - p0).cross(p2 - p0).normalize();
    let uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let vertices = [p0, p1, p2]
        .into_iter()
        .zip(uvs)
        .map(|(p, [u, v])| Vertex {
            position_u0: [p.x, p.y, p.z, u],
            normal_v0: [normal.x, normal.y, normal.z, v],
            tangent: [0.0; 4],
            color: [1.0; 4],
            uv1: [u, v, 0.0, 0.0],
        })
        .collect();
    let mut scene = PackedScene::empty();
    scene.vertices = vertices;
    scene.triangles = vec![Triangle::new([0, 1, 2], &scene.vertices, 0, 7)];
    scene.materials = vec![material];
    scene
}

/// Direction at `theta` radians from `axis`, at azimuth `phi` in a frame of the tests' own.
pub fn around(axis: Vec3, theta: f64, phi: f64) -> Vec3 {
    let n = axis.as_dvec3().normalize();
    let t = n.any_orthonormal_vector();
    let b = n.cross(t);
    let d: DVec3 = t * (theta.sin() * phi.cos()) + b * (theta.sin() * phi.sin()) + n * theta.cos();
    d.as_vec3().normalize()
}
