//! OpenCV's radial-tangential distortion in f64, and its inverse with proof that it is the right one.
//!
//! Coordinates are normalised: x right, y down, at depth 1. Ideal coordinates are those of a pinhole, distorted ones those of the
//! photograph. Far from the centre the polynomial folds back, so that several ideal points share one distorted point; only the
//! sheet that is connected to the centre is meant by a calibration.

/// k1 k2 p1 p2 k3.
pub type Coefficients = [f64; 5];

/// Distorted coordinates of an ideal point.
pub fn distort(k: &Coefficients, ideal: [f64; 2]) -> [f64; 2] {
    let [k1, k2, p1, p2, k3] = *k;
    let [x, y] = ideal;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

/// Derivatives of [`distort`]: xx, xy = yx, yy.
fn jacobian(k: &Coefficients, ideal: [f64; 2]) -> [f64; 3] {
    let [k1, k2, p1, p2, k3] = *k;
    let [x, y] = ideal;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    [
        radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    ]
}

/// The map keeps orientation here: true on the sheet connected to the centre, false once past its fold.
fn is_regular(k: &Coefficients, ideal: [f64; 2]) -> bool {
    let [xx, xy, yy] = jacobian(k, ideal);
    // On the connected sheet both eigenvalues of the symmetric Jacobian are positive, so its trace is too.
    xx * yy - xy * xy > 1e-9 && xx + yy > 0.0
}

/// Newton's method from `start`; None unless it converges quadratically to rounding.
fn newton(k: &Coefficients, distorted: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
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
pub fn undistort(k: &Coefficients, distorted: [f64; 2]) -> Option<[f64; 2]> {
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
