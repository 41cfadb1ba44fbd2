//! Methods rendered in turns.

use std::time::Instant;

use crate::clock::ProcessorTime;

use super::{Errors, Method, Row, Run, Truth};
use crate::film::Picture;
use crate::pack::PackError;
use crate::renderer::{Budget, Filter, RayCounts, RenderError, Renderer, RendererOptions, Watcher};
use crate::scene::{BackendChoice, Combine, Scene};

/// What to measure on a scene.
#[derive(Clone, Debug)]
pub struct Plan {
    pub methods: Vec<Method>,
    /// Ascending.
    pub rays_per_pixel: Vec<u32>,
    /// Each row is rendered this often, with another seed each.
    pub repeats: u32,
    pub first_seed: u32,
    /// `--backend gpu` is a hardware GPU here: processor seconds say nothing of its work.
    pub hardware_gpu: bool,
}

impl Plan {
    /// Numbers of rays at which a method is measured: with a goal, that is one.
    fn levels(&self, method: &Method) -> usize {
        match method.goal {
            Some(_) => 1,
            None => self.rays_per_pixel.len(),
        }
    }

    /// Renders that [`measure`] makes of a scene.
    pub fn runs(&self) -> u64 {
        let of = |method| 1 + u64::from(self.repeats) * self.levels(method) as u64;
        self.methods.iter().map(of).sum()
    }

    /// A method's cost is seconds on the clock, not of the processor.
    pub(super) fn times_by_wall(&self, method: Method) -> bool {
        self.hardware_gpu && method.backend == BackendChoice::Gpu
    }
}

#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Pack(#[from] PackError),
    #[error("there is no thread to measure on: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    #[error("{method} was asked for, but {reason}")]
    Replaced { method: String, reason: String },
    #[error("the picture has {0}x{1} pixels, its reference {2}x{3}")]
    Size(u32, u32, u32, u32),
}

/// A picture to look at: the first run of a method at some number of rays.
#[derive(Clone, Debug)]
pub struct Shot {
    pub scene: String,
    pub method: Method,
    pub rays_per_pixel: u32,
    pub picture: Picture,
}

/// Renders every method at every number of rays, or once to its goal, all of them once before any of them again, after one untimed run of each method at the
/// fewest rays. `truth` gives the reference for a method, without which its errors stay 0; `tick` hears what is about to be rendered. Once the watcher ends it, what is
/// complete is returned.
///
/// # Errors
/// A method cannot render the scene, another backend had to take over, or a reference has another size.
pub fn measure<'a>(
    scene: &Scene,
    plan: &Plan,
    truth: &dyn Fn(&Method) -> Option<&'a Truth>,
    watcher: &Watcher<'_>,
    tick: &mut dyn FnMut(&str),
) -> Result<(Vec<Row>, Vec<Shot>), MeasureError> {
    let mut subjects = Vec::new();
    for method in &plan.methods {
        if let Some(truth) = truth(method) {
            check_size(scene, truth)?;
        }
        tick(&format!("{}: {}, warm-up", scene.name, method.label()));
        let mut subject = Subject::new(scene, *method)?;
        let fewest = plan.rays_per_pixel.first().copied().unwrap_or(1);
        subject.run(Some(fewest), plan.first_seed, watcher)?;
        subject.check_backend()?;
        subjects.push(subject);
    }

    let counts = plan.rays_per_pixel.len();
    let shown = [0, counts / 2, counts.saturating_sub(1)];
    let mut cells: Vec<Vec<Sample>> = vec![Vec::new(); counts * subjects.len()];
    let mut shots = Vec::new();
    'runs: for repeat in 0..plan.repeats {
        let seed = plan.first_seed.wrapping_add(repeat);
        for (level, &rays_per_pixel) in plan.rays_per_pixel.iter().enumerate() {
            for turn in 0..subjects.len() {
                // Another method begins in every repetition.
                let at = (turn + repeat as usize) % subjects.len();
                if level >= plan.levels(&plan.methods[at]) {
                    continue;
                }
                let subject = &mut subjects[at];
                let rays_per_pixel = subject.limit().unwrap_or(rays_per_pixel);
                tick(&format!(
                    "{}: {}, {rays_per_pixel} rays per pixel",
                    scene.name,
                    subject.method.label()
                ));
                let given = subject.method.goal.is_none().then_some(rays_per_pixel);
                let (mut sample, picture) = subject.run(given, seed, watcher)?;
                if watcher.is_cancelled() {
                    break 'runs;
                }
                subject.check_backend()?;
                if let Some(truth) = truth(&subject.method) {
                    sample.errors = Errors::of(&picture, truth);
                }
                cells[level * plan.methods.len() + at].push(sample);
                let is_shown = shown.contains(&level) || subject.method.goal.is_some();
                if repeat == 0 && is_shown {
                    shots.push(Shot {
                        scene: scene.name.clone(),
                        method: subject.method,
                        rays_per_pixel,
                        picture,
                    });
                }
            }
        }
    }

    let mut rows = Vec::new();
    for (at, subject) in subjects.iter().enumerate() {
        for (level, &rays_per_pixel) in plan.rays_per_pixel.iter().enumerate() {
            let samples = &cells[level * subjects.len() + at];
            if !samples.is_empty() {
                let rays_per_pixel = subject.limit().unwrap_or(rays_per_pixel);
                let by_wall = plan.times_by_wall(subject.method);
                rows.push(subject.row(rays_per_pixel, samples, by_wall));
            }
        }
    }
    Ok((rows, shots))
}

