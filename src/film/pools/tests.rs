use super::*;
use crate::math::{hash_combine, hash_u32, uniform_from_bits};

fn random(seed: u32, pixel: usize) -> f64 {
    f64::from(uniform_from_bits(hash_u32(hash_combine(
        seed,
        pixel as u32,
    ))))
}

#[test]
fn box_sums_are_the_sums() {
    let (width, height) = (13, 7);
    let values: Vec<f64> = (0..width * height).map(|p| random(1, p)).collect();
    for radius in [1, 2, 4, 6, 20] {
        let sums = box_sums(&values, width, radius);
        for (pixel, sum) in sums.iter().enumerate() {
            let near = |a: usize, b: usize| a.abs_diff(b) <= radius;
            let in_window =
                |&p: &usize| near(p % width, pixel % width) && near(p / width, pixel / width);
            let direct: f64 = (0..values.len()).filter(in_window).map(|p| values[p]).sum();
            assert!((sum - direct).abs() < 1e-12 * direct, "{radius}");
        }
    }
}

/// Small values far from great ones come out as they are, which differences of prefix sums would not give.
#[test]
fn the_small_is_not_drowned() {
    let mut values = vec![1e-15_f64; 1000];
    values[0] = 1e6;
    let sums = box_sums(&values, 1000, 2);
    assert!((sums[500] / 5e-15 - 1.0).abs() < 1e-12);
    let prefix: Vec<f64> = (values.iter())
        .scan(0.0, |sum, x| {
            *sum += x;
            Some(*sum)
        })
        .collect();
    assert_ne!(prefix[502] - prefix[497], sums[500], "control");
}

/// Even values keep small windows; where one pixel in a hundred carries everything a window holds hundreds of pixels.
#[test]
fn windows_grow_with_the_tail() {
    let (width, pixels) = (64, 64 * 64);
    let pool = |rare: f64| {
        let value = |p| {
            if random(2, p) < rare {
                1.0 / rare
            } else {
                1e-9
            }
        };
        let values: Vec<_> = (0..pixels).map(|p| Some(DVec3::splat(value(p)))).collect();
        pooled(width, &values, &vec![0; pixels])
    };
    let spread = |means: &[DVec3]| {
        let mean = means.iter().map(|m| m.x).sum::<f64>() / pixels as f64;
        let squares = means.iter().map(|m| (m.x - mean).powi(2)).sum::<f64>();
        (mean, (squares / pixels as f64).sqrt())
    };
    for rare in [0.9, 0.1, 0.01] {
        let (mean, spread) = spread(&pool(rare));
        assert!((mean - 1.0).abs() < 0.2, "{rare}: {mean}");
        assert!(spread < 0.5, "{rare}: {spread}");
    }
    let least = pool(0.01).iter().map(|m| m.x).fold(f64::MAX, f64::min);
    assert!(least > 0.1, "no window without the rare: {least}");
}

/// A dark half beside a bright one. Control: the windows alone.
#[test]
fn values_over_means_average_to_one() {
    let (width, pixels) = (32, 32 * 32);
    let value = |p| (if p % width < 16 { 0.01 } else { 1.0 }) * (0.5 + random(3, p));
    let values: Vec<f64> = (0..pixels).map(value).collect();
    let ratio = |means: &[f64]| {
        let ratios = values.iter().zip(means).map(|(value, mean)| value / mean);
        ratios.sum::<f64>() / pixels as f64
    };
    let three: Vec<_> = values.iter().map(|x| Some(DVec3::splat(*x))).collect();
    let means: Vec<f64> = (pooled(width, &three, &vec![0; pixels]).iter())
        .map(|m| m.x)
        .collect();
    assert!((ratio(&means) - 1.0).abs() < 1e-12);
    let sums = box_sums(&values, width, 2);
    let counts = box_sums(&vec![1.0; pixels], width, 2);
    let alone: Vec<f64> = sums.iter().zip(counts).map(|(sum, n)| sum / n).collect();
    assert!(ratio(&alone) < 0.98, "control: {}", ratio(&alone));
}

#[test]
fn classes_keep_apart() {
    let values = [1.0, 1.0, 9.0, 9.0].map(|x| Some(DVec3::splat(x)));
    let are = |classes: &[u8], expected: [f64; 4]| {
        let means = pooled(4, &values, classes);
        (means.iter().zip(expected)).all(|(mean, x)| (mean.x - x).abs() < 1e-12)
    };
    assert!(are(&[0, 0, 1, 1], [1.0, 1.0, 9.0, 9.0]));
    assert!(are(&[0; 4], [5.0; 4]), "control");
}
