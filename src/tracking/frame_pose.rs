//! The pose of one frame from all that is seen in it. A plane's pose has two minima; both are refined, and the costs say whether one is meant.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::{Matrix3, Matrix6, Vector6};

use super::homography;
use super::lens::Lens;
use super::pose::{Pose, turn};
use crate::least_squares::{Descending, Descent};

/// A point of the board and where it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    pub point: usize,
    /// Corner origin.
    pub pixel: DVec2,
}

/// A pose that fits best nearby.
#[derive(Clone, Debug)]
pub struct Fit {
    pub pose: Pose,
    /// Sum of squared errors in standard deviations, outliers counted less.
    pub cost: f64,
    /// Inverse of the covariance of the step [`Pose::moved`] takes, the board and the lens being known.
    pub information: Matrix6<f64>,
}

/// Best pose first, then the other minimum if it is one of its own.
#[derive(Clone, Debug)]
pub struct Minima {
    pub best: Fit,
    pub other: Option<Fit>,
}

impl Minima {
    /// By how much the other minimum is worse, in squared standard deviations.
    pub fn margin(&self) -> f64 {
        let best = self.best.cost;
        self.other.as_ref().map_or(f64::INFINITY, |o| o.cost - best)
    }
}

/// Standard deviations from which an error counts less (Cauchy).
pub const ROBUST_SIGMAS: f64 = 2.5;

/// Cost of an error of these squared standard deviations, and the weight of its square.
pub fn robust(squared: f64) -> (f64, f64) {
    let scale = ROBUST_SIGMAS * ROBUST_SIGMAS;
    (
        scale * (squared / scale).ln_1p(),
        1.0 / (1.0 + squared / scale),
    )
}

/// Of the inverse of an information with these weights, what is the covariance, where errors are normal along both axes: an estimate that weighs
/// errors so varies by E[psi^2] / E[psi']^2 (Huber 1981), psi being the weighted error, and the inverse says 1 / E[weight].
pub const COVARIANCE_SHARE: f64 = 0.836;

/// Error in pixels and its slopes by the pose and by the point in the camera's frame; `None`: it is behind the camera.
pub struct Projected {
    pub error: DVec2,
    pub by_pose: [[f64; 6]; 2],
    pub by_point: [DVec3; 2],
    pub ideal: DVec2,
}

pub fn project(lens: &Lens, pose: &Pose, point: DVec3, pixel: DVec2) -> Option<Projected> {
    let turned = pose.rotation * point;
    let seen = turned + pose.translation;
    if seen.z < 1e-6 {
        return None;
    }
    let ideal = DVec2::new(seen.x, seen.y) / seen.z;
    let slopes = lens.by_ideal(ideal);
    let rows = [0, 1].map(|i| {
        let (u, v) = (slopes.x_axis[i], slopes.y_axis[i]);
        DVec3::new(u, v, -u * ideal.x - v * ideal.y) / seen.z
    });
    let by_pose = rows.map(|row| {
        let turning = turned.cross(row);
        [turning.x, turning.y, turning.z, row.x, row.y, row.z]
    });
    Some(Projected {
        error: lens.pixel_of(ideal) - pixel,
        by_pose,
        by_point: rows.map(|row| pose.rotation.transpose() * row),
        ideal,
    })
}

/// What an observation behind the camera costs.
const BEHIND: f64 = 1e6;

/// A pose being fitted to what is seen from it.
struct Fitting<'a> {
    lens: &'a Lens,
    points: &'a [DVec3],
    observations: &'a [Observation],
    noise_px: f64,
    pose: Pose,
}

const DESCENT: Descent = Descent {
    steps: 40,
    first_damping: 1e-3,
    least_damping: 1e-12,
    most_damping: 1e8,
    least_gain: 1e-10,
};

impl Descending for Fitting<'_> {
    type Linearised = (Matrix6<f64>, Vector6<f64>);

    fn cost(&self) -> f64 {
        let each = self.observations.iter().map(|o| {
            project(self.lens, &self.pose, self.points[o.point], o.pixel).map_or(BEHIND, |p| {
                robust(p.error.length_squared() / (self.noise_px * self.noise_px)).0
            })
        });
        each.sum()
    }

    /// Weighted squares of the slopes, and the step's right side.
    fn linearised(&self) -> Self::Linearised {
        let mut information = Matrix6::zeros();
        let mut slope = Vector6::zeros();
        for o in self.observations {
            let Some(p) = project(self.lens, &self.pose, self.points[o.point], o.pixel) else {
                continue;
            };
            let variance = self.noise_px * self.noise_px;
            let weight = robust(p.error.length_squared() / variance).1 / variance;
            for (row, error) in p.by_pose.iter().zip(p.error.to_array()) {
                let row = Vector6::from_column_slice(row);
                information += weight * row * row.transpose();
                slope -= weight * error * row;
            }
        }
        (information, slope)
    }

    fn stepped(&self, (information, slope): &Self::Linearised, damping: f64) -> Option<Self> {
        let mut damped = *information;
        for k in 0..6 {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(slope);
        Some(Self {
            pose: self.pose.moved(step.into()),
            ..*self
        })
    }
}

