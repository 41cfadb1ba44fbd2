//! The converged picture that errors are measured against: made once, kept in a file, or given.

use std::path::{Path, PathBuf};

use super::{ReferenceNote, Truth};
use crate::files;
use crate::film::Picture;
use crate::output::{ChannelFile, Format, OutputError, Target, write_reference};
use crate::renderer::{Budget, RenderError, Renderer, RendererOptions, Watcher};
use crate::scene::{Choice, Composite, Estimator, Photo, SamplerKind, Scene};

/// Independent scrambles from which the standard error is taken, at least.
const SCRAMBLES: u32 = 16;
/// Rays per pixel of each scramble of the trial that foretells how many are needed.
const TRIAL_RAYS: u32 = 64;
/// Seeds of the scrambles; what is measured takes others, far from these.
const FIRST_SEED: u32 = 0x5ee0_0000;
/// Rays per pixel for the mask of a reference that brings none.
const MASK_RAYS: u32 = 64;

/// How good a reference shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceGoal {
    /// Root mean square over the picture, linear.
    pub standard_error: f64,
    /// Rays per pixel, all scrambles together, after which it is left as it is.
    pub max_rays_per_pixel: u32,
}

/// Where a reference comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Another program's, or one of an earlier benchmark.
    Given(PathBuf),
    /// Made by `direct` and `sobol`, unless this folder has it already.
    Folder(PathBuf),
}

#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("{0}")]
    Unreadable(String),
    #[error("{path} has {width}x{height} pixels, the scene {scene_width}x{scene_height}")]
    Size {
        path: String,
        width: u32,
        height: u32,
        scene_width: u32,
        scene_height: u32,
    },
}

/// A reference, and where it comes from.
#[derive(Clone, Debug)]
pub struct Reference {
    pub truth: Truth,
    pub note: ReferenceNote,
}

/// Reads or makes the reference of a scene, on the backend that its settings name; `tick` hears how far it is. `None` once the watcher ends it.
///
/// # Errors
/// It cannot be read, made or kept, or a given one has another size.
pub fn reference(
    scene: &Scene,
    composite: Composite,
    source: &Source,
    goal: ReferenceGoal,
    watcher: &Watcher<'_>,
    tick: &mut dyn FnMut(&str),
) -> Result<Option<Reference>, ReferenceError> {
    let mut scene = scene.clone();
    scene.settings.estimator = Estimator::Direct;
    scene.settings.sampler = SamplerKind::Sobol;
    scene.settings.composite = composite;
    match source {
        Source::Given(path) => given(scene, path, watcher),
        Source::Folder(folder) => {
            let path = folder.join(file_name(&scene));
            // Kept from run to run, and made anew if it is not good enough.
            files::own(&path).map_err(OutputError::from)?;
            if let Some(kept) = kept(&scene, &path, goal) {
                return Ok(Some(kept));
            }
            let Some((truth, rays_per_pixel, scrambles)) = make(&scene, goal, watcher, tick)?
            else {
                return Ok(None);
            };
            let note = ReferenceNote {
                source: "made".to_owned(),
                rays_per_pixel,
                scrambles,
                ..note(&scene, &path, goal, &truth)
            };
            keep(&scene, &path, &truth, &note)?;
            Ok(Some(Reference { truth, note }))
        }
    }
}

fn file_name(scene: &Scene) -> String {
    format!(
        "reference-{}-{}x{}-{}.exr",
        scene.name,
        scene.camera.width,
        scene.camera.height,
        scene.settings.composite.name()
    )
}

/// `source`, rays and scrambles are for the caller to fill in.
fn note(scene: &Scene, path: &Path, goal: ReferenceGoal, truth: &Truth) -> ReferenceNote {
    ReferenceNote {
        scene: scene.name.clone(),
        composite: scene.settings.composite,
        file: path.display().to_string(),
        source: String::new(),
        standard_error: truth.rms_standard_error(),
        wanted_standard_error: goal.standard_error,
        rays_per_pixel: 0,
        scrambles: 0,
        virtual_fraction: truth.virtual_fraction(),
    }
}

const FINGERPRINT: &str = "mixray.fingerprint";
const VERSION: &str = "mixray.version";
const RAYS: &str = "mixray.raysPerPixel";
const SCRAMBLES_MADE: &str = "mixray.scrambles";

