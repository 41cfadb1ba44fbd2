//! LDR-FLIP: the difference that a viewer sees when two images alternate in place (Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for Alternating Images", HPG 2020; constants are the paper's).
//!
//! By hand: the crates bind NVIDIA's C++ implementation, a compiler of which the build would need, where this is some hundred lines of f64.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Pixels per degree of visual angle: a display 0.7 m and 3840 pixels wide, seen from 0.7 m (67.02, the published default).
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Mean FLIP error, 0 (identical) to 1, of two linear Rec.709 images, which are clamped to 0..1.
pub fn flip(width: usize, height: usize, reference: &[[f32; 3]], test: &[[f32; 3]]) -> f64 {
    if reference.is_empty() {
        return 0.0;
    }
    // Summed in one order, so that the number of threads does not change the result.
    let sum: f64 = flip_map(width, height, reference, test).iter().sum();
    sum / (width * height) as f64
}

/// FLIP error of every pixel.
pub fn flip_map(
    width: usize,
    height: usize,
    reference: &[[f32; 3]],
    test: &[[f32; 3]],
) -> Vec<f64> {
    let colour = Colour::new();
    let reference = Perceived::new(&colour, width, height, reference);
    let test = Perceived::new(&colour, width, height, test);
    (0..width * height)
        .into_par_iter()
        .map(|i| {
            let colour_difference = colour.difference(reference.lab[i], test.lab[i]);
            let edges = (reference.edges[i] - test.edges[i]).abs();
            let points = (reference.points[i] - test.points[i]).abs();
            // q_f = 0.5; the factor brings the largest difference to 1.
            let feature_difference = (edges.max(points) / 2.0f64.sqrt()).min(1.0).sqrt();
            colour_difference.powf(1.0 - feature_difference)
        })
        .collect()
}

/// What the eye makes of one image.
struct Perceived {
    /// Filtered by the contrast sensitivity functions, Hunt-adjusted L*a*b*.
    lab: Vec<DVec3>,
    /// Edge and point strength of the achromatic channel.
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Perceived {
    fn new(colour: &Colour, width: usize, height: usize, linear: &[[f32; 3]]) -> Self {
        let opponent: Vec<DVec3> = linear
            .par_iter()
            .map(|rgb| {
                let clamped = rgb.map(|c| f64::from(c).clamp(0.0, 1.0));
                colour.opponent_from_linear(DVec3::from_array(clamped))
            })
            .collect();
        let plane = |c: usize| Plane {
            width,
            height,
            values: opponent.iter().map(|v| v[c]).collect(),
        };
        let filtered = [0, 1, 2].map(|c| contrast_sensitivity(&plane(c), &CSF[c]));
        let lab = (0..linear.len())
            .into_par_iter()
            .map(|i| {
                let value = DVec3::from_array([0, 1, 2].map(|c| filtered[c][i]));
                let linear = colour.linear_from_opponent(value);
                colour.hunt_lab(linear.clamp(DVec3::ZERO, DVec3::ONE))
            })
            .collect();

        let mut luminance = plane(0);
        for y in &mut luminance.values {
            *y = (*y + 16.0) / 116.0;
        }
        let [blur, slope, curvature] = feature_kernels();
        let magnitude = |kernel: &[f64]| -> Vec<f64> {
            let along_x = luminance.filtered(kernel, &blur);
            let along_y = luminance.filtered(&blur, kernel);
            along_x
                .iter()
                .zip(&along_y)
                .map(|(x, y)| x.hypot(*y))
                .collect()
        };
        Self {
            lab,
            edges: magnitude(&slope),
            points: magnitude(&curvature),
        }
    }
}

struct Plane {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Plane {
    /// Separable correlation with odd kernels; the border repeats.
    fn filtered(&self, along_x: &[f64], along_y: &[f64]) -> Vec<f64> {
        let (width, height) = (self.width, self.height);
        let at = |centre: usize, tap: usize, taps: usize, size: usize| {
            (centre + tap).saturating_sub(taps / 2).min(size - 1)
        };
        let mut rows = vec![0.0; self.values.len()];
        rows.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            let row = &self.values[y * width..(y + 1) * width];
            for (x, out) in out.iter_mut().enumerate() {
                *out = (along_x.iter().enumerate())
                    .map(|(k, w)| w * row[at(x, k, along_x.len(), width)])
                    .sum();
            }
        });
        let mut result = vec![0.0; self.values.len()];
        result
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(y, out)| {
                for (k, w) in along_y.iter().enumerate() {
                    let row = at(y, k, along_y.len(), height) * width;
                    for (x, out) in out.iter_mut().enumerate() {
                        *out += w * rows[row + x];
                    }
                }
            });
        result
    }
}

/// Weight a and width b of a Gaussian a * sqrt(pi / b) * exp(-pi^2 x^2 / b), x in degrees; two for each channel.
type Csf = [(f64, f64); 2];

/// Achromatic, red-green, blue-yellow (table 1 of the paper).
const CSF: [Csf; 3] = [
    [(1.0, 0.0047), (0.0, 1e-5)],
    [(1.0, 0.0053), (0.0, 1e-5)],
    [(34.1, 0.04), (13.5, 0.025)],
];

