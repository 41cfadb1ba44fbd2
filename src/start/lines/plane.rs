//! The camera that sees squares of one size, turned alike, in one plane, and the plane: by least squares over their corners.
//!
//! Lengths in the picture are in units of its half diagonal about its centre, x right, y down; directions have z ahead.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{DMatrix, DVector};

use super::guesses::{Guess, guesses, turned};
use super::model::{BEND_PRIOR, CENTRE_PRIOR, FOCAL};
use super::squares::Patch;
use crate::least_squares::{Descending, Descent};

/// What is tried first, half diagonals.
const FIRST_FOCALS: [f64; 3] = [1.0, 1.7, 3.0];
/// Standard deviations from which on a corner counts for nothing.
const MOST_SIGMAS: f64 = 4.0;
/// Rounds of a descent, each with the corners' standard deviation taken anew.
const ROUNDS: usize = 4;
const DESCENT: Descent = Descent {
    steps: 12,
    first_damping: 1e-3,
    least_damping: 1e-7,
    most_damping: 1e6,
    least_gain: 1e-5,
};
/// How far paper bends out of its plane, of the distance from its middle at which it does.
const CURVE_PRIOR: f64 = 0.005;
/// Of the logarithm of the squares' width over their height: as printed, and where they may be none.
const SQUARE: f64 = 0.003;
const ANY_RECTANGLE: f64 = 0.5;
/// Of it, what still counts as square.
const MOST_OFF_SQUARE: f64 = 0.02;
/// Corners of one sheet are off together, by its curve and by the lens, so that three quarters of them say nothing new.
const EXCESS: f64 = 4.0;
/// Parameters that all corners share: the logarithm of the focal length, the bend, the centre, the plane's turn, the logarithm of the sides' length,
/// the plane's curvatures, and the logarithm of the squares' width over their height.
const SHARED: usize = 12;

/// A camera and a plane.
#[derive(Clone, Debug)]
pub struct Fit {
    pub log_focal: f64,
    bend: f64,
    centre: DVec2,
    /// Columns: along the squares' sides, and the plane's normal, away from the camera.
    rotation: DQuat,
    log_side: f64,
    /// Second derivatives of the height over the plane: along x twice, both, y twice.
    curves: DVec3,
    log_aspect: f64,
    aspect_prior: f64,
    /// What the logarithm of the focal length is before, and its standard deviation.
    focal_prior: (f64, f64),
    /// Of the squares about `ahead`.
    radius: f64,
    /// In the plane, from where `ahead` meets it.
    places: Vec<DVec2>,
    /// Quarter turns of each patch.
    pub turns: Vec<usize>,
    pub patches: Vec<Patch>,
    ahead: DVec3,
    /// Of a corner, half diagonals.
    pub sigma: f64,
    covariance: DMatrix<f64>,
}

/// Where a lens sees what a pinhole sees at p: the inverse of p / (1 + bend |p|^2).
fn bent(p: DVec2, bend: f64) -> DVec2 {
    p * 2.0 / (1.0 + (1.0 - 4.0 * bend * p.length_squared()).max(0.0).sqrt())
}

impl Fit {
    fn guessed(guess: Guess, focal_prior: (f64, f64)) -> Self {
        let of_patches = guess.patches.iter().zip(&guess.places).zip(&guess.turns);
        let (mut squares, mut count) = (0.0, 0.0);
        for ((patch, place), turn) in of_patches {
            for (grid, _) in &patch.points {
                squares += (*place + guess.side * turned(*grid, *turn)).length_squared();
                count += 1.0;
            }
        }
        Self {
            log_focal: guess.focal.ln(),
            bend: 0.0,
            centre: DVec2::ZERO,
            rotation: guess.rotation,
            log_side: guess.side.ln(),
            curves: DVec3::ZERO,
            log_aspect: 0.0,
            aspect_prior: SQUARE,
            focal_prior,
            radius: f64::sqrt(squares / f64::max(count, 1.0)),
            places: guess.places,
            turns: guess.turns,
            patches: guess.patches,
            ahead: guess.ahead,
            sigma: 0.0,
            covariance: DMatrix::zeros(0, 0),
        }
    }

    /// Where it sees a point of a patch.
    fn sees(&self, axes: &DMat3, patch: usize, grid: DVec2) -> DVec2 {
        let grid = turned(grid, self.turns[patch]) * DVec2::new(self.log_aspect.exp(), 1.0);
        let at = self.places[patch] + self.log_side.exp() * grid;
        let height = self.curves.dot(DVec3::new(
            0.5 * at.x * at.x,
            at.x * at.y,
            0.5 * at.y * at.y,
        ));
        let point = self.ahead + *axes * at.extend(height);
        let ideal = point.truncate() / point.z.max(1e-3) * self.log_focal.exp();
        self.centre + bent(ideal, self.bend)
    }

