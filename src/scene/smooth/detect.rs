//! Tells the mesh of a depth camera from others.

use glam::Vec3;

use super::topology::Topology;
use super::{SMALLEST_RADIUS_IN_EDGES, normal_noise_radius};
use crate::scene::Primitive;

/// What [`detect_scanner_noise`] found, in the primitive's own units (metres where its transform has no scale).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedNoise {
    /// Standard deviation of the depth noise from vertex to vertex.
    pub sigma_m: f64,
    /// The radius for [`super::smooth`] at which independent noise leaves a tilt of 3/4 degree in the fitted planes.
    pub radius_m: f64,
}

const FEWEST_TRIANGLES: usize = 2000;
/// Share of inner vertices with six neighbours, as in a grid of pixels split into triangles.
const GRID_SHARE: f64 = 0.8;
/// Bumps in units of the edge length (1.48 times their median).
const BUMP_SLOPE: f64 = 0.03;
/// Share of edges whose ends bulge to opposite sides.
const SIGN_CHANGES: f64 = 0.4;

/// Whether a mesh carries the noise of a depth camera: Some if all of this holds, after vertices at one place are joined,
///
/// - it has at least 2000 triangles, has a rim, and at least 80% of its inner vertices have six neighbours: a grid of pixels;
/// - it is bumpy: 1.48 times the median height of an inner vertex over the mean of its neighbours is over 3% of the edge length;
/// - the bumps are noise: over 40% of the edges join a bulge and a dent. On a surface whose shapes are wider than a few cells,
///   neighbours bulge alike (under 30% on the sample models, 24% on a laser-scanned statue); independent noise gives 58%, the
///   two Kinect meshes 51 and 52%.
///
/// Models that are fused from many depth maps are no grids and are not found; give them a radius by hand.
pub fn detect_scanner_noise(primitive: &Primitive) -> Option<DetectedNoise> {
    if primitive.triangles.len() < FEWEST_TRIANGLES {
        return None;
    }
    let topology = Topology::new(primitive);
    let vertices = 0..topology.positions.len() as u32;
    let inner: Vec<u32> = vertices
        .filter(|&v| !topology.rim[v as usize] && !topology.neighbours(v).is_empty())
        .collect();
    let has_rim = topology.rim.contains(&true);
    let grid = share(&inner, |&v| topology.neighbours(v).len() == 6);
    if !has_rim || inner.len() < FEWEST_TRIANGLES / 4 || grid < GRID_SHARE {
        return None;
    }
    let spacings = topology.spacings();
    let heights = bump_heights(&topology);
    let slopes = inner
        .iter()
        .map(|&v| heights[v as usize].abs() / spacings[v as usize]);
    let bumpy = 1.4826 * f64::from(median(slopes.collect()));
    if bumpy < BUMP_SLOPE || sign_changes(&topology, &inner, &heights) < SIGN_CHANGES {
        return None;
    }
    // The height over the mean of six neighbours has a variance of 1 + 1/6 that of independent noise.
    let median_height = median(inner.iter().map(|&v| heights[v as usize].abs()).collect());
    let sigma = 1.4826 * f64::from(median_height) / (7.0f64 / 6.0).sqrt();
    let edge = f64::from(median(
        inner.iter().map(|&v| spacings[v as usize]).collect(),
    ));
    let radius = normal_noise_radius(sigma, edge);
    Some(DetectedNoise {
        sigma_m: sigma,
        radius_m: radius.clamp(SMALLEST_RADIUS_IN_EDGES * edge, 8.0 * edge),
    })
}

/// Signed height of each vertex over the mean of its neighbours, along the surrounding normal.
pub(super) fn bump_heights(topology: &Topology) -> Vec<f32> {
    let normals = spread_normals(topology, 2);
    (0..topology.positions.len() as u32)
        .map(|vertex| {
            let neighbours = topology.neighbours(vertex);
            if neighbours.is_empty() {
                return 0.0;
            }
            let centre = topology.positions[vertex as usize];
            let sum: Vec3 = neighbours
                .iter()
                .map(|&other| centre - topology.positions[other as usize])
                .sum();
            sum.dot(normals[vertex as usize]) / neighbours.len() as f32
        })
        .collect()
}

/// Vertex normals averaged over the neighbours `rounds` times.
fn spread_normals(topology: &Topology, rounds: usize) -> Vec<Vec3> {
    let mut normals = topology.vertex_normals();
    for _ in 0..rounds {
        normals = (0..normals.len() as u32)
            .map(|vertex| {
                let own = normals[vertex as usize];
                let others = topology.neighbours(vertex).iter();
                let sum: Vec3 = own + others.map(|&other| normals[other as usize]).sum::<Vec3>();
                sum.normalize_or(own)
            })
            .collect();
    }
    normals
}

fn sign_changes(topology: &Topology, inner: &[u32], heights: &[f32]) -> f64 {
    let pairs: Vec<(f32, f32)> = inner
        .iter()
        .flat_map(|&v| topology.neighbours(v).iter().map(move |&other| (v, other)))
        .filter(|&(v, other)| v < other && !topology.rim[other as usize])
        .map(|(v, other)| (heights[v as usize], heights[other as usize]))
        .collect();
    share(&pairs, |(a, b)| a * b < 0.0)
}

fn share<T>(items: &[T], holds: impl Fn(&T) -> bool) -> f64 {
    let count = items.iter().filter(|item| holds(item)).count();
    count as f64 / items.len().max(1) as f64
}

pub(super) fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
