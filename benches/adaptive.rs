//! Is the stated error honest? On the CPU.
//!
//!     cargo bench --bench adaptive             (a table into docs/adaptive.md)
//!
//! Renders small scenes to an error with 200 seeds each and takes the variance of z = (estimate - reference) / stated error, pooled over
//! the values whose stated error is not 0; the reference is a render of its own by rays per pixel, evenly sampled.

use std::path::{Path, PathBuf};

use mixray::bench::{replace_section, shrink};
use mixray::film::{Picture, planes};
use mixray::renderer::{Budget, ErrorGoal, Renderer, RendererOptions, Skip, Stated, Watcher};
use mixray::scene::{BackendChoice, Scene};
use rayon::prelude::*;

type Failure = Box<dyn std::error::Error + Send + Sync>;

const SCENES: [&str; 4] = ["room", "far", "sunny", "caustics"];
const SEEDS: u32 = 200;
/// Divides the scenes' size where 200 seeds are rendered.
const SMALL: u32 = 10;
/// Of each scene.
const GOALS: [&[f64]; SCENES.len()] = [&[0.02, 0.006], &[0.02, 0.006], &[0.05], &[0.03]];
const REFERENCE_RAYS: u32 = 1 << 15;
const REFERENCE_SEED: u32 = 1_000_003;

fn main() -> Result<(), Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = root.join("docs/adaptive.md");
    let table = honest(root)?;
    println!("{table}");
    let text = std::fs::read_to_string(&page)?;
    let text =
        replace_section(&text, "honest", &table).ok_or("docs/adaptive.md lacks a section")?;
    std::fs::write(&page, text)?;
    Ok(())
}

fn scene_file(root: &Path, name: &str) -> PathBuf {
    root.join("scenes").join(name).join("scene.toml")
}

fn goal(standard_error: f64) -> ErrorGoal {
    ErrorGoal {
        standard_error: Some(standard_error),
        noise: None,
        max_rays_per_pixel: ErrorGoal::DEFAULT_MAX_RAYS_PER_PIXEL,
    }
}

fn to_error(scene: &Scene, standard_error: f64) -> Result<Renderer, Failure> {
    let mut renderer = Renderer::new(scene.clone(), RendererOptions::default(), &Watcher::none())?;
    renderer.render_to_error(&goal(standard_error), &Watcher::none())?;
    Ok(renderer)
}

fn by_rays(
    scene: &Scene,
    rays: u32,
    seed: u32,
    options: RendererOptions,
) -> Result<Renderer, Failure> {
    let mut scene = scene.clone();
    scene.settings.rays_per_pixel = rays;
    scene.settings.seed = seed;
    let mut renderer = Renderer::new(scene, options, &Watcher::none())?;
    renderer.advance(Budget::Complete, &Watcher::none())?;
    Ok(renderer)
}

/// Moments of z.
#[derive(Default)]
struct Z {
    count: f64,
    sum: f64,
    squares: f64,
    beyond_3: f64,
    /// Largest |z|, its estimate and its truth.
    worst: (f64, f32, f32),
}

impl Z {
    fn add(&mut self, picture: &Picture, reference: &Picture, variance: &[[f32; 3]]) {
        let values = picture.linear.as_flattened().iter();
        let values = values.zip(reference.linear.as_flattened());
        for ((x, truth), variance) in values.zip(variance.as_flattened()) {
            if *variance > 0.0 {
                let z = f64::from(x - truth) / f64::from(*variance).sqrt();
                self.count += 1.0;
                self.sum += z;
                self.squares += z * z;
                if z.abs() > self.worst.0 {
                    self.worst = (z.abs(), *x, *truth);
                }
                self.beyond_3 += f64::from(u8::from(z.abs() > 3.0));
            }
        }
    }

    fn mean(&self) -> f64 {
        self.sum / self.count
    }

    fn variance(&self) -> f64 {
        self.squares / self.count - self.mean().powi(2)
    }
}

fn honest(root: &Path) -> Result<String, Failure> {
    let mut table = String::from(
        "| scene | goal | rays per pixel | stated RMS | true RMS | mean of z | variance of z | beyond 3 | tiles above the goal | variance of z, by the samples' variance |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, goals) in SCENES.into_iter().zip(GOALS) {
        let mut scene = shrink(mixray::scene::load(&scene_file(root, name))?, SMALL);
        scene.settings.backend = BackendChoice::Cpu;
        let options = RendererOptions {
            without: [Skip::Plan].into_iter().collect(),
            ..RendererOptions::default()
        };
        let reference = by_rays(&scene, REFERENCE_RAYS, REFERENCE_SEED, options)?.picture();
        for &goal in goals {
            let (mut stated, mut sampled) = (Z::default(), Z::default());
            let (mut rays, mut stated_mse, mut mse) = (0.0, 0.0, 0.0);
            let render = |seed: u32| -> Result<Found, Failure> {
                let mut scene = scene.clone();
                scene.settings.seed = seed;
                let renderer = to_error(&scene, goal)?;
                Ok(Found {
                    picture: renderer.picture(),
                    by_samples: planes(renderer.film(), scene.photo.as_ref()).variance,
                    stated: renderer.stated().cloned().ok_or("no scrambles")?,
                })
            };
            let found: Vec<Found> = (0..SEEDS)
                .into_par_iter()
                .map(render)
                .collect::<Result<_, _>>()?;
            let (mut tiles, mut above) = (0, 0);
            for found in &found {
                stated.add(&found.picture, &reference, &found.stated.variance);
                sampled.add(&found.picture, &reference, &found.by_samples);
                rays += found.stated.mean_rays_per_pixel;
                stated_mse += found.stated.rms().powi(2);
                mse += mean_squared(&found.picture, &reference);
                tiles += found.stated.tiles;
                above += found.stated.tiles_above_goal;
            }
            let seeds = f64::from(SEEDS);
            table += &format!(
                "| {name} | {goal} | {:.0} | {:.2e} | {:.2e} | {:+.3} | **{:.3}** | {:.2}% | {:.2}% | {:.3} |\n",
                rays / seeds,
                (stated_mse / seeds).sqrt(),
                (mse / seeds).sqrt(),
                stated.mean(),
                stated.variance(),
                100.0 * stated.beyond_3 / stated.count,
                100.0 * f64::from(above as u32) / f64::from(tiles as u32),
                sampled.variance(),
            );
            eprintln!("{}", table.lines().last().unwrap_or_default());
            let worst = stated.worst;
            eprintln!(
                "largest |z| {:.1}: {} instead of {}",
                worst.0, worst.1, worst.2
            );
        }
    }
    Ok(table)
}

/// What one seed gave.
struct Found {
    picture: Picture,
    by_samples: Vec<[f32; 3]>,
    stated: Stated,
}

fn mean_squared(picture: &Picture, reference: &Picture) -> f64 {
    let pairs = picture.linear.as_flattened().iter();
    let pairs = pairs.zip(reference.linear.as_flattened());
    let sum: f64 = pairs.map(|(x, y)| f64::from(x - y).powi(2)).sum();
    sum / (3 * picture.linear.len()) as f64
}