    fn changed(&self, step: &[f64]) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(step[4], step[5], step[6]));
        let mut other = self.clone();
        other.log_focal += step[0];
        other.bend += step[1];
        other.centre += DVec2::new(step[2], step[3]);
        other.rotation = (turn * self.rotation).normalize();
        other.log_side += step[7];
        other.curves += DVec3::new(step[8], step[9], step[10]);
        other.log_aspect += step[11];
        for (place, step) in other.places.iter_mut().zip(step[SHARED..].chunks(2)) {
            *place += DVec2::new(step[0], step[1]);
        }
        other
    }

    /// What is off of each patch's points, half diagonals.
    fn misses(&self) -> Vec<Vec<DVec2>> {
        let axes = DMat3::from_quat(self.rotation);
        (self.patches.iter().enumerate())
            .map(|(index, patch)| {
                let miss = |(grid, pixel): &(DVec2, DVec2)| self.sees(&axes, index, *grid) - *pixel;
                patch.points.iter().map(miss).collect()
            })
            .collect()
    }

    /// Parameter, what it is off, and its standard deviation.
    fn priors(&self) -> [(usize, f64, f64); 8] {
        let (log_focal, focal_sigma) = self.focal_prior;
        let curve = 2.0 * CURVE_PRIOR / self.radius;
        [
            (8, self.curves.x, curve),
            (9, self.curves.y, curve),
            (10, self.curves.z, curve),
            (11, self.log_aspect, self.aspect_prior),
            (0, self.log_focal - log_focal, focal_sigma),
            (1, self.bend, BEND_PRIOR),
            (2, self.centre.x, CENTRE_PRIOR),
            (3, self.centre.y, CENTRE_PRIOR),
        ]
    }

    fn cost_by(&self, sigma: f64) -> f64 {
        let of_points: f64 = (self.misses().iter().flatten())
            .map(|miss| tukey_cost(miss.length() / sigma))
            .sum();
        let of_priors: f64 = (self.priors().iter())
            .map(|(_, off, sigma)| (off / sigma).powi(2))
            .sum();
        of_points + of_priors
    }

    /// Normal equations with Tukey's weights.
    fn equations(&self, sigma: f64) -> (DMatrix<f64>, DVector<f64>) {
        const STEP: f64 = 1e-6;
        let size = SHARED + 2 * self.patches.len();
        let mut matrix = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        let misses = self.misses();
        let mut steps = vec![0.0; size];
        let mut slopes = Vec::with_capacity(SHARED);
        for i in 0..SHARED {
            steps[i] = STEP;
            let up = self.changed(&steps).misses();
            steps[i] = -STEP;
            let down = self.changed(&steps).misses();
            steps[i] = 0.0;
            slopes.push((up, down));
        }
        let axes = DMat3::from_quat(self.rotation);
        for (index, patch) in self.patches.iter().enumerate() {
            for (at, (grid, _)) in patch.points.iter().enumerate() {
                let miss = misses[index][at];
                let weight = tukey_weight(miss.length() / sigma) / (sigma * sigma);
                if weight == 0.0 {
                    continue;
                }
                let mut row = [(0, DVec2::ZERO); SHARED + 2];
                for (i, (up, down)) in slopes.iter().enumerate() {
                    row[i] = (i, (up[index][at] - down[index][at]) / (2.0 * STEP));
                }
                for (k, way) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                    let mut other = self.clone_place(index, STEP * way);
                    let up = other.sees(&axes, index, *grid);
                    other.places[index] -= 2.0 * STEP * way;
                    let down = other.sees(&axes, index, *grid);
                    row[SHARED + k] = (SHARED + 2 * index + k, (up - down) / (2.0 * STEP));
                }
                for (i, a) in row {
                    gradient[i] += weight * a.dot(miss);
                    for (j, b) in row {
                        matrix[(i, j)] += weight * a.dot(b);
                    }
                }
            }
        }
        for (i, off, sigma) in self.priors() {
            matrix[(i, i)] += sigma.powi(-2);
            gradient[i] += off / (sigma * sigma);
        }
        (matrix, gradient)
    }

    fn clone_place(&self, index: usize, step: DVec2) -> Self {
        let mut other = self.clone();
        other.places[index] += step;
        other
    }

    /// Standard deviation of a corner by what is off, half diagonals.
    fn spread(&self, least: f64) -> f64 {
        let mut off: Vec<f64> = (self.misses().iter().flatten())
            .map(|miss| miss.length())
            .collect();
        off.sort_by(f64::total_cmp);
        // Of a radius in two dimensions, four fifths lie within 1.79 standard deviations.
        (off[off.len() * 4 / 5] / 1.79).max(least)
    }

    fn refined(mut self, least_sigma: f64) -> Option<Self> {
        for _ in 0..ROUNDS {
            self.sigma = self.spread(least_sigma);
            (self, _) = DESCENT.from(self);
        }
        self.sigma = self.spread(least_sigma);
        let (matrix, _) = self.equations(EXCESS.sqrt() * self.sigma);
        self.covariance = matrix.try_inverse()?;
        FOCAL.contains(&self.log_focal.exp()).then_some(self)
    }

    /// Standard deviation of the logarithm of the focal length.
    pub fn focal_sigma(&self) -> f64 {
        self.covariance[(0, 0)].sqrt()
    }

    /// Of the plane, towards the camera.
    pub fn normal(&self) -> DVec3 {
        -(self.rotation * DVec3::Z)
    }

    /// Root mean square of the angle by which the normal is off, radians.
    pub fn normal_sigma(&self) -> f64 {
        let turn = self.covariance.fixed_view::<3, 3>(4, 4);
        let normal = nalgebra::Vector3::from(self.normal().to_array());
        let about = (normal.transpose() * turn * normal)[(0, 0)];
        (turn.trace() - about).max(0.0).sqrt()
    }

    /// Share of the corners that count.
    pub fn share(&self) -> f64 {
        let misses = self.misses();
        let all = misses.iter().flatten();
        let counting = all
            .clone()
            .filter(|miss| miss.length() < MOST_SIGMAS * self.sigma);
        counting.count() as f64 / all.count().max(1) as f64
    }

    /// What they are seen to be says nothing against squares.
    pub fn are_squares(&self, least_sigma: f64) -> bool {
        let free = Self {
            aspect_prior: ANY_RECTANGLE,
            ..self.clone()
        };
        free.refined(least_sigma).is_some_and(|free| {
            let sigma = free.covariance[(11, 11)].sqrt();
            free.log_aspect.abs() < MOST_OFF_SQUARE.max(3.0 * sigma)
        })
    }
}

