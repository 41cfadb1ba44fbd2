//! Codes of a photograph that a picture of 8 bits keeps.
//!
//! Where next to nothing changes, noise decides between two codes, and would roughen the photograph. So a channel's change counts as what it is on average
//! around: below [`KEPT_MEAN_CODES`] the photograph's code stays, unless the pixel's own change is larger than noise makes it. An average knows a soft
//! shadow of one code from none, where a threshold for each pixel takes a part of it away.

use rayon::prelude::*;

use crate::film::Picture;
use crate::scene::Photo;
use crate::scene::srgb::decode8;

/// The mean change around, codes, below which ...
const KEPT_MEAN_CODES: f64 = 0.85;
/// ... the photograph's code stays if the pixel's own change is less than this, which is rounded to one code at most.
const KEPT_CHANGE_CODES: f64 = 1.4;
/// Larger changes are no part of the mean: there something virtual begins.
const AVERAGED_CODES: f64 = 2.5;
/// The mean is that of the pixels so far away in every direction.
const REACH_PX: usize = 4;

/// Changes are held in shares of a code: sums of integers are the same in any order.
const PARTS: f64 = 256.0;
const KEPT_MEAN: i32 = (KEPT_MEAN_CODES * PARTS) as i32;
const KEPT: i32 = (KEPT_CHANGE_CODES * PARTS) as i32;
const AVERAGED: i32 = (AVERAGED_CODES * PARTS) as i32;

/// A column of the window: sums of the changes, and how many they are.
#[derive(Clone, Copy, Default)]
struct Column {
    sums: [i32; 3],
    counts: [i32; 3],
}

/// Puts the photograph's codes `own` in the place of those `codes` that differ from them by noise alone.
pub fn keep_codes(codes: &mut [[u8; 3]], picture: &Picture, photo: &Photo, own: &[[u8; 3]]) {
    let width = picture.width as usize;
    let slopes: Vec<f32> = (0..=255).map(codes_per_linear).collect();
    let pixels = picture.linear.par_iter().zip(&photo.linear).zip(own);
    let changes: Vec<[i16; 3]> = pixels
        .map(|((value, before), own)| {
            std::array::from_fn(|c| {
                let change = (value[c] - before[c]) * slopes[usize::from(own[c])];
                (change * PARTS as f32).round() as i16
            })
        })
        .collect();
    let rows = codes.par_chunks_mut(width).zip(own.par_chunks(width));
    rows.enumerate()
        .for_each_init(Vec::new, |columns, (y, (codes, own))| {
            if codes == own {
                return;
            }
            let end = changes.len().min((y + REACH_PX + 1) * width);
            let window = &changes[y.saturating_sub(REACH_PX) * width..end];
            sum_columns(window, width, columns);
            for (x, (codes, own)) in codes.iter_mut().zip(own).enumerate() {
                if codes == own {
                    continue;
                }
                let around = &columns[x.saturating_sub(REACH_PX)..width.min(x + REACH_PX + 1)];
                for c in 0..3 {
                    let sum: i32 = around.iter().map(|column| column.sums[c]).sum();
                    let count: i32 = around.iter().map(|column| column.counts[c]).sum();
                    let change = i32::from(changes[y * width + x][c]).abs();
                    if change < KEPT && sum.abs() < KEPT_MEAN * count {
                        codes[c] = own[c];
                    }
                }
            }
        });
}

fn sum_columns(window: &[[i16; 3]], width: usize, columns: &mut Vec<Column>) {
    columns.clear();
    columns.resize(width, Column::default());
    for row in window.chunks(width) {
        for (column, change) in columns.iter_mut().zip(row) {
            for c in 0..3 {
                let change = i32::from(change[c]);
                let is_small = change.abs() < AVERAGED;
                column.sums[c] += if is_small { change } else { 0 };
                column.counts[c] += i32::from(is_small);
            }
        }
    }
}

/// How many codes a linear value changes by, about a code.
fn codes_per_linear(code: u8) -> f32 {
    let (low, high) = (code.saturating_sub(1), code.saturating_add(1));
    f32::from(high - low) / (decode8(high) - decode8(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_as_many_as_its_neighbours_are_apart() {
        for code in 0..255 {
            let step = decode8(code + 1) - decode8(code);
            let codes = step * codes_per_linear(code);
            assert!((0.9..1.1).contains(&codes), "{code}: {codes}");
        }
    }
}