/// RMSE of one run of a method.
///
/// # Errors
/// As [`measure`].
pub fn rmse_of(
    scene: &Scene,
    method: Method,
    rays_per_pixel: u32,
    seed: u32,
    truth: &Truth,
    watcher: &Watcher<'_>,
) -> Result<f64, MeasureError> {
    check_size(scene, truth)?;
    let mut subject = Subject::new(scene, method)?;
    let (_, picture) = subject.run(Some(rays_per_pixel), seed, watcher)?;
    Ok(Errors::of(&picture, truth).all.rmse)
}

fn check_size(scene: &Scene, truth: &Truth) -> Result<(), MeasureError> {
    let (width, height) = (scene.camera.width, scene.camera.height);
    let (w, h) = (truth.picture.width, truth.picture.height);
    match (width, height) == (w, h) {
        true => Ok(()),
        false => Err(MeasureError::Size(width, height, w, h)),
    }
}

/// One run.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    seed: u32,
    pub wall_secs: f64,
    setup_secs: f64,
    pub cpu_secs: f64,
    pub rays: RayCounts,
    skipped_fraction: f64,
    non_finite: u64,
    errors: Errors,
    mean_rays_per_pixel: Option<f64>,
}

/// A method with its renderer, which stays built between runs.
pub(super) struct Subject {
    method: Method,
    renderer: Renderer,
    /// Rays per pixel of the scene file, which a render to a goal begins from.
    rays_per_pixel: u32,
    build_secs: f64,
    compile_secs: f64,
}

impl Subject {
    pub(super) fn new(scene: &Scene, method: Method) -> Result<Self, RenderError> {
        let mut scene = scene.clone();
        let settings = &mut scene.settings;
        settings.backend = method.backend;
        settings.estimator = method.estimator;
        settings.sampler = method.sampler;
        settings.composite = method.composite;
        settings.combine = Combine::Mean;
        let options = RendererOptions {
            without: method.without.into_iter().collect(),
            filter: method.filter.then_some(Filter::Preview),
            ..RendererOptions::default()
        };
        let renderer = Renderer::new(scene, options, &Watcher::none())?;
        let seconds = renderer.seconds();
        Ok(Self {
            method,
            rays_per_pixel: renderer.scene().settings.rays_per_pixel,
            renderer,
            build_secs: seconds.build,
            compile_secs: seconds.compile,
        })
    }

    /// A lost device is replaced by the CPU, which is right for a render and wrong for its time.
    pub(super) fn check_backend(&self) -> Result<(), MeasureError> {
        let asked_for_gpu = self.method.backend == BackendChoice::Gpu;
        if asked_for_gpu && self.renderer.backend_name() != "gpu" {
            return Err(MeasureError::Replaced {
                method: self.method.label(),
                reason: self.renderer.notes().join("; "),
            });
        }
        Ok(())
    }

    pub(super) fn device(&self) -> String {
        self.renderer.device_name()
    }

    /// With a goal: the rays per pixel after which it is given up.
    fn limit(&self) -> Option<u32> {
        self.method.goal.map(|goal| goal.max_rays_per_pixel)
    }

