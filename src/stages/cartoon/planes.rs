//! A picture as three planes, Y, U and V, with columns repeated at both ends so that a filter's window never leaves a row. Twin of
//! `shaders/stages/cartoon/planes.wgsl`, which computes Y, U and V where they are read.

use rayon::prelude::*;

use super::{LUMA, U_MAX, V_MAX};
use crate::shared::shared;
use crate::stages::EncodedImage;

shared! {
    /// Columns beyond each end of a row: half of the 5 x 5 window.
    pub(super) const PAD: usize = 2;
}

#[derive(Clone, Debug)]
pub(super) struct Planes {
    pub width: usize,
    pub height: usize,
    /// width + 2 PAD.
    pub stride: usize,
    pub yuv: [Vec<f32>; 3],
}

/// BT.601 from encoded RGB in 0..=1: Y in 0..=1, |U| <= 0.436, |V| <= 0.615.
pub(super) fn yuv_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = rgb;
    let y = LUMA[0] * r + LUMA[1] * g + LUMA[2] * b;
    [
        y,
        (b - y) * (U_MAX / (1.0 - LUMA[2])),
        (r - y) * (V_MAX / (1.0 - LUMA[0])),
    ]
}

pub(super) fn rgb_from_yuv(yuv: [f32; 3]) -> [f32; 3] {
    let [y, u, v] = yuv;
    let r = y + v * ((1.0 - LUMA[0]) / V_MAX);
    let b = y + u * ((1.0 - LUMA[2]) / U_MAX);
    [r, (y - LUMA[0] * r - LUMA[2] * b) / LUMA[1], b]
}

impl Planes {
    pub fn new(width: usize, height: usize) -> Self {
        let stride = width + 2 * PAD;
        Self {
            width,
            height,
            stride,
            yuv: std::array::from_fn(|_| vec![0.0; stride * height]),
        }
    }

    pub fn of_image(image: &EncodedImage) -> Self {
        let mut planes = Self::new(image.width as usize, image.height as usize);
        let width = planes.width;
        planes.fill_rows(|row, mut out| {
            for (x, rgb) in image.rgb[row * width..][..width].iter().enumerate() {
                let yuv = yuv_from_rgb(rgb.map(|channel| channel.clamp(0.0, 1.0)));
                for (plane, value) in out.iter_mut().zip(yuv) {
                    plane[x] = value;
                }
            }
        });
        planes
    }

    /// Lets `fill` write each row (without the padding) of the three planes; rows in parallel.
    pub fn fill_rows(&mut self, fill: impl Fn(usize, [&mut [f32]; 3]) + Sync) {
        let (stride, width) = (self.stride, self.width);
        let [y, u, v] = &mut self.yuv;
        y.par_chunks_mut(stride)
            .zip(u.par_chunks_mut(stride))
            .zip(v.par_chunks_mut(stride))
            .enumerate()
            .for_each(|(row, ((y, u), v))| {
                fill(
                    row,
                    [
                        &mut y[PAD..][..width],
                        &mut u[PAD..][..width],
                        &mut v[PAD..][..width],
                    ],
                );
                for plane in [y, u, v] {
                    let (first, last) = (plane[PAD], plane[PAD + width - 1]);
                    plane[..PAD].fill(first);
                    plane[PAD + width..].fill(last);
                }
            });
    }

    /// A row of a plane with its padding; rows beyond the ends repeat the first or last.
    pub fn row(&self, plane: usize, row: isize) -> &[f32] {
        let row = row.clamp(0, self.height as isize - 1) as usize;
        &self.yuv[plane][row * self.stride..][..self.stride]
    }
}
