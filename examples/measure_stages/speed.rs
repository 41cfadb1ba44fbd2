//! Times: the paper's table 1, and what the noise adds to a frame.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use mixray::gpu::{AdapterChoice, GpuDevice};
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{self, CartoonSettings, NoiseFit, NoiseProfile, NoiseSettings, Photo};
use mixray::stages::cartoon::cartoon as stylise;
use mixray::stages::{EncodedImage, GpuStages, finish};

use super::Result;

const REPEATS: usize = 15;

/// Smallest, median and largest of [`REPEATS`] runs after one that warms up, milliseconds.
fn timed(mut run: impl FnMut() -> Result<()>) -> Result<Times> {
    run()?;
    let mut times = Vec::new();
    for _ in 0..REPEATS {
        let start = Instant::now();
        run()?;
        times.push(1000.0 * start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(Times {
        median: times[REPEATS / 2],
        smallest: times[0],
        largest: times[REPEATS - 1],
    })
}

/// Milliseconds.
struct Times {
    median: f64,
    smallest: f64,
    largest: f64,
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self {
            median,
            smallest,
            largest,
        } = self;
        write!(f, "{median:.1} ({smallest:.1} to {largest:.1})")
    }
}

fn demo(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes/demo")
        .join(name)
}

/// All six rows of the paper's table 1.
pub fn cartoon() -> Result<()> {
    let (photo, _) = Photo::read(&demo("photo.png"))?;
    let image = EncodedImage::from_photo(&photo);
    let gpu = GpuDevice::open(AdapterChoice::Any).map(|gpu| GpuStages::new(Arc::new(gpu)));
    let name = gpu
        .as_ref()
        .map_or_else(ToString::to_string, GpuStages::device_name);
    println!("## The cartoon's time: the paper's table 1\n");
    println!(
        "The demo's photograph, {} x {}, photometric style, upload and download included on the GPU; median (smallest to largest) of {REPEATS} runs, ms. \
         The paper's machine: Pentium 4 Xeon 2.66 GHz, GeForce 6800. GPU: {name}.\n",
        image.width, image.height
    );
    println!(
        "| shrunk picture | iterations | paper | CPU | GPU |\n| --- | --- | --- | --- | --- |"
    );
    let rows = [
        (240, 180, 5, 19),
        (240, 180, 7, 25),
        (240, 180, 9, 30),
        (400, 300, 5, 44),
        (400, 300, 7, 59),
        (400, 300, 9, 74),
    ];
    for (shrunk_width, shrunk_height, iterations, paper) in rows {
        let settings = CartoonSettings {
            shrunk_width,
            shrunk_height,
            iterations,
            ..CartoonSettings::default()
        };
        let on_cpu = timed(|| {
            stylise(&image, &settings, false);
            Ok(())
        })?;
        let on_gpu = match &gpu {
            Ok(gpu) => timed(|| {
                gpu.cartoon(&image, &settings, false)?;
                Ok(())
            })?
            .to_string(),
            Err(_) => "none".to_owned(),
        };
        println!(
            "| {shrunk_width} x {shrunk_height} | {iterations} | {paper} | {on_cpu} | {on_gpu} |"
        );
    }
    println!();
    Ok(())
}

/// The noise of a frame against the frame.
pub fn noise() -> Result<()> {
    let mut scene = scene::load(&demo("scene.toml"))?;
    scene.settings.rays_per_pixel = 49;
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;
    renderer.advance(Budget::Complete, &Watcher::none())?;
    let frame_ms = 1000.0 * renderer.seconds().render;
    let picture = renderer.picture();
    let profile = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 2.0 }, 4);
    let mut correlated = profile.clone();
    for lags in &mut correlated.autocorrelation {
        (lags[0][2], lags[0][4], lags[1][3]) = (0.5, 0.5, 0.5);
    }
    println!("## What the noise costs\n");
    println!(
        "scenes/demo at 49 rays per pixel on {} ({}): {frame_ms:.0} ms to render; the stage takes, median (smallest to largest) of {REPEATS} runs, ms:\n",
        renderer.device_name(),
        renderer.backend_name()
    );
    println!("| noise | ms | share of the frame |\n| --- | --- | --- |");
    let mut scene = renderer.scene().clone();
    let stages = [
        ("off", None),
        ("white", Some(profile)),
        ("correlated", Some(correlated)),
    ];
    for (name, profile) in stages {
        scene.stages.noise = profile.map(NoiseSettings::new);
        // A picture that is handed over is not copied; the copy for the next run is not the stage's.
        let mut copies: Vec<_> = (0..=REPEATS).map(|_| picture.clone()).collect();
        let times = timed(|| {
            if let Some(picture) = copies.pop() {
                finish(picture, renderer.film(), &scene, 0, None, None);
            }
            Ok(())
        })?;
        let share = 100.0 * times.median / frame_ms;
        println!("| {name} | {times} | {share:.2}% |");
    }
    Ok(())
}
