//! How well a light explains the photograph, and its strengths by least squares.

use glam::{DMat3, DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::comparisons::{Clusters, Comparisons, Costs, Linearised};
use super::directions::ROTATIONS;
use super::points::Grid;
use super::rays::{Openness, sunlight};
use crate::least_squares::{Descending, Descent};
use crate::math::luminance;
use crate::packed::PackedScene;

/// Only every third comparison is asked while directions are searched.
pub const STRIDE: usize = 3;
/// Suns are looked for higher than this, sine of the elevation.
const LEAST_ELEVATION: f32 = 0.08;
/// Light of a sun over that of the surroundings, means over the points, that a search tries.
const STRENGTHS: [f64; 7] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Irradiance that no logarithm is taken below, of the mean.
const DARKEST: f64 = 1e-4;
/// Fewer do not tell their scatter.
const LEAST_CLUSTERS: usize = 8;
/// Half the steps of the slopes by direction and rotation, degrees.
const SLOPE_STEP_DEG: f64 = 2.0;
const DESCENT: Descent = Descent {
    steps: 20,
    first_damping: 1e-3,
    least_damping: 1e-9,
    most_damping: 1e6,
    least_gain: 1e-7,
};

/// What the points know of the light.
pub struct Fitter<'a> {
    pub scene: &'a PackedScene,
    pub grid: &'a Grid,
    pub directions: &'a [Vec3],
    pub openness: &'a Openness,
    pub comparisons: &'a Comparisons,
    /// Irradiance of the points by the surroundings at scale 1, by rotation.
    pub surroundings: Vec<Vec<f32>>,
    /// Irradiance of the points that is not fitted, in the photograph's units.
    pub fixed: Vec<f32>,
    /// Mean reflectance of what has none of its own.
    pub mean_albedo: f64,
    /// Spread of what light does not explain, ln of luminance.
    pub sigma: f64,
}

/// A sun and its strength.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// Towards it.
    pub direction: Vec3,
    /// Irradiance across its light, over the scale of the surroundings.
    pub ratio: f64,
}

/// Light that was tried.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub rotation_deg: f64,
    pub sun: Option<Sun>,
    pub costs: Costs,
}

impl Candidate {
    pub fn cost(&self) -> f64 {
        self.costs.iter().sum()
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64
}

impl Fitter<'_> {
    /// Irradiance by the surroundings, between the rotations that are known.
    pub fn surroundings_at(&self, rotation_deg: f64) -> Vec<f32> {
        if self.surroundings.len() == 1 {
            return self.surroundings[0].clone();
        }
        let at = rotation_deg.rem_euclid(360.0) / 360.0 * ROTATIONS as f64;
        let first = at as usize % ROTATIONS;
        let share = (at - at.floor()) as f32;
        let pair = self.surroundings[first]
            .iter()
            .zip(&self.surroundings[(first + 1) % ROTATIONS]);
        pair.map(|(a, b)| a + (b - a) * share).collect()
    }

    /// The scale at which the proxy reflects as much as it should in the mean.
    fn scale_of_mean(&self, light_at_one: &[f32]) -> f64 {
        let wanted = |point: &super::points::Point| {
            let albedo = point.albedo.map_or(self.mean_albedo, f64::from);
            f64::from(luminance(point.shown.into())) * std::f64::consts::PI / albedo
        };
        let points = &self.grid.points;
        let wanted = points.iter().map(wanted).sum::<f64>() / points.len().max(1) as f64;
        let rest = (wanted - mean(&self.fixed)).max(0.05 * wanted);
        let scale = rest / mean(light_at_one).max(1e-12);
        // Not the mean, where single points can tell: they may show what is not modelled.
        let log_light = self.log_light(light_at_one, scale);
        let off = self.comparisons.median_of_known(&log_light);
        scale * off.map_or(1.0, f64::exp)
    }

    fn light_at_one(surroundings: &[f32], sun: Option<(&[f32], f64)>) -> Vec<f32> {
        match sun {
            None => surroundings.to_vec(),
            Some((sun, ratio)) => (surroundings.iter().zip(sun))
                .map(|(around, sun)| around + sun * ratio as f32)
                .collect(),
        }
    }

    fn log_light(&self, light_at_one: &[f32], scale: f64) -> Vec<f32> {
        let least = (scale * mean(light_at_one) * DARKEST) as f32;
        let least = least.max(f32::MIN_POSITIVE);
        (light_at_one.iter().zip(&self.fixed))
            .map(|(light, fixed)| (light * scale as f32 + fixed).max(least).ln())
            .collect()
    }

    /// Costs of a light of that strength, at the scale that its mean asks for.
    fn costs(&self, surroundings: &[f32], sun: Option<(&[f32], f64)>) -> Costs {
        let light = Self::light_at_one(surroundings, sun);
        let log_light = self.log_light(&light, self.scale_of_mean(&light));
        self.comparisons.costs(&log_light, self.sigma, STRIDE)
    }

