//! Built-in shapes for stand-ins: `shape = "sphere"`, `"quad"`, `"box"`.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::Primitive;
use super::error::Result;
use super::light::read_parallelogram;
use super::reader::{Choice, Node, Table, is_positive};

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Shape {
    Sphere,
    Quad,
    Box,
}

impl Choice for Shape {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("sphere", Self::Sphere),
        ("quad", Self::Quad),
        ("box", Self::Box),
    ];
}

/// Segments around a sphere unless `segments` says otherwise: the silhouette errs by 0.02% of the radius.
const DEFAULT_SEGMENTS: u32 = 160;

impl Shape {
    /// The keys that only this shape has.
    pub fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Sphere => &["segments"],
            Self::Quad => &["corner", "edge_u", "edge_v"],
            Self::Box => &["size"],
        }
    }

    pub fn read(self, table: &Table) -> Result<Primitive> {
        match self {
            Self::Sphere => {
                let segments = table.optional("segments", |node| node.integer(8, 1024))?;
                Ok(sphere(segments.unwrap_or(DEFAULT_SEGMENTS)))
            }
            Self::Quad => {
                let (corner, edge_u, edge_v) = read_parallelogram(table)?;
                Ok(quad(corner.into(), edge_u.into(), edge_v.into()))
            }
            Self::Box => {
                let size = table.optional("size", |node: &Node| {
                    node.numbers::<3>("a finite number above 0", is_positive)
                })?;
                Ok(cuboid(size.map_or(DVec3::ONE, DVec3::from)))
            }
        }
    }
}

fn named(name: &str) -> Primitive {
    Primitive {
        name: name.to_owned(),
        ..Primitive::default()
    }
}

fn push_vertex(primitive: &mut Primitive, position: DVec3, normal: DVec3, uv: [f64; 2]) {
    primitive.positions.push(position.as_vec3().to_array());
    primitive.normals.push(normal.as_vec3().to_array());
    primitive.uvs[0].push(uv.map(|x| x as f32));
}

/// Unit radius, about the origin, poles on Y, smooth normals; `segments` around, half as many from pole to pole.
pub(crate) fn sphere(segments: u32) -> Primitive {
    let mut primitive = named("sphere");
    let rings = segments / 2;
    let columns = segments + 1;
    for ring in 0..=rings {
        let v = f64::from(ring) / f64::from(rings);
        let (sin_theta, cos_theta) = match ring {
            // Exact at the poles, so that their vertices coincide.
            0 => (0.0, 1.0),
            _ if ring == rings => (0.0, -1.0),
            _ => (v * PI).sin_cos(),
        };
        for column in 0..columns {
            let u = f64::from(column) / f64::from(segments);
            // The last column repeats the first one's positions exactly.
            let (sin_phi, cos_phi) =
                (f64::from(column % segments) / f64::from(segments) * TAU).sin_cos();
            let point = DVec3::new(sin_theta * sin_phi, cos_theta, sin_theta * cos_phi);
            push_vertex(&mut primitive, point, point, [u, v]);
        }
    }
    for ring in 0..rings {
        for column in 0..segments {
            let a = ring * columns + column;
            let b = a + columns;
            if ring > 0 {
                primitive.triangles.push([a, b, a + 1]);
            }
            if ring + 1 < rings {
                primitive.triangles.push([a + 1, b, b + 1]);
            }
        }
    }
    primitive
}

fn push_quad(primitive: &mut Primitive, corner: DVec3, edge_u: DVec3, edge_v: DVec3) {
    let first = primitive.positions.len() as u32;
    let normal = edge_u.normalize().cross(edge_v.normalize()).normalize();
    for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        push_vertex(primitive, corner + edge_u * u + edge_v * v, normal, [u, v]);
    }
    primitive.triangles.push([first, first + 1, first + 2]);
    primitive.triangles.push([first, first + 2, first + 3]);
}

/// Faces the side of edge_u x edge_v.
pub(crate) fn quad(corner: DVec3, edge_u: DVec3, edge_v: DVec3) -> Primitive {
    let mut primitive = named("quad");
    push_quad(&mut primitive, corner, edge_u, edge_v);
    primitive
}

/// About the origin, flat faces outward.
pub(crate) fn cuboid(size: DVec3) -> Primitive {
    let mut primitive = named("box");
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let normal = axes[axis] * sign;
            let u = axes[(axis + 1) % 3] * sign * size;
            let v = axes[(axis + 2) % 3] * size;
            push_quad(&mut primitive, (normal * size - u - v) * 0.5, u, v);
        }
    }
    primitive
}

#[cfg(test)]
mod tests;
