//! Lines that follow contours: the flow-guided difference of Gaussians.
//!
//! H. Kang, S. Lee, C. K. Chui: Coherent Line Drawing (2007), with the contour directions from the smoothed structure tensor (J. E.
//! Kyprianidis, J. Doellner: Image Abstraction by Structure Adaptive Filtering, 2008): across the contour a difference of Gaussians
//! answers below 0 on the dark side of an edge; along the contour the answers are averaged, so that noise does not break a line. Twin of
//! `shaders/stages/cartoon/flow.wgsl`.

use rayon::prelude::*;

use super::FlowSettings;
use super::edges::{smoothstep_, sobel};
use super::planes::{PAD, Planes};

/// Ratio of the outer Gaussian's standard deviation to the inner one's, which makes the difference nearest to a Laplacian.
const OUTER: f32 = 1.6;

/// A plane of the picture's size, borders repeated.
struct Field {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Field {
    fn new(width: usize, height: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let mut values = vec![0.0; width * height];
        values
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(y, row)| {
                for (x, out) in row.iter_mut().enumerate() {
                    *out = value(x, y);
                }
            });
        Self {
            width,
            height,
            values,
        }
    }

    fn at(&self, x: isize, y: isize) -> f32 {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.values[y * self.width + x]
    }

    /// Linear between pixel centres; (0, 0) is the first one's centre.
    fn sample(&self, x: f32, y: f32) -> f32 {
        let x = x.clamp(0.0, (self.width - 1) as f32);
        let y = y.clamp(0.0, (self.height - 1) as f32);
        let (column, row) = (x as isize, y as isize);
        let (fx, fy) = (x - column as f32, y - row as f32);
        let upper = self.at(column, row) + (self.at(column + 1, row) - self.at(column, row)) * fx;
        let lower = self.at(column, row + 1)
            + (self.at(column + 1, row + 1) - self.at(column, row + 1)) * fx;
        upper + (lower - upper) * fy
    }

    /// Convolved with a Gaussian, rows then columns.
    fn blurred(&self, weights: &[f32]) -> Self {
        let along = |dx: isize, dy: isize, field: &Field| {
            Field::new(field.width, field.height, |x, y| {
                let (x, y) = (x as isize, y as isize);
                let mut sum = weights[0] * field.at(x, y);
                for (step, weight) in (1isize..).zip(&weights[1..]) {
                    sum += weight
                        * (field.at(x + step * dx, y + step * dy)
                            + field.at(x - step * dx, y - step * dy));
                }
                sum
            })
        };
        along(0, 1, &along(1, 0, self))
    }
}

/// Weights at 0, 1, 2, ... pixels, to 2.5 standard deviations, so that both sides and the centre add up to 1.
fn half_gaussian(sigma: f32) -> Vec<f32> {
    let radius = (2.5 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=radius)
        .map(|step| (-0.5 * (step as f64 / f64::from(sigma)).powi(2)).exp())
        .collect();
    let sum = 2.0 * weights.iter().sum::<f64>() - weights[0];
    weights.iter().map(|weight| (weight / sum) as f32).collect()
}

/// Half Gaussians of the style: of the tensor, the inner and the outer one across a contour, the one along it.
pub fn flow_weights(settings: &FlowSettings) -> [Vec<f32>; 4] {
    [
        settings.tensor_sigma_px,
        settings.edge_sigma_px,
        OUTER * settings.edge_sigma_px,
        settings.line_sigma_px,
    ]
    .map(half_gaussian)
}

/// How dark a line is at each pixel, 0 to 1, row-major.
pub(super) fn lines(image: &Planes, settings: &FlowSettings) -> Vec<f32> {
    let (width, height) = (image.width, image.height);
    let [tensor, inner, outer, line] = flow_weights(settings);
    let tangents = tangents(image, &tensor);
    let luma = Field::new(width, height, |x, y| image.row(0, y as isize)[PAD + x]);
    let answers = Field::new(width, height, |x, y| {
        across(
            &luma,
            x,
            y,
            tangents.at(x, y),
            [&inner, &outer],
            settings.tau,
        )
    });
    Field::new(width, height, |x, y| {
        let sum = along(&answers, &tangents, x, y, &line);
        smoothstep_(settings.t0, settings.t1, -sum)
    })
    .values
}

