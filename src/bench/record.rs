//! The record of a benchmark: what `results.json` holds and every table, plot and comparison is made from.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Errors, Goal, Machine, Reach};
use crate::Refusal;
use crate::decode::{MAX_TEXT_BYTES, read_text};
use crate::renderer::{RayCounts, Skip};
use crate::scene::{BackendChoice, Composite, Estimator, SamplerKind};

/// Version of the JSON; a file of another version is not compared.
pub const FORMAT: u32 = 1;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub format: u32,
    /// Version of the program.
    pub mixray: String,
    /// What was typed.
    pub command: String,
    pub machine: Machine,
    pub references: Vec<ReferenceNote>,
    pub rows: Vec<Row>,
    /// Least-squares slope of log RMSE over log rays per pixel, by scene and method.
    pub slopes: BTreeMap<String, f64>,
    pub targets: Vec<Target>,
}

impl Report {
    /// Reads a `results.json`.
    ///
    /// # Errors
    /// The file, and why it is none.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let problem = |reason: String| Refusal::from(format!("{}: {reason}", path.display()));
        let text = read_text(path, MAX_TEXT_BYTES).map_err(problem)?;
        let value: serde_json::Value = serde_json::from_str(&text)
            .map_err(|error| problem(format!("is no results.json: {error}")))?;
        let format = value.get("format").and_then(serde_json::Value::as_u64);
        if format != Some(u64::from(FORMAT)) {
            return Err(problem(format!(
                "is no results.json of format {FORMAT}; make it again with this version"
            )));
        }
        serde_json::from_value(value)
            .map_err(|error| problem(format!("is no results.json: {error}")))
    }
}

/// What the errors of a scene are measured against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceNote {
    pub scene: String,
    #[serde(with = "by_name")]
    pub composite: Composite,
    pub file: String,
    /// "made", "cached" or "given".
    pub source: String,
    /// Root mean square over the picture, linear; 0: not known.
    pub standard_error: f64,
    /// What was asked for; the reference stays above it where its rays ran out.
    pub wanted_standard_error: f64,
    /// All scrambles together; 0: not known.
    pub rays_per_pixel: u64,
    pub scrambles: u32,
    /// Fraction of the picture's pixels that something virtual covers, wholly or in part.
    pub virtual_fraction: f64,
}

/// One way to render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Method {
    #[serde(with = "by_name")]
    pub backend: BackendChoice,
    #[serde(with = "by_name")]
    pub estimator: Estimator,
    #[serde(with = "by_name")]
    pub sampler: SamplerKind,
    #[serde(with = "by_name")]
    pub composite: Composite,
    /// A saving that is switched off.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        with = "by_name_if_any"
    )]
    pub without: Option<Skip>,
    /// What decides how many rays are taken, unless it is their number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<Goal>,
    /// With the preview filter.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub filter: bool,
}

impl Method {
    /// "cpu direct sobol"; a quotient composite, a goal and a saving that is off are named.
    pub fn label(&self) -> String {
        use crate::scene::Choice;
        let mut label = format!(
            "{} {} {}",
            self.backend.name(),
            self.estimator.name(),
            self.sampler.name()
        );
        if self.composite != Composite::Additive {
            label += " ";
            label += self.composite.name();
        }
        if self.filter {
            label += " filtered";
        }
        if let Some(goal) = &self.goal {
            label += " ";
            label += &goal.label();
        }
        if let Some(skip) = self.without {
            label += " without ";
            label += skip.name();
        }
        label
    }
}

/// One method at one number of rays per pixel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub scene: String,
    pub width: u32,
    pub height: u32,
    #[serde(flatten)]
    pub method: Method,
    pub device: String,
    /// With a goal: the most that a pixel may take.
    pub rays_per_pixel: u32,
    /// With a goal: what a pixel within reach took, mean over pixels and runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_rays_per_pixel: Option<f64>,
    /// Acceleration structures and packing, once.
    pub build_secs: f64,
    /// Opening the device and composing its shaders, once; they are compiled in the warm-up.
    pub compile_secs: f64,
    /// From the scene in memory to the composite: pilot, samples, real rays of edge pixels, composite. Mean over the runs.
    pub wall_secs: f64,
    /// Standard deviation between runs, 0 of one run; likewise below.
    pub wall_secs_sd: f64,
    /// Of these the seconds before the first sample: pilot, empty film, upload.
    pub setup_secs: f64,
    /// Processor seconds of the whole process over the same stretch.
    pub cpu_secs: f64,
    pub cpu_secs_sd: f64,
    /// Mean over the runs.
    pub rays: RayCounts,
    /// All rays over wall seconds.
    pub mrays_per_sec: f64,
    /// Of the pixels: out of everything virtual's reach, so that no ray was traced for them.
    pub skipped_fraction: f64,
    pub non_finite_samples: u64,
    pub errors: Errors,
    pub mse_sd: f64,
    /// What `efficiency` counts: "cpu" seconds, or "wall" seconds on a hardware GPU.
    pub cost: String,
    /// 1 / (seconds x mean squared error); none where the error is lost in the reference's.
    pub efficiency: Option<f64>,
    pub runs: Vec<Run>,
}

impl Row {
    /// Tells a row from all others of a report.
    pub fn key(&self) -> String {
        format!(
            "{} {}x{} {} {}",
            self.scene,
            self.width,
            self.height,
            self.method.label(),
            self.rays_per_pixel
        )
    }

