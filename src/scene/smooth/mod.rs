//! Smoothing of scanned meshes that keeps creases and depth edges.
//!
//! A depth camera's noise tilts triangles by tens of degrees, which shows as mottled shadows and shading. Two passes remove it:
//! a robust plane is fitted around every vertex (weights fall with distance and with the height over the plane, so that what
//! lies beyond a crease drops out), then each vertex moves to where the planes around it predict it (after T. R. Jones,
//! F. Durand, M. Desbrun, "Non-iterative, feature-preserving mesh smoothing", SIGGRAPH 2003, with fitted planes as predictors).
//! Vertices move along the planes' normals only, so the rim stays where it is; neighbourhoods follow the mesh's edges, so
//! surfaces apart do not pull each other.

mod detect;
mod topology;

use glam::Vec3;
use rayon::prelude::*;

use super::Primitive;
pub use detect::{DetectedNoise, detect_scanner_noise};
use topology::{Search, Topology};

/// A smaller neighbourhood holds too few vertices to fit a plane to.
const SMALLEST_RADIUS_IN_EDGES: f64 = 2.5;
/// Heights of this many noise sigmas count 60% in a fit; beyond a crease they soon count nothing.
const HEIGHT_SIGMAS: f32 = 2.5;
/// Planes whose unit normals lie this far apart count 60% for each other (20 degrees).
const NORMAL_SPREAD: f32 = 0.35;
/// Rounds of a fit, in units of that height: the first takes all there is, the last ones the noise alone.
const HEIGHT_SCALES: [f32; 5] = [f32::INFINITY, 4.0, 4.0, 2.0, 1.0];

/// Smooths positions and normals in place.
///
/// `radius_m` is the radius of the neighbourhood that each vertex is fitted to, in the primitive's own units (divide a radius in
/// world metres by the scale of the transform). Bumps smaller than it are levelled, and so is any detail of the noise's own
/// height. Raising it smooths more, costs time with its square, and rounds curved surfaces of that radius. Where the mesh is
/// coarse, at least 2.5 edge lengths are used. 0 leaves the mesh as it is. Triangles that smoothing degenerates are dropped.
pub fn smooth(primitive: &mut Primitive, radius_m: f64) {
    if radius_m <= 0.0 || primitive.triangles.is_empty() {
        return;
    }
    let topology = Topology::new(primitive);
    let radii: Vec<f32> = topology
        .spacings()
        .iter()
        .map(|spacing| (radius_m as f32).max(SMALLEST_RADIUS_IN_EDGES as f32 * spacing))
        .collect();
    let planes = predict(&topology, &radii, &fit_planes(&topology, &radii));
    for (vertex, &joined) in topology.joined.iter().enumerate() {
        let plane = planes[joined as usize];
        // Coordinates near the ends of f32 overflow in the fit; they stay as they are.
        if plane.point.is_finite() && plane.normal.is_finite() {
            primitive.positions[vertex] = plane.point.to_array();
            primitive.normals[vertex] = plane.normal.to_array();
        }
    }
    let positions = &primitive.positions;
    primitive.triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|vertex| Vec3::from(positions[vertex as usize]).as_dvec3());
        (b - a).cross(c - a) != glam::DVec3::ZERO
    });
}

/// The radius at which a plane fitted to independent noise `sigma` on a grid of spacing `edge` has a slope error of 3/4 degree:
/// a disc of n = pi r^2 / edge^2 points gives 2 sigma / (r sqrt(n)) radians.
fn normal_noise_radius(sigma: f64, edge: f64) -> f64 {
    let slope = 0.75f64.to_radians();
    (2.0 * sigma * edge / (std::f64::consts::PI.sqrt() * slope)).sqrt()
}

#[derive(Clone, Copy)]
struct Plane {
    point: Vec3,
    normal: Vec3,
}

/// A plane fitted around a vertex, and the height over it that counts as noise there: depth noise grows with distance.
struct Fit {
    plane: Plane,
    height: f32,
}

fn for_each_vertex<T: Send>(
    topology: &Topology,
    work: impl Fn(&mut Search, u32) -> T + Sync,
) -> Vec<T> {
    let count = topology.positions.len();
    let chunk = (count / 64).max(4096);
    (0..count.div_ceil(chunk))
        .into_par_iter()
        .flat_map_iter(|number| {
            let mut search = Search::new(topology);
            let work = &work;
            (number * chunk..((number + 1) * chunk).min(count))
                .map(move |vertex| work(&mut search, vertex as u32))
        })
        .collect()
}

/// 1 at the centre, 0 with a flat end at the radius.
fn near_weight(distance_squared: f32, radius: f32) -> f32 {
    let rest = (1.0 - distance_squared / (radius * radius)).max(0.0);
    rest * rest
}

fn gauss(deviation: f32, sigma: f32) -> f32 {
    let ratio = deviation / sigma;
    (-0.5 * ratio * ratio).exp()
}