fn keep(
    scene: &Scene,
    path: &Path,
    truth: &Truth,
    note: &ReferenceNote,
) -> Result<(), OutputError> {
    let texts = [
        (FINGERPRINT, scene.fingerprint()),
        (VERSION, env!("CARGO_PKG_VERSION").to_owned()),
        (RAYS, note.rays_per_pixel.to_string()),
        (SCRAMBLES_MADE, note.scrambles.to_string()),
    ];
    let target = Target::named(path, Format::Exr);
    write_reference(
        &target,
        &truth.picture,
        &truth.standard_error,
        &truth.mask,
        &texts,
    )
}

/// The file's, if it is of this very scene, made by this version and as good as wanted.
fn kept(scene: &Scene, path: &Path, goal: ReferenceGoal) -> Option<Reference> {
    let file = ChannelFile::read(path).ok()?;
    let text = |name| file.texts.get(name).map(String::as_str);
    let same =
        text(FINGERPRINT)? == scene.fingerprint() && text(VERSION)? == env!("CARGO_PKG_VERSION");
    let rays_per_pixel: u64 = text(RAYS)?.parse().ok()?;
    let scrambles = text(SCRAMBLES_MADE)?.parse().ok()?;
    let truth = truth_of(&file)?;
    let note = ReferenceNote {
        source: "cached".to_owned(),
        rays_per_pixel,
        scrambles,
        ..note(scene, path, goal, &truth)
    };
    let good = note.standard_error <= goal.standard_error
        || rays_per_pixel >= u64::from(goal.max_rays_per_pixel);
    (same && good).then_some(Reference { truth, note })
}

/// Of a file that `keep` wrote.
fn truth_of(file: &ChannelFile) -> Option<Truth> {
    Some(Truth {
        picture: Picture {
            width: file.width,
            height: file.height,
            linear: file.rgb(["R", "G", "B"])?,
        },
        standard_error: file.rgb(["error.R", "error.G", "error.B"])?,
        mask: file.floats.get("mask.Y")?.clone(),
    })
}

fn given(
    mut scene: Scene,
    path: &Path,
    watcher: &Watcher<'_>,
) -> Result<Option<Reference>, ReferenceError> {
    let size = (scene.camera.width, scene.camera.height);
    let check = |width, height| {
        if (width, height) == size {
            return Ok(());
        }
        Err(ReferenceError::Size {
            path: path.display().to_string(),
            width,
            height,
            scene_width: size.0,
            scene_height: size.1,
        })
    };
    let own = ChannelFile::read(path)
        .ok()
        .and_then(|file| truth_of(&file));
    let truth = match own {
        Some(truth) => {
            check(truth.picture.width, truth.picture.height)?;
            truth
        }
        None => {
            let (photo, _) = Photo::read(path).map_err(|problem| {
                ReferenceError::Unreadable(format!("{}: {problem}", path.display()))
            })?;
            check(photo.width, photo.height)?;
            scene.settings.rays_per_pixel = MASK_RAYS;
            let mut renderer =
                Renderer::new(scene.clone(), RendererOptions::default(), &Watcher::none())?;
            renderer.advance(Budget::Complete, watcher)?;
            if watcher.is_cancelled() {
                return Ok(None);
            }
            Truth {
                standard_error: vec![[0.0; 3]; photo.linear.len()],
                mask: renderer.planes().mask,
                picture: Picture {
                    width: photo.width,
                    height: photo.height,
                    linear: photo.linear,
                },
            }
        }
    };
    let goal = ReferenceGoal {
        standard_error: 0.0,
        max_rays_per_pixel: 0,
    };
    let note = ReferenceNote {
        source: "given".to_owned(),
        ..note(&scene, path, goal, &truth)
    };
    Ok(Some(Reference { truth, note }))
}

