//! Meshes made by formula, in metres, Y up, counter-clockwise from outside.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};
use mixray::scene::Primitive;

/// Indexed triangles with smooth normals and one set of texture coordinates.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn push(&mut self, position: DVec3, normal: DVec3, uv: DVec2) {
        self.positions.push(position);
        self.normals.push(normal.normalize());
        self.uvs.push(uv);
    }

    /// Two triangles between two neighbouring rows of vertices that are `columns` long; a row on the axis leaves one.
    fn push_strip(&mut self, first: usize, columns: usize) {
        for column in 0..columns - 1 {
            let a = first + column;
            let c = a + columns;
            for triangle in [[a, a + 1, c], [a + 1, c + 1, c]] {
                let [p, q, r] = triangle.map(|index| self.positions[index]);
                if (q - p).cross(r - p).length() > 1e-12 {
                    self.triangles.push(triangle.map(|index| index as u32));
                }
            }
        }
    }

    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uvs.extend(&other.uvs);
        let shifted = other.triangles.iter().map(|t| t.map(|index| first + index));
        self.triangles.extend(shifted);
    }

    /// Placed by a rigid motion.
    pub fn placed(mut self, world_from_mesh: DAffine3) -> Self {
        for position in &mut self.positions {
            *position = world_from_mesh.transform_point3(*position);
        }
        for normal in &mut self.normals {
            *normal = world_from_mesh.transform_vector3(*normal);
        }
        self
    }

    /// Lifted so that its lowest vertex is at height 0.
    pub fn standing(self) -> Self {
        let lowest = self.positions.iter().map(|p| p.y).fold(f64::MAX, f64::min);
        self.placed(DAffine3::from_translation(DVec3::new(0.0, -lowest, 0.0)))
    }

    pub fn to_primitive(&self, name: &str) -> Primitive {
        Primitive {
            name: name.to_owned(),
            positions: self
                .positions
                .iter()
                .map(|p| p.as_vec3().to_array())
                .collect(),
            normals: self
                .normals
                .iter()
                .map(|n| n.as_vec3().to_array())
                .collect(),
            uvs: [
                self.uvs.iter().map(|uv| uv.as_vec2().to_array()).collect(),
                Vec::new(),
            ],
            triangles: self.triangles.clone(),
            ..Primitive::default()
        }
    }
}

/// Faces the side of edge_u x edge_v; texture coordinates run along the edges.
pub fn quad(corner: DVec3, edge_u: DVec3, edge_v: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for uv in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
        mesh.push(
            corner + edge_u * uv.x + edge_v * uv.y,
            edge_u.cross(edge_v),
            uv,
        );
    }
    mesh.push_strip(0, 2);
    mesh
}

/// From `low` to `high`; each face has the whole texture.
pub fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let size = high - low;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        let (u, v) = (axes[(axis + 1) % 3] * size, axes[(axis + 2) % 3] * size);
        mesh.append(&quad(high - u - v, u, v));
        mesh.append(&quad(low, v, u));
    }
    mesh
}

/// Turns profile lines of (radius, height) about the Y axis. Each line is smooth in itself; edges are sharp between lines. Seen with the
/// radius to the right, the outside is to the right of the way that the points run. Texture: u once around, v = height / `v_height_m`.
pub fn lathe(lines: &[Vec<DVec2>], segments: usize, v_height_m: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let columns = segments + 1;
    for line in lines {
        for (row, point) in line.iter().enumerate() {
            let before = line[row.saturating_sub(1)];
            let after = line[(row + 1).min(line.len() - 1)];
            let along = (after - before).normalize();
            for column in 0..columns {
                let u = column as f64 / segments as f64;
                let (sin, cos) = ((column % segments) as f64 / segments as f64 * TAU).sin_cos();
                let turned = |v: DVec2| DVec3::new(v.x * sin, v.y, v.x * cos);
                mesh.push(
                    turned(*point),
                    turned(DVec2::new(along.y, -along.x)),
                    DVec2::new(u, point.y / v_height_m),
                );
            }
            if row > 0 {
                mesh.push_strip(mesh.positions.len() - 2 * columns, columns);
            }
        }
    }
    mesh
}

/// A line through all points, rounded (Catmull and Rom), with `steps` pieces between neighbours.
pub fn rounded(points: &[[f64; 2]], steps: usize) -> Vec<DVec2> {
    let at = |index: isize| DVec2::from(points[index.clamp(0, points.len() as isize - 1) as usize]);
    let mut line = vec![at(0)];
    for i in 0..points.len() as isize - 1 {
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for step in 1..=steps {
            let t = step as f64 / steps as f64;
            let cubic = (b - c) * 3.0 + d - a;
            let square = a * 2.0 - b * 5.0 + c * 4.0 - d;
            line.push(b + ((c - a) + (square + cubic * t) * t) * (0.5 * t));
        }
    }
    line
}

/// A line of straight pieces.
pub fn straight(points: &[[f64; 2]]) -> Vec<DVec2> {
    points.iter().map(|point| DVec2::from(*point)).collect()
}

/// A round tube of `radius_m` about a curve. `curve` gives, for a parameter from 0 to 1, a point and a direction that is not the curve's.
pub fn tube(
    curve: impl Fn(f64) -> (DVec3, DVec3),
    radius_m: f64,
    rows: usize,
    segments: usize,
) -> Mesh {
    let mut mesh = Mesh::default();
    let columns = segments + 1;
    for row in 0..=rows {
        let t = row as f64 / rows as f64;
        let (centre, aside) = curve(t);
        let tangent = (curve(t + 1e-5).0 - curve(t - 1e-5).0).normalize();
        let normal = aside.reject_from_normalized(tangent).normalize();
        let binormal = tangent.cross(normal);
        for column in 0..columns {
            let u = column as f64 / segments as f64;
            let (sin, cos) = ((column % segments) as f64 / segments as f64 * TAU).sin_cos();
            let outward = normal * cos + binormal * sin;
            mesh.push(centre + outward * radius_m, outward, DVec2::new(u, t));
        }
        if row > 0 {
            mesh.push_strip(mesh.positions.len() - 2 * columns, columns);
        }
    }
    mesh
}

/// A trefoil knot that stands on two of its loops, `radius_m` from the middle to the loops' outer side.
pub fn trefoil(radius_m: f64, rows: usize, segments: usize) -> Mesh {
    let tube_radius_m = 0.17 * radius_m;
    let ring_m = 0.56 * radius_m;
    let swing_m = radius_m - tube_radius_m - ring_m;
    let curve = |t: f64| {
        let (sin_3, cos_3) = (3.0 * t * TAU).sin_cos();
        // A quarter turn puts one loop on top.
        let (sin_2, cos_2) = ((2.0 * t + 0.25) * TAU).sin_cos();
        let outward = DVec3::new(cos_3 * cos_2, cos_3 * sin_2, sin_3);
        (
            DVec3::new(cos_2, sin_2, 0.0) * ring_m + outward * swing_m,
            outward,
        )
    };
    tube(curve, tube_radius_m, rows, segments).standing()
}

/// About the origin.
pub fn ball(radius_m: f64, segments: usize) -> Mesh {
    let rows = segments / 2;
    let line = (0..=rows).map(|row| {
        let (sin, cos) = (row as f64 / rows as f64 * TAU * 0.5).sin_cos();
        DVec2::new(sin.max(0.0) * radius_m, -cos * radius_m)
    });
    lathe(&[line.collect()], segments, 2.0 * radius_m)
}
