//! Camera stages against independent transcriptions and simulated cameras, in the library and from the command line.

mod antialias;
mod cartoon;
mod commands;
mod flicker;
mod layers;
mod noise;
mod render;

/// Standard deviation of what is left of `values`, n - 1.
fn spread(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
}
