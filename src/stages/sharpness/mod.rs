//! The camera's sharpness for the virtual light: its point spread, sharpening and lateral colour, measured at a photograph's own edges or given.
//!
//! The composite is If = Ic (1 + g) + l, with the gain g (-M; for the quotient composite (1 - M) q - 1) and the light l that was added (M Im, and D for
//! the additive one). The photograph Ic has gone through the lens and the camera's sharpening already; g and l have not. Both are
//! filtered alike, so that what a virtual thing covers and what it shows stay together, and what a shadow takes keeps the photograph's grain:
//!
//! ```text
//! Ic (1 + K*g) + K*l          K = (1 + a) G(s) - a G(sqrt(s^2 + r^2)), weights that sum to 1
//! ```
//!
//! Where g and l are 0 as far as K reaches the photograph's bits stay. The twin for the GPU is `shaders/stages/sharpness/mod.wgsl`.

mod edges;
mod gpu;
mod measure;
mod model;
pub(super) mod settings;
mod stage;

pub use edges::{Edge, edges_of};
pub use measure::{Measured, NoEdges, measure};
pub use settings::{PointSpread, SharpnessSettings};
pub(super) use stage::STAGE;

use rayon::prelude::*;

use crate::film::Picture;
use crate::math::exp_;
use crate::shared::shared;

shared! {
    /// Furthest pixel that the filter reads along each axis: three of the largest deviations.
    pub const MAX_REACH: u32 = 21;
    /// Taps of a filter along an axis.
    pub const TAPS: u32 = 43;
}

/// What the filter works on; row-major, as long as the picture.
#[derive(Clone, Copy, Debug)]
pub struct VirtualLight<'a> {
    /// The photograph, linear. None: nothing was photographed.
    pub photo: Option<&'a [[f32; 3]]>,
    /// How much of each pixel is virtual.
    pub mask: &'a [f32],
    /// What the quotient composite multiplied the photograph with. None: 1.
    pub ratio: Option<&'a [[f32; 3]]>,
}

impl VirtualLight<'_> {
    /// Gain on the photograph, then added light, six words a pixel.
    fn planes(&self, picture: &Picture) -> Vec<[f32; 6]> {
        let pixels = picture.linear.par_iter().enumerate();
        pixels
            .map(|(index, value)| {
                let photo = self.photo.map_or([0.0; 3], |photo| photo[index]);
                let ratio = self.ratio.map_or([1.0; 3], |ratio| ratio[index]);
                let share = 1.0 - self.mask[index];
                let kept = ratio.map(|ratio| share * ratio);
                let mut plane = [0.0; 6];
                for c in 0..3 {
                    plane[c] = kept[c] - 1.0;
                    plane[3 + c] = value[c] - kept[c] * photo[c];
                }
                plane
            })
            .collect()
    }
}

/// Pixels that the filter reads along each axis.
pub(super) fn reach(spread: &PointSpread) -> u32 {
    let deviations = spread.sigma_px.iter().chain(&spread.corner_sigma_px);
    let sigma = deviations.fold(0.0f32, |most, sigma| most.max(*sigma));
    let wide = match spread.sharpening > 0.0 {
        true => sigma.hypot(spread.sharpening_radius_px),
        false => sigma,
    };
    let shift = spread.lateral_px[0].abs().max(spread.lateral_px[1].abs());
    ((3.0 * wide + shift).ceil() as u32).min(MAX_REACH)
}

/// What the filter multiplies the variance of independent pixels with.
pub(super) fn variance_gain(spread: &PointSpread) -> f32 {
    let reach = reach(spread);
    let sigma2 = spread.sigma_px[1] * spread.sigma_px[1];
    let radius = spread.sharpening_radius_px;
    let core = taps(sigma2, 0.0, reach);
    let halo = taps(sigma2 + radius * radius, 0.0, reach);
    let product = |a: &[f32], b: &[f32]| {
        let along: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        along * along
    };
    let (plus, minus) = (1.0 + spread.sharpening, spread.sharpening);
    plus * plus * product(&core, &core) - 2.0 * plus * minus * product(&core, &halo)
        + minus * minus * product(&halo, &halo)
}

/// Gives the virtual light in `picture` the camera's sharpness; what is beyond the border is as the border. Pixels that nothing virtual
/// reaches keep their bits.
pub fn sharpen(picture: &mut Picture, light: &VirtualLight, spread: &PointSpread) {
    let planes = light.planes(picture);
    let size = (picture.width, picture.height);
    let reach = reach(spread);
    let near = near_virtual(&planes, size, reach as usize);
    let width = picture.width as usize;
    picture
        .linear
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                let index = y * width + x;
                if near[index] {
                    let photo = light.photo.map_or([0.0; 3], |photo| photo[index]);
                    *value = sharpened(&planes, size, (x as u32, y as u32), photo, spread, reach);
                }
            }
        });
}

