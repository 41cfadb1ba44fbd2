//! The noise that a film's composite lacks.

use super::own_variance::own_variance;
use super::{NoiseInput, NoiseMethod, NoiseSettings, NoiseStage, field, gpu, kernel};
use crate::film::{Film, Means};
use crate::gpu::GpuError;
use crate::scene::Composite;
use crate::stages::GpuStages;
use crate::stages::finish::{Shot, Stage};

pub(in crate::stages) const STAGE: Stage = Stage {
    name: "noise",
    declared: &[
        &super::SHARED,
        &field::SHARED,
        &gpu::SHARED,
        &kernel::SHARED,
    ],
    wants: |shot| shot.scene.stages.noise.is_some(),
    run,
};

fn run(shot: &mut Shot, gpu: Option<&GpuStages>) -> Result<(), GpuError> {
    let scene = shot.scene;
    let Some(settings) = &scene.stages.noise else {
        return Ok(());
    };
    let stage = NoiseStage::new(settings, scene.settings.seed);
    let photo = scene.photo.as_ref();
    let ratio = ratio(shot.film, scene.settings.composite);
    // Copies average the estimate's own noise away.
    let is_blurred = shot.blurred_mask.is_some();
    let variance = (settings.method == NoiseMethod::Missing && !is_blurred).then(|| {
        own_variance(
            shot.film,
            &shot.picture,
            photo,
            ratio.as_deref(),
            scene.settings.sampler,
            smallest_sigma(settings),
        )
    });
    let mask = shot.mask().into_owned();
    let input = NoiseInput {
        photo: photo.map(|photo| photo.linear.as_slice()),
        // Where nothing was photographed the whole picture lacks noise.
        mask: photo.is_some().then_some(&mask),
        ratio: ratio.as_deref(),
        variance: variance.as_deref(),
    };
    match gpu {
        Some(gpu) => gpu.noise(&stage, &mut shot.picture, &input, shot.frame),
        None => {
            stage.apply(&mut shot.picture, &input, shot.frame);
            Ok(())
        }
    }
}

/// What the quotient composite multiplied the photograph with; None for the additive one, which leaves it as it is.
fn ratio(film: &Film, composite: Composite) -> Option<Vec<[f32; 3]>> {
    if composite == Composite::Additive {
        return None;
    }
    let ratios = (0..film.pixels.len()).map(|pixel| {
        let sums = film.sums(pixel);
        if sums.n == 0 || sums.n_real == 0 {
            return [1.0; 3];
        }
        let ratio = Means::of(&sums).quotient().max(glam::DVec3::ZERO);
        ratio.as_vec3().to_array()
    });
    Some(ratios.collect())
}

/// DN, over bins and channels.
fn smallest_sigma(settings: &NoiseSettings) -> f32 {
    let sigmas = settings.profile.bins.iter().flat_map(|bin| bin.sigma);
    sigmas.fold(f64::INFINITY, f64::min) as f32
}
