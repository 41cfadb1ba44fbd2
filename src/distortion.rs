//! OpenCV's lens models and their inverses: with proof that it is the right one, and fast. WGSL twin of what is fast:
//! `shaders/distortion.wgsl`.
//!
//! Coordinates are normalised: x right, y down, at depth 1. Ideal coordinates are those of a pinhole, distorted ones those of the
//! photograph. Far from the centre the polynomials fold back, so that several ideal points share one distorted point; only the
//! sheet that is connected to the centre is meant by a calibration. A fisheye's ideal points end at 89 degrees.

use std::ops::{Add, Div, Mul};

use crate::math::{INV_TAU, atan2_, sincos_2pi};
use crate::shared::shared;

/// k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4; of a fisheye k1 to k4, then 0.
pub type Coefficients<T> = [T; 12];

shared! {
    /// Newton steps of [`undistort_fast`]; `scene::projection::check_distortion` proves them enough for a camera.
    const UNDISTORT_STEPS: u32 = 8;

    /// k1 k2 p1 p2 k3: radial and tangential.
    pub const LENS_RADIAL: u32 = 0;
    /// With k4 k5 k6 in the denominator and s1 to s4 of a thin prism.
    pub const LENS_RATIONAL: u32 = 1;
    /// Equidistant with k1 to k4: the distance from the centre grows with the angle.
    pub const LENS_FISHEYE: u32 = 2;

    /// Radians from the axis up to which a fisheye has ideal points: 89 degrees.
    const FARTHEST_ANGLE: f32 = 1.553_343;
    /// Radians from the axis that the rays of a fisheye without an aperture reach at most.
    const WIDEST_ANGLE: f32 = 3.13;
    /// Nearer to the centre a fisheye is a pinhole.
    const CENTRE: f32 = 1e-7;
}

/// A lens of OpenCV's models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// `LENS_*`.
    pub model: u32,
    pub coefficients: Coefficients<f64>,
}

impl Distortion {
    /// A pinhole.
    pub const NONE: Self = Self {
        model: LENS_RADIAL,
        coefficients: [0.0; 12],
    };

    /// OpenCV's k1 k2 p1 p2, then k3, then k4 k5 k6, then s1 s2 s3 s4; `None`: another number of them.
    pub fn opencv(coefficients: &[f64]) -> Option<Self> {
        if ![0, 4, 5, 8, 12].contains(&coefficients.len()) {
            return None;
        }
        let mut all = [0.0; 12];
        all[..coefficients.len()].copy_from_slice(coefficients);
        let model = match all[5..].iter().all(|k| *k == 0.0) {
            true => LENS_RADIAL,
            false => LENS_RATIONAL,
        };
        Some(Self {
            model,
            coefficients: all,
        })
    }

    /// OpenCV's fisheye: equidistant, with k1 to k4.
    pub fn fisheye([k1, k2, k3, k4]: [f64; 4]) -> Self {
        let mut coefficients = [0.0; 12];
        coefficients[..4].copy_from_slice(&[k1, k2, k3, k4]);
        Self {
            model: LENS_FISHEYE,
            coefficients,
        }
    }

    /// Pinhole and photograph are one.
    pub fn is_none(&self) -> bool {
        self.model == LENS_RADIAL && self.coefficients.iter().all(|k| *k == 0.0)
    }
}

/// f32 and f64.
pub trait Real:
    Copy + From<f32> + PartialOrd + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn sqrt(self) -> Self;
    /// From 0 on.
    fn atan(self) -> Self;
}

impl Real for f32 {
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    fn atan(self) -> Self {
        atan2_(self, 1.0)
    }
}

impl Real for f64 {
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    fn atan(self) -> Self {
        self.atan()
    }
}

