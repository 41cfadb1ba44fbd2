//! Sobel edges in Y, U and V: equation 4. Twin of `shaders/stages/cartoon/edges.wgsl`.

use rayon::prelude::*;

use super::planes::{PAD, Planes};

/// Equation 4 for every pixel of `planes`, row-major.
pub(super) fn responses(planes: &Planes, alpha: f32) -> Vec<f32> {
    let mut out = vec![0.0; planes.width * planes.height];
    out.par_chunks_mut(planes.width)
        .enumerate()
        .for_each(|(row, out)| gradient_row(planes, row, alpha, out));
    out
}

/// Equation 4 for one row: (1 - alpha) |grad Y| + alpha (|grad U| + |grad V|) / 2.
pub(super) fn gradient_row(planes: &Planes, row: usize, alpha: f32, out: &mut [f32]) {
    let weights = [1.0 - alpha, 0.5 * alpha, 0.5 * alpha];
    out.fill(0.0);
    for (plane, weight) in weights.into_iter().enumerate() {
        let width = planes.width;
        let rows = [-1, 0, 1].map(|dy| planes.row(plane, row as isize + dy));
        let [above, here, below] = rows.map(|row| &row[PAD - 1..][..width + 2]);
        for (x, out) in out.iter_mut().enumerate() {
            let (gx, gy) = sobel(
                [above[x], above[x + 1], above[x + 2]],
                [here[x], here[x + 2]],
                [below[x], below[x + 1], below[x + 2]],
            );
            *out += weight * (gx * gx + gy * gy).sqrt();
        }
    }
}

/// Sobel's derivatives along x and y from a pixel's neighbours, in the picture's units per pixel times 2 (sums divided by 4).
pub(super) fn sobel(above: [f32; 3], here: [f32; 2], below: [f32; 3]) -> (f32, f32) {
    let gx = (above[2] - above[0]) + 2.0 * (here[1] - here[0]) + (below[2] - below[0]);
    let gy = (below[0] - above[0]) + 2.0 * (below[1] - above[1]) + (below[2] - above[2]);
    (gx * 0.25, gy * 0.25)
}

/// 0 up to `low`, 1 from `high` on, Hermite between.
pub(super) fn smoothstep_(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