    /// The strength of a sun among a few.
    fn with_sun(&self, surroundings: &[f32], sun: &[f32]) -> (f64, Costs) {
        let unit = mean(surroundings).max(1e-9) / mean(sun).max(1e-9);
        let tried = STRENGTHS.map(|strength| {
            let ratio = strength * unit;
            (ratio, self.costs(surroundings, Some((sun, ratio))))
        });
        let total = |costs: &Costs| costs.iter().sum::<f64>();
        let best = tried
            .into_iter()
            .min_by(|a, b| total(&a.1).total_cmp(&total(&b.1)));
        best.expect("some strength is tried")
    }

    /// Surroundings that are none of the environment's.
    pub fn of_light(&self, surroundings: &[f32]) -> Candidate {
        Candidate {
            rotation_deg: 0.0,
            sun: None,
            costs: self.costs(surroundings, None),
        }
    }

    /// No light that differs from point to point.
    pub fn flat(&self) -> Costs {
        let light = vec![1.0; self.fixed.len()];
        let flat = Fitter {
            fixed: vec![0.0; self.fixed.len()],
            surroundings: Vec::new(),
            ..*self
        };
        flat.costs(&light, None)
    }

    /// Every rotation, with a sun or without.
    pub fn rotations(&self, sun: Option<Vec3>) -> Vec<Candidate> {
        let points = &self.grid.points;
        let sunlight = sun.map(|direction| sunlight(self.scene, points, direction));
        (self.surroundings.par_iter().enumerate())
            .map(|(rotation, surroundings)| {
                let (ratio, costs) = match &sunlight {
                    Some(sunlight) => self.with_sun(surroundings, sunlight),
                    None => (0.0, self.costs(surroundings, None)),
                };
                Candidate {
                    rotation_deg: rotation as f64 * 360.0 / ROTATIONS as f64,
                    sun: sun.map(|direction| Sun { direction, ratio }),
                    costs,
                }
            })
            .collect()
    }

    /// One light, its sun's strength among a few.
    pub fn candidate(&self, rotation_deg: f64, sun: Option<Vec3>) -> Candidate {
        let surroundings = self.surroundings_at(rotation_deg);
        let (sun, costs) = match sun {
            None => (None, self.costs(&surroundings, None)),
            Some(direction) => {
                let sunlight = sunlight(self.scene, &self.grid.points, direction);
                let (ratio, costs) = self.with_sun(&surroundings, &sunlight);
                (Some(Sun { direction, ratio }), costs)
            }
        };
        Candidate {
            rotation_deg,
            sun,
            costs,
        }
    }

    /// A sun in every direction above the horizon.
    pub fn suns(&self, rotation_deg: f64) -> Vec<Candidate> {
        let surroundings = self.surroundings_at(rotation_deg);
        (0..self.directions.len())
            .into_par_iter()
            .filter(|index| self.directions[*index].y > LEAST_ELEVATION)
            .map(|index| {
                let sunlight =
                    self.openness
                        .of_direction(&self.grid.points, self.directions, index);
                let (ratio, costs) = self.with_sun(&surroundings, &sunlight);
                let direction = self.directions[index];
                Candidate {
                    rotation_deg,
                    sun: Some(Sun { direction, ratio }),
                    costs,
                }
            })
            .collect()
    }

    /// The sun nearby that explains most: by steps that are halved where none helps.
    pub fn refine_sun(&self, rotation_deg: f64, start: Sun) -> Sun {
        let surroundings = self.surroundings_at(rotation_deg);
        let fitted = |direction: Vec3, ratio: f64| {
            let sunlight = sunlight(self.scene, &self.grid.points, direction);
            let fit = self.strengths(&surroundings, Some((&sunlight, ratio)));
            (fit.cost, fit.ratio)
        };
        let (mut cost, ratio) = fitted(start.direction, start.ratio);
        let mut best = Sun { ratio, ..start };
        let mut step_deg: f64 = 4.0;
        while step_deg > 0.2 {
            let around = (0..6).map(|i| {
                let direction = tilted(best.direction, f64::from(i) * 60.0, step_deg);
                (direction, fitted(direction, best.ratio))
            });
            let nearest = around
                .filter(|(direction, _)| direction.y > LEAST_ELEVATION)
                .min_by(|a, b| a.1.0.total_cmp(&b.1.0));
            match nearest {
                Some((direction, (lower, ratio))) if lower < cost => {
                    cost = lower;
                    best = Sun { direction, ratio };
                }
                _ => step_deg *= 0.5,
            }
        }
        best
    }

    /// Least squares, robust, in the scale (where an albedo is known) and the strength of the sun.
    pub fn strengths(&self, surroundings: &[f32], sun: Option<(&[f32], f64)>) -> Strengths {
        let start = Strengthening {
            fitter: self,
            surroundings,
            sun: sun.map(|(sunlight, _)| sunlight),
            log_scale: self
                .scale_of_mean(&Self::light_at_one(surroundings, sun))
                .ln(),
            log_ratio: sun.map_or(0.0, |(_, ratio)| ratio.max(1e-12).ln()),
        };
        let (state, cost) = DESCENT.from(start);
        let log_light = state.log_light();
        Strengths {
            scale: state.log_scale.exp(),
            ratio: sun.map_or(0.0, |_| state.log_ratio.exp()),
            cost,
            log_light,
        }
    }

