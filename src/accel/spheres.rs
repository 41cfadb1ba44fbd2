//! Few spheres that contain all triangles.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// A split must take at least this share off the summed squares of the radii.
const LEAST_GAIN: f64 = 0.15;
/// Places tried along each axis.
const BINS: usize = 16;
/// Passes of the centre's walk towards the farthest point.
const WALK_STEPS: usize = 64;

/// Triangles whose corners know which of them lie at one point.
struct Mesh {
    /// Indices of points.
    triangles: Vec<[u32; 3]>,
    points: Vec<DVec3>,
    /// By point, the last cluster that it was counted for.
    counted: Vec<u32>,
    /// Clusters so far.
    clusters: u32,
}

impl Mesh {
    fn new(corners: &[[Vec3; 3]]) -> Self {
        let mut known = HashMap::new();
        let mut points = Vec::new();
        let triangles = corners.iter().map(|triangle| {
            triangle.map(|corner| {
                *known
                    .entry(corner.to_array().map(f32::to_bits))
                    .or_insert_with(|| {
                        points.push(corner.as_dvec3());
                        points.len() as u32 - 1
                    })
            })
        });
        let triangles = triangles.collect();
        Self {
            triangles,
            counted: vec![0; points.len()],
            points,
            clusters: 0,
        }
    }

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|point| self.points[point as usize])
    }

    /// The points of some triangles, each once: most corners are those of several triangles.
    fn points_of(&mut self, triangles: &[u32]) -> Vec<DVec3> {
        self.clusters += 1;
        let mut points = Vec::new();
        for triangle in triangles {
            for point in self.triangles[*triangle as usize] {
                if self.counted[point as usize] != self.clusters {
                    self.counted[point as usize] = self.clusters;
                    points.push(self.points[point as usize]);
                }
            }
        }
        points
    }
}

struct Cluster {
    /// Indices into the mesh.
    triangles: Vec<u32>,
    center: DVec3,
    radius: f64,
    split: Option<Box<(Cluster, Cluster)>>,
}

/// Spheres (centre, radius) that together contain all triangles of a mesh: one, and how it is replaced by more.
pub struct Cover {
    /// `None` without triangles.
    whole: Option<[f32; 4]>,
    splits: Vec<Split>,
}

/// Two spheres in place of one.
struct Split {
    /// Of the list as the splits before have left it.
    replaced: usize,
    parts: [[f32; 4]; 2],
    /// Off the sum of squared radii.
    gain: f64,
}

impl Cover {
    /// Splits the cluster whose split saves most of the sum of squared radii, which is what the cones towards the spheres cover, until none
    /// saves enough, or there are `max` spheres.
    pub fn of(mesh: &[[Vec3; 3]], max: usize) -> Cover {
        let mut cover = Cover {
            whole: None,
            splits: Vec::new(),
        };
        if mesh.is_empty() {
            return cover;
        }
        let mesh = &mut Mesh::new(mesh);
        let all = (0..mesh.triangles.len() as u32).collect();
        let mut clusters = vec![Cluster::new(mesh, all)];
        cover.whole = Some(clusters[0].rounded());
        if max > 1 {
            clusters[0].find_split(mesh);
        }
        while clusters.len() < max {
            let best = clusters
                .iter()
                .enumerate()
                .max_by(|(_, a), (_, b)| a.gain().total_cmp(&b.gain()));
            let Some((replaced, cluster)) = best else {
                break;
            };
            let gain = cluster.gain();
            let Some(parts) = clusters.swap_remove(replaced).split else {
                break;
            };
            let (mut a, mut b) = *parts;
            cover.splits.push(Split {
                replaced,
                parts: [a.rounded(), b.rounded()],
                gain,
            });
            a.find_split(mesh);
            b.find_split(mesh);
            clusters.extend([a, b]);
        }
        cover
    }