/// Distorted coordinates of an ideal point.
pub fn distort<T: Real>(model: u32, k: &Coefficients<T>, ideal: [T; 2]) -> [T; 2] {
    if model == LENS_FISHEYE {
        return fisheye_distort(k, ideal);
    }
    if model == LENS_RATIONAL {
        return rational_distort(k, ideal);
    }
    let [k1, k2, p1, p2, k3, ..] = *k;
    let [x, y] = ideal;
    let two = T::from(2.0);
    let r2 = x * x + y * y;
    let radial = T::from(1.0) + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + two * p1 * x * y + p2 * (r2 + two * x * x),
        y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y,
    ]
}

/// Derivatives of [`distort`]: of x by x and y, of y by x and y.
fn jacobian<T: Real>(model: u32, k: &Coefficients<T>, ideal: [T; 2]) -> [T; 4] {
    if model == LENS_FISHEYE {
        return fisheye_jacobian(k, ideal);
    }
    if model == LENS_RATIONAL {
        return rational_jacobian(k, ideal);
    }
    let [k1, k2, p1, p2, k3, ..] = *k;
    let [x, y] = ideal;
    let [two, three, six] = [2.0, 3.0, 6.0].map(T::from);
    let r2 = x * x + y * y;
    let radial = T::from(1.0) + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = k1 + r2 * (two * k2 + r2 * three * k3);
    let across = two * x * y * slope + two * p1 * x + two * p2 * y;
    [
        radial + two * x * x * slope + two * p1 * y + six * p2 * x,
        across,
        across,
        radial + two * y * y * slope + six * p1 * y + two * p2 * x,
    ]
}

fn rational_distort<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 2] {
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = *k;
    let [x, y] = ideal;
    let [one, two] = [1.0, 2.0].map(T::from);
    let r2 = x * x + y * y;
    let above = one + r2 * (k1 + r2 * (k2 + r2 * k3));
    let below = one + r2 * (k4 + r2 * (k5 + r2 * k6));
    let radial = above / below;
    [
        x * radial + two * p1 * x * y + p2 * (r2 + two * x * x) + r2 * (s1 + r2 * s2),
        y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y + r2 * (s3 + r2 * s4),
    ]
}

fn rational_jacobian<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 4] {
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = *k;
    let [x, y] = ideal;
    let [one, two, three, six] = [1.0, 2.0, 3.0, 6.0].map(T::from);
    let minus = T::from(-1.0);
    let r2 = x * x + y * y;
    let above = one + r2 * (k1 + r2 * (k2 + r2 * k3));
    let below = one + r2 * (k4 + r2 * (k5 + r2 * k6));
    let radial = above / below;
    let above_slope = k1 + r2 * (two * k2 + r2 * three * k3);
    let below_slope = k4 + r2 * (two * k5 + r2 * three * k6);
    // By r2.
    let slope = (above_slope + minus * (radial * below_slope)) / below;
    let across = two * x * y * slope + two * p1 * x + two * p2 * y;
    let prism_x = two * (s1 + two * s2 * r2);
    let prism_y = two * (s3 + two * s4 * r2);
    [
        radial + two * x * x * slope + two * p1 * y + six * p2 * x + prism_x * x,
        across + prism_x * y,
        across + prism_y * x,
        radial + two * y * y * slope + six * p1 * y + two * p2 * x + prism_y * y,
    ]
}

/// Distance from the centre in the photograph, of an angle in radians.
pub fn fisheye_radius<T: Real>(k: &Coefficients<T>, angle: T) -> T {
    let t2 = angle * angle;
    angle * (T::from(1.0) + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
}

/// Derivative of [`fisheye_radius`].
pub fn fisheye_slope<T: Real>(k: &Coefficients<T>, angle: T) -> T {
    let [one, three, five, seven, nine] = [1.0, 3.0, 5.0, 7.0, 9.0].map(T::from);
    let t2 = angle * angle;
    one + t2 * (three * k[0] + t2 * (five * k[1] + t2 * (seven * k[2] + t2 * nine * k[3])))
}

fn fisheye_distort<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 2] {
    let [x, y] = ideal;
    let r = (x * x + y * y).sqrt();
    if r < T::from(CENTRE) {
        return [x, y];
    }
    let scale = fisheye_radius(k, r.atan()) / r;
    [x * scale, y * scale]
}

