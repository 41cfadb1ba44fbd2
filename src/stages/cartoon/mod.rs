//! The cartoon: flat colours with dark silhouettes, over the whole picture, so that real and virtual things look alike.
//!
//! J. Fischer, D. Bartz: Real-time Cartoon-like Stylization of AR Video Streams on the GPU (2005), its equations 1 to 5:
//!
//! - the picture is shrunk (area average) and filtered several times by a 5 x 5 window whose weights fall with the distance in
//!   UV (1 to 3),
//! - edges of the shrunk and of the original picture are found by Sobel's gradients in Y, U and V (4),
//! - both go through a smooth threshold each; their weighted sum darkens the enlarged colours (5).
//!
//! Everything is done on encoded sRGB values in 0..=1 and BT.601 YUV. Where the paper leaves it open: borders repeat, Sobel sums are
//! divided by 4, pixel centres lie at halves, and the enlarged colours and responses are interpolated linearly. The twin for the GPU is
//! `shaders/stages/cartoon/`.

mod edges;
mod flow;
mod gpu;
mod planes;
pub(super) mod settings;
mod simplify;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::finish::{Shot, Stage};
use super::{EncodedImage, GpuStages};
use crate::gpu::GpuError;
use crate::shared::shared;
use edges::{gradient_row, smoothstep_};
pub use flow::flow_weights;
use planes::{PAD, Planes, rgb_from_yuv};
pub use settings::{CartoonSettings, CartoonStyle, FlowSettings};

shared! {
    /// Weights of red, green and blue in brightness (BT.601).
    const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
    /// Largest values of U and V.
    const U_MAX: f32 = 0.436;
    const V_MAX: f32 = 0.615;
}

pub(super) const STAGE: Stage = Stage {
    name: "cartoon",
    declared: &[&SHARED, &gpu::SHARED, &planes::SHARED, &simplify::SHARED],
    wants: |shot| shot.scene.stages.cartoon.is_some(),
    run,
};

fn run(shot: &mut Shot, gpu: Option<&GpuStages>) -> Result<(), GpuError> {
    let settings = shot.scene.stages.cartoon.unwrap_or_default();
    let image = EncodedImage::from_picture(&shot.picture);
    let done = match gpu {
        Some(gpu) => gpu.cartoon(&image, &settings, false)?,
        None => cartoon(&image, &settings, false),
    };
    shot.picture = done.image.to_picture();
    Ok(())
}

/// A stylised picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Cartoon {
    pub image: EncodedImage,
    /// Only if they were asked for.
    pub edges: Option<EdgeResponses>,
}

/// What the edge detectors answered, at the size of the picture: the paper's figure 5.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeResponses {
    pub width: u32,
    pub height: u32,
    /// Equation 4 of the simplified picture, enlarged. 0 in the flow style, which does not use it.
    pub simplified: Vec<f32>,
    /// Equation 4 of the original picture.
    pub original: Vec<f32>,
    /// Equation 5: what darkens the picture, 0 to 1.
    pub silhouette: Vec<f32>,
}

/// The cartoon of `image`, whose values are clamped to 0..=1 first.
pub fn cartoon(image: &EncodedImage, settings: &CartoonSettings, with_edges: bool) -> Cartoon {
    let original = Planes::of_image(image);
    let shrunk = simplify::shrink(image, settings.shrunk_width, settings.shrunk_height);
    let simplified = simplify::filter(shrunk, settings.sigma_p, settings.iterations);
    let lines = match settings.style {
        CartoonStyle::Photometric => None,
        CartoonStyle::Flow => Some(flow::lines(&original, &settings.flow)),
    };
    compose(
        &original,
        &simplified,
        lines.as_deref(),
        settings,
        with_edges,
    )
}

