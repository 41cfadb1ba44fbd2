//! How far two images are apart.

use serde::Serialize;

use super::Picture;
use super::flip::flip;

/// Differences of a test image from a reference, over all pixels and channels, on linear values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// Mean of squared difference / (squared reference + 0.01).
    pub rel_mse: f64,
    /// Peak signal (1) to noise ratio, decibels; none (JSON null) for equal images.
    pub psnr: Option<f64>,
    /// Mean LDR-FLIP error, 0 to 1; both images clamped to 0..1.
    pub flip: f64,
}

#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "the images differ in size: {0} x {1} and {2} x {3} pixels; expected one size; crop or scale one of them"
)]
pub struct SizeMismatch(u32, u32, u32, u32);

/// Keeps the relative error finite over black.
const REL_MSE_OFFSET: f64 = 0.01;

/// Compares `test` to `reference`.
///
/// # Errors
/// If their sizes differ.
pub fn compare(test: &Picture, reference: &Picture) -> Result<Comparison, SizeMismatch> {
    if (test.width, test.height) != (reference.width, reference.height) {
        return Err(SizeMismatch(
            test.width,
            test.height,
            reference.width,
            reference.height,
        ));
    }
    let pairs = || {
        let test = test.linear.as_flattened().iter();
        test.zip(reference.linear.as_flattened())
            .map(|(&t, &r)| (f64::from(t), f64::from(r)))
    };
    let count = (reference.linear.len() * 3).max(1) as f64;
    let mse = pairs().map(|(t, r)| (t - r).powi(2)).sum::<f64>() / count;
    let rel_mse = pairs()
        .map(|(t, r)| (t - r).powi(2) / (r * r + REL_MSE_OFFSET))
        .sum::<f64>()
        / count;
    Ok(Comparison {
        rmse: mse.sqrt(),
        rel_mse,
        psnr: (mse > 0.0).then(|| -10.0 * mse.log10()),
        flip: flip(
            reference.width as usize,
            reference.height as usize,
            &reference.linear,
            &test.linear,
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: &[f32]) -> Picture {
        Picture {
            width: values.len() as u32 / 3,
            height: 1,
            linear: values.as_chunks::<3>().0.to_vec(),
        }
    }

    #[test]
    fn numbers_against_hand_computed_ones() {
        let reference = picture(&[0.0, 0.5, 1.0, 0.25, 0.25, 2.0]);
        let test = picture(&[0.1, 0.5, 1.0, 0.25, 0.45, 1.0]);
        let c = compare(&test, &reference).unwrap();
        let mse = (0.01 + 0.04 + 1.0) / 6.0;
        assert!((c.rmse - f64::sqrt(mse)).abs() < 1e-7);
        let rel = (0.01 / 0.01 + 0.04 / (0.0625 + 0.01) + 1.0 / 4.01) / 6.0;
        assert!((c.rel_mse - rel).abs() < 1e-7, "{}", c.rel_mse);
        assert!((c.psnr.unwrap() - 10.0 * (1.0 / mse).log10()).abs() < 1e-6);
        let swapped = compare(&reference, &test).unwrap();
        assert_eq!(swapped.rmse, c.rmse);
        assert!(
            (swapped.rel_mse - c.rel_mse).abs() > 1e-3,
            "control: the reference is the second"
        );
    }

    #[test]
    fn equal_images_and_unequal_sizes() {
        let a = picture(&[0.1, 0.2, 0.3]);
        let c = compare(&a, &a).unwrap();
        assert_eq!((c.rmse, c.rel_mse, c.psnr, c.flip), (0.0, 0.0, None, 0.0));
        let b = picture(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        assert_eq!(compare(&a, &b), Err(SizeMismatch(1, 1, 2, 1)));
    }
}
