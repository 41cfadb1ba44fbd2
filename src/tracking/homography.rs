//! Projective maps between planes.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

/// Of the unit square (0,0) (1,0) (1,1) (0,1) to four points (Heckbert 1989).
pub fn of_square([p0, p1, p2, p3]: [DVec2; 4]) -> DMat3 {
    let (a, b, sum) = (p1 - p2, p3 - p2, p0 - p1 + p2 - p3);
    let determinant = a.perp_dot(b);
    let g = sum.perp_dot(b) / determinant;
    let h = a.perp_dot(sum) / determinant;
    DMat3::from_cols(
        (p1 - p0 + g * p1).extend(g),
        (p3 - p0 + h * p3).extend(h),
        p0.extend(1.0),
    )
}

pub fn apply(map: &DMat3, point: DVec2) -> DVec2 {
    let DVec3 { x, y, z } = *map * point.extend(1.0);
    DVec2::new(x, y) / z
}

/// Least squares through four or more pairs, of coordinates about 1 in size; `None`: they lie on a line.
pub fn of_pairs(pairs: &[(DVec2, DVec2)]) -> Option<DMat3> {
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (from, to) in pairs {
        let (x, y) = (from.x, from.y);
        let rows = [
            ([x, y, 1.0, 0.0, 0.0, 0.0, -to.x * x, -to.x * y], to.x),
            ([0.0, 0.0, 0.0, x, y, 1.0, -to.y * x, -to.y * y], to.y),
        ];
        for (row, value) in rows {
            let row = SVector::<f64, 8>::from(row);
            normal += row * row.transpose();
            right += row * value;
        }
    }
    let h = normal.cholesky()?.solve(&right);
    Some(DMat3::from_cols(
        DVec3::new(h[0], h[3], h[6]),
        DVec3::new(h[1], h[4], h[7]),
        DVec3::new(h[2], h[5], 1.0),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_agree_on_a_square() {
        let quad = [(10.0, 12.0), (52.0, 9.0), (60.0, 55.0), (8.0, 47.0)].map(DVec2::from);
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(DVec2::from);
        let exact = of_square(quad);
        let pairs: Vec<_> = square.into_iter().zip(quad).collect();
        let fitted = of_pairs(&pairs).unwrap();
        let inside = DVec2::new(0.3, 0.8);
        assert!(apply(&exact, inside).distance(apply(&fitted, inside)) < 1e-9);
        for (from, to) in pairs {
            assert!(apply(&exact, from).distance(to) < 1e-12);
        }
        assert!(
            apply(&exact, DVec2::new(1.0, 0.0)).distance(quad[0]) > 1.0,
            "control"
        );
    }
}
