//! obvhs' own trees and traversals, for comparison.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use mixray::accel::Ray;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    rt_triangle::RtTriangle,
    triangle::Triangle,
};

pub struct ObvhsPeer {
    binary: Bvh2,
    binary_triangles: Vec<RtTriangle>,
    wide: CwBvh,
    wide_triangles: Vec<RtTriangle>,
}

fn peer_ray(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(
        Vec3A::from(ray.origin),
        Vec3A::from(ray.direction),
        ray.t_min,
        ray.t_max,
    )
}

impl ObvhsPeer {
    /// Both trees with the preset `medium`.
    pub fn new(triangles: &[[Vec3; 3]]) -> ObvhsPeer {
        let triangles: Vec<Triangle> = triangles
            .iter()
            .map(|&[a, b, c]| Triangle {
                v0: a.into(),
                v1: b.into(),
                v2: c.into(),
            })
            .collect();
        let settings = BvhBuildParams::medium_build();
        let mut build_time = Duration::ZERO;
        let binary = build_bvh2_from_tris(&triangles, settings, &mut build_time);
        let wide = build_cwbvh_from_tris(&triangles, settings, &mut build_time);
        let in_order = |indices: &[u32]| -> Vec<RtTriangle> {
            let of = |&i: &u32| RtTriangle::from(&triangles[i as usize]);
            indices.iter().map(of).collect()
        };
        ObvhsPeer {
            binary_triangles: in_order(&binary.primitive_indices),
            wide_triangles: in_order(&wide.primitive_indices),
            binary,
            wide,
        }
    }

    /// Distance of the nearest hit by the BVH2.
    pub fn binary_closest(&self, ray: &Ray) -> Option<f32> {
        let mut hit = RayHit::none();
        let test = |ray: &obvhs::ray::Ray, i: usize| self.binary_triangles[i].intersect(ray);
        self.binary
            .ray_traverse(peer_ray(ray), &mut hit, test)
            .then_some(hit.t)
    }

    /// Whether the BVH2 has any hit.
    pub fn binary_any(&self, ray: &Ray) -> bool {
        let test = |ray: &obvhs::ray::Ray, i: usize| self.binary_triangles[i].intersect(ray);
        !self.binary.ray_traverse_miss(peer_ray(ray), test)
    }

    /// Distance of the nearest hit by the CWBVH.
    pub fn wide_closest(&self, ray: &Ray) -> Option<f32> {
        let mut hit = RayHit::none();
        let test = |ray: &obvhs::ray::Ray, i: usize| self.wide_triangles[i].intersect(ray);
        self.wide
            .ray_traverse(peer_ray(ray), &mut hit, test)
            .then_some(hit.t)
    }

    /// Whether the CWBVH has any hit.
    pub fn wide_any(&self, ray: &Ray) -> bool {
        let test = |ray: &obvhs::ray::Ray, i: usize| self.wide_triangles[i].intersect(ray);
        !self.wide.ray_traverse_miss(peer_ray(ray), test)
    }
}
