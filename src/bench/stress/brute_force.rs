//! Every triangle asked in f64: what a ray's hit is judged by.

use glam::{DVec3, Vec3};

use crate::accel::{Hit, Ray};
use crate::refusal::Refusal;

/// One triangle in f64: distance, and by how far the ray passes inside the edges (negative: outside), both absolute.
pub(crate) fn exact(triangle: &[Vec3; 3], ray: &Ray) -> Option<(f64, f64)> {
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
pub(crate) fn tolerance(triangle: &[Vec3; 3], ray: &Ray, t: f64) -> (f64, f64) {
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
pub(crate) fn judge(
    triangles: &[[Vec3; 3]],
    first_id: u32,
    ray: &Ray,
    hit: &Hit,
) -> Result<(), Refusal> {
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
                return Err(format!("triangle {id} reported, {inside:e} outside").into());
            }
            if (t - reported).abs() > t_slack {
                return Err(format!("triangle {id} at {t}, reported at {reported}").into());
            }
        }
        let inside_interval =
            t > f64::from(ray.t_min) + t_slack && t < f64::from(ray.t_max) - t_slack;
        if inside > edge_slack && inside_interval && t + t_slack < reported {
            return Err(format!("triangle {id} at {t} lost, reported {reported}").into());
        }
    }
    Ok(())
}
