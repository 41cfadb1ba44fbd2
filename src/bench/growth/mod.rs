//! Cost as work grows: seconds against triangles, pixels, rays, objects and lights, each with the exponent of its power law.
//!
//! [`grow`] measures a [`Law`] on scenes made in code, in which one thing grows and all else that costs is held; the tables, the plot and the files are made
//! from its [`Curve`]s.

mod measure;
mod plot;
mod scenes;
mod table;

use serde::Serialize;

use super::Plan;
use super::fit::{Fit, log_log_fit};
use crate::cpu::pilot::MAX_LIGHTS_EXAMINED;
use crate::pack::FEW_LIGHTS;
use crate::packed::MAX_SPHERES;
use crate::scene::Choice;

pub use measure::grow;
pub use plot::growth_plot;
pub use table::{growth_csv, growth_markdown, growth_text};

/// An exponent is worse than expected if it lies above the range by more than this and by two of the errors that the runs' spread explains.
const SLACK: f64 = 0.03;

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Triangles of one mesh, and the time to build its tree on one thread.
    Build,
    /// Triangles, half of them real, at a fixed picture.
    Triangles,
    /// Pixels of one view.
    Pixels,
    RaysPerPixel,
    /// Virtual objects that cover the same area and have about the same triangles all together.
    Objects,
    /// Area lights that share one panel.
    Lights,
}

impl Choice for Law {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("build", Self::Build),
        ("triangles", Self::Triangles),
        ("pixels", Self::Pixels),
        ("rays", Self::RaysPerPixel),
        ("objects", Self::Objects),
        ("lights", Self::Lights),
    ];
}

impl Law {
    /// How often [`grow`] says what it is about to do.
    pub fn steps(self, plan: &Plan) -> u64 {
        let turns = 1 + u64::from(plan.repeats);
        match self {
            Self::Build => turns * scenes::triangle_counts().count() as u64,
            law => turns * plan.methods.len() as u64 * scenes::sizes(law),
        }
    }

    /// What is timed.
    pub fn timed(self) -> &'static str {
        match self {
            Self::Build => "tree build",
            _ => "render",
        }
    }

    /// What is counted.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Build | Self::Triangles => "triangles",
            Self::Pixels => "pixels",
            Self::RaysPerPixel => "rays per pixel",
            Self::Objects => "virtual objects",
            Self::Lights => "area lights",
        }
    }

    /// The range of exponents that the algorithms promise.
    pub fn expected(self) -> (f64, f64) {
        match self {
            Self::Build => (1.0, 1.15),
            Self::Triangles | Self::Objects => (0.0, 0.2),
            Self::Pixels | Self::RaysPerPixel => (0.9, 1.0),
            Self::Lights => (0.0, 0.05),
        }
    }

    /// Why that range.
    pub fn reason(self) -> String {
        let reason = match self {
            Self::Build => {
                "sorting and merging n boxes is O(n log n); the logarithm doubles from 1e3 to 1e6, which adds 0.1 to the exponent"
            }
            Self::Triangles => {
                "a ray descends O(log n) levels, twice as many at 1e6 triangles as at 1e3, an exponent of 0.1; a tree that no cache holds adds to it"
            }
            Self::Pixels => {
                "each pixel costs the same; edge pixels grow with the root only, and neighbouring rays lie closer together, which saves some"
            }
            Self::RaysPerPixel => {
                "each ray costs the same; the pilot and the composite cost once a pixel, so few rays are dearer a ray. (`direct` measures where rays are worth \
                 most from 8 a pixel on and spends more where they are: a step, no slope)"
            }
            Self::Objects => {
                return format!(
                    "covered area and, within 12%, triangles are held, the search is O(log n), and {MAX_SPHERES} spheres bound any number of objects; \
                     only the outlines grow, with the root of the number, and with them the rays of edge pixels"
                );
            }
            Self::Lights => {
                return format!(
                    "the panel is held; a light is drawn in O(1) from an alias table. (`direct` takes two steps up: it drops rays that up to {FEW_LIGHTS} \
                     lights make needless, and plans fewer rays where none of up to {MAX_LIGHTS_EXAMINED} lights can be blocked)"
                );
            }
        };
        reason.to_owned()
    }
}

