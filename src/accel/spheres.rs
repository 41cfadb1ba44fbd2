//! Few spheres that contain all triangles.

use glam::{DVec3, Vec3};

/// A split must take at least this share off the summed squares of the radii.
const LEAST_GAIN: f64 = 0.15;
/// Places tried along each axis.
const BINS: usize = 16;
/// Passes of the centre's walk towards the farthest point.
const WALK_STEPS: usize = 64;
/// Points that share a box: neighbours in their mesh.
const IN_A_BOX: usize = 32;

/// Triangles over points that they share.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Metres; no harm is done by two that are equal, or by some that no triangle has.
    pub points: Vec<Vec3>,
    /// Indices of points.
    pub triangles: Vec<[u32; 3]>,
}

/// What is looked up of a mesh while it is split.
struct Parts<'a> {
    mesh: &'a Mesh,
    /// By triangle: the middle of its corners, and its box.
    centers: Vec<DVec3>,
    boxes: Vec<(Vec3, Vec3)>,
    /// By point, the last cluster that it was counted for.
    counted: Vec<u32>,
    /// Clusters so far.
    clusters: u32,
}

impl<'a> Parts<'a> {
    fn of(mesh: &'a Mesh) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|point| mesh.points[point as usize]);
        let center = |triangle: &[u32; 3]| {
            let corners = corners(triangle).map(Vec3::as_dvec3);
            corners.into_iter().sum::<DVec3>() / 3.0
        };
        let box_of = |triangle: &[u32; 3]| {
            let [a, b, c] = corners(triangle);
            (a.min(b).min(c), a.max(b).max(c))
        };
        Self {
            mesh,
            centers: mesh.triangles.iter().map(center).collect(),
            boxes: mesh.triangles.iter().map(box_of).collect(),
            counted: vec![0; mesh.points.len()],
            clusters: 0,
        }
    }

    /// The points of some triangles, each once: most corners are those of several triangles.
    fn points_of(&mut self, triangles: &[u32]) -> Cloud {
        self.clusters += 1;
        let mut points = Vec::new();
        for triangle in triangles {
            for point in self.mesh.triangles[*triangle as usize] {
                if self.counted[point as usize] != self.clusters {
                    self.counted[point as usize] = self.clusters;
                    points.push(self.mesh.points[point as usize].as_dvec3());
                }
            }
        }
        Cloud::of(points)
    }
}

/// Points in boxes, so that few of them are looked at for the farthest.
struct Cloud {
    points: Vec<DVec3>,
    /// Of each [`IN_A_BOX`] of them: least and largest coordinates.
    boxes: Vec<(DVec3, DVec3)>,
}

impl Cloud {
    fn of(points: Vec<DVec3>) -> Self {
        let box_of = |points: &[DVec3]| {
            let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let wider =
                |(low, high): (DVec3, DVec3), point: &DVec3| (low.min(*point), high.max(*point));
            points.iter().fold(start, wider)
        };
        Self {
            boxes: points.chunks(IN_A_BOX).map(box_of).collect(),
            points,
        }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let wider =
            |(low, high): (DVec3, DVec3), of: &(DVec3, DVec3)| (low.min(of.0), high.max(of.1));
        self.boxes.iter().fold(start, wider)
    }

    /// Squared distance and index of the point farthest from `center`, the first of equally far ones. `guess`: a point that may be it.
    fn farthest(&self, center: DVec3, guess: usize) -> (f64, usize) {
        let mut worst = (self.points[guess].distance_squared(center), guess);
        for (index, (low, high)) in self.boxes.iter().enumerate() {
            // Rounding keeps the order of numbers: no point of the box is found farther than this.
            let reach = (*low - center).abs().max((*high - center).abs());
            if reach.length_squared() < worst.0 {
                continue;
            }
            let first = index * IN_A_BOX;
            let end = self.points.len().min(first + IN_A_BOX);
            for (point, at) in self.points[first..end].iter().zip(first..) {
                let squared = point.distance_squared(center);
                if squared > worst.0 || (squared == worst.0 && at < worst.1) {
                    worst = (squared, at);
                }
            }
        }
        worst
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
    pub fn of(mesh: &Mesh, max: usize) -> Cover {
        let mut cover = Cover {
            whole: None,
            splits: Vec::new(),
        };
        if mesh.triangles.is_empty() {
            return cover;
        }
        let lookup = &mut Parts::of(mesh);
        let all = (0..mesh.triangles.len() as u32).collect();
        let mut clusters = vec![Cluster::new(lookup, all)];
        cover.whole = Some(clusters[0].rounded());
        if max > 1 {
            clusters[0].find_split(lookup);
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
            a.find_split(lookup);
            b.find_split(lookup);
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
    fn new(parts: &mut Parts<'_>, triangles: Vec<u32>) -> Cluster {
        let cloud = parts.points_of(&triangles);
        let (low, high) = cloud.bounds();
        let mut guess = 0;
        let mut farthest = |center: DVec3| {
            let squared;
            (squared, guess) = cloud.farthest(center, guess);
            (squared.sqrt(), cloud.points[guess])
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
    fn find_split(&mut self, parts: &mut Parts<'_>) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &triangle in &self.triangles {
            let center = parts.centers[triangle as usize];
            (low, high) = (low.min(center), high.max(center));
        }
        let mut best = (f64::INFINITY, 0, 0.0);
        for axis in 0..3 {
            let width = (high[axis] - low[axis]) / BINS as f64;
            if width <= 0.0 {
                continue;
            }
            let mut bins = [(Vec3::INFINITY, Vec3::NEG_INFINITY); BINS];
            for &triangle in &self.triangles {
                let center = parts.centers[triangle as usize][axis];
                let bin = (((center - low[axis]) / width) as usize).min(BINS - 1);
                let (from, to) = parts.boxes[triangle as usize];
                bins[bin] = (bins[bin].0.min(from), bins[bin].1.max(to));
            }
            for plane in 1..BINS {
                let diagonal = |part: &[(Vec3, Vec3)]| {
                    let (low, high) = part
                        .iter()
                        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |a, b| {
                            (a.0.min(b.0), a.1.max(b.1))
                        });
                    (high.as_dvec3() - low.as_dvec3()).length_squared()
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
        for &triangle in &self.triangles {
            let side = if parts.centers[triangle as usize][axis] < place {
                &mut left
            } else {
                &mut right
            };
            side.push(triangle);
        }
        if left.is_empty() || right.is_empty() {
            return;
        }
        let split = (Cluster::new(parts, left), Cluster::new(parts, right));
        let kept = split.0.radius.powi(2) + split.1.radius.powi(2);
        if kept <= (1.0 - LEAST_GAIN) * self.radius.powi(2) {
            self.split = Some(Box::new(split));
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
