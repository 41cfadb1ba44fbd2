//! How long edits take to be seen.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::Window;
use crate::preview::composition::{rounded, virtual_objects};
use crate::preview::quantity::Quantity;
use crate::preview::render_threads::Level;

impl Window {
    /// From edits to the pictures that show them first, as a Markdown table.
    pub(super) fn measure(&mut self, edits: u32) -> Result<String, String> {
        let objects = self
            .session()
            .loaded()
            .map(|loaded| virtual_objects(&loaded.scene).next());
        let object = objects.flatten();
        self.wait_for_picture(Some(1))?;
        for kind in 0..4 {
            for n in 0..edits {
                let step = f64::from(n % 7) * 0.01 + 0.01;
                self.session_mut()
                    .edit("measure", |composition| match kind {
                        0 => composition.lens.focus_distance_m = rounded(0.7 + step, 1e-4),
                        1 => {
                            if let Some(form) = &mut composition.environment {
                                form.rotation_deg = rounded(100.0 * step, 0.01);
                            }
                        }
                        2 => {
                            if let Some(object) = object {
                                composition.objects[object].translation.x = rounded(step, 1e-5);
                            }
                        }
                        _ => Quantity::Exposure.set(composition, step),
                    });
                self.wait_for_coarse()?;
            }
        }
        let whole = [4, 16].map(|rays| (rays, self.measure_whole(rays)));
        let added = self.measure_files(&["glb", "gltf"], true)?;
        let swapped = self.measure_files(&["png", "jpg", "jpeg", "webp"], false)?;
        let longest_ms = 1e3 * self.app().longest_frame.as_secs_f64();
        let latencies = self.session().renderers().latencies();
        let mut table = String::from(
            "| edit | edits | median, ms | p95, ms | of the processors, median, ms |\n| --- | --- | --- | --- | --- |\n",
        );
        let mut row = |name: &str, times: Option<Spread>, processors: Option<Spread>| {
            if let Some(times) = times {
                let processors =
                    processors.map_or("".to_owned(), |p| format!("{:.0}", p.median_ms));
                table += &format!(
                    "| {name} | {} | {:.0} | {:.0} | {processors} |\n",
                    times.count, times.median_ms, times.p95_ms
                );
            }
        };
        for change in ["lens", "light", "object", "exposure or bounces"] {
            let of_change = || {
                let all = latencies.iter();
                all.filter(|latency| latency.change == change && latency.level == Level::Coarse)
            };
            let times = Spread::of(of_change().map(|latency| latency.time));
            let processors = Spread::of(of_change().map(|latency| latency.processor_time));
            row(change, times, processors);
        }
        for (rays, times) in whole {
            row(
                &format!("lens, whole picture of {rays} rays"),
                Spread::of(times?.into_iter()),
                None,
            );
        }
        row("object added", Spread::of(added.into_iter()), None);
        row("photograph swapped", Spread::of(swapped.into_iter()), None);
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = load.split(' ').next().unwrap_or_default();
        Ok(table
            + &format!(
                "\nlongest frame of the window: {longest_ms:.0} ms; load of the machine: {load}\n"
            ))
    }

    /// From edits of the lens to whole pictures of so many rays per pixel, the pause before the first of them included.
    fn measure_whole(&mut self, rays: u32) -> Result<Vec<Duration>, String> {
        const PICTURES: u32 = 5;
        let mut times = Vec::new();
        for n in 0..PICTURES {
            let begin = Instant::now();
            let focus_m = rounded(0.6 + 0.01 * f64::from(n + 1), 1e-4);
            (self.session_mut()).edit("measure", |composition| {
                composition.lens.focus_distance_m = focus_m;
            });
            self.wait_for_picture(Some(rays))?;
            times.push(begin.elapsed());
        }
        Ok(times)
    }

    /// From files that are dropped, one of the scene's own with such an ending, to the pictures that show them first; `undone`: each is taken out
    /// again.
    fn measure_files(&mut self, endings: &[&str], undone: bool) -> Result<Vec<Duration>, String> {
        const FILES: usize = 5;
        let loaded = self.session().loaded().ok_or("no scene is read")?;
        let has_ending = |file: &&PathBuf| {
            let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
            ending.is_some_and(|ending| endings.contains(&&*ending))
        };
        let Some(file) = loaded.scene.inputs.iter().find(has_ending).cloned() else {
            return Ok(Vec::new());
        };
        let mut times = Vec::new();
        for _ in 0..FILES {
            let begin = Instant::now();
            self.session_mut().take_file(&file, None);
            self.wait_for_scene()?;
            self.wait_for_coarse()?;
            times.push(begin.elapsed());
            if undone {
                self.session_mut().undo();
                self.wait_for_scene()?;
                self.wait_for_coarse()?;
            }
        }
        Ok(times)
    }
}

/// Of some times.
struct Spread {
    count: usize,
    median_ms: f64,
    p95_ms: f64,
}

impl Spread {
    /// `None` of none.
    fn of(times: impl Iterator<Item = Duration>) -> Option<Self> {
        let mut ms: Vec<f64> = times.map(|time| 1e3 * time.as_secs_f64()).collect();
        ms.sort_by(f64::total_cmp);
        let last = ms.len().checked_sub(1)?;
        let at = |share: f64| ms[(last as f64 * share).round() as usize];
        Some(Self {
            count: ms.len(),
            median_ms: at(0.5),
            p95_ms: at(0.95),
        })
    }
}
