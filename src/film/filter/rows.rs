//! The filter's sums over neighbours, row by row and without branches, which a compiler turns into vector instructions.

use glam::Vec3;
use rayon::prelude::*;

use super::{Light, RealSurface, plane_exponent_per_m, same_way};
use crate::math::luminance;

/// By distance from the middle, in taps.
const KERNEL: [f32; 2] = [1.0 / 2.0, 1.0 / 4.0];
/// Rows and columns off a pixel's own, of the pixels whose values tell its variance.
const NEAR: isize = 2;
/// Standard deviations of brightness at which a tap has fallen to 1/e.
const DEVIATIONS: f32 = 3.0;
/// A tap that has fallen to less than exp of this counts for nothing.
const LEAST_EXPONENT: f32 = -12.0;
/// Columns on either side of the picture that hold zeros: no tap is farther away.
const MARGIN: usize = 16;
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Pictures of N numbers a pixel: a row of the first, of the second and so on, then the next row.
struct Planes<const N: usize> {
    width: usize,
    numbers: Vec<f32>,
}

impl<const N: usize> Planes<N> {
    fn zero(width: usize, height: usize) -> Self {
        let mut planes = Self {
            width,
            numbers: Vec::new(),
        };
        planes.numbers = vec![0.0; N * planes.pitch() * height];
        planes
    }

    /// The columns that are worked on, zeros at the right end among them.
    fn columns(&self) -> usize {
        self.width.next_multiple_of(LANES)
    }

    fn pitch(&self) -> usize {
        self.columns() + 2 * MARGIN
    }

    fn height(&self) -> usize {
        self.numbers.len() / (N * self.pitch())
    }

    /// A row as it looks from `dx` columns further left.
    fn row(&self, y: usize, dx: isize) -> [&[f32]; N] {
        let pitch = self.pitch();
        let begin = MARGIN.saturating_add_signed(dx);
        std::array::from_fn(|plane| {
            &self.numbers[(N * y + plane) * pitch + begin..][..self.columns()]
        })
    }

    fn for_each_row(&mut self, f: impl Fn(usize, [&mut [f32]; N]) + Sync) {
        let (pitch, columns) = (self.pitch(), self.columns());
        let rows = self.numbers.par_chunks_exact_mut(N * pitch).enumerate();
        rows.for_each(|(y, row)| {
            let mut planes = row.chunks_exact_mut(pitch);
            let mut next = || &mut planes.next().expect("there are N")[MARGIN..][..columns];
            f(y, std::array::from_fn(|_| next()));
        });
    }

    /// The row `dy` further down, if it lies on the picture.
    fn below(&self, y: usize, dy: isize) -> Option<usize> {
        y.checked_add_signed(dy).filter(|&y| y < self.height())
    }
}

/// What each level of the wavelet makes of the pixels: red, green and blue light, its brightness, and the brightness's variance.
pub(super) struct Values(Planes<5>);

impl Values {
    /// Over the albedo.
    pub fn light(&self, pixel: usize) -> Vec3 {
        let (x, y) = (pixel % self.0.width, pixel / self.0.width);
        let [r, g, b, ..] = self.0.row(y, 0).map(|row| row[x]);
        Vec3::new(r, g, b)
    }
}

/// The surfaces of the pixels: normal, position, and what a metre off the plane counts for; all 0 where nothing is filtered.
pub(super) struct Canvas(Planes<7>);

impl Canvas {
    pub fn new(width: usize, surfaces: &[Option<RealSurface>]) -> Self {
        let mut planes = Planes::zero(width, surfaces.len() / width.max(1));
        planes.for_each_row(|y, mut row| {
            for (x, surface) in surfaces[y * width..][..width].iter().enumerate() {
                let Some(surface) = surface else {
                    continue;
                };
                let [nx, ny, nz] = surface.normal.to_array();
                let [px, py, pz] = surface.position.to_array();
                let per_m = plane_exponent_per_m(surface.depth_m);
                for (plane, number) in row.iter_mut().zip([nx, ny, nz, px, py, pz, per_m]) {
                    plane[x] = number;
                }
            }
        });
        Self(planes)
    }

    /// What the wavelet begins with, from a light a pixel.
    pub fn values(&self, lights: &[Light]) -> Values {
        let width = self.0.width;
        let variance = self.variance(lights);
        let mut values = Planes::zero(width, self.0.height());
        values.for_each_row(|y, [r, g, b, brightness, blurred]| {
            for (x, light) in lights[y * width..][..width].iter().enumerate() {
                [r[x], g[x], b[x]] = light.mean.to_array();
                brightness[x] = luminance(light.mean);
            }
            self.blur(y, &variance, blurred);
        });
        Values(values)
    }