/// Robust planes by iteratively reweighted least squares, from a broad height scale down to that of the noise.
fn fit_planes(topology: &Topology, radii: &[f32]) -> Vec<Fit> {
    let positions = &topology.positions;
    let normals = topology.vertex_normals();
    let bumps = detect::bump_heights(topology);
    for_each_vertex(topology, |search, vertex| {
        let centre = positions[vertex as usize];
        let radius = radii[vertex as usize];
        let ball = search.ball(vertex, radius);
        let nearby_bumps = ball.iter().map(|&other| bumps[other as usize].abs());
        let sigma = 1.4826 * detect::median(nearby_bumps.collect());
        let height = (HEIGHT_SIGMAS * sigma).max(1e-3 * radius);
        let near: Vec<(Vec3, f32)> = ball
            .iter()
            .map(|&other| {
                let offset = positions[other as usize] - centre;
                (offset, near_weight(offset.length_squared(), radius))
            })
            .collect();
        let mean_normal: Vec3 = ball
            .iter()
            .zip(&near)
            .map(|(&other, (_, weight))| normals[other as usize] * *weight)
            .sum();
        let mut plane = Plane {
            point: Vec3::ZERO,
            normal: mean_normal.normalize_or(normals[vertex as usize]),
        };
        for scale in HEIGHT_SCALES {
            let weighted = near.iter().map(|&(offset, weight)| {
                let deviation = (offset - plane.point).dot(plane.normal);
                (offset, weight * gauss(deviation, scale * height))
            });
            match fit_plane(weighted, plane.normal) {
                Some(fitted) => plane = fitted,
                None => break,
            }
        }
        plane.point += centre;
        Fit { plane, height }
    })
}

/// Weighted least squares of the heights along `up`: h = a + b x + c y. None where the points do not span a plane.
fn fit_plane(points: impl Iterator<Item = (Vec3, f32)>, up: Vec3) -> Option<Plane> {
    let (x_axis, y_axis) = up.any_orthonormal_pair();
    let mut sum = 0.0f64;
    let (mut mean, mut xx, mut xy, mut yy, mut xh, mut yh) =
        ([0.0f64; 3], 0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (offset, weight) in points {
        let weight = f64::from(weight);
        let x = f64::from(offset.dot(x_axis));
        let y = f64::from(offset.dot(y_axis));
        let h = f64::from(offset.dot(up));
        sum += weight;
        mean[0] += weight * x;
        mean[1] += weight * y;
        mean[2] += weight * h;
        xx += weight * x * x;
        xy += weight * x * y;
        yy += weight * y * y;
        xh += weight * x * h;
        yh += weight * y * h;
    }
    let [x, y, h] = mean.map(|value| value / sum);
    let (xx, xy, yy) = (xx / sum - x * x, xy / sum - x * y, yy / sum - y * y);
    let (xh, yh) = (xh / sum - x * h, yh / sum - y * h);
    let determinant = xx * yy - xy * xy;
    // Points on a line leave the tilt about it open.
    if determinant.is_nan() || determinant <= 1e-3 * (xx + yy) * (xx + yy) {
        return None;
    }
    let slope_x = (yy * xh - xy * yh) / determinant;
    let slope_y = (xx * yh - xy * xh) / determinant;
    let normal = up - x_axis * slope_x as f32 - y_axis * slope_y as f32;
    Some(Plane {
        point: x_axis * x as f32 + y_axis * y as f32 + up * h as f32,
        normal: normal.normalize(),
    })
}

/// Each vertex moved to the mean of its projections onto the planes around it, with the mean of their normals.
fn predict(topology: &Topology, radii: &[f32], fits: &[Fit]) -> Vec<Plane> {
    let positions = &topology.positions;
    for_each_vertex(topology, |search, vertex| {
        let centre = positions[vertex as usize];
        let Fit { plane: own, height } = &fits[vertex as usize];
        let radius = radii[vertex as usize];
        let (mut shift, mut normal, mut sum) = (Vec3::ZERO, Vec3::ZERO, 0.0f32);
        for &other in search.ball(vertex, radius) {
            let plane = fits[other as usize].plane;
            let distance_squared = positions[other as usize].distance_squared(centre);
            let move_by = (plane.point - centre).dot(plane.normal);
            let weight = near_weight(distance_squared, radius)
                * gauss(move_by, *height)
                * gauss((plane.normal - own.normal).length(), NORMAL_SPREAD);
            shift += plane.normal * (weight * move_by);
            normal += plane.normal * weight;
            sum += weight;
        }
        // A vertex far off every plane, an outlier, moves onto its own.
        let shift = if sum > f32::MIN_POSITIVE {
            shift / sum
        } else {
            own.normal * (own.point - centre).dot(own.normal)
        };
        Plane {
            point: centre + shift,
            normal: normal.normalize_or(own.normal),
        }
    })
}
