//! Smooth borders for pictures whose mask is binary: a virtual pixel beside real ones is mixed with them.
//!
//! J. Fischer, D. Bartz: Handling Photographic Imperfections and Aliasing in Augmented Reality (WSI-2006-03), section 4, its equations 9
//! and 10: b = (v + sum of the real ones among the 3 x 3 neighbours) / (1 + their number), and beta b + (1 - beta) v is shown. In linear
//! light. The twin for the GPU is `shaders/stages/antialias/mod.wgsl`.

mod gpu;
pub(super) mod settings;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::GpuStages;
use super::finish::{Shot, Stage};
use crate::film::Picture;
use crate::gpu::GpuError;
pub use settings::AntialiasSettings;

pub(super) const STAGE: Stage = Stage {
    name: "antialias",
    declared: &[&gpu::SHARED],
    wants: |shot| shot.scene.stages.antialias.is_some(),
    run,
};

fn run(shot: &mut Shot, gpu: Option<&GpuStages>) -> Result<(), GpuError> {
    let settings = shot.scene.stages.antialias.unwrap_or_default();
    let mask = shot.mask().into_owned();
    let done = match gpu {
        Some(gpu) => gpu.antialias(&mut shot.picture, &mask, &settings)?,
        None => antialias(&mut shot.picture, &mask, &settings),
    };
    if !done {
        let note = "[antialias] is off: the film's borders are smooth already";
        shot.notes.push(note.to_owned());
    }
    Ok(())
}

/// Every value is 0 or 1: borders are hard, and the blend has work to do. A film of many samples has soft borders already.
pub fn is_binary(mask: &[f32]) -> bool {
    mask.iter().all(|m| *m == 0.0 || *m == 1.0)
}

/// Blends the virtual border pixels. `mask` is 1 where the picture is virtual, 0 where it is real; unless it is binary nothing is done.
/// Real pixels keep their values bit for bit. Returns whether the blend was done.
pub fn antialias(picture: &mut Picture, mask: &[f32], settings: &AntialiasSettings) -> bool {
    if !is_binary(mask) {
        return false;
    }
    let (width, height) = (picture.width as usize, picture.height as usize);
    let source = picture.linear.clone();
    picture
        .linear
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                if mask[y * width + x] != 0.0 {
                    *value = blended(&source, mask, (width, height), (x, y), settings.beta);
                }
            }
        });
    true
}

/// The virtual pixel in that column and row of `source`, mixed with the real ones among its neighbours.
fn blended(
    source: &[[f32; 3]],
    mask: &[f32],
    (width, height): (usize, usize),
    (column, row): (usize, usize),
    beta: f32,
) -> [f32; 3] {
    let mut value = source[row * width + column];
    let mut sum = [0.0f32; 3];
    let mut count = 1.0f32;
    for y in row.saturating_sub(1)..(row + 2).min(height) {
        for x in column.saturating_sub(1)..(column + 2).min(width) {
            let near = y * width + x;
            if mask[near] == 0.0 {
                for c in 0..3 {
                    // Of differences: a sum of bright values would overflow.
                    sum[c] += source[near][c] - value[c];
                }
                count += 1.0;
            }
        }
    }
    if count > 1.0 {
        for c in 0..3 {
            value[c] += beta * (sum[c] / count);
        }
    }
    value
}
