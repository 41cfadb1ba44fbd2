//! Where the time of a GPU render goes: kernels by timestamp queries, and what is left to the host.

use std::fmt::Write as _;
use std::time::Instant;

use serde::Serialize;

use super::Machine;
use super::columns::aligned;
use crate::gpu::KernelSeconds;
use crate::renderer::{Budget, RenderError, Renderer, RendererOptions, Watcher};
use crate::scene::{BackendChoice, Scene};

/// One render of a scene, shaders compiled before. Seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GpuTime {
    pub scene: String,
    pub width: u32,
    pub height: u32,
    pub rays_per_pixel: u32,
    /// Wall clock, from the settings to the composite, with a pass and two timestamps for each dispatch.
    pub wall_secs: f64,
    /// Of these before the first sample: the pilot, an empty film, the upload.
    pub setup_secs: f64,
    /// Of these in the composite.
    pub composite_secs: f64,
    pub kernels: KernelSeconds,
}

impl GpuTime {
    /// What neither a kernel nor a named step of the host took: submission, waiting, moving sums.
    fn rest_secs(&self) -> f64 {
        let k = &self.kernels;
        let kernels = k.trace + k.advance + k.generate + k.turn + k.share + k.accumulate;
        (self.wall_secs - self.setup_secs - self.composite_secs - kernels).max(0.0)
    }

    /// Traversal and shading.
    fn tracing_share(&self) -> f64 {
        (self.kernels.trace + self.kernels.advance) / self.wall_secs
    }
}

/// Renders `scene` on the GPU, once untimed and once timed; None if the device takes no timestamps.
///
/// # Errors
/// There is no adapter, or the scene does not fit it.
pub fn gpu_time(scene: &Scene, rays_per_pixel: u32) -> Result<Option<GpuTime>, RenderError> {
    let mut scene = scene.clone();
    scene.settings.backend = BackendChoice::Gpu;
    scene.settings.rays_per_pixel = rays_per_pixel;
    let seed = scene.settings.seed;
    let (name, width, height) = (scene.name.clone(), scene.camera.width, scene.camera.height);
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;
    let complete = |renderer: &mut Renderer| renderer.advance(Budget::Complete, &Watcher::none());
    complete(&mut renderer)?;
    if !renderer.profile_gpu() {
        return Ok(None);
    }
    let start = Instant::now();
    renderer.set_samples(rays_per_pixel, seed.wrapping_add(1), &Watcher::none())?;
    let setup_secs = start.elapsed().as_secs_f64();
    complete(&mut renderer)?;
    let composite = Instant::now();
    renderer.picture();
    let composite_secs = composite.elapsed().as_secs_f64();
    let wall_secs = start.elapsed().as_secs_f64();
    Ok(renderer.gpu_kernel_seconds().map(|kernels| GpuTime {
        scene: name,
        width,
        height,
        rays_per_pixel,
        wall_secs,
        setup_secs,
        composite_secs,
        kernels,
    }))
}

const HEADS: [&str; 12] = [
    "scene",
    "rays/px",
    "wall s",
    "trace",
    "shade",
    "both",
    "generate",
    "queue",
    "share",
    "sum",
    "pilot, upload, composite",
    "rest",
];

fn cells(time: &GpuTime) -> Vec<String> {
    let k = &time.kernels;
    let share = |secs: f64| format!("{:.1}%", 100.0 * secs / time.wall_secs);
    vec![
        format!("{} {} x {}", time.scene, time.width, time.height),
        time.rays_per_pixel.to_string(),
        format!("{:.3}", time.wall_secs),
        share(k.trace),
        share(k.advance),
        format!("{:.1}%", 100.0 * time.tracing_share()),
        share(k.generate),
        share(k.turn),
        share(k.share),
        share(k.accumulate),
        share(time.setup_secs + time.composite_secs),
        share(time.rest_secs()),
    ]
}

pub(super) fn device_line(machine: &Machine) -> String {
    match &machine.gpu {
        Some(gpu) => {
            let kind = if gpu.hardware { "" } else { ", software" };
            format!("GPU {}{kind}; driver {}", gpu.name, gpu.driver)
        }
        None => "no GPU".to_owned(),
    }
}

/// For a terminal.
pub fn gpu_time_text(machine: &Machine, times: &[GpuTime]) -> String {
    let mut all = vec![HEADS.map(str::to_owned).to_vec()];
    all.extend(times.iter().map(cells));
    device_line(machine) + "\n" + &aligned(&all)
}

/// The same as Markdown, with the command.
pub fn gpu_time_markdown(command: &str, machine: &Machine, times: &[GpuTime]) -> String {
    let mut out = format!("    {command}\n\n- {}\n\n", device_line(machine));
    let _ = writeln!(out, "| {} |", HEADS.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(HEADS.len()));
    for time in times {
        let _ = writeln!(out, "| {} |", cells(time).join(" | "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up() {
        let time = GpuTime {
            scene: "s".into(),
            width: 8,
            height: 4,
            rays_per_pixel: 16,
            wall_secs: 2.0,
            setup_secs: 0.1,
            composite_secs: 0.1,
            kernels: KernelSeconds {
                generate: 0.1,
                turn: 0.02,
                trace: 0.8,
                advance: 0.6,
                accumulate: 0.07,
                share: 0.01,
            },
        };
        assert!((time.rest_secs() - 0.2).abs() < 1e-12);
        assert!((time.tracing_share() - 0.7).abs() < 1e-12);
        let row = cells(&time);
        assert_eq!(row.len(), HEADS.len());
        let shares = row[3..].iter().enumerate().filter(|(i, _)| *i != 2);
        let sum: f64 = shares
            .map(|(_, s)| s.trim_end_matches('%').parse::<f64>().unwrap())
            .sum();
        assert!((sum - 100.0).abs() < 0.5, "{sum}");
    }

    #[test]
    fn a_render_is_timed_kernel_by_kernel() {
        if crate::gpu::harness::test_device().is_none() {
            return;
        }
        let mut scene = crate::pack::test_scene();
        scene.objects.push(crate::pack::test_mesh(
            crate::scene::Side::Virtual,
            &[[-1.0, -1.0, -2.0], [1.0, -1.0, -2.0], [0.0, 1.0, -2.0]],
            &[[0, 1, 2]],
            crate::scene::Material::default(),
        ));
        let Some(time) = gpu_time(&scene, 16).expect("renders") else {
            eprintln!("skipped: the device takes no timestamps");
            return;
        };
        let kernels = time.kernels.trace + time.kernels.advance;
        assert!(kernels > 0.0 && kernels < time.wall_secs, "{time:?}");
    }
}