fn contrast_sensitivity(plane: &Plane, csf: &Csf) -> Vec<f64> {
    let widest = CSF.iter().flatten().map(|&(_, b)| b).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let mut result = vec![0.0; plane.values.len()];
    let mut total = 0.0;
    for &(a, b) in csf.iter().filter(|&&(a, _)| a > 0.0) {
        let kernel: Vec<f64> = (-radius..=radius)
            .map(|x| (-(PI * f64::from(x) / PIXELS_PER_DEGREE).powi(2) / b).exp())
            .collect();
        let peak = a * (PI / b).sqrt();
        // A product of two 1-D sums: the kernel is a Gaussian in x times one in y.
        total += peak * kernel.iter().sum::<f64>().powi(2);
        for (out, value) in result.iter_mut().zip(plane.filtered(&kernel, &kernel)) {
            *out += peak * value;
        }
    }
    for value in &mut result {
        *value /= total;
    }
    result
}

/// Gaussian, its first and its second derivative; positive weights sum to 1 and negative ones to -1.
fn feature_kernels() -> [Vec<f64>; 3] {
    const WIDTH_DEG: f64 = 0.082;
    let sigma = 0.5 * WIDTH_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let kernel = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let weights: Vec<f64> = (-radius..=radius)
            .map(|x| {
                let x = f64::from(x);
                f(x) * (-x * x / (2.0 * sigma * sigma)).exp()
            })
            .collect();
        let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
        weights
            .iter()
            .map(|&w| {
                w / if w > 0.0 {
                    positive
                } else {
                    negative.max(f64::MIN_POSITIVE)
                }
            })
            .collect()
    };
    [
        kernel(&|_| 1.0),
        kernel(&|x| -x),
        kernel(&|x| x * x / (sigma * sigma) - 1.0),
    ]
}

/// Colour spaces under D65, and the colour difference's scale.
struct Colour {
    xyz_from_linear: DMat3,
    linear_from_xyz: DMat3,
    white: DVec3,
    /// Compressed difference of the farthest two colours of the sRGB gamut, green and blue.
    largest: f64,
}

/// Exponent that compresses large colour differences.
const Q_C: f64 = 0.7;
/// The differences below `P_C` of the largest are stretched over the errors below `P_T`.
const P_C: f64 = 0.4;
const P_T: f64 = 0.95;

impl Colour {
    fn new() -> Self {
        // sRGB primaries and D65 (IEC 61966-2-1), in exact form.
        let xyz_from_linear = DMat3::from_cols(
            DVec3::new(
                10_135_552.0 / 24_577_794.0,
                2_613_072.0 / 12_288_897.0,
                1_425_312.0 / 73_733_382.0,
            ),
            DVec3::new(
                8_788_810.0 / 24_577_794.0,
                8_788_810.0 / 12_288_897.0,
                8_788_810.0 / 73_733_382.0,
            ),
            DVec3::new(
                4_435_075.0 / 24_577_794.0,
                887_015.0 / 12_288_897.0,
                70_074_185.0 / 73_733_382.0,
            ),
        );
        let mut colour = Self {
            xyz_from_linear,
            linear_from_xyz: xyz_from_linear.inverse(),
            white: xyz_from_linear * DVec3::ONE,
            largest: 0.0,
        };
        colour.largest = hyab(colour.hunt_lab(DVec3::Y), colour.hunt_lab(DVec3::Z)).powf(Q_C);
        colour
    }

    /// YCxCz, the linearised L*a*b*.
    fn opponent_from_linear(&self, linear: DVec3) -> DVec3 {
        let v = self.xyz_from_linear * linear / self.white;
        DVec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
    }

    fn linear_from_opponent(&self, opponent: DVec3) -> DVec3 {
        let y = (opponent.x + 16.0) / 116.0;
        let v = DVec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0);
        self.linear_from_xyz * (v * self.white)
    }

    /// CIE L*a*b* with a* and b* scaled by 0.01 L* (the Hunt effect: colours look weaker in the dark).
    fn hunt_lab(&self, linear: DVec3) -> DVec3 {
        const DELTA: f64 = 6.0 / 29.0;
        let f = |t: f64| {
            if t > DELTA.powi(3) {
                t.cbrt()
            } else {
                t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
            }
        };
        let v = self.xyz_from_linear * linear / self.white;
        let (x, y, z) = (f(v.x), f(v.y), f(v.z));
        let lightness = 116.0 * y - 16.0;
        let chroma = 0.01 * lightness;
        DVec3::new(
            lightness,
            chroma * 500.0 * (x - y),
            chroma * 200.0 * (y - z),
        )
    }

    /// 0..1.
    fn difference(&self, a: DVec3, b: DVec3) -> f64 {
        let difference = hyab(a, b).powf(Q_C);
        let knee = P_C * self.largest;
        if difference < knee {
            difference * P_T / knee
        } else {
            P_T + (difference - knee) / (self.largest - knee) * (1.0 - P_T)
        }
    }
}

/// City-block distance in lightness plus Euclidean distance in chroma.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

#[cfg(test)]
mod tests;
