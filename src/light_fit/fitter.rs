//! How well a light explains the photograph, and its strengths by least squares.

use glam::{DMat3, DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::comparisons::{Clusters, Comparisons, Costs};
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
const STRENGTHS: [f64; 9] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// Between them, for this many of the best suns: by factors that are halved (ln), from the first to the last.
const CLOSER: usize = 96;
const CLOSER_STEPS: [f64; 4] = [0.35, 0.17, 0.09, 0.04];
/// Irradiance that no logarithm is taken below, of the mean.
const DARKEST: f64 = 1e-4;
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

    pub(super) fn light_at_one(surroundings: &[f32], sun: Option<(&[f32], f64)>) -> Vec<f32> {
        match sun {
            None => surroundings.to_vec(),
            Some((sun, ratio)) => (surroundings.iter().zip(sun))
                .map(|(around, sun)| around + sun * ratio as f32)
                .collect(),
        }
    }

    pub(super) fn log_light(&self, light_at_one: &[f32], scale: f64) -> Vec<f32> {
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
    fn roughly_with_sun(&self, surroundings: &[f32], sun: &[f32]) -> (f64, Costs) {
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

    /// The strength about that one which explains most: between those of [`STRENGTHS`] light is off by more than what is left of a good fit.
    fn closer(
        &self,
        surroundings: &[f32],
        sun: &[f32],
        (mut ratio, mut costs): (f64, Costs),
    ) -> (f64, Costs) {
        let total = |costs: &Costs| costs.iter().sum::<f64>();
        for step in CLOSER_STEPS {
            for factor in [step.exp(), (-step).exp()] {
                let tried = self.costs(surroundings, Some((sun, ratio * factor)));
                if total(&tried) < total(&costs) {
                    (ratio, costs) = (ratio * factor, tried);
                    break;
                }
            }
        }
        (ratio, costs)
    }

    fn with_sun(&self, surroundings: &[f32], sun: &[f32]) -> (f64, Costs) {
        let rough = self.roughly_with_sun(surroundings, sun);
        self.closer(surroundings, sun, rough)
    }

    /// By how much the strength of the sun over the surroundings, and the scale, are others where points are compared with each other alone; ln.
    pub fn off_by_pairs(&self, surroundings: &[f32], sun: &[f32], ratio: f64) -> [f64; 2] {
        let comparisons = &Comparisons::of_pairs(self.grid);
        let light = Self::light_at_one(surroundings, Some((sun, ratio)));
        let pairs = Fitter {
            sigma: comparisons.spread(&self.log_light(&light, self.scale_of_mean(&light))),
            comparisons,
            surroundings: Vec::new(),
            fixed: self.fixed.clone(),
            ..*self
        };
        let rough = pairs.with_sun(surroundings, sun).0;
        let other = pairs.strengths(surroundings, Some((sun, rough))).ratio;
        let other_light = Self::light_at_one(surroundings, Some((sun, other)));
        [other / ratio, mean(&light) / mean(&other_light)].map(f64::ln)
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

    /// Irradiance by the surroundings, the mean over the rotations that are known.
    fn surroundings_of_all_rotations(&self) -> Vec<f32> {
        let count = self.surroundings.len() as f32;
        let points = 0..self.fixed.len();
        let sum = |at: usize| self.surroundings.iter().map(|light| light[at]).sum::<f32>();
        points.map(|at| sum(at) / count).collect()
    }

    /// A sun in every direction above the horizon.
    pub fn suns(&self, rotation_deg: f64) -> Vec<Candidate> {
        self.suns_under(&self.surroundings_at(rotation_deg), rotation_deg)
    }

    /// The same where nothing is known of the rotation: one that was chosen without a strong sun would stand in for it, and hide where it is.
    pub fn suns_under_any_rotation(&self) -> Vec<Candidate> {
        self.suns_under(&self.surroundings_of_all_rotations(), 0.0)
    }

    fn suns_under(&self, surroundings: &[f32], rotation_deg: f64) -> Vec<Candidate> {
        let points = &self.grid.points;
        let sunlight_of = |index: usize| self.openness.of_direction(points, self.directions, index);
        let mut tried: Vec<(usize, f64, Costs)> = (0..self.directions.len())
            .into_par_iter()
            .filter(|index| self.directions[*index].y > LEAST_ELEVATION)
            .map(|index| {
                let (ratio, costs) = self.roughly_with_sun(surroundings, &sunlight_of(index));
                (index, ratio, costs)
            })
            .collect();
        let total = |costs: &Costs| costs.iter().sum::<f64>();
        tried.sort_by(|a, b| total(&a.2).total_cmp(&total(&b.2)));
        let best = CLOSER.min(tried.len());
        tried[..best]
            .par_iter_mut()
            .for_each(|(index, ratio, costs)| {
                let rough = (*ratio, *costs);
                (*ratio, *costs) = self.closer(surroundings, &sunlight_of(*index), rough);
            });
        let candidate = |(index, ratio, costs): (usize, f64, Costs)| Candidate {
            rotation_deg,
            sun: Some(Sun {
                direction: self.directions[index],
                ratio,
            }),
            costs,
        };
        tried.into_iter().map(candidate).collect()
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
}

/// Away from `direction` by `degrees`, on the side of `turn_deg`.
fn tilted(direction: Vec3, turn_deg: f64, degrees: f64) -> Vec3 {
    let side = direction.as_dvec3().any_orthonormal_vector();
    let axis = DMat3::from_axis_angle(direction.as_dvec3(), turn_deg.to_radians()) * side;
    rotated(direction, axis, degrees)
}

pub(super) fn rotated(direction: Vec3, axis: DVec3, degrees: f64) -> Vec3 {
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
