//! The noise that a film's composite lacks.

use super::own_variance::own_variance;
use super::{NoiseInput, NoiseMethod, NoiseSettings, NoiseStage, field, gpu, kernel};
use crate::gpu::GpuError;
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
    let ratio = shot.ratio();
    let has_own = settings.method == NoiseMethod::Missing && shot.estimate_gain > 0.0;
    let variance = has_own.then(|| {
        own_variance(
            shot.film,
            &shot.picture,
            photo,
            ratio.as_deref(),
            scene.settings.sampler,
            shot.estimate_gain,
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

/// DN, over bins and channels.
fn smallest_sigma(settings: &NoiseSettings) -> f32 {
    let sigmas = settings.profile.bins.iter().flat_map(|bin| bin.sigma);
    sigmas.fold(f64::INFINITY, f64::min) as f32
}