/// Equation 5 and the picture: the enlarged colours, darkened by the silhouettes.
fn compose(
    original: &Planes,
    simplified: &Planes,
    lines: Option<&[f32]>,
    settings: &CartoonSettings,
    with_edges: bool,
) -> Cartoon {
    let (width, height) = (original.width, original.height);
    let count = width * height;
    let response = edges::responses(simplified, settings.alpha);
    let columns: Vec<Tap> = taps(width, simplified.width);
    let rows: Vec<Tap> = taps(height, simplified.height);
    let mut rgb = vec![[0.0; 3]; count];
    let mut edges = EdgeResponses {
        width: width as u32,
        height: height as u32,
        simplified: vec![0.0; count],
        original: vec![0.0; count],
        silhouette: vec![0.0; count],
    };
    rgb.par_chunks_mut(width)
        .zip(edges.simplified.par_chunks_mut(width))
        .zip(edges.original.par_chunks_mut(width))
        .zip(edges.silhouette.par_chunks_mut(width))
        .enumerate()
        .for_each_init(
            || Scratch::new(simplified.width, width),
            |scratch, (row, (((out, edge_s), edge_a), silhouette))| {
                gradient_row(original, row, settings.alpha, edge_a);
                scratch.interpolate_rows(simplified, &response, rows[row]);
                scratch.interpolate_columns(&columns, edge_s);
                match lines {
                    Some(lines) => silhouette.copy_from_slice(&lines[row * width..][..width]),
                    None => {
                        for ((silhouette, s), a) in
                            silhouette.iter_mut().zip(edge_s.iter()).zip(edge_a.iter())
                        {
                            *silhouette = (1.0 - settings.beta)
                                * smoothstep_(settings.s0, settings.s1, *s)
                                + settings.beta * smoothstep_(settings.a0, settings.a1, *a);
                        }
                    }
                }
                for (x, (out, silhouette)) in out.iter_mut().zip(silhouette.iter()).enumerate() {
                    let yuv = [scratch.wide[0][x], scratch.wide[1][x], scratch.wide[2][x]];
                    *out = rgb_from_yuv(yuv).map(|channel| channel * (1.0 - silhouette));
                }
            },
        );
    Cartoon {
        image: EncodedImage {
            width: width as u32,
            height: height as u32,
            rgb,
        },
        edges: with_edges.then_some(edges),
    }
}

/// Two neighbouring samples and the weight of the second, for linear interpolation between pixel centres.
#[derive(Clone, Copy, Debug)]
struct Tap {
    first: usize,
    second: usize,
    weight: f32,
}

/// Where pixel `index` of `large` ones lies among `small` ones.
fn tap(index: usize, large: usize, small: usize) -> f32 {
    let scale = small as f32 / large as f32;
    ((index as f32 + 0.5) * scale - 0.5).clamp(0.0, (small - 1) as f32)
}

/// Where each of `large` pixels lies among `small` ones.
fn taps(large: usize, small: usize) -> Vec<Tap> {
    (0..large)
        .map(|index| {
            let at = tap(index, large, small);
            let first = at as usize;
            Tap {
                first,
                second: (first + 1).min(small - 1),
                weight: at - first as f32,
            }
        })
        .collect()
}

/// One row of the simplified picture's Y, U, V and response, interpolated down, then across.
struct Scratch {
    narrow: [Vec<f32>; 4],
    wide: [Vec<f32>; 3],
}

impl Scratch {
    fn new(narrow: usize, wide: usize) -> Self {
        Self {
            narrow: std::array::from_fn(|_| vec![0.0; narrow]),
            wide: std::array::from_fn(|_| vec![0.0; wide]),
        }
    }

    fn interpolate_rows(&mut self, simplified: &Planes, response: &[f32], tap: Tap) {
        let width = simplified.width;
        let [y, u, v, e] = &mut self.narrow;
        for (out, plane) in [y, u, v].into_iter().zip(&simplified.yuv) {
            let first = &plane[tap.first * simplified.stride + PAD..][..width];
            let second = &plane[tap.second * simplified.stride + PAD..][..width];
            mix_rows(out, first, second, tap.weight);
        }
        let first = &response[tap.first * width..][..width];
        let second = &response[tap.second * width..][..width];
        mix_rows(e, first, second, tap.weight);
    }

    fn interpolate_columns(&mut self, columns: &[Tap], edge: &mut [f32]) {
        let [y, u, v, e] = &self.narrow;
        let [wide_y, wide_u, wide_v] = &mut self.wide;
        for (out, narrow) in [(&mut **wide_y, y), (wide_u, u), (wide_v, v), (edge, e)] {
            for (out, tap) in out.iter_mut().zip(columns) {
                let first = narrow[tap.first];
                *out = first + (narrow[tap.second] - first) * tap.weight;
            }
        }
    }
}

fn mix_rows(out: &mut [f32], first: &[f32], second: &[f32], weight: f32) {
    for ((out, first), second) in out.iter_mut().zip(first).zip(second) {
        *out = first + (second - first) * weight;
    }
}