/// The minimum next to `start`.
pub fn fit(
    lens: &Lens,
    points: &[DVec3],
    observations: &[Observation],
    start: &Pose,
    noise_px: f64,
) -> Option<Fit> {
    let (fitted, cost) = DESCENT.from(Fitting {
        lens,
        points,
        observations,
        noise_px,
        pose: *start,
    });
    let (information, _) = fitted.linearised();
    cost.is_finite().then_some(Fit {
        pose: fitted.pose,
        cost,
        information,
    })
}

/// Both minima over all observations. `groups` are ranges of observations that lie in planes of their own: each marker.
pub fn find_pose(
    lens: &Lens,
    points: &[DVec3],
    observations: &[Observation],
    groups: &[std::ops::Range<usize>],
    noise_px: f64,
) -> Option<Minima> {
    let mut starts = Vec::new();
    starts.extend(plane_poses(lens, points, observations));
    if groups.len() > 1 || starts.is_empty() {
        let mut ranked: Vec<_> = groups.to_vec();
        ranked.sort_by(|a, b| {
            extent(&observations[b.clone()]).total_cmp(&extent(&observations[a.clone()]))
        });
        // Of a plane one more start will do; of markers in space the largest three.
        let count = if starts.is_empty() { 3 } else { 1 };
        for group in ranked.into_iter().take(count) {
            starts.extend(plane_poses(lens, points, &observations[group]));
        }
    }
    minima(lens, points, observations, &starts, noise_px)
}

/// The best of the minima next to these, and the second.
pub fn minima(
    lens: &Lens,
    points: &[DVec3],
    observations: &[Observation],
    starts: &[Pose],
    noise_px: f64,
) -> Option<Minima> {
    let fits = starts
        .iter()
        .filter_map(|start| fit(lens, points, observations, start, noise_px));
    let mut fits: Vec<Fit> = fits.collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut fits = fits.into_iter();
    let best = fits.next()?;
    let other = fits.find(|f| f.pose.angle_to(&best.pose) > 0.01);
    Some(Minima { best, other })
}

/// Diagonal in pixels.
fn extent(observations: &[Observation]) -> f64 {
    let ends = observations
        .iter()
        .fold((DVec2::MAX, DVec2::MIN), |(a, b), o| {
            (a.min(o.pixel), b.max(o.pixel))
        });
    (ends.1 - ends.0).length()
}

/// Start of both minima, from the plane that the points lie in; empty: they lie in none.
fn plane_poses(lens: &Lens, points: &[DVec3], observations: &[Observation]) -> Vec<Pose> {
    let Some(plane) = Plane::through(observations.iter().map(|o| points[o.point])) else {
        return Vec::new();
    };
    let pairs: Option<Vec<(DVec2, DVec2)>> = observations
        .iter()
        .map(|o| {
            let on_plane = plane.basis.transpose() * (points[o.point] - plane.middle);
            let at = DVec2::new(on_plane.x, on_plane.y) / plane.size;
            Some((at, lens.ideal_of(o.pixel)?))
        })
        .collect();
    let Some(map) = pairs.and_then(|pairs| homography::of_pairs(&pairs)) else {
        return Vec::new();
    };
    let (a, b) = (map.x_axis / plane.size, map.y_axis / plane.size);
    let scale = 2.0 / (a.length() + b.length());
    let x = a.normalize_or_zero();
    let z = x.cross(b).normalize_or_zero();
    if z == DVec3::ZERO {
        return Vec::new();
    }
    let from_plane = Pose {
        rotation: DMat3::from_cols(x, z.cross(x), z),
        translation: map.z_axis * scale,
    };
    let to_plane = Pose {
        rotation: plane.basis,
        translation: plane.middle,
    }
    .inverse();
    let first = from_plane.after(&to_plane);
    vec![first, tilted_back(&first, &plane)]
}

