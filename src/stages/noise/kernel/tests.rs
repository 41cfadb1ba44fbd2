use super::*;
use crate::stages::settings::WHITE;

fn worst(a: &Autocorrelation, b: &Autocorrelation) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn smooth(weights: impl Fn(isize, isize) -> f64) -> Kernel {
    let mut kernel = [[0.0; KERNEL_SIDE]; KERNEL_SIDE];
    for (y, row) in kernel.iter_mut().enumerate() {
        for (x, weight) in row.iter_mut().enumerate() {
            *weight = weights(x as isize - REACH, y as isize - REACH);
        }
    }
    let energy = overlap(&kernel, &kernel).sqrt();
    kernel.map(|row| row.map(|weight| weight / energy))
}

/// What some kernel gave, a kernel is found for: also one that is no symmetric kernel's, and one with long tails.
#[test]
fn the_kernel_gives_the_lags_back() {
    let kernels = [
        smooth(|x, y| {
            if x.abs() <= 1 && y.abs() <= 1 {
                1.0
            } else {
                0.0
            }
        }),
        smooth(|x, y| (-0.5 * (x * x + y * y) as f64).exp()),
        smooth(|x, y| {
            if y == 0 && (0..3).contains(&x) {
                1.0
            } else {
                0.0
            }
        }),
        smooth(|x, y| match (x, y) {
            (0, 0) => 1.0,
            (1, 1) | (-1, -1) => 0.4,
            (1, 0) => -0.2,
            _ => 0.0,
        }),
    ];
    for kernel in kernels {
        let lags = autocorrelation_of(&kernel);
        let fitted = fit_kernel(&lags);
        assert!(
            worst(&autocorrelation_of(&fitted), &lags) < 0.02,
            "{lags:?}"
        );
        assert!((overlap(&fitted, &fitted) - 1.0).abs() < 1e-12);
        assert!(worst(&WHITE, &lags) > 0.1, "control");
    }
}

#[test]
fn white_noise_needs_no_neighbours() {
    let kernel = fit_kernel(&WHITE);
    assert!((at(&kernel, 0, 0).abs() - 1.0).abs() < 1e-6);
    assert!(worst(&autocorrelation_of(&kernel), &WHITE) < 1e-6);
}

/// The spectrum of exp(-r / 2): lags that go on beyond 3, so that the cut ones are no autocorrelation at all.
#[test]
fn lags_that_are_cut_off_are_met_nearly() {
    let mut lags = WHITE;
    for (dy, row) in lags.iter_mut().enumerate() {
        for (column, rho) in row.iter_mut().enumerate() {
            *rho = (-0.5 * (dy as f64).hypot(column as f64 - 3.0)).exp();
        }
    }
    let kernel = fit_kernel(&lags);
    assert!(worst(&autocorrelation_of(&kernel), &lags) < 0.06);
}