/// Mean over independent scrambles, with the rays per pixel and the scrambles that it took. A trial of [`SCRAMBLES`] short renders
/// foretells how long they have to be (taking the error to fall no faster than the root of the rays); more follow until the standard error
/// of the mean is low enough or the rays are spent.
fn make(
    scene: &Scene,
    goal: ReferenceGoal,
    watcher: &Watcher<'_>,
    tick: &mut dyn FnMut(&str),
) -> Result<Option<(Truth, u64, u32)>, ReferenceError> {
    let limit = goal.max_rays_per_pixel;
    let longest = (limit / SCRAMBLES).max(1);
    let mut rays = TRIAL_RAYS.min(longest);
    let mut first = scene.clone();
    first.settings.rays_per_pixel = rays;
    let mut renderer = Renderer::new(first, RendererOptions::default(), &Watcher::none())?;
    let mut seed = FIRST_SEED;
    let mut mean = MeanPicture::new(scene);
    let is_trial_enough =
        |mean: &MeanPicture| mean.standard_error() <= goal.standard_error || rays >= longest;
    for _ in 0..SCRAMBLES {
        if !mean.add(&mut renderer, rays, &mut seed, watcher, tick)? {
            return Ok(None);
        }
    }
    if !is_trial_enough(&mean) {
        let factor = (mean.standard_error() / goal.standard_error).powi(2);
        let wanted = (f64::from(rays) * factor).min(f64::from(longest));
        // A power of two keeps a Sobol sequence whole.
        rays = (wanted as u32).next_power_of_two().min(longest);
        mean = MeanPicture::new(scene);
        for _ in 0..SCRAMBLES {
            if !mean.add(&mut renderer, rays, &mut seed, watcher, tick)? {
                return Ok(None);
            }
        }
    }
    while mean.standard_error() > goal.standard_error
        && u64::from(rays) * u64::from(mean.scrambles + 1) <= u64::from(limit)
    {
        if !mean.add(&mut renderer, rays, &mut seed, watcher, tick)? {
            return Ok(None);
        }
    }
    let rays_per_pixel = u64::from(rays) * u64::from(mean.scrambles);
    let scrambles = mean.scrambles;
    Ok(Some((mean.truth(), rays_per_pixel, scrambles)))
}

/// Mean and spread of pictures, value by value (Welford's recurrence), and their mean mask.
struct MeanPicture {
    name: String,
    width: u32,
    height: u32,
    scrambles: u32,
    mean: Vec<f64>,
    /// Sum of squared deviations from the mean.
    squares: Vec<f64>,
    mask: Vec<f64>,
}

impl MeanPicture {
    fn new(scene: &Scene) -> Self {
        let (width, height) = (scene.camera.width, scene.camera.height);
        let pixels = width as usize * height as usize;
        Self {
            name: scene.name.clone(),
            width,
            height,
            scrambles: 0,
            mean: vec![0.0; 3 * pixels],
            squares: vec![0.0; 3 * pixels],
            mask: vec![0.0; pixels],
        }
    }

    /// Renders one more with the next seed; false if it was cancelled.
    fn add(
        &mut self,
        renderer: &mut Renderer,
        rays: u32,
        seed: &mut u32,
        watcher: &Watcher<'_>,
        tick: &mut dyn FnMut(&str),
    ) -> Result<bool, RenderError> {
        tick(&format!(
            "{}: reference, scramble {} of {rays} rays per pixel, standard error {:.1e}",
            self.name,
            self.scrambles + 1,
            self.standard_error()
        ));
        renderer.set_samples(rays, *seed, &Watcher::none())?;
        *seed = seed.wrapping_add(1);
        renderer.advance(Budget::Complete, watcher)?;
        if watcher.is_cancelled() {
            return Ok(false);
        }
        self.add_picture(&renderer.picture(), &renderer.planes().mask);
        Ok(true)
    }

    fn add_picture(&mut self, picture: &Picture, mask: &[f32]) {
        self.scrambles += 1;
        let count = f64::from(self.scrambles);
        let values = picture.linear.as_flattened().iter().map(|&x| f64::from(x));
        for ((mean, square), x) in self.mean.iter_mut().zip(&mut self.squares).zip(values) {
            let step = x - *mean;
            *mean += step / count;
            *square += step * (x - *mean);
        }
        for (mean, x) in self.mask.iter_mut().zip(mask) {
            *mean += (f64::from(*x) - *mean) / count;
        }
    }

    /// Variance of the mean of one value.
    fn variance(&self, square: f64) -> f64 {
        let count = f64::from(self.scrambles);
        square / (count * (count - 1.0).max(1.0)).max(1.0)
    }

    /// Root mean square over the picture.
    fn standard_error(&self) -> f64 {
        let sum: f64 = self.squares.iter().map(|&s| self.variance(s)).sum();
        (sum / self.squares.len().max(1) as f64).sqrt()
    }

    fn truth(self) -> Truth {
        let three = |values: &[f64], f: &dyn Fn(f64) -> f64| -> Vec<[f32; 3]> {
            let (values, _) = values.as_chunks::<3>();
            values.iter().map(|v| v.map(|x| f(x) as f32)).collect()
        };
        Truth {
            picture: Picture {
                width: self.width,
                height: self.height,
                linear: three(&self.mean, &|x| x),
            },
            standard_error: three(&self.squares, &|s| self.variance(s).sqrt()),
            mask: self.mask.iter().map(|&m| m as f32).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
