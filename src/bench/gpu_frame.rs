//! What a frame of the GPU costs the host after an edit: processor time by place, and what goes to the device and back.

use std::fmt::Write as _;

use glam::{DMat4, DVec3};
use serde::Serialize;

use super::Machine;
use super::columns::aligned;
use super::gpu_time::device_line;
use crate::gpu::Traffic;
use crate::renderer::{Budget, Place, Places, RenderError, Renderer, RendererOptions, Watcher};
use crate::scene::{BackendChoice, Combine, Scene, Side};

/// What is changed before the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Edit {
    /// The camera moves.
    Pose,
    /// It focuses elsewhere.
    Lens,
    /// The first virtual object moves.
    Object,
}

impl Edit {
    const ALL: [Self; 3] = [Self::Pose, Self::Lens, Self::Object];
    /// Of poses and objects, metres.
    const STEP_M: f64 = 0.002;
    /// Of focus distances.
    const FOCUS_STEP: f64 = 1.002;

    fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Lens => "lens",
            Self::Object => "object",
        }
    }

    fn make(self, renderer: &mut Renderer) -> Result<(), RenderError> {
        let scene = renderer.scene();
        let step = DMat4::from_translation(Self::STEP_M * DVec3::X);
        let watcher = Watcher::none();
        match self {
            Self::Pose => {
                let pose = step * scene.camera.world_from_camera;
                renderer.set_camera_pose(pose, &watcher)
            }
            Self::Lens => {
                let mut lens = scene.lens;
                lens.focus_distance_m *= Self::FOCUS_STEP;
                renderer.set_lens(lens, &watcher)
            }
            Self::Object => {
                let is_virtual = |object: &crate::scene::Object| object.side == Side::Virtual;
                let Some(first) = scene.objects.iter().position(is_virtual) else {
                    return Ok(());
                };
                let place = step * scene.objects[first].world_from_object;
                renderer.set_object_transform(first, place, &watcher)
            }
        }
    }
}

/// Seconds at one place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtPlace {
    pub place: &'static str,
    pub wall_secs: f64,
    pub host_cpu_secs: f64,
}

/// A frame, from the edit to the picture of means.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GpuFrame {
    pub scene: String,
    pub width: u32,
    pub height: u32,
    pub rays_per_pixel: u32,
    pub edit: Edit,
    pub wall_secs: f64,
    /// Of the processors, in the program's own threads.
    pub host_cpu_secs: f64,
    pub places: Vec<AtPlace>,
    pub traffic: Traffic,
}

impl GpuFrame {
    /// Of the processor time, what no place is named for.
    fn rest_secs(&self) -> f64 {
        let named: f64 = self.places.iter().map(|at| at.host_cpu_secs).sum();
        (self.host_cpu_secs - named).max(0.0)
    }
}

/// A frame of `scene` after each edit, kernels compiled and buffers made before.
///
/// # Errors
/// There is no adapter, or the scene does not fit it.
pub fn gpu_frames(scene: &Scene, rays_per_pixel: u32) -> Result<Vec<GpuFrame>, RenderError> {
    let mut scene = scene.clone();
    scene.settings.backend = BackendChoice::Gpu;
    scene.settings.combine = Combine::Mean;
    scene.settings.rays_per_pixel = 1;
    let watcher = Watcher::none();
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &watcher)?;
    // Once with few rays: the device learns its speed, memory comes into use.
    for edit in Edit::ALL {
        edit.make(&mut renderer)?;
        renderer.advance(Budget::Complete, &watcher)?;
    }
    renderer.set_samples(rays_per_pixel, 1, &watcher)?;
    (Edit::ALL.into_iter())
        .map(|edit| frame(&mut renderer, edit))
        .collect()
}

