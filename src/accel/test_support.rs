//! Meshes, rays and brute force in f64 for the tests.

use glam::{DVec3, Vec3};

use super::{Hit, Ray};
use crate::packed::NONE;

/// A repeatable generator: SplitMix64.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// In [0, 1).
    pub(super) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    /// In [-1, 1) on each axis.
    pub(super) fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - Vec3::ONE
    }

    pub(super) fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let squared = v.length_squared();
            if squared > 1e-3 && squared <= 1.0 {
                return v / squared.sqrt();
            }
        }
    }
}

pub(super) fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    }
}

/// Random triangles in the unit cube with edges of about `size`.
pub(super) fn soup(count: usize, size: f32, seed: u64) -> Vec<[Vec3; 3]> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let corner = random.cube();
            [
                corner,
                corner + random.cube() * size,
                corner + random.cube() * size,
            ]
        })
        .collect()
}

/// Long thin triangles across the unit cube.
pub(super) fn slivers(count: usize, seed: u64) -> Vec<[Vec3; 3]> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let corner = random.cube();
            [corner, random.cube(), corner + random.cube() * 1e-3]
        })
        .collect()
}

/// A closed sphere of `2 * rings * segments` triangles whose neighbours share vertices bit for bit.
pub(super) fn sphere(rings: usize, segments: usize, radius: f32) -> Vec<[Vec3; 3]> {
    let point = |ring: usize, segment: usize| {
        if ring == 0 || ring == rings {
            return Vec3::new(0.0, if ring == 0 { radius } else { -radius }, 0.0);
        }
        let theta = std::f32::consts::PI * ring as f32 / rings as f32;
        let phi = std::f32::consts::TAU * (segment % segments) as f32 / segments as f32;
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

/// One triangle in f64: distance, and by how far the ray passes inside the edges (negative: outside), both absolute.
pub(super) fn exact(triangle: &[Vec3; 3], ray: &Ray) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.map(|v| v.as_dvec3() - ray.origin.as_dvec3());
    let d = ray.direction.as_dvec3();
    let normal = (b - a).cross(c - a);
    let slope = normal.dot(d);
    if slope == 0.0 {
        return None;
    }
    let t = normal.dot(a) / slope;
    let p = d * t;
    let inside = |p0: DVec3, p1: DVec3| {
        let outward = (p1 - p0).cross(normal).normalize_or_zero();
        -outward.dot(p - p0)
    };
    Some((t, inside(a, b).min(inside(b, c)).min(inside(c, a))))
}

/// What a single precision tracer may get wrong in absolute terms for this ray and triangle.
pub(super) fn tolerance(triangle: &[Vec3; 3], ray: &Ray, t: f64) -> (f64, f64) {
    let [a, b, c] = triangle.map(|v| v.as_dvec3() - ray.origin.as_dvec3());
    let extent = (b - a).length().max((c - a).length());
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let cosine = normal.dot(ray.direction.as_dvec3()).abs().max(1e-12);
    let unit = 1.2e-7 * 8.0 * (t.abs() + extent);
    // Weights are only as good as the triangle is wide.
    let height = (b - a).cross(c - a).length() / extent;
    (unit / cosine * (1.0 + 0.1 * extent / height), unit / cosine)
}

/// Checks a hit against all triangles; returns what is wrong.
pub(super) fn judge(
    triangles: &[[Vec3; 3]],
    first_id: u32,
    ray: &Ray,
    hit: &Hit,
) -> Result<(), String> {
    let reported = if hit.is_hit() {
        f64::from(hit.t)
    } else {
        f64::INFINITY
    };
    for (triangle, id) in triangles.iter().zip(first_id..) {
        let Some((t, inside)) = exact(triangle, ray) else {
            continue;
        };
        let (t_slack, edge_slack) = tolerance(triangle, ray, t);
        if id == hit.triangle {
            if inside < -edge_slack {
                return Err(format!("triangle {id} reported, {inside:e} outside"));
            }
            if (t - reported).abs() > t_slack {
                return Err(format!("triangle {id} at {t}, reported at {reported}"));
            }
        }
        let inside_interval =
            t > f64::from(ray.t_min) + t_slack && t < f64::from(ray.t_max) - t_slack;
        if inside > edge_slack && inside_interval && t + t_slack < reported {
            return Err(format!("triangle {id} at {t} lost, reported {reported}"));
        }
    }
    Ok(())
}
