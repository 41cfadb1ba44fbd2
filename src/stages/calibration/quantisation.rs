//! The part of a measured variance that rounding to codes made.

use std::f64::consts::PI;

/// Temporal variance of rounded values, in squared codes, of a normal deviate of variance `variance` whose mean lies anywhere between two
/// codes with equal probability.
///
/// Rounding adds 1/12, less the mean square of the bias that the mean's place causes: sum over k of exp(-4 pi^2 k^2 sigma^2) / (2
/// pi^2 k^2), from the Fourier series of the rounding error (Widrow and Kollar, Quantization Noise, 2008). For sigma above 0.4 codes that
/// sum vanishes, and this is Sheppard's correction.
pub fn variance_of_codes(variance: f64) -> f64 {
    let bias: f64 = (1..=30)
        .map(|k| {
            let k2 = f64::from(k * k);
            (-4.0 * PI * PI * k2 * variance).exp() / (2.0 * PI * PI * k2)
        })
        .sum();
    variance + 1.0 / 12.0 - bias
}

/// The inverse: the variance before rounding of codes whose variance is `codes`. 0 for 0.
pub fn variance_before_rounding(codes: f64) -> f64 {
    let (mut low, mut high) = (0.0, codes.max(0.0));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if variance_of_codes(middle) > codes {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the exact sum over codes, averaged over the place of the mean.
    #[test]
    fn it_is_the_variance_of_rounded_normal_deviates() {
        let cdf = |x: f64| {
            // Simpson's rule from -8 sigma: exact to 1e-9 here.
            let steps = 2000;
            let h = (x + 8.0).max(0.0) / f64::from(steps);
            let f = |t: f64| (-0.5 * t * t).exp() / (2.0 * PI).sqrt();
            (0..steps)
                .map(|i| {
                    let t = -8.0 + f64::from(i) * h;
                    h / 6.0 * (f(t) + 4.0 * f(t + 0.5 * h) + f(t + h))
                })
                .sum::<f64>()
        };
        for sigma in [0.15, 0.3, 0.5, 1.0] {
            let phases = 24;
            let mut mean_variance = 0.0;
            for phase in 0..phases {
                let mean = (f64::from(phase) + 0.5) / f64::from(phases) - 0.5;
                let (mut first, mut second) = (0.0, 0.0);
                for code in -8..=8 {
                    let code = f64::from(code);
                    let p = cdf((code + 0.5 - mean) / sigma) - cdf((code - 0.5 - mean) / sigma);
                    first += p * code;
                    second += p * code * code;
                }
                mean_variance += (second - first * first) / f64::from(phases);
            }
            let expected = variance_of_codes(sigma * sigma);
            assert!(
                (mean_variance - expected).abs() < 2e-4,
                "{sigma}: {mean_variance} {expected}"
            );
            let back = variance_before_rounding(expected).sqrt();
            assert!((back - sigma).abs() < 1e-6, "{back}");
        }
        let plain = |codes: f64| codes - 1.0 / 12.0;
        assert!(
            (plain(variance_of_codes(0.0225)) - 0.0225).abs() > 0.01,
            "control: Sheppard fails at 0.15"
        );
        assert_eq!(variance_before_rounding(0.0), 0.0);
    }
}