    /// The seconds that `efficiency` counts.
    pub fn cost_secs(&self) -> f64 {
        if self.cost == "wall" {
            self.wall_secs
        } else {
            self.cpu_secs
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    pub seed: u32,
    pub wall_secs: f64,
    pub cpu_secs: f64,
    pub mse: f64,
}

/// What a method needs to reach an RMSE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    pub scene: String,
    #[serde(flatten)]
    pub method: Method,
    pub rmse: f64,
    pub wall_secs: Reach,
    pub cpu_secs: Reach,
    pub rays_per_pixel: Reach,
}

/// Likewise, where there may be none.
mod by_name_if_any {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use crate::scene::Choice;

    pub fn serialize<T: Choice, S: Serializer>(
        choice: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match choice {
            Some(choice) => serializer.serialize_str(choice.name()),
            None => serializer.serialize_none(),
        }
    }

    pub fn deserialize<'de, T: Choice, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<T>, D::Error> {
        let name: Option<String> = Option::deserialize(deserializer)?;
        name.map(|name| {
            T::from_name(&name).ok_or_else(|| D::Error::custom(format!("unknown choice {name:?}")))
        })
        .transpose()
    }
}

/// Choices as their names.
mod by_name {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use crate::scene::Choice;

    pub fn serialize<T: Choice, S: Serializer>(
        choice: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(choice.name())
    }

    pub fn deserialize<'de, T: Choice, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<T, D::Error> {
        let name = String::deserialize(deserializer)?;
        T::from_name(&name).ok_or_else(|| D::Error::custom(format!("unknown choice {name:?}")))
    }
}

#[cfg(test)]
pub(super) mod test_support {
    use super::*;
    use crate::bench::{Aim, Figures};
    use crate::renderer::CameraNoise;
    use crate::scene::NoiseFit;

    /// Two rows of two runs each.
    pub fn report() -> Report {
        let method = |estimator, sampler| Method {
            backend: BackendChoice::Cpu,
            estimator,
            sampler,
            composite: Composite::Additive,
            without: None,
            goal: None,
            filter: false,
        };
        let row = |method, secs: f64, mse: f64| Row {
            scene: "a <b>, \"c\"".into(),
            width: 4,
            height: 3,
            method,
            device: "2 CPU threads".into(),
            rays_per_pixel: 4,
            mean_rays_per_pixel: None,
            build_secs: 0.01,
            compile_secs: 0.0,
            wall_secs: secs / 2.0,
            wall_secs_sd: 0.001,
            setup_secs: 0.001,
            cpu_secs: secs,
            cpu_secs_sd: 0.002,
            rays: RayCounts {
                primary: 48,
                mixed: 60,
                real: 5,
                mixed_shadow: 70,
                real_shadow: 7,
            },
            mrays_per_sec: 1.5,
            skipped_fraction: 0.25,
            non_finite_samples: 0,
            errors: Errors {
                all: Figures {
                    pixels: 12,
                    mse,
                    rmse: mse.sqrt(),
                    rel_mse: 2.0 * mse,
                    p99: 3.0 * mse.sqrt(),
                    flip: 0.01,
                },
                ..Errors::default()
            },
            mse_sd: 0.1 * mse,
            cost: "cpu".into(),
            efficiency: Some(1.0 / (secs * mse)),
            runs: [0.98, 1.02]
                .iter()
                .enumerate()
                .map(|(seed, factor)| Run {
                    seed: seed as u32,
                    wall_secs: secs / 2.0,
                    cpu_secs: secs * factor,
                    mse,
                })
                .collect(),
        };
        Report {
            format: FORMAT,
            mixray: "0.0.0".into(),
            command: "mixray bench".into(),
            machine: Machine {
                cpu: "cpu".into(),
                threads: 2,
                os: "linux".into(),
                gpu: None,
            },
            references: Vec::new(),
            rows: vec![
                row(method(Estimator::Direct, SamplerKind::Sobol), 0.2, 1e-4),
                row(method(Estimator::Paper, SamplerKind::Jittered), 0.4, 4e-4),
            ],
            slopes: BTreeMap::new(),
            targets: Vec::new(),
        }
    }

    #[test]
    fn json_reads_back_and_names_what_it_holds() {
        let mut report = report();
        report.rows[0].method.without = Some(Skip::OutOfReach);
        let fit = [1.0, 2.0, 3.0].map(|a| NoiseFit { a, b: 0.25 });
        let max_rays_per_pixel = 64;
        let goal = |aim| Goal {
            aim,
            max_rays_per_pixel,
        };
        report.rows[0].method.goal = Some(goal(Aim::TargetError(0.004)));
        report.rows[0].mean_rays_per_pixel = Some(31.5);
        let label = report.rows[0].method.label();
        assert_eq!(
            label,
            "cpu direct sobol to error 0.004 without out-of-reach"
        );
        report.rows.push(report.rows[0].clone());
        report.rows[2].method.goal = Some(goal(Aim::CameraNoise(CameraNoise { fit })));
        let json = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<Report>(&json).unwrap(), report);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["rows"][0]["without"], "out-of-reach");
        let row = value["rows"][1].as_object().unwrap();
        assert!(!row.contains_key("without") && !row.contains_key("goal"));
        for (key, expected) in [
            ("backend", "cpu"),
            ("estimator", "paper"),
            ("sampler", "jittered"),
            ("composite", "additive"),
            ("cost", "cpu"),
        ] {
            assert_eq!(row[key], expected);
        }
        assert_eq!(row["rays"]["mixed_shadow"], 70);
        assert_eq!(row["errors"]["edge"], serde_json::Value::Null);
        let wrong = json.replace("jittered", "jitterd");
        assert!(serde_json::from_str::<Report>(&wrong).is_err());
    }
}