fn frame(renderer: &mut Renderer, edit: Edit) -> Result<GpuFrame, RenderError> {
    renderer.count_places();
    let before = renderer.gpu_traffic().unwrap_or_default();
    // A clock of its own for the whole, another for what the renderer does not book.
    let mut whole = renderer.places();
    let mut picture = whole.clone();
    let begun = whole.begin();
    edit.make(renderer)?;
    renderer.advance(Budget::Complete, &Watcher::none())?;
    let composite = picture.begin();
    renderer.picture();
    picture.end(Place::Composite, composite);
    whole.end(Place::Composite, begun);
    let mut places: Places = renderer.places();
    places.add(&picture);
    let spent = whole.of(Place::Composite);
    let scene = renderer.scene();
    Ok(GpuFrame {
        scene: scene.name.clone(),
        width: scene.camera.width,
        height: scene.camera.height,
        rays_per_pixel: scene.settings.rays_per_pixel,
        edit,
        wall_secs: spent.wall,
        host_cpu_secs: spent.cpu,
        places: (Place::ALL.iter())
            .map(|&place| AtPlace {
                place: place.name(),
                wall_secs: places.of(place).wall,
                host_cpu_secs: places.of(place).cpu,
            })
            .collect(),
        traffic: renderer.gpu_traffic().unwrap_or_default() - before,
    })
}

fn heads() -> Vec<String> {
    let first = ["scene", "rays/px", "edit", "host ms"];
    let places = Place::ALL.map(Place::name);
    let last = [
        "rest",
        "MB up",
        "MB down",
        "dispatches",
        "steps",
        "idle",
        "submissions",
        "uncut",
        "waits",
    ];
    let all = first.into_iter().chain(places).chain(last);
    all.map(str::to_owned).collect()
}

fn cells(frame: &GpuFrame) -> Vec<String> {
    let ms = |secs: f64| format!("{:.1}", 1e3 * secs);
    let mb = |bytes: u64| format!("{:.2}", bytes as f64 * 1e-6);
    let mut cells = vec![
        format!("{} {} x {}", frame.scene, frame.width, frame.height),
        frame.rays_per_pixel.to_string(),
        frame.edit.name().to_owned(),
        ms(frame.host_cpu_secs),
    ];
    cells.extend(frame.places.iter().map(|at| ms(at.host_cpu_secs)));
    let traffic = &frame.traffic;
    cells.extend([
        ms(frame.rest_secs()),
        mb(traffic.bytes_up),
        mb(traffic.bytes_down),
        traffic.dispatches.to_string(),
        traffic.steps.to_string(),
        traffic.idle_steps.to_string(),
        traffic.submissions.to_string(),
        traffic.recordings.to_string(),
        traffic.waits.to_string(),
    ]);
    cells
}

/// For a terminal.
pub fn gpu_frame_text(machine: &Machine, frames: &[GpuFrame]) -> String {
    let mut all = vec![heads()];
    all.extend(frames.iter().map(cells));
    device_line(machine) + "\n" + &aligned(&all)
}

/// The same as Markdown, with the command.
pub fn gpu_frame_markdown(command: &str, machine: &Machine, frames: &[GpuFrame]) -> String {
    let mut out = format!("    {command}\n\n- {}\n\n", device_line(machine));
    let heads = heads();
    let _ = writeln!(out, "| {} |", heads.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(heads.len()));
    for frame in frames {
        let _ = writeln!(out, "| {} |", cells(frame).join(" | "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lie_within_their_frame() {
        if crate::gpu::harness::test_device().is_none() {
            return;
        }
        let mut scene = crate::pack::test_scene();
        scene.objects.push(crate::pack::test_mesh(
            Side::Virtual,
            &[[-1.0, -1.0, -2.0], [1.0, -1.0, -2.0], [0.0, 1.0, -2.0]],
            &[[0, 1, 2]],
            crate::scene::Material::default(),
        ));
        let frames = gpu_frames(&scene, 2).expect("renders");
        assert_eq!(frames.len(), 3);
        for frame in &frames {
            assert_eq!(cells(frame).len(), heads().len());
            let named: f64 = frame.places.iter().map(|at| at.wall_secs).sum();
            assert!(named > 0.0 && named <= frame.wall_secs, "{frame:?}");
            let traffic = frame.traffic;
            assert!(traffic.bytes_up > 0 && traffic.bytes_down > 0, "{frame:?}");
            assert!(traffic.dispatches >= traffic.submissions, "{frame:?}");
            assert!(traffic.submissions >= traffic.waits, "{frame:?}");
            assert!(traffic.submissions >= traffic.recordings, "{frame:?}");
            assert!(traffic.recordings > 0, "{frame:?}");
        }
        // Negative control: a place left out is missed.
        let mut lacking = frames[0].clone();
        lacking.host_cpu_secs += 1.0;
        assert!(lacking.rest_secs() >= 1.0);
    }
}
