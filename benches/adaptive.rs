//! Is the stated error honest, and what is adaptive sampling worth? On the CPU.
//!
//!     cargo bench --bench adaptive             (both tables into docs/adaptive.md)
//!     cargo bench --bench adaptive -- honest   (or `worth`: one of them)
//!
//! `honest` renders small scenes to an error with 200 seeds each and takes the variance of z = (estimate - reference) / stated error, pooled over
//! the values whose stated error is not 0; the reference is a render of its own by rays per pixel, evenly sampled. `worth` times the processor of one thread.

#[path = "support/cpu_time.rs"]
mod cpu_time;

use std::path::{Path, PathBuf};

use cpu_time::thread_cpu_secs;
use mixray::bench::{replace_section, shrink};
use mixray::film::{Picture, planes};
use mixray::renderer::{Budget, ErrorGoal, Renderer, RendererOptions, Skip, Stated, Watcher};
use mixray::scene::{BackendChoice, Scene};
use rayon::prelude::*;

type Failure = Box<dyn std::error::Error + Send + Sync>;

const SCENES: [&str; 3] = ["room", "far", "sunny"];
const SEEDS: u32 = 200;
/// Divides the scenes' size where 200 seeds are rendered.
const SMALL: u32 = 10;
/// Of each scene, for `honest`.
const GOALS: [&[f64]; SCENES.len()] = [&[0.02, 0.006], &[0.02, 0.006], &[0.05]];
const REFERENCE_RAYS: u32 = 1 << 15;
const REFERENCE_SEED: u32 = 1_000_003;
/// Of the scenes at half size, for `worth`.
const WORTH_REFERENCE_RAYS: u32 = 1024;
const WORTH_GOALS: [f64; 2] = [0.012, 0.006];
const EVEN_RAYS: [u32; 3] = [16, 64, 256];
const WORTH_SEEDS: u32 = 1;

fn main() -> Result<(), Failure> {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = root.join("docs/adaptive.md");
    for (name, table) in [("honest", honest as fn(&Path) -> _), ("worth", worth)] {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        let table: String = table(root)?;
        println!("{table}");
        let text = std::fs::read_to_string(&page)?;
        let text =
            replace_section(&text, name, &table).ok_or("docs/adaptive.md lacks a section")?;
        std::fs::write(&page, text)?;
    }
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

/// Of the tiles of 16 pixels, the mean squared error of the one that 5% exceed.
fn worst_tiles(picture: &Picture, reference: &Picture) -> f64 {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let across = width.div_ceil(16);
    let mut tiles = vec![(0.0, 0.0); across * height.div_ceil(16)];
    for (i, (x, y)) in picture.linear.iter().zip(&reference.linear).enumerate() {
        let tile = &mut tiles[i / width / 16 * across + i % width / 16];
        tile.0 += (0..3).map(|c| f64::from(x[c] - y[c]).powi(2)).sum::<f64>();
        tile.1 += 3.0;
    }
    let mut errors: Vec<f64> = tiles.iter().map(|(sum, n)| sum / n).collect();
    errors.sort_unstable_by(f64::total_cmp);
    errors[errors.len() * 95 / 100]
}

/// One way to render at one setting: processor seconds, squared error of the picture and of its bad tiles.
#[derive(Clone, Copy, Default)]
struct Point {
    secs: f64,
    picture: f64,
    tiles: f64,
}

fn worth(root: &Path) -> Result<String, Failure> {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut table = String::from(
        "| scene | goal | RMSE | 95th of 100 tiles | CPU s | time of even sampling, equal RMSE | equal bad tiles | time of the plan, equal RMSE | equal bad tiles |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for name in SCENES {
        let mut scene = shrink(mixray::scene::load(&scene_file(root, name))?, 2);
        scene.settings.backend = BackendChoice::Cpu;
        let reference = by_rays(
            &scene,
            WORTH_REFERENCE_RAYS,
            REFERENCE_SEED,
            RendererOptions::default(),
        )?
        .picture();
        table += &one_thread.install(|| worth_of(name, &scene, &reference))?;
        eprintln!("{table}");
    }
    Ok(table)
}

fn worth_of(name: &str, scene: &Scene, reference: &Picture) -> Result<String, Failure> {
    let even = RendererOptions {
        without: [Skip::Plan].into_iter().collect(),
        ..RendererOptions::default()
    };
    let mut adaptive = [Point::default(); WORTH_GOALS.len()];
    let mut others = [[Point::default(); EVEN_RAYS.len()]; 2];
    for seed in 0..WORTH_SEEDS {
        let mut scene = scene.clone();
        scene.settings.seed = seed;
        for (point, goal) in adaptive.iter_mut().zip(WORTH_GOALS) {
            add(point, reference, || to_error(&scene, goal))?;
        }
        for (points, options) in others.iter_mut().zip([even, RendererOptions::default()]) {
            for (point, rays) in points.iter_mut().zip(EVEN_RAYS) {
                add(point, reference, || by_rays(&scene, rays, seed, options))?;
            }
        }
    }
    let mut rows = String::new();
    for (point, goal) in adaptive.iter().zip(WORTH_GOALS) {
        let n = f64::from(WORTH_SEEDS);
        let ratio = |points: &[Point], pick: fn(&Point) -> f64| {
            format!(
                "{:.2} times",
                secs_at(points, pick, pick(point)) / point.secs
            )
        };
        rows += &format!(
            "| {name} | {goal} | {:.2e} | {:.2e} | {:.2} | {} | {} | {} | {} |\n",
            (point.picture / n).sqrt(),
            (point.tiles / n).sqrt(),
            point.secs / n,
            ratio(&others[0], |p| p.picture),
            ratio(&others[0], |p| p.tiles),
            ratio(&others[1], |p| p.picture),
            ratio(&others[1], |p| p.tiles),
        );
    }
    Ok(rows)
}

/// Everything from the scene in memory to the film is timed.
fn add(
    point: &mut Point,
    reference: &Picture,
    render: impl FnOnce() -> Result<Renderer, Failure>,
) -> Result<(), Failure> {
    let start = thread_cpu_secs();
    let renderer = render()?;
    point.secs += thread_cpu_secs() - start;
    let picture = renderer.picture();
    point.picture += mean_squared(&picture, reference);
    point.tiles += worst_tiles(&picture, reference);
    Ok(())
}

/// Time at which the least-squares line through the points, in log error over log time, reaches `error`.
fn secs_at(points: &[Point], pick: fn(&Point) -> f64, error: f64) -> f64 {
    let n = points.len() as f64;
    let x: Vec<f64> = points.iter().map(|p| pick(p).ln()).collect();
    let y: Vec<f64> = points.iter().map(|p| p.secs.ln()).collect();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sxy: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    let sxx: f64 = x.iter().map(|x| (x - mx) * (x - mx)).sum();
    (my + sxy / sxx * (error.ln() - mx)).exp()
}
