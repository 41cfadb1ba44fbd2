//! The simplified colour picture: equations 1 to 3 on a shrunk picture. Twin of `shaders/stages/cartoon/simplify.wgsl`.

use super::planes::{PAD, Planes, yuv_from_rgb};
use crate::shared::shared;
use crate::stages::EncodedImage;

shared! {
    /// Exponents below this give weights that vanish beside the centre's 1.
    const LEAST_EXPONENT: f32 = -80.0;
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    const LN_2: f32 = std::f32::consts::LN_2;
}

/// One pixel of a shrunk row: where it begins and how much of each pixel of the large row lies in it; the weights add up to 1.
struct Cover {
    first: usize,
    weights: Vec<f32>,
}

/// How `small` equal parts cover `large` pixels. In units of 1 / small of a pixel everything is whole.
fn covers(large: usize, small: usize) -> Vec<Cover> {
    (0..small)
        .map(|index| {
            let (begin, end) = (index * large, (index + 1) * large);
            let first = begin / small;
            let weights = (first..end.div_ceil(small))
                .map(|pixel| overlap(index, pixel, large, small))
                .collect();
            Cover { first, weights }
        })
        .collect()
}

/// Share of part `part` of `small` that lies in pixel `pixel` of `large`.
fn overlap(part: usize, pixel: usize, large: usize, small: usize) -> f32 {
    let covered = ((part + 1) * large).min((pixel + 1) * small) - (part * large).max(pixel * small);
    covered as f32 / large as f32
}

/// The area average at `width` x `height`, or at the picture's own size where that is smaller.
pub(super) fn shrink(image: &EncodedImage, width: u32, height: u32) -> Planes {
    let large_width = image.width as usize;
    let columns = covers(large_width, image.width.min(width) as usize);
    let rows = covers(image.height as usize, image.height.min(height) as usize);
    let mut planes = Planes::new(columns.len(), rows.len());
    planes.fill_rows(|row, mut out| {
        let mut sums = vec![[0.0f32; 3]; large_width];
        for (offset, weight) in rows[row].weights.iter().enumerate() {
            let pixels = &image.rgb[(rows[row].first + offset) * large_width..][..large_width];
            for (sum, pixel) in sums.iter_mut().zip(pixels) {
                for (sum, channel) in sum.iter_mut().zip(pixel) {
                    *sum += weight * channel.clamp(0.0, 1.0);
                }
            }
        }
        for (x, cover) in columns.iter().enumerate() {
            let mut rgb = [0.0f32; 3];
            for (sum, weight) in sums[cover.first..].iter().zip(&cover.weights) {
                for (channel, sum) in rgb.iter_mut().zip(sum) {
                    *channel += weight * sum;
                }
            }
            for (plane, value) in out.iter_mut().zip(yuv_from_rgb(rgb)) {
                plane[x] = value;
            }
        }
    });
    planes
}

/// `iterations` passes of the photometric filter. The paper sums RGB; sums of Y, U and V are the same ones in other coordinates.
pub(super) fn filter(mut image: Planes, sigma_p: f32, iterations: u32) -> Planes {
    let mut next = Planes::new(image.width, image.height);
    let factor = -0.5 / (sigma_p * sigma_p);
    for _ in 0..iterations {
        next.fill_rows(|row, out| filter_row(&image, row, factor, out));
        std::mem::swap(&mut image, &mut next);
    }
    image
}

fn filter_row(image: &Planes, row: usize, factor: f32, [y, u, v]: [&mut [f32]; 3]) {
    let width = image.width;
    let center_u = &image.row(1, row as isize)[PAD..][..width];
    let center_v = &image.row(2, row as isize)[PAD..][..width];
    let mut norm = vec![0.0f32; width];
    y.fill(0.0);
    u.fill(0.0);
    v.fill(0.0);
    for dy in 0..=2 * PAD {
        let near_row = row as isize + dy as isize - PAD as isize;
        for dx in 0..=2 * PAD {
            let near_y = &image.row(0, near_row)[dx..][..width];
            let near_u = &image.row(1, near_row)[dx..][..width];
            let near_v = &image.row(2, near_row)[dx..][..width];
            for x in 0..width {
                let du = near_u[x] - center_u[x];
                let dv = near_v[x] - center_v[x];
                let weight = gaussian((du * du + dv * dv) * factor);
                norm[x] += weight;
                y[x] += weight * near_y[x];
                u[x] += weight * near_u[x];
                v[x] += weight * near_v[x];
            }
        }
    }
    for x in 0..width {
        let scale = 1.0 / norm[x];
        y[x] *= scale;
        u[x] *= scale;
        v[x] *= scale;
    }
}

/// e^x for x <= 0, to 3e-7 relative; without calls, so that the loop over a row becomes vector code.
pub(super) fn gaussian(x: f32) -> f32 {
    let t = x.max(LEAST_EXPONENT) * LOG2_E;
    let whole = (t - 0.5) as i32;
    let r = t - whole as f32;
    // Taylor series of 2^r on [-1/2, 1/2]
    let p = (((((1.540_353e-4 * r + 1.333_355_8e-3) * r + 9.618_129e-3) * r + 0.055_504_11) * r
        + 0.240_226_5)
        * r
        + LN_2)
        * r
        + 1.0;
    p * f32::from_bits(((whole + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_exponential() {
        let worst = |reference: &dyn Fn(f64) -> f64| {
            (0..80_000)
                .map(|i| -f64::from(i) * 1e-3)
                .map(|x| (f64::from(gaussian(x as f32)) / reference(x) - 1.0).abs())
                .fold(0.0, f64::max)
        };
        // The argument itself is rounded: 80 * 2^-24.
        assert!(worst(&|x| f64::from(x as f32).exp()) < 6e-6);
        assert!(worst(&|x| (x * 1.0001).exp()) > 1e-3, "control");
        assert_eq!(gaussian(0.0), 1.0);
        assert!(gaussian(-1e30) < 1e-34);
    }

    #[test]
    fn covers_share_every_pixel_out_once() {
        for (large, small) in [(640, 240), (480, 180), (7, 5), (5, 5), (1000, 1)] {
            let mut share = vec![0.0; large];
            for cover in covers(large, small) {
                let sum: f32 = cover.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-5, "{large} {small}");
                for (offset, weight) in cover.weights.iter().enumerate() {
                    share[cover.first + offset] += weight;
                }
            }
            let each = small as f32 / large as f32;
            assert!(share.iter().all(|s| (s / each - 1.0).abs() < 1e-5));
        }
    }
}