/// The other minimum: the plane's normal mirrored at the line of sight to its middle.
fn tilted_back(pose: &Pose, plane: &Plane) -> Pose {
    let middle = pose.of(plane.middle);
    let sight = middle.normalize();
    let normal = pose.rotation * plane.basis.z_axis;
    let mirrored = 2.0 * normal.dot(sight) * sight - normal;
    let axis = normal.cross(mirrored);
    let angle = axis.length().atan2(normal.dot(mirrored));
    let rotation = turn(axis.normalize_or_zero() * angle) * pose.rotation;
    Pose {
        rotation,
        translation: middle - rotation * plane.middle,
    }
}

/// Points that lie in a plane.
struct Plane {
    middle: DVec3,
    /// Along the plane twice, then its normal.
    basis: DMat3,
    /// About half of its extent.
    size: f64,
}

impl Plane {
    /// `None`: they do not, to a twentieth of their extent, or they lie on a line.
    fn through(points: impl Iterator<Item = DVec3> + Clone) -> Option<Self> {
        let count = points.clone().count();
        if count < 4 {
            return None;
        }
        let middle = points.clone().sum::<DVec3>() / count as f64;
        let mut spread = Matrix3::zeros();
        for point in points {
            let off = nalgebra::Vector3::from((point - middle).to_array());
            spread += off * off.transpose() / count as f64;
        }
        let eigen = spread.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let [most, second, least] = order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt());
        if least > 0.05 * most || second < 0.02 * most || most == 0.0 {
            return None;
        }
        let axis = |k: usize| {
            let column = eigen.eigenvectors.column(order[k]);
            DVec3::new(column[0], column[1], column[2])
        };
        let (x, y) = (axis(0), axis(1));
        Some(Self {
            middle,
            basis: DMat3::from_cols(x, y, x.cross(y)),
            size: most,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distortion::Distortion;

    fn lens() -> Lens {
        Lens {
            distortion: Distortion::opencv(&[-0.276, 0.194, 0.0, 0.0]).unwrap(),
            ..Lens::ideal(640, 480, 698.0)
        }
    }

    fn seen(pose: &Pose, points: &[DVec3]) -> Vec<Observation> {
        let each = points.iter().enumerate().map(|(point, place)| {
            let at = pose.of(*place);
            Observation {
                point,
                pixel: lens().pixel_of(DVec2::new(at.x, at.y) / at.z),
            }
        });
        each.collect()
    }

    fn pose() -> Pose {
        Pose {
            rotation: turn(DVec3::new(2.1, 0.4, -0.3)),
            translation: DVec3::new(0.03, -0.02, 0.6),
        }
    }

    /// Over squared lengths of normal errors, which fall off exponentially. Control: without weights nothing is to be put right.
    #[test]
    fn covariances_are_those_of_weighted_errors() {
        let share = |weight: &dyn Fn(f64) -> f64| {
            let (mut weights, mut squares, mut slopes) = (0.0, 0.0, 0.0);
            const STEP: f64 = 1e-3;
            for k in 0..60_000 {
                let squared = (f64::from(k) + 0.5) * STEP;
                let density = 0.5 * (-0.5 * squared).exp() * STEP;
                let by_squared = (weight(squared + 1e-5) - weight(squared - 1e-5)) / 2e-5;
                weights += density * weight(squared);
                squares += density * 0.5 * squared * weight(squared).powi(2);
                slopes += density * (weight(squared) + squared * by_squared);
            }
            squares / (slopes * slopes) * weights
        };
        assert!((share(&|squared| robust(squared).1) - COVARIANCE_SHARE).abs() < 5e-4);
        assert!((share(&|_| 1.0) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn exact_corners_give_the_exact_pose_and_its_mirror_costs_more() {
        let points = super::super::board::square(DVec2::splat(-0.04), 0.08, 0);
        let found = find_pose(&lens(), &points, &seen(&pose(), &points), &[], 0.1).unwrap();
        assert!(found.best.pose.angle_to(&pose()) < 1e-6, "{:?}", found.best);
        assert!((found.best.pose.translation - pose().translation).length() < 1e-7);
        let other = found.other.clone().unwrap();
        assert!(other.pose.angle_to(&pose()) > 0.2 && found.margin() > 10.0);
    }

    #[test]
    fn markers_in_space_give_one_pose() {
        let mut points = super::super::board::square(DVec2::splat(-0.04), 0.08, 0).to_vec();
        let upright = points
            .iter()
            .map(|p| DVec3::new(p.x, p.z + 0.05, -0.06))
            .collect::<Vec<_>>();
        points.extend(upright);
        let found = find_pose(
            &lens(),
            &points,
            &seen(&pose(), &points),
            &[0..4, 4..8],
            0.1,
        )
        .unwrap();
        assert!(found.best.pose.angle_to(&pose()) < 1e-6);
        assert!(found.margin() > 100.0);
    }
}
