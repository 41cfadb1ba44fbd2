//! Means of a heavy-tailed quantity over windows of like pixels, wide enough to be believed.

use std::ops::Add;

use glam::{DVec3, DVec4};
use rayon::prelude::*;

/// A window holds so many pixels that this many would carry the whole sum, were they alike and the rest 0.
const EFFECTIVE_PIXELS: f64 = 8.0;

/// For each pixel that has a value the mean over the pixels of its class in a window around it, 0 for others.
///
/// The class's pixels carry its sum unevenly: S of them alike would give the same ratio of the squared sum to the sum of squares. The windows
/// hold the same share of the class's pixels that [`EFFECTIVE_PIXELS`] are of S, at most all. Their size is one for the whole class, and does not
/// follow what is found nearby: a window that may end where it has met nothing rare knows nothing of what is rare.
///
/// Beside a step the windows on its low side reach across and the mean of value over window is below 1. All of a class are scaled by one
/// factor that brings it to 1.
pub fn pooled(width: usize, values: &[Option<DVec3>], classes: &[u8]) -> Vec<DVec3> {
    let mut means = vec![DVec3::ZERO; values.len()];
    let height = values.len() / width.max(1);
    for class in values_of(classes) {
        let member = |pixel: usize| values[pixel].filter(|_| classes[pixel] == class);
        let entries: Vec<DVec4> = (0..values.len())
            .map(|pixel| member(pixel).map_or(DVec4::ZERO, |value| value.extend(1.0)))
            .collect();
        let (mut pixels, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for value in (0..values.len()).filter_map(member) {
            let value = value.element_sum();
            pixels += 1.0;
            sum += value;
            squares += value * value;
        }
        if sum <= 0.0 {
            continue;
        }
        let wanted = (EFFECTIVE_PIXELS * pixels * squares / (sum * sum)).min(pixels);
        let mut missing: Vec<usize> = (0..values.len()).filter(|&p| member(p).is_some()).collect();
        let mut radius = 1;
        while !missing.is_empty() {
            let sums = box_sums(&entries, width, radius);
            let all = radius >= width.max(height);
            missing.retain(|&pixel| {
                let enough = sums[pixel].w >= wanted || all;
                if enough {
                    means[pixel] = sums[pixel].truncate() / sums[pixel].w;
                }
                !enough
            });
            radius += 1 + radius / 2;
        }
        let members = || (0..values.len()).filter_map(|p| Some((p, member(p)?)));
        let (mut ratios, mut count) = (0.0, 0.0);
        for (pixel, value) in members() {
            for (value, mean) in value.to_array().into_iter().zip(means[pixel].to_array()) {
                if mean > 0.0 {
                    ratios += value / mean;
                    count += 1.0;
                }
            }
        }
        for (pixel, _) in members() {
            means[pixel] *= ratios / count;
        }
    }
    means
}

fn values_of(classes: &[u8]) -> impl Iterator<Item = u8> {
    let mut present = [false; 256];
    for &class in classes {
        present[usize::from(class)] = true;
    }
    (0..=u8::MAX).filter(move |&class| present[usize::from(class)])
}

/// Sums over the squares of pixels at most `radius` away in either direction. Nothing is subtracted: what is small beside what is great far away
/// keeps its precision.
fn box_sums<T: Copy + Default + Add<Output = T> + Send + Sync>(
    values: &[T],
    width: usize,
    radius: usize,
) -> Vec<T> {
    let height = values.len() / width.max(1);
    let along_rows = line_sums(values, width, radius);
    let along_both = line_sums(&transposed(&along_rows, width), height, radius);
    transposed(&along_both, height)
}

fn transposed<T: Copy + Send + Sync>(values: &[T], width: usize) -> Vec<T> {
    let height = values.len() / width.max(1);
    (0..values.len())
        .into_par_iter()
        .map(|at| values[at % height * width + at / height])
        .collect()
}

/// Sums along each line of this length: sums from the beginning and to the end of blocks as long as the window (van Herk 1992).
fn line_sums<T: Copy + Default + Add<Output = T> + Send + Sync>(
    values: &[T],
    length: usize,
    radius: usize,
) -> Vec<T> {
    let radius = radius.min(length);
    let window = 2 * radius + 1;
    let padded = (length + 2 * radius).next_multiple_of(window);
    values
        .par_chunks(length.max(1))
        .flat_map_iter(|line| {
            let mut from_start = vec![T::default(); padded];
            from_start[radius..radius + length].copy_from_slice(line);
            let mut to_end = from_start.clone();
            for block in 0..padded / window {
                for at in block * window + 1..(block + 1) * window {
                    from_start[at] = from_start[at - 1] + from_start[at];
                }
                for at in (block * window..(block + 1) * window - 1).rev() {
                    to_end[at] = to_end[at] + to_end[at + 1];
                }
            }
            (0..length).map(move |at| {
                let end = from_start[at + window - 1];
                if at.is_multiple_of(window) {
                    end
                } else {
                    to_end[at] + end
                }
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
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
}
