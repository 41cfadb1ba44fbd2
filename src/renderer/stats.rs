//! What a render took, for programs: the record behind `--stats`.

use serde::Serialize;

use super::{RayCounts, Renderer};
use crate::film::PixelCounts;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stats {
    pub seconds: StatsSeconds,
    pub rays: RayCounts,
    pub pixels: PixelCounts,
    pub error: StatsError,
    /// Samples left out because they were not finite.
    pub non_finite_samples: u64,
    /// "cpu" or "gpu".
    pub backend: String,
    /// The adapter's name, or the number of threads.
    pub device: String,
}

/// Seconds on the clock, but for `cpu`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StatsSeconds {
    /// Scene file and everything it names.
    pub load: f64,
    /// Acceleration structures and whatever else precedes the first ray.
    pub build: f64,
    /// The GPU's device, shaders and trees.
    pub compile: f64,
    /// The pilot, which plans the samples.
    pub look_ahead: f64,
    pub render: f64,
    /// Composite and files.
    pub write: f64,
    /// Of the processors, in all threads, for `look_ahead` and `render`.
    pub cpu: f64,
}

/// How good the picture is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StatsError {
    /// Root mean square over the picture, linear.
    pub rms: f64,
    /// "scrambles": a standard error from independent scrambles; "samples": an upper estimate from the variance of the samples.
    pub from: String,
    /// Independent scrambles; 1 where the error is from the samples.
    pub scrambles: u32,
}

impl Stats {
    /// Of a render whose loading and writing took these times.
    pub fn new(renderer: &Renderer, load_secs: f64, write_secs: f64) -> Self {
        let seconds = renderer.seconds();
        Self {
            seconds: StatsSeconds {
                load: load_secs,
                build: seconds.build,
                compile: seconds.compile,
                look_ahead: seconds.look_ahead,
                render: seconds.render,
                write: write_secs,
                cpu: seconds.cpu,
            },
            rays: renderer.rays(),
            error: StatsError {
                rms: renderer.error(),
                from: match renderer.stated() {
                    Some(_) => "scrambles",
                    None => "samples",
                }
                .to_owned(),
                scrambles: renderer.stated().map_or(1, |stated| stated.scrambles),
            },
            pixels: renderer.film().counts(),
            non_finite_samples: renderer.film().non_finite_samples(),
            backend: renderer.backend_name().to_owned(),
            device: renderer.device_name(),
        }
    }

    pub fn to_json(&self) -> String {
        // Strings and numbers only: this cannot fail.
        let mut json = serde_json::to_string_pretty(self).unwrap_or_default();
        json.push('\n');
        json
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_exactly_the_documented_keys() {
        let stats = Stats {
            seconds: StatsSeconds::default(),
            rays: RayCounts::default(),
            pixels: PixelCounts::default(),
            error: StatsError::default(),
            non_finite_samples: 0,
            backend: "cpu".into(),
            device: "2 CPU threads".into(),
        };
        let json: serde_json::Value = serde_json::from_str(&stats.to_json()).unwrap();
        let mut keys = Vec::new();
        for (key, value) in json.as_object().unwrap() {
            match value.as_object() {
                Some(inner) => keys.extend(inner.keys().map(|k| format!("{key}.{k}"))),
                None => keys.push(key.clone()),
            }
        }
        keys.sort();
        let mut documented: Vec<&str> = "backend device non_finite_samples \
            seconds.load seconds.build seconds.compile seconds.look_ahead seconds.render seconds.write seconds.cpu \
            rays.primary rays.mixed rays.real rays.mixed_shadow rays.real_shadow \
            error.rms error.from error.scrambles pixels.background pixels.edge pixels.virtual pixels.skipped"
            .split_whitespace()
            .collect();
        documented.sort_unstable();
        assert_eq!(keys, documented);
    }
}