    /// Of each pixel's brightness: the neighbourhood's mean of what samples tell, or its spread where they are too few.
    fn variance(&self, lights: &[Light]) -> Planes<1> {
        let (width, height) = (self.0.width, self.0.height());
        // Brightness, its square, and where samples tell their variance 1 and that.
        let mut told = Planes::<4>::zero(width, height);
        told.for_each_row(|y, [brightness, square, tells, variance]| {
            for (x, light) in lights[y * width..][..width].iter().enumerate() {
                brightness[x] = luminance(light.mean);
                square[x] = brightness[x] * brightness[x];
                if let Some(own) = light.variance {
                    (tells[x], variance[x]) = (1.0, own);
                }
            }
        });
        let mut planes = Planes::zero(width, height);
        planes.for_each_row(|y, [out]| {
            let mut weights = vec![0.0; out.len()];
            let mut sums = [const { Vec::new() }; 5].map(|_: Vec<f32>| weights.clone());
            for other in [-NEAR, 0, NEAR]
                .iter()
                .filter_map(|&dy| self.0.below(y, dy))
            {
                for dx in [-NEAR, 0, NEAR] {
                    same_surface(&mut weights, self.0.row(y, 0), self.0.row(other, dx));
                    let [all, of_told @ ..] = &mut sums;
                    add(all, &weights);
                    for (sum, values) in of_told.iter_mut().zip(told.row(other, dx)) {
                        add_product(sum, &weights, values);
                    }
                }
            }
            let [weights, brightness, squares, tell, variance] = &sums;
            for (x, light) in lights[y * width..][..width].iter().enumerate() {
                out[x] = match light.has_enough {
                    true if tell[x] > 0.0 => variance[x] / tell[x],
                    false if weights[x] > 0.0 => {
                        let mean = brightness[x] / weights[x];
                        (squares[x] / weights[x] - mean * mean).max(0.0)
                    }
                    _ => 0.0,
                };
            }
        });
        planes
    }

    /// 3 x 3 binomial over what is filtered, so that one pixel's lucky variance does not shut it off.
    fn blur(&self, y: usize, variance: &Planes<1>, out: &mut [f32]) {
        let mut weights = vec![0.0; out.len()];
        for dy in -1..=1 {
            let Some(other) = self.0.below(y, dy) else {
                continue;
            };
            for dx in -1..=1_isize {
                let weight = 1.0 / (1 << (dx.abs() + dy.abs())) as f32;
                let ([variance], [.., per_m]) = (variance.row(other, dx), self.0.row(other, dx));
                let sums = weights.iter_mut().zip(&mut *out);
                for ((weights, out), (variance, per_m)) in sums.zip(variance.iter().zip(per_m)) {
                    let weight = if *per_m < 0.0 { weight } else { 0.0 };
                    *weights += weight;
                    *out += weight * variance;
                }
            }
        }
        for (out, weight) in out.iter_mut().zip(weights) {
            *out /= weight.max(f32::MIN_POSITIVE);
        }
    }

    /// One level of the wavelet, its taps `step` pixels apart: [`MARGIN`] at most.
    pub fn level(&self, step: usize, values: &Values) -> Values {
        let (values, step) = (&values.0, step as isize);
        let mut out = Planes::zero(values.width, values.height());
        out.for_each_row(|y, [r, g, b, brightness, variance]| {
            let surfaces = self.0.row(y, 0);
            let [own_r, own_g, own_b, own_brightness, own_variance] = values.row(y, 0);
            let per_deviation: Vec<f32> = (own_variance.iter())
                .map(|variance| 1.0 / (DEVIATIONS * variance.sqrt() + 1e-6))
                .collect();
            let mut weights = vec![KERNEL[0] * KERNEL[0]; r.len()];
            let mut squares = vec![KERNEL[0].powi(4); r.len()];
            let mut all = weights.clone();
            for (sum, own) in [&mut *r, g, b].into_iter().zip([own_r, own_g, own_b]) {
                add_product(sum, &weights, own);
            }
            add_product(variance, &squares, own_variance);
            for dy in -1..=1_isize {
                let Some(other) = self.0.below(y, dy * step) else {
                    continue;
                };
                for dx in -1..=1_isize {
                    if (dx, dy) == (0, 0) {
                        continue;
                    }
                    let kernel: f32 = [dx, dy].map(|d| KERNEL[d.unsigned_abs()]).iter().product();
                    let there = values.row(other, dx * step);
                    tap(
                        &mut weights,
                        kernel,
                        surfaces,
                        self.0.row(other, dx * step),
                        [own_brightness, there[3], &per_deviation],
                    );
                    for (square, weight) in squares.iter_mut().zip(&weights) {
                        *square = weight * weight;
                    }
                    add(&mut all, &weights);
                    for (sum, values) in [&mut *r, g, b].into_iter().zip(there) {
                        add_product(sum, &weights, values);
                    }
                    add_product(variance, &squares, there[4]);
                }
            }
            for (x, weight) in all.iter().enumerate() {
                [r[x], g[x], b[x]] = [r[x], g[x], b[x]].map(|sum| sum / weight);
                variance[x] /= weight * weight;
                brightness[x] = luminance(Vec3::new(r[x], g[x], b[x]));
            }
        });
        Values(out)
    }
}

fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

fn add_product(sums: &mut [f32], weights: &[f32], values: &[f32]) {
    for (sum, (weight, value)) in sums.iter_mut().zip(weights.iter().zip(values)) {
        *sum += weight * value;
    }
}

/// 1 where pixels lie on one plane and face the same way, towards 0 elsewhere.
fn same_surface(out: &mut [f32], a: [&[f32]; 7], b: [&[f32]; 7]) {
    let (out, _) = out.as_chunks_mut::<LANES>();
    let (a, b) = (lanes(a, out.len()), lanes(b, out.len()));
    for (chunk, out) in out.iter_mut().enumerate() {
        let (cos, exponent) = alike(a.map(|row| &row[chunk]), b.map(|row| &row[chunk]));
        for lane in 0..LANES {
            out[lane] = same_way(cos[lane]) * exp_of_negative(exponent[lane]);
        }
    }
}

/// The weight of a tap: as far as it lies on the same surface, and its brightness no farther off than noise. `light`: brightness here and there, and
/// what a difference counts for.
fn tap(out: &mut [f32], kernel: f32, a: [&[f32]; 7], b: [&[f32]; 7], light: [&[f32]; 3]) {
    let (out, _) = out.as_chunks_mut::<LANES>();
    let (a, b, light) = (
        lanes(a, out.len()),
        lanes(b, out.len()),
        lanes(light, out.len()),
    );
    for (chunk, out) in out.iter_mut().enumerate() {
        let (cos, off_plane) = alike(a.map(|row| &row[chunk]), b.map(|row| &row[chunk]));
        let [here, there, per_deviation] = light.map(|row| &row[chunk]);
        for lane in 0..LANES {
            let exponent = off_plane[lane] - (there[lane] - here[lane]).abs() * per_deviation[lane];
            let weight = kernel * same_way(cos[lane]) * exp_of_negative(exponent);
            // A mask, where a choice would become a branch.
            let kept = 0_u32.wrapping_sub(u32::from(exponent >= LEAST_EXPONENT));
            out[lane] = f32::from_bits(weight.to_bits() & kept);
        }
    }
}

fn lanes<const N: usize>(rows: [&[f32]; N], count: usize) -> [&[Lanes]; N] {
    rows.map(|row| &row.as_chunks::<LANES>().0[..count])
}

/// The cosine between the normals, and what the distance from the first one's plane counts for.
#[inline(always)]
fn alike(a: [&Lanes; 7], b: [&Lanes; 7]) -> (Lanes, Lanes) {
    let (mut cos, mut exponent) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        cos[i] = a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i];
        let off_plane_m = a[0][i] * (b[3][i] - a[3][i])
            + a[1][i] * (b[4][i] - a[4][i])
            + a[2][i] * (b[5][i] - a[5][i]);
        exponent[i] = off_plane_m.abs() * a[6][i];
    }
    (cos, exponent)
}

