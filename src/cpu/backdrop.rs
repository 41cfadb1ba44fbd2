//! How much of what virtual objects show is the photograph.

use rayon::prelude::*;

use super::batch::run_alone;
use super::estimator::begin_sample;
use super::state::path_state;
use crate::math::luminance;
use crate::packed::{FRAME_BACKDROP, PIXEL_BEAM_MAY_MEET_VIRTUAL, PackedScene};

/// Samples that are looked at.
const SAMPLES: usize = 4096;

/// Share of the light of virtual pixels that paths find in the photograph, by a few samples; nothing where none may.
pub fn backdrop_share(scene: &mut PackedScene) -> Option<f64> {
    if scene.frame.flags & FRAME_BACKDROP == 0 {
        return None;
    }
    let with = light_of_virtual(scene);
    let black = vec![0.0; scene.backdrop.len()];
    let backdrop = std::mem::replace(&mut scene.backdrop, black);
    let without = light_of_virtual(scene);
    scene.backdrop = backdrop;
    (with > 0.0).then(|| 1.0 - without / with)
}

/// Sum of the luminance of samples that meet virtual geometry.
fn light_of_virtual(scene: &PackedScene) -> f64 {
    let near = |pixel: &u32| scene.pixels[*pixel as usize].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0;
    let pixels: Vec<u32> = (0..scene.pixels.len() as u32).filter(near).collect();
    let samples = (0..SAMPLES.min(64 * pixels.len())).into_par_iter();
    samples
        .map(|i| {
            let at = i * pixels.len() / SAMPLES.min(64 * pixels.len());
            let mut state = path_state(0, 0);
            begin_sample(scene, &mut state, pixels[at], i as u32 % 64, false);
            run_alone(scene, &mut state);
            let light = f64::from(luminance(state.result.radiance));
            if state.result.mask != 0 && light.is_finite() {
                light
            } else {
                0.0
            }
        })
        .collect::<Vec<f64>>()
        .iter()
        .sum()
}
