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
mod tests;