fn fisheye_jacobian<T: Real>(k: &Coefficients<T>, ideal: [T; 2]) -> [T; 4] {
    let [x, y] = ideal;
    let [zero, one] = [0.0, 1.0].map(T::from);
    let r = (x * x + y * y).sqrt();
    if r < T::from(CENTRE) {
        return [one, zero, zero, one];
    }
    let angle = r.atan();
    let around = fisheye_radius(k, angle) / r;
    let outwards = fisheye_slope(k, angle) / (one + r * r);
    let difference = (outwards + T::from(-1.0) * around) / (r * r);
    let across = difference * x * y;
    [
        around + difference * x * x,
        across,
        across,
        around + difference * y * y,
    ]
}

/// How much larger a small area is in distorted coordinates than in ideal ones.
pub fn distortion_area(model: u32, k: &Coefficients<f32>, ideal: [f32; 2]) -> f32 {
    let [xx, xy, yx, yy] = jacobian(model, k, ideal);
    (xx * yy - xy * yx).abs()
}

/// The ideal point of a distorted one as a backend finds it; the argument itself where there is no distortion.
pub fn undistort_fast(model: u32, k: &Coefficients<f32>, distorted: [f32; 2]) -> [f32; 2] {
    if model == LENS_FISHEYE {
        return fisheye_undistort_fast(k, distorted);
    }
    if model == LENS_RADIAL
        && k[0] == 0.0
        && k[1] == 0.0
        && k[2] == 0.0
        && k[3] == 0.0
        && k[4] == 0.0
    {
        return distorted;
    }
    let [mut x, mut y] = distorted;
    for _ in 0..UNDISTORT_STEPS {
        let at = distort(model, k, [x, y]);
        let ex = at[0] - distorted[0];
        let ey = at[1] - distorted[1];
        if ex == 0.0 && ey == 0.0 {
            // Further steps stay; a device's lanes would only wait for one another.
            break;
        }
        let [jxx, jxy, jyx, jyy] = jacobian(model, k, [x, y]);
        let determinant = jxx * jyy - jxy * jyx;
        // Bounded steps: a pixel that cannot be inverted is refused at load, but must not overflow either.
        let inverse = 1.0 / determinant.max(1e-4);
        x -= ((jyy * ex - jxy * ey) * inverse).clamp(-0.5, 0.5);
        y -= ((jxx * ey - jyx * ex) * inverse).clamp(-0.5, 0.5);
    }
    [x, y]
}

/// The angle whose distance from the centre is `r`, radians.
pub fn fisheye_angle_fast(k: &Coefficients<f32>, r: f32) -> f32 {
    let mut angle = r.min(WIDEST_ANGLE);
    for _ in 0..UNDISTORT_STEPS {
        let error = fisheye_radius(k, angle) - r;
        if error == 0.0 {
            break;
        }
        angle -= (error / fisheye_slope(k, angle).max(1e-4)).clamp(-0.5, 0.5);
        angle = angle.clamp(0.0, WIDEST_ANGLE);
    }
    angle
}

/// Where a point of a fisheye's photograph looks: right, down and along the axis, of length 1; also behind.
pub fn fisheye_direction(k: &Coefficients<f32>, distorted: [f32; 2]) -> [f32; 3] {
    let [x, y] = distorted;
    let r = (x * x + y * y).sqrt();
    if r < CENTRE {
        return [x, y, 1.0];
    }
    let (sin, cos) = sincos_2pi(fisheye_angle_fast(k, r) * INV_TAU);
    let scale = sin / r;
    [x * scale, y * scale, cos]
}

fn fisheye_undistort_fast(k: &Coefficients<f32>, distorted: [f32; 2]) -> [f32; 2] {
    let [x, y] = distorted;
    let r = (x * x + y * y).sqrt();
    if r < CENTRE {
        return [x, y];
    }
    let angle = fisheye_angle_fast(k, r).min(FARTHEST_ANGLE);
    let (sin, cos) = sincos_2pi(angle * INV_TAU);
    let scale = sin / (cos * r);
    [x * scale, y * scale]
}