    /// Of the mesh moved by `to`, which makes nothing longer by more than `stretch`; coordinates of its triangles are rounded to f32.
    pub fn placed(&self, to: impl Fn(DVec3) -> DVec3, stretch: f64) -> Self {
        let place = |[x, y, z, radius]: [f32; 4]| {
            let center = to(DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
            let rounding = 1e-6 * center.abs().max_element();
            rounded(center, stretch * f64::from(radius) + rounding)
        };
        let split = |split: &Split| Split {
            replaced: split.replaced,
            parts: split.parts.map(place),
            gain: split.gain * stretch * stretch,
        };
        Self {
            whole: self.whole.map(place),
            splits: self.splits.iter().map(split).collect(),
        }
    }

    /// Of no triangle.
    pub fn is_empty(&self) -> bool {
        self.whole.is_none()
    }

    /// At most `max` spheres over all meshes, or one a mesh; fewer where more would hardly be smaller in total cross-section. Of two meshes
    /// the one is split whose next split saves more.
    pub fn spheres(covers: &[&Cover], max: usize) -> Vec<[f32; 4]> {
        let mut lists: Vec<Vec<[f32; 4]>> = (covers.iter())
            .map(|cover| Vec::from_iter(cover.whole))
            .collect();
        let mut left: Vec<&[Split]> = covers.iter().map(|cover| &*cover.splits).collect();
        let count = |lists: &[Vec<_>]| lists.iter().map(Vec::len).sum::<usize>();
        while count(&lists) < max {
            let next = (left.iter().enumerate())
                .filter_map(|(mesh, splits)| Some((mesh, splits.split_first()?)))
                .max_by(|(_, (a, _)), (_, (b, _))| a.gain.total_cmp(&b.gain));
            let Some((mesh, (split, rest))) = next else {
                break;
            };
            lists[mesh].swap_remove(split.replaced);
            lists[mesh].extend(split.parts);
            left[mesh] = rest;
        }
        lists.concat()
    }
}

impl Cluster {
    fn new(mesh: &mut Mesh, triangles: Vec<u32>) -> Cluster {
        let points = mesh.points_of(&triangles);
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for &point in &points {
            low = low.min(point);
            high = high.max(point);
        }
        let farthest = |center: DVec3| {
            let mut worst = (0.0, center);
            for &point in &points {
                let squared = point.distance_squared(center);
                if squared > worst.0 {
                    worst = (squared, point);
                }
            }
            (worst.0.sqrt(), worst.1)
        };
        // Badoiu and Clarkson 2003: steps of 1/(i + 1) towards the farthest point converge to the smallest sphere.
        let mut walk = 0.5 * (low + high);
        let (mut radius, mut far) = farthest(walk);
        let mut center = walk;
        let steps = if triangles.len() > 100_000 {
            8
        } else {
            WALK_STEPS
        };
        for step in 1..=steps {
            walk += (far - walk) / (step + 1) as f64;
            let reach;
            (reach, far) = farthest(walk);
            if reach < radius {
                (radius, center) = (reach, walk);
            }
        }
        Cluster {
            triangles,
            center,
            radius,
            split: None,
        }
    }

    fn gain(&self) -> f64 {
        self.split.as_ref().map_or(0.0, |parts| {
            self.radius.powi(2) - parts.0.radius.powi(2) - parts.1.radius.powi(2)
        })
    }

    /// Finds the best split by the surface area heuristic on the triangles' centres, and keeps it if it gains enough.
    fn find_split(&mut self, mesh: &mut Mesh) {
        let centers: Vec<DVec3> = self
            .triangles
            .iter()
            .map(|&t| mesh.corners(t).into_iter().sum::<DVec3>() / 3.0)
            .collect();
        let (low, high) = centers
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &c| {
                (low.min(c), high.max(c))
            });
        let mut best = (f64::INFINITY, 0, 0.0);
        for axis in 0..3 {
            let width = (high[axis] - low[axis]) / BINS as f64;
            if width <= 0.0 {
                continue;
            }
            let mut bins = [(DVec3::INFINITY, DVec3::NEG_INFINITY); BINS];
            for (&triangle, center) in self.triangles.iter().zip(&centers) {
                let bin = (((center[axis] - low[axis]) / width) as usize).min(BINS - 1);
                for corner in mesh.corners(triangle) {
                    bins[bin] = (bins[bin].0.min(corner), bins[bin].1.max(corner));
                }
            }
            for plane in 1..BINS {
                let diagonal = |part: &[(DVec3, DVec3)]| {
                    let (low, high) = part
                        .iter()
                        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |a, b| {
                            (a.0.min(b.0), a.1.max(b.1))
                        });
                    (high - low).length_squared()
                };
                let cost = diagonal(&bins[..plane]) + diagonal(&bins[plane..]);
                if cost < best.0 {
                    best = (cost, axis, low[axis] + width * plane as f64);
                }
            }
        }
        let (cost, axis, place) = best;
        if !cost.is_finite() {
            return;
        }
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for (&triangle, center) in self.triangles.iter().zip(&centers) {
            let side = if center[axis] < place {
                &mut left
            } else {
                &mut right
            };
            side.push(triangle);
        }
        if left.is_empty() || right.is_empty() {
            return;
        }
        let parts = (Cluster::new(mesh, left), Cluster::new(mesh, right));
        let kept = parts.0.radius.powi(2) + parts.1.radius.powi(2);
        if kept <= (1.0 - LEAST_GAIN) * self.radius.powi(2) {
            self.split = Some(Box::new(parts));
        }
    }

    fn rounded(&self) -> [f32; 4] {
        rounded(self.center, self.radius)
    }
}

/// In f32, the radius raised by what rounding the centre and itself can lose.
fn rounded(exact: DVec3, radius: f64) -> [f32; 4] {
    let center = exact.as_vec3();
    let shift = center.as_dvec3().distance(exact);
    let radius = (radius + shift) * (1.0 + 1e-6);
    [center.x, center.y, center.z, (radius as f32).next_up()]
}
