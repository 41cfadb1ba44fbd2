//! Normal deviates for every pixel of every frame, drawn by hash and correlated as the camera's noise is. Twin of
//! `shaders/stages/noise/field.wgsl`.

use std::ops::Range;

use super::kernel::{KERNEL_SIDE, fit_kernel, overlap};
use crate::math::{hash_combine, log_, sincos_2pi, uniform_from_bits};
use crate::shared::shared;
use crate::stages::settings::{LAGS, NoiseProfile};

shared! {
    /// Coordinates are shifted by this before they are hashed: pixels beyond the left and top borders have numbers too.
    const MARGIN: u32 = 16;
}

/// Correlations below this are not worth a convolution.
const WHITE_ENOUGH: f64 = 0.01;

/// Unit variance in every channel.
#[derive(Clone, Debug)]
pub struct NoiseField {
    /// By channel, 7 x 7 weights whose squares add up to 1; empty if the noise is white.
    pub kernels: Vec<[[f32; KERNEL_SIDE]; KERNEL_SIDE]>,
    /// Channel from independent deviates: lower triangular, rows of unit length.
    pub mix: [[f32; 3]; 3],
    pub seed: u32,
}

impl NoiseField {
    /// With the correlation of `profile`.
    pub fn of(profile: &NoiseProfile, seed: u32) -> Self {
        let white = profile.autocorrelation.iter().all(|lags| {
            let lags = lags.as_flattened().iter().enumerate();
            lags.filter(|(i, _)| *i != LAGS)
                .all(|(_, rho)| rho.abs() < WHITE_ENOUGH)
        });
        let kernels: Vec<_> = if white {
            Vec::new()
        } else {
            profile.autocorrelation.iter().map(fit_kernel).collect()
        };
        // Different kernels lower the correlation between channels: the deviates need more of it.
        let mut wanted = [[1.0; 3]; 3];
        for ((a, b), rho) in [(0, 1), (0, 2), (1, 2)]
            .into_iter()
            .zip(profile.channel_correlation)
        {
            let shared = match kernels.as_slice() {
                [] => 1.0,
                kernels => overlap(&kernels[a], &kernels[b]).max(0.1),
            };
            wanted[a][b] = (rho / shared).clamp(-1.0, 1.0);
            wanted[b][a] = wanted[a][b];
        }
        Self {
            kernels: kernels
                .iter()
                .map(|kernel| kernel.map(|row| row.map(|weight| weight as f32)))
                .collect(),
            mix: cholesky(wanted).map(|row| row.map(|weight| weight as f32)),
            seed,
        }
    }

    /// How far a pixel's deviate depends on others', pixels.
    fn reach(&self) -> usize {
        if self.kernels.is_empty() { 0 } else { LAGS }
    }

    fn mixed(&self, frame: u32, x: u32, y: u32) -> [f32; 3] {
        let white = white_deviates(self.seed, frame, x, y);
        self.mix
            .map(|row| row[0] * white[0] + row[1] * white[1] + row[2] * white[2])
    }
}

/// The deviates of some rows and columns of one frame. The white noise behind them is drawn once for all rows.
pub struct FieldBand<'a> {
    field: &'a NoiseField,
    columns: Range<usize>,
    first_row: usize,
    /// Rows of the white noise, by channel, from `first_row` less the kernel's reach on, each wider by the reach on both sides.
    white: Vec<[Vec<f32>; 3]>,
}

impl<'a> FieldBand<'a> {
    pub fn new(
        field: &'a NoiseField,
        frame: u32,
        columns: Range<usize>,
        rows: Range<usize>,
    ) -> Self {
        let reach = field.reach();
        let wide = columns.len() + 2 * reach;
        let white = (0..rows.len() + 2 * reach)
            .map(|row| {
                let mut planes: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; wide]);
                let y = (rows.start + row) as u32 + MARGIN - reach as u32;
                for i in 0..wide {
                    let x = (columns.start + i) as u32 + MARGIN - reach as u32;
                    for (plane, mixed) in planes.iter_mut().zip(field.mixed(frame, x, y)) {
                        plane[i] = mixed;
                    }
                }
                planes
            })
            .collect();
        Self {
            field,
            columns,
            first_row: rows.start,
            white,
        }
    }

    /// Row `y` of the deviates, by channel, correlated by the kernels.
    pub fn correlated(&self, y: usize) -> [Vec<f32>; 3] {
        let first = y - self.first_row;
        if self.field.kernels.is_empty() {
            return self.white[first].clone();
        }
        let mut out: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; self.columns.len()]);
        for (dy, planes) in self.white[first..][..KERNEL_SIDE].iter().enumerate() {
            for ((out, white), kernel) in out.iter_mut().zip(planes).zip(&self.field.kernels) {
                for (dx, weight) in kernel[dy].iter().enumerate() {
                    for (out, white) in out.iter_mut().zip(&white[dx..]) {
                        *out += weight * white;
                    }
                }
            }
        }
        out
    }
}

