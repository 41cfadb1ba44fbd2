//! Photographs taken by mixray itself: what is real is rendered as if it were virtual, over a black backplate.

use std::error::Error;
use std::io::Write as _;
use std::path::Path;

use mixray::math::{hash_combine, uniform_from_bits};
use mixray::output::{PngBits, Target, write_png};
use mixray::renderer::{Budget, Progress, Renderer, RendererOptions, Watcher};
use mixray::scene::{self, BackendChoice, Overrides, Scene, Side};

/// Noise of a camera, in linear photograph values where white is 1.
pub struct Sensor {
    /// Variance per unit of signal: photons.
    pub shot_variance: f64,
    /// Standard deviation in the dark.
    pub read_sigma: f64,
}

impl Sensor {
    pub const NOISELESS: Self = Self {
        shot_variance: 0.0,
        read_sigma: 0.0,
    };
}

/// The real things of a scene file, without its photograph.
pub fn real_scene(scene_file: &Path) -> Result<Scene, Box<dyn Error>> {
    let text = std::fs::read_to_string(scene_file)?;
    let folder = scene_file.parent().unwrap_or(Path::new("."));
    real_scene_of(&text, &["[photo]"], "", folder)
}

/// The real things of a scene file's text, without some of its tables and with others, its files from `folder`.
pub fn real_scene_of(
    text: &str,
    without: &[&str],
    with: &str,
    folder: &Path,
) -> Result<Scene, Box<dyn Error>> {
    let mut file = tempfile::Builder::new()
        .suffix(".toml")
        .tempfile_in(folder)?;
    file.write_all(without_tables(text, without).as_bytes())?;
    file.write_all(with.as_bytes())?;
    let mut scene = scene::load(file.path())?;
    scene.objects.retain(|object| object.side == Side::Real);
    scene.lights.retain(|light| light.side == Side::Real);
    Ok(scene)
}

/// The TOML text without some tables.
fn without_tables(text: &str, headers: &[&str]) -> String {
    let mut inside = false;
    let mut kept = String::new();
    for line in text.lines() {
        if line.starts_with('[') {
            let header = line.split('#').next().unwrap_or("").trim_end();
            inside = headers.contains(&header);
        }
        if !inside {
            kept += line;
            kept += "\n";
        }
    }
    kept
}

/// Renders all that is in the scene and writes it as the camera's 8-bit picture.
pub fn photograph(
    mut scene: Scene,
    rays_per_pixel: u32,
    sensor: Sensor,
    path: &Path,
) -> Result<(), Box<dyn Error>> {
    for object in &mut scene.objects {
        object.side = Side::Virtual;
    }
    for light in &mut scene.lights {
        light.side = Side::Virtual;
    }
    scene.settings.apply(&Overrides {
        rays_per_pixel: Some(rays_per_pixel),
        seed: Some(1),
        backend: Some(BackendChoice::Cpu),
        ..Overrides::default()
    });
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;
    let say = |progress: &Progress| {
        let percent = 100.0 * progress.share_done;
        eprintln!(
            "{}: {} {percent:.0}%",
            path.display(),
            progress.phase.name()
        );
    };
    renderer.advance(Budget::Complete, &Watcher::none().heard_by(&say))?;
    let mut picture = renderer.picture();
    for (index, value) in picture.linear.as_flattened_mut().iter_mut().enumerate() {
        let signal = f64::from(*value).max(0.0);
        let sigma = (sensor.read_sigma.powi(2) + sensor.shot_variance * signal).sqrt();
        *value += (sigma * standard_normal(index as u32)) as f32;
    }
    write_png(&Target::picture(path)?, &picture, None, PngBits::Eight)?;
    Ok(())
}

/// One number a counter, by Box and Muller.
fn standard_normal(counter: u32) -> f64 {
    let uniform = |salt| f64::from(uniform_from_bits(hash_combine(counter, salt)));
    (-2.0 * (1.0 - uniform(1)).ln()).sqrt() * (std::f64::consts::TAU * uniform(2)).cos()
}