/// e^x for x of at most 0, no less than e^-87; relative error below 1e-5. [`crate::math::exp_`] without its branches.
#[inline(always)]
fn exp_of_negative(x: f32) -> f32 {
    use std::f32::consts::{LN_2, LOG2_E};
    /// Added to a number, it leaves the nearest whole one in the last bits.
    const TO_WHOLE: f32 = 12_582_912.0;
    let x = x.max(-87.0);
    let shifted = x * LOG2_E + TO_WHOLE;
    let r = x - (shifted - TO_WHOLE) * LN_2;
    let p = (((0.001_381_459_7 * r + 0.008_368_729) * r + 0.041_668_39) * r + 0.166_665_21) * r
        + 0.499_999_94;
    let power_of_two = (shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits());
    ((p * r + 1.0) * r + 1.0) * f32::from_bits(power_of_two)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_right() {
        for i in 0..87_000 {
            let x = -0.001 * i as f32;
            let ratio = f64::from(exp_of_negative(x)) / f64::from(x).exp();
            assert!((ratio - 1.0).abs() < 1e-5, "{x}: {ratio}");
        }
        assert!(exp_of_negative(-1e6) < 2e-38, "control");
    }

    /// A bent surface with holes, and light on it.
    fn scene(width: usize, height: usize) -> (Vec<Option<RealSurface>>, Vec<Light>) {
        let surface = |pixel: usize| RealSurface {
            position: Vec3::new(
                (pixel % width) as f32,
                (pixel / width) as f32,
                0.01 * pixel as f32,
            ),
            depth_m: 20.0 + pixel as f32,
            normal: Vec3::new(0.1, 0.02 * (pixel % 5) as f32, 1.0).normalize(),
            albedo: Vec3::ONE,
        };
        let surfaces: Vec<_> = (0..width * height)
            .map(|pixel| (pixel % 11 != 3).then(|| surface(pixel)))
            .collect();
        let lights: Vec<_> = (surfaces.iter().enumerate())
            .map(|(pixel, surface)| Light {
                mean: surface.map_or(Vec3::ZERO, |_| Vec3::splat((pixel * 7 % 10) as f32)),
                ..Light::default()
            })
            .collect();
        (surfaces, lights)
    }

    /// A level over rows is that over pixels one by one. Control: the light before.
    #[test]
    fn taps_are_those_of_each_pixel_alone() {
        let (width, height) = (21, 7);
        let (surfaces, lights) = scene(width, height);
        let canvas = Canvas::new(width, &surfaces);
        let before = canvas.values(&lights);
        let of = |pixel: usize| before.0.row(pixel / width, 0).map(|row| row[pixel % width]);
        for step in [1, 2, 16] {
            let after = canvas.level(step as usize, &before);
            let mut changed = 0;
            for (pixel, surface) in surfaces.iter().enumerate() {
                let Some(a) = surface else {
                    continue;
                };
                let (x, y) = (pixel % width, pixel / width);
                let [here, _, _, brightness, variance] = of(pixel);
                let (mut weights, mut sum) = (0.25, 0.25 * here);
                for (dx, dy) in (0..9).map(|i| (i % 3 - 1, i / 3 - 1)) {
                    let x = x.wrapping_add_signed(dx * step);
                    let y = y.wrapping_add_signed(dy * step);
                    let other = (x < width && y < height).then(|| y * width + x);
                    let known = other.and_then(|at| Some((at, surfaces[at]?)));
                    let Some((at, b)) = known.filter(|_| (dx, dy) != (0, 0)) else {
                        continue;
                    };
                    let [there, _, _, other_brightness, _] = of(at);
                    let off =
                        (other_brightness - brightness).abs() / (3.0 * variance.sqrt() + 1e-6);
                    let kernel = 0.5_f32.powi(2 + (dx.abs() + dy.abs()) as i32);
                    let weight = kernel * super::super::same_surface(a, &b) * (-off).exp();
                    weights += weight;
                    sum += weight * there;
                }
                let found = after.light(pixel).x;
                assert!(
                    (found - sum / weights).abs() < 1e-3,
                    "{step}: {x} {y}: {found}"
                );
                changed += usize::from((found - here).abs() > 0.1);
            }
            assert!(changed > 10, "control: {step}: {changed}");
        }
    }

    /// Sums over rows are those over pixels one by one. Control: there is a spread wherever there is a surface.
    #[test]
    fn variance_is_that_of_each_pixel_alone() {
        let (width, height) = (13, 6);
        let (surfaces, lights) = scene(width, height);
        let canvas = Canvas::new(width, &surfaces);
        let variance = canvas.variance(&lights);
        for (pixel, surface) in surfaces.iter().enumerate() {
            let (x, y) = (pixel % width, pixel / width);
            let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
            for dy in [-NEAR, 0, NEAR] {
                for dx in [-NEAR, 0, NEAR] {
                    let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                    let inside = x < width && y < height;
                    let other = inside.then(|| y * width + x);
                    let Some((a, b)) = surface.zip(other.and_then(|other| surfaces[other])) else {
                        continue;
                    };
                    let weight = super::super::same_surface(&a, &b);
                    let value = luminance(lights[y * width + x].mean);
                    weights += weight;
                    sum += weight * value;
                    squares += weight * value * value;
                }
            }
            let wanted = match weights > 0.0 {
                true => squares / weights - (sum / weights) * (sum / weights),
                false => 0.0,
            };
            let found = variance.row(y, 0)[0][x];
            assert!(
                (found - wanted).abs() < 1e-3 * wanted.max(1.0),
                "{x} {y}: {found} {wanted}"
            );
            assert!(surface.is_none() || found > 0.1, "control: {found}");
        }
    }
}
