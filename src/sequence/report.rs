//! What a sequence came to: counts, seconds, frames a second.

use std::fmt::Write;

use serde::Serialize;

use crate::renderer::{RayCounts, Renderer};
use crate::stages::StageSeconds;

/// Seconds over all frames, by what they were spent on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SequenceSeconds {
    /// Reading and decoding frames.
    pub load: f64,
    /// The first frame's acceleration structures and packing.
    pub first_build: f64,
    /// GPU kernels.
    pub compile: f64,
    /// Pilot, camera, and what moved.
    pub edit: f64,
    pub render: f64,
    pub composite: f64,
    #[serde(flatten)]
    pub stages: StageSeconds,
    pub write: f64,
}

impl SequenceSeconds {
    /// What is spent on every frame.
    fn of_frames(&self) -> f64 {
        self.load + self.edit + self.render + self.composite + self.stages.total() + self.write
    }
}

/// Frames by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FrameCounts {
    pub rendered: u32,
    /// Their poses are null.
    pub passed_through: u32,
    /// Finished by an earlier run.
    pub kept: u32,
    /// Rendered with the camera or an object moving while the shutter was open.
    pub moving: u32,
}

/// What a sequence came to.
#[derive(Debug, Serialize)]
pub struct SequenceStats {
    pub frames: FrameCounts,
    pub seconds: SequenceSeconds,
    /// Rendered frames over the seconds spent on them.
    pub frames_per_second: f64,
    pub rays: u64,
    pub non_finite_samples: u64,
    pub backend: String,
    pub device: String,
    /// Largest so far, where the system tells.
    pub peak_memory_mib: Option<f64>,
    /// Matrix and range of what was written, where it is a film.
    pub film_colours: Option<String>,
}

impl SequenceStats {
    pub(super) fn new(
        frames: FrameCounts,
        seconds: SequenceSeconds,
        rays: RayCounts,
        non_finite_samples: u64,
        renderer: Option<&Renderer>,
        film_colours: Option<String>,
    ) -> Self {
        let spent = seconds.of_frames();
        Self {
            frames,
            seconds,
            frames_per_second: match spent > 0.0 {
                true => f64::from(frames.rendered) / spent,
                false => 0.0,
            },
            rays: rays.traced(),
            non_finite_samples,
            backend: renderer.map_or("none", Renderer::backend_name).to_owned(),
            device: renderer.map_or_else(String::new, Renderer::device_name),
            peak_memory_mib: peak_memory_mib(),
            film_colours,
        }
    }

    /// A few lines for the user, `output` being where the frames went.
    pub fn text(&self, output: &str) -> String {
        let FrameCounts {
            rendered,
            passed_through,
            kept,
            moving,
        } = self.frames;
        let s = &self.seconds;
        let mut text = format!("frames {output}\n");
        let _ = writeln!(
            text,
            "{rendered} rendered ({moving} in motion), {passed_through} passed through, {kept} kept from before"
        );
        if let Some(colours) = &self.film_colours {
            let _ = writeln!(text, "film in {colours} (--matrix)");
        }
        if rendered == 0 {
            return text;
        }
        let each = |seconds: f64| 1e3 * seconds / f64::from(rendered.max(1));
        let _ = write!(
            text,
            "{:.2} frames/s on {}; ms a frame: load {:.1}, edit {:.1}, render {:.1}, composite {:.1}",
            self.frames_per_second,
            self.device,
            each(s.load),
            each(s.edit),
            each(s.render),
            each(s.composite)
        );
        for (name, seconds) in s.stages.by_name() {
            if seconds > 0.0 {
                let name = name.replace('_', " ");
                let _ = write!(text, ", {name} {:.1}", each(seconds));
            }
        }
        let _ = writeln!(text, ", write {:.1}", each(s.write));
        text
    }
}

/// Linux's VmHWM.
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}