/// The difference of Gaussians across the contour of tangent (tx, ty) through a pixel.
fn across(
    luma: &Field,
    x: usize,
    y: usize,
    (tx, ty): (f32, f32),
    [inner, outer]: [&[f32]; 2],
    tau: f32,
) -> f32 {
    let (x, y) = (x as f32, y as f32);
    let mut sum = 0.0;
    for (step, outer) in outer.iter().enumerate() {
        let weight = inner.get(step).copied().unwrap_or(0.0) - tau * outer;
        let s = step as f32;
        let value = luma.sample(x + s * ty, y - s * tx);
        sum += weight
            * if step == 0 {
                value
            } else {
                value + luma.sample(x - s * ty, y + s * tx)
            };
    }
    sum
}

/// The answers across the contour, averaged along it on both sides of a pixel.
fn along(answers: &Field, tangents: &Tangents, x: usize, y: usize, weights: &[f32]) -> f32 {
    let (tx, ty) = tangents.at(x, y);
    let mut sum = weights[0] * answers.values[y * answers.width + x];
    for sign in [1.0, -1.0] {
        let (mut px, mut py) = (x as f32, y as f32);
        let (mut dx, mut dy) = (sign * tx, sign * ty);
        for weight in &weights[1..] {
            px += dx;
            py += dy;
            sum += weight * answers.sample(px, py);
            let (nx, ny) = tangents.nearest(px, py);
            // A contour has no direction of its own: keep going the same way.
            let flip = if nx * dx + ny * dy < 0.0 { -1.0 } else { 1.0 };
            (dx, dy) = (flip * nx, flip * ny);
        }
    }
    sum
}

/// Unit vectors along the contours.
struct Tangents {
    x: Field,
    y: Field,
}

impl Tangents {
    fn at(&self, x: usize, y: usize) -> (f32, f32) {
        let index = y * self.x.width + x;
        (self.x.values[index], self.y.values[index])
    }

    fn nearest(&self, x: f32, y: f32) -> (f32, f32) {
        let x = (x + 0.5).clamp(0.0, (self.x.width - 1) as f32) as usize;
        let y = (y + 0.5).clamp(0.0, (self.x.height - 1) as f32) as usize;
        self.at(x, y)
    }
}

/// From the structure tensor of Y, U and V: its minor eigenvector, along +X where there is no contour.
fn tangents(image: &Planes, weights: &[f32]) -> Tangents {
    let (width, height) = (image.width, image.height);
    let product = |a: usize, b: usize| {
        Field::new(width, height, |x, y| {
            let mut sum = 0.0;
            for plane in 0..3 {
                let rows = [-1, 0, 1].map(|dy| image.row(plane, y as isize + dy));
                let [above, here, below] = rows.map(|row| &row[PAD + x - 1..][..3]);
                let (gx, gy) = sobel(
                    [above[0], above[1], above[2]],
                    [here[0], here[2]],
                    [below[0], below[1], below[2]],
                );
                let gradient = [gx, gy];
                sum += gradient[a] * gradient[b];
            }
            sum
        })
        .blurred(weights)
    };
    let (xx, xy, yy) = (product(0, 0), product(0, 1), product(1, 1));
    let tangent = |x: usize, y: usize| {
        let index = y * width + x;
        minor_eigenvector(xx.values[index], xy.values[index], yy.values[index])
    };
    Tangents {
        x: Field::new(width, height, |x, y| tangent(x, y).0),
        y: Field::new(width, height, |x, y| tangent(x, y).1),
    }
}

/// Unit eigenvector of the smaller eigenvalue of [[xx, xy], [xy, yy]].
fn minor_eigenvector(xx: f32, xy: f32, yy: f32) -> (f32, f32) {
    let difference = xx - yy;
    let root = (difference * difference + 4.0 * xy * xy).sqrt();
    // Of the two equal forms of the vector the one that does not subtract like from like.
    let (x, y) = if difference > 0.0 {
        (-2.0 * xy, difference + root)
    } else {
        (root - difference, -2.0 * xy)
    };
    let length = (x * x + y * y).sqrt();
    if length > 0.0 {
        (x / length, y / length)
    } else {
        (1.0, 0.0)
    }
}
