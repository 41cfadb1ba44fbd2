//! The plane that most of a cloud of points lies in, if it can be a floor or a table.

use glam::DVec3;
use nalgebra::Matrix3;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

/// Points p with `normal . p = offset_m`. The normal has unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub normal: DVec3,
    pub offset_m: f64,
    /// Of the points that it was fitted to.
    pub rms_m: f64,
    /// Share of all points that lie in it.
    pub support: f64,
}

/// Points that are looked at.
const MOST_POINTS: usize = 4000;
const TRIES: usize = 500;
/// Cosine of how far from the picture's vertical a ground's normal may seem to lean sideways, and how steeply a camera may look down on it.
const LEAST_UP: f64 = 0.35;
const MOST_ROLL: f64 = 0.6;

/// In camera space (y up, looking along -Z), by consensus of triples and least squares over those that agree; `None`: under 5% do.
pub fn ground_plane(points: &[DVec3]) -> Option<Plane> {
    let step = points.len().div_ceil(MOST_POINTS).max(1);
    let points: Vec<DVec3> = points.iter().copied().step_by(step).collect();
    if points.len() < 20 {
        return None;
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut best: Option<(usize, Plane)> = None;
    for _ in 0..TRIES {
        let [a, b, c] = [(); 3].map(|()| points[random.random_range(0..points.len())]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            continue;
        };
        let normal = normal * normal.y.signum();
        if !(normal.y > LEAST_UP && normal.x.abs() < MOST_ROLL && normal.dot(a) < 0.0) {
            continue;
        }
        let plane = Plane {
            normal,
            offset_m: normal.dot(a),
            rms_m: 0.0,
            support: 0.0,
        };
        let count = points.iter().filter(|p| lies_in(&plane, **p)).count();
        if best.as_ref().is_none_or(|(most, _)| count > *most) {
            best = Some((count, plane));
        }
    }
    let (count, mut plane) = best?;
    if (count as f64) < 0.05 * points.len() as f64 {
        return None;
    }
    for _ in 0..4 {
        let agreeing: Vec<DVec3> = (points.iter().copied())
            .filter(|p| lies_in(&plane, *p))
            .collect();
        plane = least_squares(&agreeing, points.len())?;
    }
    Some(plane)
}

/// Within what depth cameras are off by at that distance.
fn lies_in(plane: &Plane, point: DVec3) -> bool {
    (plane.normal.dot(point) - plane.offset_m).abs() < 0.008 * point.length()
}

fn least_squares(points: &[DVec3], of: usize) -> Option<Plane> {
    if points.len() < 3 {
        return None;
    }
    let count = points.len() as f64;
    let middle = points.iter().sum::<DVec3>() / count;
    let mut scatter = Matrix3::<f64>::zeros();
    for point in points {
        let d = *point - middle;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        scatter += d * d.transpose();
    }
    let eigen = scatter.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let axis = eigen.eigenvectors.column(least);
    let normal = DVec3::new(axis[0], axis[1], axis[2]);
    let normal = normal * normal.y.signum();
    Some(Plane {
        normal,
        offset_m: normal.dot(middle),
        rms_m: (eigen.eigenvalues[least].max(0.0) / count).sqrt(),
        support: count / of as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_is_told_from_a_larger_wall() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut spread = |width: f64| width * (random.random::<f64>() - 0.5);
        let up = DVec3::new(0.1, 0.9, 0.3).normalize();
        let (right, back) = (up.any_orthonormal_pair().0, up.any_orthonormal_pair().1);
        let floor = (0..1000).map(|_| (right, back)).collect::<Vec<_>>();
        let mut points: Vec<DVec3> = (floor.into_iter())
            .map(|(right, back)| {
                up * (-1.4 + spread(0.004)) + right * spread(3.0) + back * spread(3.0)
            })
            .collect();
        for _ in 0..3000 {
            points.push(DVec3::new(spread(4.0), spread(4.0), -5.0 + spread(0.01)));
        }
        let plane = ground_plane(&points).unwrap();
        assert!(plane.normal.dot(up) > 0.9999, "{plane:?}");
        assert!((plane.offset_m + 1.4).abs() < 2e-3, "{plane:?}");
        assert!((plane.support - 0.25).abs() < 0.02, "{plane:?}");
        assert_eq!(ground_plane(&points[1000..]), None, "control: a wall alone");
        assert_eq!(ground_plane(&points[..5]), None);
    }
}