    /// `rays_per_pixel`: `None` to the method's goal.
    pub(super) fn run(
        &mut self,
        rays_per_pixel: Option<u32>,
        seed: u32,
        watcher: &Watcher<'_>,
    ) -> Result<(Sample, Picture), RenderError> {
        let before = self.renderer.rays();
        let (wall, cpu) = (Instant::now(), ProcessorTime::now());
        let samples = rays_per_pixel.unwrap_or(self.rays_per_pixel);
        self.renderer.set_samples(samples, seed, &Watcher::none())?;
        let setup_secs = wall.elapsed().as_secs_f64();
        let goal = self.method.goal.filter(|_| rays_per_pixel.is_none());
        match goal {
            Some(goal) => self.renderer.render_to_error(&goal.into(), watcher)?,
            None => self.renderer.advance(Budget::Complete, watcher)?,
        }
        let picture = self.renderer.picture();
        let (wall_secs, cpu_secs) = (wall.elapsed().as_secs_f64(), cpu.elapsed_secs());
        let film = self.renderer.film();
        let sample = Sample {
            seed,
            wall_secs,
            setup_secs,
            cpu_secs,
            rays: self.renderer.rays() - before,
            skipped_fraction: film.counts().skipped as f64 / film.pixels.len().max(1) as f64,
            non_finite: film.non_finite_samples(),
            errors: Errors::default(),
            mean_rays_per_pixel: self.renderer.stated().map(|s| s.mean_rays_per_pixel),
        };
        Ok((sample, picture))
    }

    fn row(&self, rays_per_pixel: u32, samples: &[Sample], by_wall: bool) -> Row {
        let values = |pick: fn(&Sample) -> f64| samples.iter().map(pick).collect::<Vec<f64>>();
        let wall = values(|s| s.wall_secs);
        let cpu = values(|s| s.cpu_secs);
        let mse = values(|s| s.errors.all.mse);
        let rays = mean_rays(samples);
        let traced = rays.mixed + rays.real + rays.mixed_shadow + rays.real_shadow;
        let errors = Errors::mean(&samples.iter().map(|s| s.errors).collect::<Vec<_>>());
        let (wall_secs, cpu_secs) = (mean(&wall), mean(&cpu));
        let cost_secs = if by_wall { wall_secs } else { cpu_secs };
        let product = cost_secs * errors.all.mse;
        let film = self.renderer.film();
        Row {
            scene: self.renderer.scene().name.clone(),
            width: film.width,
            height: film.height,
            method: self.method,
            device: self.renderer.device_name(),
            rays_per_pixel,
            mean_rays_per_pixel: self
                .method
                .goal
                .map(|_| mean(&values(|s| s.mean_rays_per_pixel.unwrap_or(0.0)))),
            build_secs: self.build_secs,
            compile_secs: self.compile_secs,
            wall_secs,
            wall_secs_sd: deviation(&wall),
            setup_secs: mean(&values(|s| s.setup_secs)),
            cpu_secs,
            cpu_secs_sd: deviation(&cpu),
            rays,
            mrays_per_sec: traced as f64 / wall_secs.max(1e-9) / 1e6,
            skipped_fraction: mean(&values(|s| s.skipped_fraction)),
            non_finite_samples: samples.iter().map(|s| s.non_finite).sum(),
            errors,
            mse_sd: deviation(&mse),
            cost: if by_wall { "wall" } else { "cpu" }.to_owned(),
            efficiency: (product > 0.0).then(|| 1.0 / product),
            runs: samples
                .iter()
                .map(|s| Run {
                    seed: s.seed,
                    wall_secs: s.wall_secs,
                    cpu_secs: s.cpu_secs,
                    mse: s.errors.all.mse,
                })
                .collect(),
        }
    }
}

fn mean_rays(samples: &[Sample]) -> RayCounts {
    let sum: RayCounts = samples.iter().map(|sample| sample.rays).sum();
    sum / samples.len().max(1) as u64
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation of a sample, 0 of a single value.
fn deviation(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let mean = mean(values);
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_against_hand_computed_ones() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), 3.0);
        assert!((deviation(&[1.0, 2.0, 6.0]) - 7.0f64.sqrt()).abs() < 1e-12);
        assert_eq!(deviation(&[5.0]), 0.0);
    }
}