/// The map keeps orientation here: true on the sheet connected to the centre, false once past its fold.
fn is_regular(lens: &Distortion, ideal: [f64; 2]) -> bool {
    let [xx, xy, yx, yy] = jacobian(lens.model, &lens.coefficients, ideal);
    // On the connected sheet both eigenvalues of the Jacobian are positive, so its trace is too.
    xx * yy - xy * yx > 1e-9 && xx + yy > 0.0
}

/// Newton's method from `start`; None unless it converges quadratically to rounding.
fn newton(lens: &Distortion, distorted: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
    let scale = 1.0 + distorted[0].abs() + distorted[1].abs();
    let Distortion {
        model,
        coefficients: k,
    } = lens;
    let mut ideal = start;
    for _ in 0..12 {
        let at = distort(*model, k, ideal);
        let (ex, ey) = (at[0] - distorted[0], at[1] - distorted[1]);
        if ex.abs() + ey.abs() <= 4e-16 * scale {
            break;
        }
        let [xx, xy, yx, yy] = jacobian(*model, k, ideal);
        let det = xx * yy - xy * yx;
        ideal[0] -= (yy * ex - xy * ey) / det;
        ideal[1] -= (xx * ey - yx * ex) / det;
    }
    let at = distort(*model, k, ideal);
    let error = (at[0] - distorted[0]).abs() + (at[1] - distorted[1]).abs();
    (error <= 1e-14 * scale).then_some(ideal)
}

/// The ideal point of a distorted one, or None where the lens model has none on the sheet connected to the centre.
///
/// Follows the straight line from the centre in distorted coordinates, in steps that halve where Newton's method fails or where the
/// way between two solutions leaves the regular sheet.
pub fn undistort(lens: &Distortion, distorted: [f64; 2]) -> Option<[f64; 2]> {
    if lens.is_none() {
        return Some(distorted);
    }
    if lens.model == LENS_FISHEYE {
        let [x, y] = distorted;
        let r = x.hypot(y);
        let angle = fisheye_angle(&lens.coefficients, r)?;
        return match r < f64::from(CENTRE) {
            true => Some(distorted),
            false => (angle <= f64::from(FARTHEST_ANGLE)).then(|| {
                let scale = angle.tan() / r;
                [x * scale, y * scale]
            }),
        };
    }
    const SMALLEST_STEP: f64 = 1.0 / 65_536.0;
    const CHECKS: u32 = 6;
    let mut ideal = [0.0, 0.0];
    let mut done = 0.0;
    let mut step: f64 = 0.125;
    while done < 1.0 {
        let next = (done + step).min(1.0);
        let target = distorted.map(|c| c * next);
        let found = newton(lens, target, ideal).filter(|to| {
            (1..=CHECKS).all(|i| {
                let t = f64::from(i) / f64::from(CHECKS);
                is_regular(lens, [0, 1].map(|c| ideal[c] + (to[c] - ideal[c]) * t))
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

/// The angle in radians whose distance from the centre is `r`, or None where the lens has none before the distance falls, or at the back.
///
/// By steps of the angle, over which the distance has to rise, and halves of the last one.
pub fn fisheye_angle(k: &Coefficients<f64>, r: f64) -> Option<f64> {
    const STEP: f64 = 1.0 / 256.0;
    let (mut below, mut above) = (0.0, 0.0);
    while fisheye_radius(k, above) < r {
        below = above;
        above += STEP;
        if above > f64::from(WIDEST_ANGLE) || fisheye_slope(k, above) <= 1e-9 {
            return None;
        }
    }
    for _ in 0..60 {
        let middle = 0.5 * (below + above);
        match fisheye_radius(k, middle) < r {
            true => below = middle,
            false => above = middle,
        }
    }
    Some(0.5 * (below + above))
}
