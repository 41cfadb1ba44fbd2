//! Motion blur by copies: an object is drawn several times along its motion in the picture, each time faintly, and once more at its own
//! place.
//!
//! J. Fischer, D. Bartz: Handling Photographic Imperfections and Aliasing in Augmented Reality (WSI-2006-03), section 5, its equations 11 and
//! 12. Where k of n copies cover a pixel their opacity is 1 - (1 - 1/n)^k. In linear light; for several objects, the farthest first. The twin
//! for the GPU is `shaders/stages/motion_blur/copies.wgsl`.

use rayon::prelude::*;

use super::MotionBlurSettings;

/// An object alone, as large as the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct CopyLayer {
    /// Linear colour times coverage, and coverage, row-major from the top left.
    pub pixels: Vec<[f32; 4]>,
    /// Motion of the object's centre since the frame before, pixels.
    pub blur_px: [f32; 2],
}

/// Where the copies of one layer go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Copies {
    pub count: u32,
    /// Of the first copy from the object's place, pixels.
    pub start: [f32; 2],
    /// From one copy to the next, pixels.
    pub step: [f32; 2],
    pub opacity: f32,
    /// Of the last copy, at the object's own place.
    pub centre_opacity: f32,
}

impl Copies {
    /// Longest motion that can be blurred, pixels.
    pub const MAX_LENGTH_PX: f32 = 4096.0;

    /// `None` where the motion is shorter or longer than the settings want: the object is drawn once.
    pub fn of(blur_px: [f32; 2], settings: &MotionBlurSettings) -> Option<Self> {
        let [x, y] = blur_px;
        let length = (x * x + y * y).sqrt();
        let longest = settings.max_length_px.min(Self::MAX_LENGTH_PX);
        let count = (length / settings.step_px).floor();
        // Written so that a NaN is left alone.
        if !(length >= settings.min_length_px && length <= longest && count >= 1.0) {
            return None;
        }
        let along = settings.step_px / length;
        Some(Self {
            count: count as u32,
            start: [-0.5 * x, -0.5 * y],
            step: [x * along, y * along],
            opacity: 1.0 / count,
            centre_opacity: settings.centre_opacity,
        })
    }

    /// One opaque copy.
    pub const ONE: Self = Self {
        count: 0,
        start: [0.0; 2],
        step: [0.0; 2],
        opacity: 0.0,
        centre_opacity: 1.0,
    };
}

/// Draws a layer's copies over `canvas`, linear colour and what is covered so far.
pub fn draw_copies(
    canvas: &mut [[f32; 4]],
    (width, height): (u32, u32),
    layer: &[[f32; 4]],
    copies: &Copies,
) {
    canvas
        .par_chunks_mut(width as usize)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let at = [x as f32, y as f32];
                for i in 0..copies.count {
                    let offset = [0, 1].map(|c| copies.start[c] + copies.step[c] * i as f32);
                    let sample =
                        layer_at(layer, width, height, at[0] - offset[0], at[1] - offset[1]);
                    *pixel = over(*pixel, sample, copies.opacity);
                }
                let sample = layer[y * width as usize + x];
                *pixel = over(*pixel, sample, copies.centre_opacity);
            }
        });
}

fn over(below: [f32; 4], above: [f32; 4], opacity: f32) -> [f32; 4] {
    let through = 1.0 - opacity * above[3];
    [
        below[0] * through + opacity * above[0],
        below[1] * through + opacity * above[1],
        below[2] * through + opacity * above[2],
        1.0 - (1.0 - below[3]) * through,
    ]
}

/// Bilinear between pixel centres; nothing beyond the border.
fn layer_at(layer: &[[f32; 4]], width: u32, height: u32, x: f32, y: f32) -> [f32; 4] {
    let (left, top) = (x.floor(), y.floor());
    let (along, down) = (x - left, y - top);
    let mut sum = [0.0f32; 4];
    for (dx, dy, weight) in [
        (0.0, 0.0, (1.0 - along) * (1.0 - down)),
        (1.0, 0.0, along * (1.0 - down)),
        (0.0, 1.0, (1.0 - along) * down),
        (1.0, 1.0, along * down),
    ] {
        if let Some(value) = texel(layer, width, height, left + dx, top + dy) {
            for c in 0..4 {
                sum[c] += weight * value[c];
            }
        }
    }
    sum
}

/// `None` beyond the border, where the twin has zeros.
fn texel(layer: &[[f32; 4]], width: u32, height: u32, column: f32, row: f32) -> Option<&[f32; 4]> {
    (column >= 0.0 && row >= 0.0 && column < width as f32 && row < height as f32)
        .then(|| &layer[row as usize * width as usize + column as usize])
}
