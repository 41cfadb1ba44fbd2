//! OpenCV's radial-tangential distortion, and its inverse: with proof that it is the right one, and fast. WGSL twin of what is fast:
//! `shaders/distortion.wgsl`.
//!
//! Coordinates are normalised: x right, y down, at depth 1. Ideal coordinates are those of a pinhole, distorted ones those of the
//! photograph. Far from the centre the polynomial folds back, so that several ideal points share one distorted point; only the
//! sheet that is connected to the centre is meant by a calibration.

use std::ops::{Add, Mul};

use crate::shared::shared;

/// k1 k2 p1 p2 k3.
pub type Coefficients<T> = [T; 5];

shared! {
    /// Newton steps of [`undistort_fast`]; `scene::projection::check_distortion` proves them enough for a camera.
    const UNDISTORT_STEPS: u32 = 8;
}

/// f32 and f64.
pub trait Real: Copy + From<f32> + Add<Output = Self> + Mul<Output = Self> {}

impl Real for f32 {}
impl Real for f64 {}

/// Distorted coordinates of an ideal point.
pub fn distort<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 2] {
    let [k1, k2, p1, p2, k3] = *k;
    let [x, y] = ideal;
    let two = T::from(2.0);
    let r2 = x * x + y * y;
    let radial = T::from(1.0) + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + two * p1 * x * y + p2 * (r2 + two * x * x),
        y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y,
    ]
}

/// Derivatives of [`distort`]: xx, xy = yx, yy.
fn jacobian<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 3] {
    let [k1, k2, p1, p2, k3] = *k;
    let [x, y] = ideal;
    let [two, three, six] = [2.0, 3.0, 6.0].map(T::from);
    let r2 = x * x + y * y;
    let radial = T::from(1.0) + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = k1 + r2 * (two * k2 + r2 * three * k3);
    [
        radial + two * x * x * slope + two * p1 * y + six * p2 * x,
        two * x * y * slope + two * p1 * x + two * p2 * y,
        radial + two * y * y * slope + six * p1 * y + two * p2 * x,
    ]
}

/// How much larger a small area is in distorted coordinates than in ideal ones.
pub fn distortion_area(k: &Coefficients<f32>, ideal: [f32; 2]) -> f32 {
    let [xx, xy, yy] = jacobian(k, ideal);
    (xx * yy - xy * xy).abs()
}

/// The ideal point of a distorted one as a backend finds it; the argument itself where there is no distortion.
pub fn undistort_fast(k: &Coefficients<f32>, distorted: [f32; 2]) -> [f32; 2] {
    if k.iter().all(|&c| c == 0.0) {
        return distorted;
    }
    let [mut x, mut y] = distorted;
    for _ in 0..UNDISTORT_STEPS {
        let at = distort(k, [x, y]);
        let ex = at[0] - distorted[0];
        let ey = at[1] - distorted[1];
        let [jxx, jxy, jyy] = jacobian(k, [x, y]);
        let determinant = jxx * jyy - jxy * jxy;
        // Bounded steps: a pixel that cannot be inverted is refused at load, but must not overflow either.
        let inverse = 1.0 / determinant.max(1e-4);
        x -= ((jyy * ex - jxy * ey) * inverse).clamp(-0.5, 0.5);
        y -= ((jxx * ey - jxy * ex) * inverse).clamp(-0.5, 0.5);
    }
    [x, y]
}

/// The map keeps orientation here: true on the sheet connected to the centre, false once past its fold.
fn is_regular(k: &Coefficients<f64>, ideal: [f64; 2]) -> bool {
    let [xx, xy, yy] = jacobian(k, ideal);
    // On the connected sheet both eigenvalues of the symmetric Jacobian are positive, so its trace is too.
    xx * yy - xy * xy > 1e-9 && xx + yy > 0.0
}

/// Newton's method from `start`; None unless it converges quadratically to rounding.
fn newton(k: &Coefficients<f64>, distorted: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
    let scale = 1.0 + distorted[0].abs() + distorted[1].abs();
    let mut ideal = start;
    for _ in 0..12 {
        let at = distort(k, ideal);
        let (ex, ey) = (at[0] - distorted[0], at[1] - distorted[1]);
        if ex.abs() + ey.abs() <= 4e-16 * scale {
            break;
        }
        let [xx, xy, yy] = jacobian(k, ideal);
        let det = xx * yy - xy * xy;
        ideal[0] -= (yy * ex - xy * ey) / det;
        ideal[1] -= (xx * ey - xy * ex) / det;
    }
    let at = distort(k, ideal);
    let error = (at[0] - distorted[0]).abs() + (at[1] - distorted[1]).abs();
    (error <= 1e-14 * scale).then_some(ideal)
}

/// The ideal point of a distorted one, or None where the lens model has none on the sheet connected to the centre.
///
/// Follows the straight line from the centre in distorted coordinates, in steps that halve where Newton's method fails or where the
/// way between two solutions leaves the regular sheet.
pub fn undistort(k: &Coefficients<f64>, distorted: [f64; 2]) -> Option<[f64; 2]> {
    if k.iter().all(|&c| c == 0.0) {
        return Some(distorted);
    }
    const SMALLEST_STEP: f64 = 1.0 / 65_536.0;
    const CHECKS: u32 = 6;
    let mut ideal = [0.0, 0.0];
    let mut done = 0.0;
    let mut step: f64 = 0.125;
    while done < 1.0 {
        let next = (done + step).min(1.0);
        let target = distorted.map(|c| c * next);
        let found = newton(k, target, ideal).filter(|to| {
            (1..=CHECKS).all(|i| {
                let t = f64::from(i) / f64::from(CHECKS);
                is_regular(k, [0, 1].map(|c| ideal[c] + (to[c] - ideal[c]) * t))
            })
        });
        match found {
            Some(point) => {
                ideal = point;
                done = next;
                step *= 2.0;
            }
            None => {
                step *= 0.5;
                if step < SMALLEST_STEP {
                    return None;
                }
            }
        }
    }
    Some(ideal)
}