    /// Standard deviations: the sandwich of White (1980), with blocks of the photograph for independent errors (Liang and Zeger 1986), or materials
    /// where albedos are known and that is more.
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

/// Standard deviations of the parameters; `None`: the comparisons do not tell them apart, or are too few clusters.
fn sandwich(sums: &Linearised, n: usize) -> Option<Vec<f64>> {
    let has_terms = |gradient: &&Vec<f64>| gradient.iter().any(|value| *value != 0.0);
    let count = sums.gradients.iter().filter(has_terms).count();
    if count < LEAST_CLUSTERS {
        return None;
    }

    let normal = DMatrix::from_row_slice(n, n, &sums.normal);
    let inverse = normal.cholesky()?.inverse();
    let mut scatter = DMatrix::zeros(n, n);
    for gradient in &sums.gradients {
        let gradient = DVector::from_column_slice(gradient);
        scatter += &gradient * gradient.transpose();
    }
    let correction = count as f64 / (count - 1) as f64;
    let covariance = &inverse * scatter * &inverse * correction;
    Some((0..n).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect())
}

/// Away from `direction` by `degrees`, on the side of `turn_deg`.
fn tilted(direction: Vec3, turn_deg: f64, degrees: f64) -> Vec3 {
    let side = direction.as_dvec3().any_orthonormal_vector();
    let axis = DMat3::from_axis_angle(direction.as_dvec3(), turn_deg.to_radians()) * side;
    rotated(direction, axis, degrees)
}

fn rotated(direction: Vec3, axis: DVec3, degrees: f64) -> Vec3 {
    let turn = DMat3::from_axis_angle(axis, degrees.to_radians());
    (turn * direction.as_dvec3()).as_vec3().normalize()
}

/// Strengths that explain most.
pub struct Strengths {
    /// Of the surroundings, in the photograph's units.
    pub scale: f64,
    /// Of the sun over that.
    pub ratio: f64,
    pub cost: f64,
    /// ln of the irradiance of the points.
    pub log_light: Vec<f32>,
}

#[derive(Clone, Copy)]
struct Strengthening<'a> {
    fitter: &'a Fitter<'a>,
    surroundings: &'a [f32],
    sun: Option<&'a [f32]>,
    log_scale: f64,
    log_ratio: f64,
}

impl Strengthening<'_> {
    fn light_at_one(&self) -> Vec<f32> {
        let sun = self.sun.map(|sun| (sun, self.log_ratio.exp()));
        Fitter::light_at_one(self.surroundings, sun)
    }

    fn log_light(&self) -> Vec<f32> {
        let light = self.light_at_one();
        self.fitter.log_light(&light, self.log_scale.exp())
    }
}

impl Descending for Strengthening<'_> {
    type Linearised = (DMatrix<f64>, DVector<f64>);

    fn cost(&self) -> f64 {
        (self.fitter.comparisons).cost(&self.log_light(), self.fitter.sigma, 1)
    }

    fn linearised(&self) -> Self::Linearised {
        let log_light = self.log_light();
        let scale = self.log_scale.exp() as f32;
        // Of the share of all light.
        let share = |part: &[f32], factor: f32| -> Vec<f32> {
            let pairs = part.iter().zip(&log_light);
            pairs.map(|(part, log)| factor * part / log.exp()).collect()
        };
        let mut slopes = Vec::new();
        if self.fitter.comparisons.are_absolute {
            slopes.push(share(&self.light_at_one(), scale));
        }
        if let Some(sun) = self.sun {
            slopes.push(share(sun, scale * self.log_ratio.exp() as f32));
        }
        let comparisons = self.fitter.comparisons;
        let sigma = self.fitter.sigma;
        let sums = comparisons.linearised(&log_light, &slopes, sigma, Clusters::Blocks);
        let n = slopes.len();
        let right = (0..n).map(|i| sums.gradients.iter().map(|g| g[i]).sum::<f64>());
        (
            DMatrix::from_row_slice(n, n, &sums.normal),
            DVector::from_iterator(n, right),
        )
    }

    fn stepped(&self, (normal, right): &Self::Linearised, damping: f64) -> Option<Self> {
        if right.is_empty() {
            return None;
        }
        let mut damped = normal.clone();
        for i in 0..right.len() {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(right);
        let mut next = *self;
        let mut steps = step.iter().map(|step| step.clamp(-1.0, 1.0));
        if self.fitter.comparisons.are_absolute {
            next.log_scale += steps.next()?;
        }
        if self.sun.is_some() {
            next.log_ratio += steps.next()?;
        }
        if !self.fitter.comparisons.are_absolute {
            next.log_scale = self.fitter.scale_of_mean(&next.light_at_one()).ln();
        }
        next.log_scale.is_finite().then_some(next)
    }
}