impl Descending for Fit {
    type Linearised = (DMatrix<f64>, DVector<f64>);

    fn cost(&self) -> f64 {
        self.cost_by(self.sigma)
    }

    fn linearised(&self) -> Self::Linearised {
        self.equations(self.sigma)
    }

    fn stepped(&self, (matrix, gradient): &Self::Linearised, damping: f64) -> Option<Self> {
        let mut damped = matrix.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] = damped[(i, i)] * (1.0 + damping) + 1e-9;
        }
        let step = -damped.cholesky()?.solve(gradient);
        Some(self.changed(step.as_slice()))
    }
}

fn tukey_weight(sigmas: f64) -> f64 {
    (1.0 - (sigmas / MOST_SIGMAS).powi(2)).max(0.0).powi(2)
}

fn tukey_cost(sigmas: f64) -> f64 {
    let inside = (1.0 - (sigmas / MOST_SIGMAS).powi(2)).max(0.0);
    MOST_SIGMAS * MOST_SIGMAS / 3.0 * (1.0 - inside.powi(3))
}

/// The fits of one group of patches that take up most of them, the best first, with their costs; `patches` in half diagonals about the centre, the focal
/// length's logarithm and its standard deviation before.
pub fn fits(
    patches: &[Patch],
    focal: (f64, f64),
    is_known: bool,
    least_sigma: f64,
) -> Vec<(f64, Fit)> {
    let focals = match is_known {
        true => vec![focal.0.exp()],
        false => FIRST_FOCALS.to_vec(),
    };
    let mut found: Vec<Fit> = guesses(patches, &focals)
        .into_iter()
        .filter_map(|guess| Fit::guessed(guess, focal).refined(least_sigma))
        .collect();
    let most = found.iter().map(|fit| fit.patches.len()).max();
    found.retain(|fit| Some(fit.patches.len()) == most);
    // By one measure for all of them.
    let sigma = (found.iter())
        .map(|fit| fit.sigma)
        .fold(f64::INFINITY, f64::min);
    let mut found: Vec<(f64, Fit)> = (found.into_iter())
        .map(|fit| (fit.cost_by(sigma), fit))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}