/// How the cost of one method grew.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    #[serde(serialize_with = "by_name")]
    pub law: Law,
    /// "cpu direct sobol".
    pub method: String,
    pub device: String,
    /// "cpu": processor seconds of the whole process; "wall": seconds on the clock.
    pub cost: &'static str,
    /// Of seconds over work; `None` of fewer than two sizes.
    pub exponent: Option<Fit>,
    /// Error of the exponent that the spread of the runs explains; `None` where a size ran once.
    pub exponent_noise: Option<f64>,
    /// Of rays traced over work.
    pub rays_exponent: Option<Fit>,
    /// Ascending.
    pub points: Vec<Point>,
}

/// One amount of work.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// In the law's unit.
    pub work: u64,
    /// The least of the runs: what disturbs a run only adds to it.
    pub secs: f64,
    pub runs: Vec<f64>,
    /// Rays traced, all kinds together, in the last run; 0 where nothing is traced.
    pub rays: u64,
}

impl Curve {
    fn new(
        law: Law,
        method: String,
        device: String,
        cost: &'static str,
        points: Vec<Point>,
    ) -> Self {
        let fit = |y: fn(&Point) -> f64| {
            log_log_fit(
                &points
                    .iter()
                    .map(|p| (p.work as f64, y(p)))
                    .collect::<Vec<_>>(),
            )
        };
        let (exponent, rays_exponent) = (fit(|p| p.secs), fit(|p| p.rays as f64));
        let exponent_noise = slope_noise(&points);
        Self {
            law,
            method,
            device,
            cost,
            exponent,
            exponent_noise,
            rays_exponent,
            points,
        }
    }

    /// The cost grows faster than the algorithms promise by more than the runs' spread explains. How well a power law fits does not matter: a
    /// step is a growth too.
    pub fn is_worse_than_expected(&self) -> bool {
        let (_, most) = self.law.expected();
        self.exponent.is_some_and(|fit| {
            let doubt = 2.0 * self.exponent_noise.unwrap_or(f64::INFINITY);
            fit.slope - most > doubt.max(SLACK)
        })
    }
}

/// The error of the slope of log seconds over log work, from those of the points: the spread of each one's runs, for the least of them is no surer
/// than any.
fn slope_noise(points: &[Point]) -> Option<f64> {
    let count = points.len() as f64;
    let logs: Vec<f64> = points.iter().map(|p| (p.work as f64).ln()).collect();
    let mean = logs.iter().sum::<f64>() / count;
    let spread: f64 = logs.iter().map(|x| (x - mean).powi(2)).sum();
    let variances: Option<Vec<f64>> = points.iter().map(|p| log_variance(&p.runs)).collect();
    let sum: f64 = (logs.iter().zip(variances?))
        .map(|(x, variance)| (x - mean).powi(2) * variance)
        .sum();
    (spread > 0.0).then(|| sum.sqrt() / spread)
}

/// Variance of the logarithms of two or more numbers.
fn log_variance(runs: &[f64]) -> Option<f64> {
    let count = runs.len() as f64;
    let mean = runs.iter().map(|r| r.ln()).sum::<f64>() / count;
    let squares: f64 = runs.iter().map(|r| (r.ln() - mean).powi(2)).sum();
    (runs.len() > 1).then(|| squares / (count - 1.0))
}

fn by_name<S: serde::Serializer>(law: &Law, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(law.name())
}

#[cfg(test)]
mod test_support {
    use super::*;

    /// Seconds as a power of the work, with a scatter of a few percent.
    pub(super) fn curve(law: Law, exponent: f64) -> Curve {
        let scatter = [1.01, 0.98, 1.02, 0.99, 1.0];
        let points = [1u64, 4, 16, 64, 256]
            .iter()
            .zip(scatter)
            .map(|(&work, s)| {
                let secs = 0.01 * (work as f64).powf(exponent) * s;
                Point {
                    work,
                    secs,
                    runs: vec![secs, 1.1 * secs],
                    rays: 1000 * work,
                }
            });
        let [method, device] = ["cpu direct sobol", "2 CPU threads"].map(str::to_owned);
        Curve::new(law, method, device, "cpu", points.collect())
    }
}

#[cfg(test)]
mod tests;
