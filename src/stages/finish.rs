//! The way of a picture through the stages that its scene asks for.

use std::borrow::Cow;
use std::time::Instant;

use serde::{Serialize, Serializer};

use super::motion_blur::PictureMotion;
use super::{GpuStages, STAGES};
use crate::film::{Film, Means, Picture};
use crate::gpu::GpuError;
use crate::scene::{Composite, Scene};
use crate::shared::Module;

/// A stage as it is applied to a shot.
pub(super) struct Stage {
    /// That of its table in a scene file.
    pub name: &'static str,
    /// What its files declare for their shaders too.
    pub declared: &'static [&'static Module],
    /// Whether it has something to do; it is not run otherwise.
    pub wants: fn(&Shot) -> bool,
    /// Runs on the device if there is one; only then it can fail, and it leaves the shot as it was.
    pub run: fn(&mut Shot, Option<&GpuStages>) -> Result<(), GpuError>,
}

/// A picture on its way through the stages, and what they may know of it.
pub(super) struct Shot<'a> {
    pub picture: Picture,
    pub film: &'a Film,
    pub scene: &'a Scene,
    /// Number in a video.
    pub frame: u32,
    /// What the copies of motion blur go along.
    pub motion: Option<&'a PictureMotion>,
    /// How much of each pixel is virtual since a stage has changed that.
    pub changed_mask: Option<Vec<f32>>,
    /// What the stages have multiplied the variance with that the estimate brought in.
    pub estimate_gain: f32,
    /// What the user should hear.
    pub notes: Vec<String>,
}

impl Shot<'_> {
    /// How much of each pixel is virtual, 0 to 1.
    pub fn mask(&self) -> Cow<'_, [f32]> {
        match &self.changed_mask {
            Some(mask) => Cow::Borrowed(mask),
            None => {
                let pixels = self.film.pixels.iter();
                pixels.map(|sums| Means::of(sums).mask as f32).collect()
            }
        }
    }

    /// What the quotient composite multiplied the photograph with; None for the additive one, which leaves it as it is.
    pub fn ratio(&self) -> Option<Vec<[f32; 3]>> {
        if self.scene.settings.composite == Composite::Additive {
            return None;
        }
        let ratios = (0..self.film.pixels.len()).map(|pixel| {
            let sums = self.film.sums(pixel);
            if sums.n == 0 || sums.n_real == 0 {
                return [1.0; 3];
            }
            let ratio = Means::of(&sums).quotient().max(glam::DVec3::ZERO);
            ratio.as_vec3().to_array()
        });
        Some(ratios.collect())
    }
}

/// A finished picture and what the user should hear about it.
#[derive(Clone, Debug)]
pub struct Finished {
    pub picture: Picture,
    pub added: Added,
    pub notes: Vec<String>,
    pub seconds: StageSeconds,
}

/// What single stages added to the picture; empty if they did not run, or nobody asked.
#[derive(Clone, Debug, Default)]
pub struct Added {
    /// To the virtual light, by its point spread.
    pub sharpness: Vec<[f32; 3]>,
    pub noise: Vec<[f32; 3]>,
}

/// What each stage took, by its name; 0 if it did not run.
#[derive(Clone, Debug, PartialEq)]
pub struct StageSeconds([f64; STAGES.len()]);

impl Default for StageSeconds {
    fn default() -> Self {
        Self([0.0; STAGES.len()])
    }
}

impl StageSeconds {
    /// In the order of the stages.
    pub fn by_name(&self) -> impl Iterator<Item = (&'static str, f64)> {
        STAGES.iter().map(|stage| stage.name).zip(self.0)
    }

    /// Of all stages.
    pub fn total(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Adds those of another picture.
    pub fn add(&mut self, other: &Self) {
        for (sum, seconds) in self.0.iter_mut().zip(other.0) {
            *sum += seconds;
        }
    }
}

impl Serialize for StageSeconds {
    /// A map from names to seconds.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.by_name())
    }
}

/// As [`finish`], and keeps what sharpness and noise add.
pub fn finish_in_layers(
    picture: Picture,
    film: &Film,
    scene: &Scene,
    frame: u32,
    motion: Option<&PictureMotion>,
    gpu: Option<&GpuStages>,
) -> Finished {
    let shot = Shot::new(picture, film, scene, frame, motion);
    shot.finish(gpu, true)
}

/// Applies the scene's stages to the composite `picture` of `film`, as frame number `frame` of a video. Without a stage the picture
/// comes back as it is, and nothing is computed. `motion` is what the copies of motion blur go along; without it they do nothing. They run on `gpu` if there is one and it can; else on the CPU.
pub fn finish(
    picture: Picture,
    film: &Film,
    scene: &Scene,
    frame: u32,
    motion: Option<&PictureMotion>,
    gpu: Option<&GpuStages>,
) -> Finished {
    let shot = Shot::new(picture, film, scene, frame, motion);
    shot.finish(gpu, false)
}

impl<'a> Shot<'a> {
    fn new(
        picture: Picture,
        film: &'a Film,
        scene: &'a Scene,
        frame: u32,
        motion: Option<&'a PictureMotion>,
    ) -> Self {
        Self {
            picture,
            film,
            scene,
            frame,
            motion,
            changed_mask: None,
            estimate_gain: 1.0,
            notes: Vec::new(),
        }
    }

    fn finish(mut self, gpu: Option<&GpuStages>, in_layers: bool) -> Finished {
        let mut seconds = StageSeconds::default();
        let mut added = Added::default();
        for (stage, seconds) in STAGES.iter().zip(&mut seconds.0) {
            if !(stage.wants)(&self) {
                continue;
            }
            let layer = match stage.name {
                "sharpness" if in_layers => Some(&mut added.sharpness),
                "noise" if in_layers => Some(&mut added.noise),
                _ => None,
            };
            let before = layer.map(|layer| (layer, self.picture.linear.clone()));
            let begin = Instant::now();
            self.run(stage, gpu);
            *seconds = begin.elapsed().as_secs_f64();
            if let Some((layer, before)) = before {
                let pixels = self.picture.linear.iter().zip(before);
                *layer = pixels
                    .map(|(with, without)| std::array::from_fn(|c| with[c] - without[c]))
                    .collect();
            }
        }
        Finished {
            picture: self.picture,
            added,
            notes: self.notes,
            seconds,
        }
    }

    fn run(&mut self, stage: &Stage, gpu: Option<&GpuStages>) {
        for device in [gpu, None] {
            match (stage.run)(self, device) {
                Ok(()) => break,
                Err(error) => self.notes.push(format!(
                    "a stage runs on the CPU, for the GPU cannot: {error}"
                )),
            }
        }
    }
}
