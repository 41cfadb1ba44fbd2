//! A filter that gives white noise a measured autocorrelation.

use crate::shared::shared;
use crate::stages::settings::{Autocorrelation, LAGS};

shared! {
    /// 7 x 7 weights.
    pub const KERNEL_SIDE: usize = 2 * LAGS + 1;
}

pub type Kernel = [[f64; KERNEL_SIDE]; KERNEL_SIDE];

/// Free weights: the centre and one of each pair of opposite ones.
const FREE: usize = KERNEL_SIDE * KERNEL_SIDE / 2 + 1;
/// Samples of the spectrum along each axis.
const SPECTRUM: usize = 16;
/// What lags beyond the measured ones count against those, which should be met: they should be small.
const OUTER_WEIGHT: f64 = 0.3;
const STEPS: usize = 60;

/// Point-symmetric kernel of unit energy whose autocorrelation is nearest to `lags` in the least squares sense.
///
/// It begins with the square root of the spectrum, cut to 7 x 7, and is refined by Levenberg's method.
pub fn fit_kernel(lags: &Autocorrelation) -> Kernel {
    let mut kernel = spectral_root(lags);
    let mut damping = 1e-2;
    let mut residuals = Residuals::of(&kernel, lags);
    for _ in 0..STEPS {
        let step = residuals.step(&kernel, damping);
        let mut next = kernel;
        for (free, change) in step.into_iter().enumerate() {
            let (dx, dy) = place(free);
            set(&mut next, dx, dy, at(&kernel, dx, dy) + change);
        }
        let next_residuals = Residuals::of(&next, lags);
        if next_residuals.sum() < residuals.sum() {
            let gain = residuals.sum() - next_residuals.sum();
            (kernel, residuals) = (next, next_residuals);
            damping *= 0.3;
            if gain < 1e-10 {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    let energy = overlap(&kernel, &kernel).sqrt();
    kernel.map(|row| row.map(|weight| weight / energy))
}

/// Autocorrelation that a kernel gives to white noise, at the measured lags.
pub fn autocorrelation_of(kernel: &Kernel) -> Autocorrelation {
    let mut out = [[0.0; KERNEL_SIDE]; LAGS + 1];
    for (dy, row) in out.iter_mut().enumerate() {
        for (column, value) in row.iter_mut().enumerate() {
            *value = shifted(kernel, column as isize - LAGS as isize, dy as isize);
        }
    }
    out
}

/// Sum of products of two kernels.
pub fn overlap(a: &Kernel, b: &Kernel) -> f64 {
    let products = a.as_flattened().iter().zip(b.as_flattened());
    products.map(|(a, b)| a * b).sum()
}

const REACH: isize = LAGS as isize;

/// The weight at an offset from the centre, 0 beyond the kernel.
fn at(kernel: &Kernel, dx: isize, dy: isize) -> f64 {
    if dx.abs() > REACH || dy.abs() > REACH {
        return 0.0;
    }
    kernel[(dy + REACH) as usize][(dx + REACH) as usize]
}

/// Sets a weight and its opposite.
fn set(kernel: &mut Kernel, dx: isize, dy: isize, value: f64) {
    kernel[(REACH + dy) as usize][(REACH + dx) as usize] = value;
    kernel[(REACH - dy) as usize][(REACH - dx) as usize] = value;
}

/// Offset of a free weight, in row order from the centre.
fn place(free: usize) -> (isize, isize) {
    let index = KERNEL_SIDE * KERNEL_SIDE / 2 + free;
    (
        (index % KERNEL_SIDE) as isize - REACH,
        (index / KERNEL_SIDE) as isize - REACH,
    )
}

fn shifted(kernel: &Kernel, dx: isize, dy: isize) -> f64 {
    let mut sum = 0.0;
    for y in -REACH..=REACH {
        for x in -REACH..=REACH {
            sum += at(kernel, x, y) * at(kernel, x + dx, y + dy);
        }
    }
    sum
}

fn spectral_root(lags: &Autocorrelation) -> Kernel {
    let angle = |u: usize, v: usize, x: isize, y: isize| {
        (u as f64 * x as f64 + v as f64 * y as f64) * std::f64::consts::TAU / SPECTRUM as f64
    };
    let mut kernel = [[0.0; KERNEL_SIDE]; KERNEL_SIDE];
    for u in 0..SPECTRUM {
        for v in 0..SPECTRUM {
            let mut power = 0.0;
            for (dy, row) in lags.iter().enumerate() {
                for (column, rho) in row.iter().enumerate() {
                    let twice = if dy == 0 { 1.0 } else { 2.0 };
                    let dx = column as isize - REACH;
                    power += twice * rho * angle(u, v, dx, dy as isize).cos();
                }
            }
            let amplitude = power.max(0.0).sqrt() / (SPECTRUM * SPECTRUM) as f64;
            for y in -REACH..=REACH {
                for x in -REACH..=REACH {
                    kernel[(y + REACH) as usize][(x + REACH) as usize] +=
                        amplitude * angle(u, v, x, y).cos();
                }
            }
        }
    }
    kernel
}

/// Weighted differences between a kernel's autocorrelation and the wanted one, over the half plane.
struct Residuals {
    lags: Vec<(isize, isize, f64)>,
    values: Vec<f64>,
}

impl Residuals {
    fn of(kernel: &Kernel, wanted: &Autocorrelation) -> Self {
        let mut lags = Vec::new();
        let mut values = Vec::new();
        for dy in 0..=2 * REACH {
            for dx in -2 * REACH..=2 * REACH {
                if dy == 0 && dx < 0 {
                    continue;
                }
                let measured = dx.abs() <= REACH && dy <= REACH;
                let (weight, rho) = if measured {
                    (1.0, wanted[dy as usize][(dx + REACH) as usize])
                } else {
                    (OUTER_WEIGHT, 0.0)
                };
                lags.push((dx, dy, weight));
                values.push(weight * (shifted(kernel, dx, dy) - rho));
            }
        }
        Self { lags, values }
    }

    fn sum(&self) -> f64 {
        self.values.iter().map(|r| r * r).sum()
    }

    /// Change of the free weights that minimises the linearised residuals.
    fn step(&self, kernel: &Kernel, damping: f64) -> [f64; FREE] {
        let mut normal = [[0.0; FREE]; FREE];
        let mut right = [0.0; FREE];
        for ((dx, dy, weight), residual) in self.lags.iter().zip(&self.values) {
            let slopes: [f64; FREE] = std::array::from_fn(|free| {
                let (x, y) = place(free);
                let one = at(kernel, x + dx, y + dy) + at(kernel, x - dx, y - dy);
                weight * if free == 0 { one } else { 2.0 * one }
            });
            for i in 0..FREE {
                right[i] -= slopes[i] * residual;
                for j in 0..FREE {
                    normal[i][j] += slopes[i] * slopes[j];
                }
            }
        }
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] += damping;
        }
        solve(normal, right)
    }
}

/// Gaussian elimination; the matrix is positive definite, so no pivot vanishes.
fn solve(mut matrix: [[f64; FREE]; FREE], mut right: [f64; FREE]) -> [f64; FREE] {
    for i in 0..FREE {
        for j in i + 1..FREE {
            let (upper, lower) = matrix.split_at_mut(j);
            let (pivot, row) = (&upper[i], &mut lower[0]);
            let factor = row[i] / pivot[i];
            for (value, pivot) in row.iter_mut().zip(pivot).skip(i) {
                *value -= factor * pivot;
            }
            right[j] -= factor * right[i];
        }
    }
    for i in (0..FREE).rev() {
        for k in i + 1..FREE {
            right[i] -= matrix[i][k] * right[k];
        }
        right[i] /= matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests;
