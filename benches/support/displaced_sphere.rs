//! A closed mesh of any number of triangles.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// A sphere of radius about 1 with bumps, `2 * segments * (rings - 1)` triangles.
pub fn displaced_sphere(rings: usize, segments: usize) -> Vec<[Vec3; 3]> {
    let point = |ring: usize, segment: usize| {
        let theta = PI * ring as f32 / rings as f32;
        let phi = TAU * (segment % segments) as f32 / segments as f32;
        let bump = (9.0 * theta).sin() * (7.0 * phi).cos()
            + 0.5 * (23.0 * theta).cos() * (19.0 * phi).sin();
        let radius = 1.0 + 0.08 * bump * theta.sin();
        radius
            * Vec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            )
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let [a, b] = [point(ring, segment), point(ring, segment + 1)];
            let [c, d] = [point(ring + 1, segment), point(ring + 1, segment + 1)];
            if ring > 0 {
                triangles.push([a, b, d]);
            }
            if ring + 1 < rings {
                triangles.push([a, d, c]);
            }
        }
    }
    triangles
}
