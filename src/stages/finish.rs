//! The stages that a scene asks for, in their order, on a film's composite.

use std::time::Instant;

use super::antialias::antialias;
use super::cartoon::cartoon;
use super::motion_blur::{PictureMotion, blur_film};
use super::noise::own_variance::own_variance;
use super::noise::{NoiseInput, NoiseStage};
use super::{EncodedImage, GpuStages};
use crate::film::{Film, Picture, QUOTIENT_EPSILON};
use crate::gpu::GpuError;
use crate::scene::{
    Composite, MotionBlurMethod, MotionBlurSettings, NoiseMethod, NoiseSettings, Scene,
};

/// A finished picture and what the user should hear about it.
#[derive(Clone, Debug)]
pub struct Finished {
    pub picture: Picture,
    pub notes: Vec<String>,
    pub seconds: StageSeconds,
}

/// What each stage took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageSeconds {
    pub antialias: f64,
    pub motion_blur: f64,
    pub noise: f64,
    pub cartoon: f64,
}

/// Applies the scene's stages to the composite `picture` of `film`, as frame number `frame` of a video. Without a stage the picture
/// comes back as it is, and nothing is computed. `motion` is what the copies of motion blur go along; without it they do nothing. They run on `gpu` if there is one and it can; else on the CPU.
pub fn finish(
    mut picture: Picture,
    film: &Film,
    scene: &Scene,
    frame: u32,
    motion: Option<&PictureMotion>,
    gpu: Option<&GpuStages>,
) -> Finished {
    let stages = &scene.stages;
    let mut notes = Vec::new();
    let mut seconds = StageSeconds::default();
    let begin = Instant::now();
    if let Some(settings) = &stages.cartoon {
        let image = EncodedImage::from_picture(&picture);
        let done = on_gpu(gpu, &mut notes, |gpu| gpu.cartoon(&image, settings, false));
        let result = done.unwrap_or_else(|| cartoon(&image, settings, false));
        picture = result.image.to_picture();
        seconds.cartoon = begin.elapsed().as_secs_f64();
    }
    let begin = Instant::now();
    if let Some(settings) = &stages.antialias {
        let mask = mask(film);
        let done = on_gpu(gpu, &mut notes, |gpu| {
            gpu.antialias(&mut picture, &mask, settings)
        });
        if !done.unwrap_or_else(|| antialias(&mut picture, &mask, settings)) {
            notes.push("[antialias] is off: the film's borders are smooth already".to_owned());
        }
        seconds.antialias = begin.elapsed().as_secs_f64();
    }
    let begin = Instant::now();
    let mut blurred_mask = None;
    let copies = |settings: &&MotionBlurSettings| settings.method == MotionBlurMethod::Copies;
    if let (Some(settings), Some(motion)) = (stages.motion_blur.as_ref().filter(copies), motion) {
        let mut blur = |gpu: Option<&GpuStages>| {
            let composite = scene.settings.composite;
            let photo = scene.photo.as_ref();
            blur_film(&mut picture, film, photo, composite, motion, settings, gpu)
        };
        let done = on_gpu(gpu, &mut notes, |gpu| blur(Some(gpu)));
        blurred_mask = done.unwrap_or_else(|| blur(None).unwrap_or_default());
        seconds.motion_blur = begin.elapsed().as_secs_f64();
    }
    let begin = Instant::now();
    if let Some(settings) = &stages.noise {
        let stage = NoiseStage::new(settings, scene.settings.seed);
        let is_blurred = blurred_mask.is_some();
        let mask = blurred_mask.unwrap_or_else(|| mask(film));
        let mut input = NoiseInput {
            photo: scene.photo.as_ref().map(|photo| photo.linear.as_slice()),
            mask: Some(&mask),
            ..NoiseInput::default()
        };
        if scene.photo.is_none() {
            // Nothing was photographed: the whole picture lacks noise.
            input.mask = None;
        }
        let ratio = ratio(film, scene.settings.composite);
        input.ratio = ratio.as_deref();
        let variance = match settings.method {
            // Copies average the estimate's own noise away.
            NoiseMethod::Missing if is_blurred => None,
            NoiseMethod::Missing => Some(own_variance(
                film,
                &picture,
                scene.photo.as_ref(),
                ratio.as_deref(),
                scene.settings.sampler,
                smallest_sigma(settings),
            )),
            NoiseMethod::Textures => None,
        };
        input.variance = variance.as_deref();
        let done = on_gpu(gpu, &mut notes, |gpu| {
            gpu.noise(&stage, &mut picture, &input, frame)
        });
        if done.is_none() {
            stage.apply(&mut picture, &input, frame);
        }
        seconds.noise = begin.elapsed().as_secs_f64();
    }
    Finished {
        picture,
        notes,
        seconds,
    }
}

/// What `run` gives on the GPU; None without one, or where it cannot, which is noted.
fn on_gpu<T>(
    gpu: Option<&GpuStages>,
    notes: &mut Vec<String>,
    run: impl FnOnce(&GpuStages) -> Result<T, GpuError>,
) -> Option<T> {
    match run(gpu?) {
        Ok(done) => Some(done),
        Err(error) => {
            notes.push(format!(
                "a stage runs on the CPU, for the GPU cannot: {error}"
            ));
            None
        }
    }
}

/// M of each pixel.
fn mask(film: &Film) -> Vec<f32> {
    film.pixels
        .iter()
        .map(|sums| sums.m as f32 / sums.n.max(1) as f32)
        .collect()
}

/// What the quotient composite multiplied the photograph with; None for the additive one, which leaves it as it is.
fn ratio(film: &Film, composite: Composite) -> Option<Vec<[f32; 3]>> {
    if composite == Composite::Additive {
        return None;
    }
    let ratios = film.pixels.iter().map(|sums| {
        if sums.n == 0 || sums.n_real == 0 {
            return [1.0; 3];
        }
        let difference = sums.diff.value() / f64::from(sums.n);
        let real = sums.r_ir.value() / f64::from(sums.n_real);
        let ratio = difference / real.max(glam::DVec3::splat(QUOTIENT_EPSILON));
        (ratio + glam::DVec3::ONE)
            .max(glam::DVec3::ZERO)
            .as_vec3()
            .to_array()
    });
    Some(ratios.collect())
}

/// DN, over bins and channels.
fn smallest_sigma(settings: &NoiseSettings) -> f32 {
    let sigmas = settings.profile.bins.iter().flat_map(|bin| bin.sigma);
    sigmas.fold(f64::INFINITY, f64::min) as f32
}
