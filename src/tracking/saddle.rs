//! Corners of a chessboard: saddle points of the light, where two dark and two light squares meet.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use nalgebra::{SMatrix, SVector};

use super::light::LightImage;

/// A saddle point and the directions of the two edges that cross in it, radians.
#[derive(Clone, Copy, Debug)]
pub struct Saddle {
    /// Corner origin.
    pub place: DVec2,
    pub edges: [f64; 2],
}

/// Blur in which saddles are looked for: pixels, one standard deviation.
const BLUR_PX: f64 = 1.5;
/// Of the strongest saddle, what one has at least.
const LEAST_STRENGTH: f32 = 0.003;
/// Pixels within which there is one saddle.
const APART: usize = 3;
/// Radii of the rings on which light changes four times, pixels.
const RINGS: [f64; 2] = [3.5, 5.0];
const LEAST_CONTRAST: f32 = 0.02;

/// Convolved with a Gaussian, the edge's value beyond the picture.
pub fn blurred(image: &LightImage, sigma_px: f64) -> LightImage {
    let reach = (3.0 * sigma_px).ceil() as usize;
    let weights: Vec<f32> = (0..=2 * reach)
        .map(|k| (-0.5 * ((k as f64 - reach as f64) / sigma_px).powi(2)).exp() as f32)
        .collect();
    let total: f32 = weights.iter().sum();
    let (width, height) = (image.width, image.height);
    let mut rows = vec![0.0; image.values.len()];
    let mut padded = vec![0.0; width + 2 * reach];
    for (from, to) in image
        .values
        .chunks_exact(width)
        .zip(rows.chunks_exact_mut(width))
    {
        padded[..reach].fill(from[0]);
        padded[reach..reach + width].copy_from_slice(from);
        padded[reach + width..].fill(from[width - 1]);
        for (k, weight) in weights.iter().enumerate() {
            let shifted = &padded[k..k + width];
            to.iter_mut()
                .zip(shifted)
                .for_each(|(sum, value)| *sum += weight / total * value);
        }
    }
    let mut values = vec![0.0; image.values.len()];
    for (y, to) in values.chunks_exact_mut(width).enumerate() {
        for (k, weight) in weights.iter().enumerate() {
            let row = (y + k).saturating_sub(reach).min(height - 1);
            let from = &rows[row * width..][..width];
            to.iter_mut()
                .zip(from)
                .for_each(|(sum, value)| *sum += weight / total * value);
        }
    }
    LightImage {
        width,
        height,
        values,
    }
}

/// All saddles, to a few tenths of a pixel.
pub fn find_saddles(image: &LightImage) -> Vec<Saddle> {
    let smooth = blurred(image, BLUR_PX);
    let (width, height) = (image.width, image.height);
    let border = 8;
    if width < 3 * border || height < 3 * border {
        return Vec::new();
    }
    let strength = strengths(&smooth);
    let limit = LEAST_STRENGTH * strength.iter().copied().fold(0.0, f32::max);
    let mut saddles = Vec::new();
    for y in border..height - border {
        for x in border..width - border {
            let own = strength[y * width + x];
            let rows = y - APART..=y + APART;
            let is_most = own > limit
                && rows.clone().all(|row| {
                    let around = &strength[row * width + x - APART..=row * width + x + APART];
                    around.iter().all(|other| *other <= own)
                });
            if !is_most {
                continue;
            }
            let start = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let saddle = refine_saddle(&smooth, start, 4.0).and_then(|at| checked(&smooth, at));
            saddles.extend(saddle);
        }
    }
    saddles
}

/// How much of a saddle each pixel is: minus the determinant of the second derivatives.
fn strengths(image: &LightImage) -> Vec<f32> {
    let (width, v) = (image.width, &image.values);
    let mut strength = vec![0.0; v.len()];
    for y in 1..image.height - 1 {
        for x in 1..width - 1 {
            let p = y * width + x;
            let xx = v[p + 1] + v[p - 1] - 2.0 * v[p];
            let yy = v[p + width] + v[p - width] - 2.0 * v[p];
            let xy =
                0.25 * (v[p + width + 1] + v[p - width - 1] - v[p + width - 1] - v[p - width + 1]);
            strength[p] = (xy * xy - xx * yy).max(0.0);
        }
    }
    strength
}

/// The saddle of a quadric fitted in a round window, repeated where it moves; `None`: there is none near.
pub fn refine_saddle(image: &LightImage, start: DVec2, radius: f64) -> Option<DVec2> {
    let mut place = start;
    for _ in 0..6 {
        let step = saddle_of_quadric(image, place, radius)?;
        if step.length() > 2.0 {
            return None;
        }
        place += step;
        if step.length() < 1e-3 {
            break;
        }
    }
    (place.distance(start) < 3.0).then_some(place)
}

fn saddle_of_quadric(image: &LightImage, place: DVec2, radius: f64) -> Option<DVec2> {
    let reach = radius.ceil() as i32;
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = SVector::<f64, 6>::zeros();
    for j in -reach..=reach {
        for i in -reach..=reach {
            let off = DVec2::new(f64::from(i), f64::from(j));
            let distance = off.length_squared();
            if distance > radius * radius {
                continue;
            }
            let weight = (-distance / (2.0 * (0.6 * radius).powi(2))).exp();
            let value = f64::from(image.at(place + off));
            let (x, y) = (off.x, off.y);
            let row = SVector::<f64, 6>::from([x * x, x * y, y * y, x, y, 1.0]);
            normal.ger(weight, &row, &row, 1.0);
            right.axpy(weight * value, &row, 1.0);
        }
    }
    let q = normal.cholesky()?.solve(&right);
    let determinant = 4.0 * q[0] * q[2] - q[1] * q[1];
    (determinant < 0.0).then(|| {
        DVec2::new(
            q[1] * q[4] - 2.0 * q[2] * q[3],
            q[1] * q[3] - 2.0 * q[0] * q[4],
        ) / determinant
    })
}

/// Around a corner of a chessboard light changes four times, alike on both sides.
fn checked(image: &LightImage, place: DVec2) -> Option<Saddle> {
    const STEPS: usize = 32;
    let mut edges = [0.0; 2];
    for radius in RINGS {
        let ring: [f32; STEPS] = std::array::from_fn(|k| {
            let angle = k as f64 * TAU / STEPS as f64;
            image.at(place + radius * DVec2::from_angle(angle))
        });
        let (least, most) =
            (ring.iter()).fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let middle = 0.5 * (least + most);
        let changes: Vec<usize> = (0..STEPS)
            .filter(|k| (ring[*k] > middle) != (ring[(k + 1) % STEPS] > middle))
            .collect();
        let unlike: f32 = (0..STEPS / 2)
            .map(|k| (ring[k] - ring[k + STEPS / 2]).abs())
            .sum();
        let unlike = unlike / (0.5 * STEPS as f32) / (most - least);
        if changes.len() != 4 || most - least < LEAST_CONTRAST || unlike > 0.3 {
            return None;
        }
        let angle = |k: usize| {
            let (a, b) = (ring[k] - middle, ring[(k + 1) % STEPS] - middle);
            (k as f64 + f64::from(a / (a - b))) * TAU / STEPS as f64
        };
        for (edge, k) in edges.iter_mut().zip(0..) {
            let (one, opposite) = (angle(changes[k]), angle(changes[k + 2]) - PI);
            *edge = one + 0.5 * wrapped(opposite - one);
        }
    }
    Some(Saddle { place, edges })
}

/// To -pi..pi.
pub fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}
