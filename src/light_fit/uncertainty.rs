//! How sure the strengths and directions of a fitted light are.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::comparisons::{Clusters, Linearised};
use super::fitter::{Fitter, Sun, rotated};
use super::rays::sunlight;

/// Fewer do not tell their scatter.
const LEAST_CLUSTERS: usize = 8;
/// Half the steps of the slopes by direction and rotation, degrees.
const SLOPE_STEP_DEG: f64 = 2.0;
/// How far the light of surfaces that the camera does not see may be off, as a share of it, one standard deviation: they lie in the sun or in shadow.
const UNSEEN: f32 = 0.5;

impl Fitter<'_> {
    /// Standard deviations: the sandwich of White (1980), with blocks of the photograph for independent errors (Liang and Zeger 1986), or materials
    /// where albedos are known and that is more; and what the light of those surfaces would change that the photograph does not show.
    pub fn uncertainty(
        &self,
        (rotation_deg, turns): (f64, bool),
        sun: Option<Sun>,
        scale: f64,
    ) -> Uncertainty {
        let log_light = |rotation_deg: f64, sun: Option<Sun>, scale: f64| {
            let surroundings = self.surroundings_at(rotation_deg);
            let points = &self.grid.points;
            let sunlight = sun.map(|sun| (sunlight(self.scene, points, sun.direction), sun.ratio));
            let sun = sunlight.as_ref().map(|(light, ratio)| (&light[..], *ratio));
            self.log_light(&Self::light_at_one(&surroundings, sun), scale)
        };
        let slope = |low: Vec<f32>, high: Vec<f32>, step: f64| -> Vec<f32> {
            let pairs = low.iter().zip(&high);
            pairs
                .map(|(low, high)| (high - low) / (2.0 * step) as f32)
                .collect()
        };
        let turned = |sun: Sun, axis: DVec3, degrees: f64| Sun {
            direction: rotated(sun.direction, axis, degrees),
            ..sun
        };
        let mut slopes = Vec::new();
        let mut names = Vec::new();
        if self.comparisons.are_absolute {
            names.push(Parameter::LogScale);
            let at = |factor: f64| log_light(rotation_deg, sun, scale * factor);
            slopes.push(slope(at((-0.01f64).exp()), at(0.01f64.exp()), 0.01));
        }
        if turns {
            names.push(Parameter::Rotation);
            let at = |step: f64| log_light(rotation_deg + step, sun, scale);
            slopes.push(slope(
                at(-SLOPE_STEP_DEG),
                at(SLOPE_STEP_DEG),
                SLOPE_STEP_DEG,
            ));
        }
        if let Some(sun) = sun {
            names.push(Parameter::LogRatio);
            let with = |sun: Sun| log_light(rotation_deg, Some(sun), scale);
            let at = |factor: f64| {
                let ratio = sun.ratio * factor;
                with(Sun { ratio, ..sun })
            };
            slopes.push(slope(at((-0.05f64).exp()), at(0.05f64.exp()), 0.05));
            let towards = sun.direction.as_dvec3();
            let side = towards.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
            for (parameter, axis) in [
                (Parameter::Sideways, side.cross(towards)),
                (Parameter::Upwards, side),
            ] {
                names.push(parameter);
                let at = |step: f64| with(turned(sun, axis, step));
                slopes.push(slope(
                    at(-SLOPE_STEP_DEG),
                    at(SLOPE_STEP_DEG),
                    SLOPE_STEP_DEG,
                ));
            }
        }
        let centre = log_light(rotation_deg, sun, scale);
        // The last slope is no parameter.
        slopes.push(self.unseen_slope(&centre));
        let sigmas = [Clusters::Blocks, Clusters::Materials].map(|clusters| {
            if clusters == Clusters::Materials && !self.comparisons.are_absolute {
                return None;
            }
            let sums = (self.comparisons).linearised(&centre, &slopes, self.sigma, clusters);
            sandwich(&sums, names.len())
        });
        let of = |wanted: Parameter| {
            let at = names.iter().position(|name| *name == wanted)?;
            let told = sigmas.iter().flatten().map(|sigmas| sigmas[at]);
            told.max_by(f64::total_cmp)
        };
        Uncertainty {
            log_scale: of(Parameter::LogScale),
            rotation_deg: of(Parameter::Rotation),
            log_ratio: of(Parameter::LogRatio),
            sun_deg: of(Parameter::Sideways)
                .zip(of(Parameter::Upwards))
                .map(|(a, b)| a.hypot(b)),
        }
    }

    /// ln of the irradiance by one standard deviation of the light that unseen surfaces send.
    fn unseen_slope(&self, log_light: &[f32]) -> Vec<f32> {
        let pairs = self.openness.from_unseen.iter().zip(log_light);
        pairs
            .map(|(unseen, log)| UNSEEN * unseen / log.exp())
            .collect()
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Parameter {
    LogScale,
    Rotation,
    LogRatio,
    Sideways,
    Upwards,
}

/// Standard deviations; `None`: not fitted, or not told by the photograph.
#[derive(Clone, Copy, Debug, Default)]
pub struct Uncertainty {
    pub log_scale: Option<f64>,
    pub rotation_deg: Option<f64>,
    pub log_ratio: Option<f64>,
    /// Of the direction, both ways together.
    pub sun_deg: Option<f64>,
}

/// Standard deviations of the first `n` parameters; `None`: the comparisons do not tell them apart, or are too few clusters. The last slope is that of
/// one standard deviation of an error that all comparisons share.
fn sandwich(sums: &Linearised, n: usize) -> Option<Vec<f64>> {
    let has_terms = |gradient: &&Vec<f64>| gradient.iter().any(|value| *value != 0.0);
    let count = sums.gradients.iter().filter(has_terms).count();
    if count < LEAST_CLUSTERS {
        return None;
    }

    let all = DMatrix::from_row_slice(n + 1, n + 1, &sums.normal);
    let inverse = all.view((0, 0), (n, n)).into_owned().cholesky()?.inverse();
    let shared = &inverse * all.view((0, n), (n, 1));
    let mut scatter = DMatrix::zeros(n, n);
    for gradient in &sums.gradients {
        let gradient = DVector::from_column_slice(&gradient[..n]);
        scatter += &gradient * gradient.transpose();
    }
    let correction = count as f64 / (count - 1) as f64;
    let covariance = &inverse * scatter * &inverse * correction;
    let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt().hypot(shared[i]);
    Some((0..n).map(sigma).collect())
}
