//! What a packed triangle says about its corners: asked for wherever a ray meets it, so computed once.

use glam::Vec3;

use super::records::{TRIANGLE_UNTINTED, Triangle, Vertex, xyz};
use crate::math::{cross3, dot3, safe_sqrt};
use crate::shared::NONE;

/// A triangle's weights are differences of products of two of its lengths, and four roundings of 2^-24 each.
const PLANE_ERROR: f32 = 2.384_185_8e-7;
/// Triangles slimmer than this (width over length) count as no slimmer: rays would leave them from too far off.
const SLIMMEST: f32 = 1e-4;

impl Triangle {
    /// Of three of the vertices `all`; no light.
    pub fn new(vertices: [u32; 3], all: &[Vertex], material: u32, object: u32) -> Self {
        let corners = vertices.map(|v| &all[v as usize]);
        let [p0, p1, p2] = corners.map(|vertex| xyz(vertex.position_u0));
        let untinted = corners.iter().all(|vertex| vertex.color == [1.0; 4]);
        Self {
            vertices,
            material,
            normal: normal(p1 - p0, p2 - p0).to_array(),
            plane_error: plane_error(p1 - p0, p2 - p0),
            light: NONE,
            object,
            flags: if untinted { TRIANGLE_UNTINTED } else { 0 },
            pad: 0,
        }
    }
}

/// Unit normal of a triangle with these edges; zero if it has no area in f32.
fn normal(e1: Vec3, e2: Vec3) -> Vec3 {
    let [m1, m2] = [e1, e2].map(|edge| edge.abs().max_element());
    if m1 <= 1e-36 || m2 <= 1e-36 {
        return Vec3::ZERO;
    }
    // Scaled first: the square of a millimetre triangle's cross product would underflow.
    let n = cross3(e1 * (1.0 / m1), e2 * (1.0 / m2));
    let length2 = n.dot(n);
    if length2 > 1e-30 {
        n * (1.0 / length2.sqrt())
    } else {
        Vec3::ZERO
    }
}

/// How far from its plane the tracer may find the triangle of these edges for a ray that starts near it: a sliver's weights, and with them the
/// distance along the ray, are only as good as it is wide.
fn plane_error(e1: Vec3, e2: Vec3) -> f32 {
    let length = e1.abs().max(e2.abs()).max_element();
    if length <= 1e-36 {
        return 0.0;
    }
    let inv = 1.0 / length;
    let n = cross3(e1 * inv, e2 * inv);
    let slimness = safe_sqrt(dot3(n, n)).max(SLIMMEST);
    PLANE_ERROR * length / slimness
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f32; 3]; 3], alpha: f32) -> Triangle {
        let vertices = corners.map(|[x, y, z]| Vertex {
            position_u0: [x, y, z, 0.0],
            color: [1.0, 1.0, 1.0, alpha],
            ..Vertex::default()
        });
        Triangle::new([0, 1, 2], &vertices, 0, 0)
    }

    #[test]
    fn a_triangle_knows_its_normal_and_how_well_its_plane_is_met() {
        let right = triangle([[1.0, 1.0, 2.0], [3.0, 1.0, 2.0], [1.0, 3.0, 2.0]], 1.0);
        assert_eq!(right.normal, [0.0, 0.0, 1.0]);
        assert_eq!(right.plane_error, 2.0 * PLANE_ERROR);
        assert_eq!(right.flags, TRIANGLE_UNTINTED);
        let turned = triangle([[1.0, 1.0, 2.0], [1.0, 3.0, 2.0], [3.0, 1.0, 2.0]], 0.5);
        assert_eq!((turned.normal, turned.flags), ([0.0, 0.0, -1.0], 0));
        let tiny = triangle([[0.0; 3], [1e-25, 0.0, 0.0], [0.0, 1e-25, 0.0]], 1.0);
        assert_eq!(tiny.normal, [0.0, 0.0, 1.0]);
        let sliver = triangle([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1e-7, 0.0]], 1.0);
        assert_eq!(sliver.plane_error, PLANE_ERROR / SLIMMEST);
        let none = triangle([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 1.0);
        assert_eq!(none.normal, [0.0; 3]);
    }
}