/// Whether something virtual is within the filter's reach: most pixels of a picture need no filter.
fn near_virtual(planes: &[[f32; 6]], (width, height): (u32, u32), reach: usize) -> Vec<bool> {
    let (width, height) = (width as usize, height as usize);
    let mut along = vec![false; planes.len()];
    along
        .par_chunks_mut(width)
        .zip(planes.par_chunks(width))
        .for_each(|(along, planes)| {
            for (x, plane) in planes.iter().enumerate() {
                if *plane != [0.0; 6] {
                    along[x.saturating_sub(reach)..(x + reach + 1).min(width)].fill(true);
                }
            }
        });
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let near = y.saturating_sub(reach)..(y + reach + 1).min(height);
        let along = &along;
        (0..width).map(move |x| near.clone().any(|row| along[row * width + x]))
    });
    rows.collect()
}

/// The filtered pixel in that column and row.
fn sharpened(
    planes: &[[f32; 6]],
    (width, height): (u32, u32),
    (column, row): (u32, u32),
    photo: [f32; 3],
    spread: &PointSpread,
    reach: u32,
) -> [f32; 3] {
    let from_centre = [
        column as f32 + 0.5 - 0.5 * width as f32,
        row as f32 + 0.5 - 0.5 * height as f32,
    ];
    let half_diagonal = 0.5 * ((width * width + height * height) as f32).sqrt();
    let out = from_centre.map(|x| x / half_diagonal);
    let distance2 = out[0] * out[0] + out[1] * out[1];
    let lateral = [spread.lateral_px[0], 0.0, spread.lateral_px[1]];
    let mut value = photo;
    for c in 0..3 {
        let sigma2 = variance_at(spread.sigma_px[c], spread.corner_sigma_px[c], distance2);
        let radius = spread.sharpening_radius_px;
        let wide2 = sigma2 + radius * radius;
        let shift = [lateral[c] * out[0], lateral[c] * out[1]];
        let core_x = taps(sigma2, shift[0], reach);
        let core_y = taps(sigma2, shift[1], reach);
        let halo_x = taps(wide2, shift[0], reach);
        let halo_y = taps(wide2, shift[1], reach);
        let mut gain = 0.0;
        let mut light = 0.0;
        for j in 0..=2 * reach {
            let y = (row + j).clamp(reach, height - 1 + reach) - reach;
            let (mut core_gain, mut core_light) = (0.0, 0.0);
            let (mut halo_gain, mut halo_light) = (0.0, 0.0);
            for i in 0..=2 * reach {
                let x = (column + i).clamp(reach, width - 1 + reach) - reach;
                let plane = planes[(y * width + x) as usize];
                core_gain += core_x[i as usize] * plane[c];
                core_light += core_x[i as usize] * plane[3 + c];
                halo_gain += halo_x[i as usize] * plane[c];
                halo_light += halo_x[i as usize] * plane[3 + c];
            }
            let core = (1.0 + spread.sharpening) * core_y[j as usize];
            let halo = spread.sharpening * halo_y[j as usize];
            gain += core * core_gain - halo * halo_gain;
            light += core * core_light - halo * halo_light;
        }
        // Where both are 0 the photograph's bits stay, a negative 0 too.
        if gain != 0.0 || light != 0.0 {
            value[c] = photo[c] * (1.0 + gain) + light;
        }
    }
    value
}

/// s^2 at that squared distance from the centre, the corner's being 1.
fn variance_at(centre: f32, corner: f32, distance2: f32) -> f32 {
    centre * centre + (corner * corner - centre * centre) * distance2
}

/// Weights of the pixels from -reach to reach around the place where the light comes from; their sum is 1.
fn taps(variance: f32, shift: f32, reach: u32) -> [f32; TAPS as usize] {
    // A deviation of 0 would divide by 0; this one leaves 4e-6 to the neighbours.
    let scale = -0.5 / variance.max(0.04);
    let mut taps = [0.0; TAPS as usize];
    let mut sum = 0.0;
    for i in 0..=2 * reach {
        let x = i as f32 - reach as f32 + shift;
        let weight = exp_(x * x * scale);
        taps[i as usize] = weight;
        sum += weight;
    }
    for i in 0..=2 * reach {
        taps[i as usize] /= sum;
    }
    taps
}

#[cfg(test)]
mod tests;