/// Three independent normal deviates of a place (Box and Muller).
pub fn white_deviates(seed: u32, frame: u32, x: u32, y: u32) -> [f32; 3] {
    let key = hash_combine(hash_combine(hash_combine(seed, frame), y), x);
    let first = box_muller(hash_combine(key, 0), hash_combine(key, 1));
    let second = box_muller(hash_combine(key, 2), hash_combine(key, 3));
    [first.0, first.1, second.0]
}

fn box_muller(bits_a: u32, bits_b: u32) -> (f32, f32) {
    // In (0, 1]: the logarithm of 0 is no number.
    let u = 1.0 - uniform_from_bits(bits_a);
    let radius = (-2.0 * log_(u)).max(0.0).sqrt();
    let (sin, cos) = sincos_2pi(uniform_from_bits(bits_b));
    (radius * cos, radius * sin)
}

/// Lower triangular square root with rows of unit length, also of a matrix that is a correlation matrix only nearly.
fn cholesky(matrix: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut root = [[0.0f64; 3]; 3];
    for i in 0..3 {
        for j in 0..i {
            let inner: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            if root[j][j] > 1e-6 {
                root[i][j] = (matrix[i][j] - inner) / root[j][j];
            }
        }
        let length2: f64 = root[i][..i].iter().map(|x| x * x).sum();
        if length2 > 1.0 {
            let length = length2.sqrt();
            root[i][..i].iter_mut().for_each(|x| *x /= length);
        }
        root[i][i] = (1.0 - length2).max(0.0).sqrt();
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviates_are_normal_and_independent() {
        let n = 200_000;
        let deviates: Vec<[f32; 3]> = (0..n)
            .map(|i| white_deviates(7, 3, i % 640, i / 640))
            .collect();
        let mean =
            |f: &dyn Fn(&[f32; 3]) -> f64| deviates.iter().map(f).sum::<f64>() / f64::from(n);
        for c in 0..3 {
            let x = |d: &[f32; 3]| f64::from(d[c]);
            assert!(mean(&x).abs() < 0.01);
            assert!((mean(&|d| x(d).powi(2)) - 1.0).abs() < 0.02);
            assert!((mean(&|d| x(d).powi(4)) - 3.0).abs() < 0.15);
            let beyond = mean(&|d| f64::from(u8::from(x(d) > 1.96)));
            assert!((beyond - 0.025).abs() < 0.002, "{beyond}");
            let other = |d: &[f32; 3]| f64::from(d[(c + 1) % 3]);
            assert!(mean(&|d| x(d) * other(d)).abs() < 0.01);
        }
        let next: f64 = deviates
            .windows(2)
            .map(|w| f64::from(w[0][0] * w[1][0]))
            .sum::<f64>()
            / f64::from(n);
        assert!(next.abs() < 0.01);
        assert_ne!(white_deviates(7, 3, 5, 5), white_deviates(7, 4, 5, 5));
        assert_ne!(white_deviates(7, 3, 5, 5), white_deviates(8, 3, 5, 5));
    }

    #[test]
    fn the_root_of_a_correlation_matrix_gives_it_back() {
        let matrix = [[1.0, 0.6, 0.3], [0.6, 1.0, -0.2], [0.3, -0.2, 1.0]];
        let root = cholesky(matrix);
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = (0..3).map(|k| root[i][k] * root[j][k]).sum();
                assert!((product - matrix[i][j]).abs() < 1e-12);
            }
        }
        // Grey: all channels are one.
        assert_eq!(cholesky([[1.0; 3]; 3]), [[1.0, 0.0, 0.0]; 3]);
        // No correlation matrix: rows still have unit length.
        let bad = cholesky([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]]);
        for row in bad {
            assert!((row.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
