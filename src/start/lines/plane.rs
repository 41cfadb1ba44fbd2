//! The camera that sees squares of one size, turned alike, in one plane, and the plane: by least squares over their corners.
//!
//! Lengths in the picture are in units of its half diagonal about its centre, x right, y down; directions have z ahead.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
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
/// Of the corners' coordinates, the share that is taken to be free to differ from the fit.
const LEAST_FREE: f64 = 0.1;
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
/// By what squares that lie apart are off equal ones, of a side: those of the markers' video lean by 0.0086 and differ by 0.003 to 0.005 in size, as
/// `mixray track` solves for their sheet. What belongs to one board is one.
const UNEQUAL: f64 = 0.009;
const OF_ONE_BOARD: f64 = 1e-5;
/// Parameters that all corners share: the logarithm of the focal length, the bend, the centre, the plane's turn, the logarithm of the sides' length,
/// the plane's curvatures, and the logarithm of the squares' width over their height.
const SHARED: usize = 12;
/// Parameters of each patch: its place, and by what it is off an equal square.
const OWN: usize = 6;

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
    /// What maps each patch's points to what they are off those of equal squares, sides.
    unequal: Vec<DMat2>,
    unequal_prior: f64,
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
            unequal: vec![DMat2::ZERO; guess.places.len()],
            unequal_prior: match guess.patches.len() {
                1 => OF_ONE_BOARD,
                _ => UNEQUAL,
            },
            places: guess.places,
            turns: guess.turns,
            patches: guess.patches,
            ahead: guess.ahead,
            sigma: 0.0,
            covariance: DMatrix::zeros(0, 0),
        }
    }

    /// A point of a patch as squares of one size have it, sides.
    fn on_grid(&self, patch: usize, grid: DVec2) -> DVec2 {
        turned(grid, self.turns[patch]) * DVec2::new(self.log_aspect.exp(), 1.0)
    }

    /// Where it is in the plane.
    fn place(&self, patch: usize, grid: DVec2) -> DVec2 {
        let grid = self.on_grid(patch, grid);
        self.places[patch] + self.log_side.exp() * (grid + self.unequal[patch] * grid)
    }

    /// Where it sees a place of the plane.
    fn sees(&self, axes: &DMat3, at: DVec2) -> DVec2 {
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
        for (patch, step) in step[SHARED..].chunks(OWN).enumerate() {
            other.places[patch] += DVec2::new(step[0], step[1]);
            other.unequal[patch] += DMat2::from_cols_slice(&step[2..]);
        }
        other
    }

    /// What is off of each patch's points, half diagonals.
    fn misses(&self) -> Vec<Vec<DVec2>> {
        let axes = DMat3::from_quat(self.rotation);
        (self.patches.iter().enumerate())
            .map(|(index, patch)| {
                let miss = |(grid, pixel): &(DVec2, DVec2)| {
                    self.sees(&axes, self.place(index, *grid)) - *pixel
                };
                patch.points.iter().map(miss).collect()
            })
            .collect()
    }

    /// Parameter, what it is off, and its standard deviation.
    fn priors(&self) -> Vec<(usize, f64, f64)> {
        let (log_focal, focal_sigma) = self.focal_prior;
        let curve = 2.0 * CURVE_PRIOR / self.radius;
        let shared = [
            (8, self.curves.x, curve),
            (9, self.curves.y, curve),
            (10, self.curves.z, curve),
            (11, self.log_aspect, self.aspect_prior),
            (0, self.log_focal - log_focal, focal_sigma),
            (1, self.bend, BEND_PRIOR),
            (2, self.centre.x, CENTRE_PRIOR),
            (3, self.centre.y, CENTRE_PRIOR),
        ];
        let own = self.unequal.iter().enumerate().flat_map(|(patch, off)| {
            let first = SHARED + OWN * patch + 2;
            let sigma = self.unequal_prior;
            (first..)
                .zip(off.to_cols_array())
                .map(move |(i, off)| (i, off, sigma))
        });
        shared.into_iter().chain(own).collect()
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
        let size = SHARED + OWN * self.patches.len();
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
                let mut row = [(0, DVec2::ZERO); SHARED + OWN];
                for (i, (up, down)) in slopes.iter().enumerate() {
                    row[i] = (i, (up[index][at] - down[index][at]) / (2.0 * STEP));
                }
                let place = self.place(index, *grid);
                let [x, y] = [DVec2::X, DVec2::Y].map(|way| {
                    let at = |step: f64| self.sees(&axes, place + step * way);
                    (at(STEP) - at(-STEP)) / (2.0 * STEP)
                });
                let g = self.log_side.exp() * self.on_grid(index, *grid);
                let own = [x, y, g.x * x, g.x * y, g.y * x, g.y * y];
                for (k, slope) in own.into_iter().enumerate() {
                    row[SHARED + k] = (SHARED + OWN * index + k, slope);
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

    /// How many parameters the points fix: each as much as they and not its prior tell of it.
    fn fixed(&self) -> f64 {
        let by_priors: f64 = (self.priors().iter())
            .map(|(i, _, sigma)| self.covariance[(*i, *i)] / (sigma * sigma))
            .sum();
        self.covariance.nrows() as f64 - by_priors
    }

    /// Standard deviation of a corner by what is off, half diagonals, along either way; `fixed` parameters were made to fit.
    fn spread(&self, fixed: f64) -> f64 {
        let mut off: Vec<f64> = (self.misses().iter().flatten())
            .map(|miss| miss.length())
            .collect();
        off.sort_by(f64::total_cmp);
        let count = 2.0 * off.len() as f64;
        let free = (count - fixed).max(LEAST_FREE * count);
        // Of a radius in two dimensions, four fifths lie within 1.79 standard deviations.
        off[off.len() * 4 / 5] / 1.79 * (count / free).sqrt()
    }

    fn refined(mut self, least_sigma: f64) -> Option<Self> {
        self.sigma = self.spread(0.0).max(least_sigma);
        for _ in 0..ROUNDS {
            (self, _) = DESCENT.from(self);
            self.covariance = self.equations(self.sigma).0.try_inverse()?;
            self.sigma = self.spread(self.fixed()).max(least_sigma);
        }
        self.covariance = self.equations(self.sigma).0.try_inverse()?;
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

#[cfg(test)]
mod tests {
    use rand::rngs::Xoshiro256PlusPlus;
    use rand::{RngExt, SeedableRng};

    use super::*;

    const FOCAL: f64 = 1.7;
    /// A VGA picture's half diagonal.
    const UNIT_PX: f64 = 400.0;
    const LEAST_SIGMA: f64 = 0.1 / UNIT_PX;
    const PRIOR: (f64, f64) = (0.47, 0.5);

    /// Of variance 1.
    fn any(random: &mut Xoshiro256PlusPlus) -> f64 {
        12.0_f64.sqrt() * (random.random::<f64>() - 0.5)
    }

    /// Four by three squares of side 0.1 seen askew, each unequal to the others by `unequal`, their corners off by `noise_px`; begun at the truth.
    fn sheet(seed: u64, unequal: f64, noise_px: f64) -> Fit {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(DVec2::from);
        let places: Vec<DVec2> = (0..12)
            .map(|k| 0.15 * DVec2::new(f64::from(k % 4) - 1.5, f64::from(k / 4) - 1.0))
            .collect();
        let patch = Patch {
            points: corners.map(|corner| (corner, DVec2::ZERO)).to_vec(),
        };
        let guess = Guess {
            focal: FOCAL,
            rotation: DQuat::from_rotation_x(-0.7) * DQuat::from_rotation_y(0.4),
            ahead: DVec3::Z,
            side: 0.1,
            turns: vec![0; places.len()],
            patches: vec![patch; places.len()],
            places,
        };
        let mut fit = Fit::guessed(guess, PRIOR);
        let exact = fit.unequal.clone();
        for off in &mut fit.unequal {
            *off = DMat2::from_cols_array(&[(); 4].map(|()| unequal * any(&mut random)));
        }
        // What is off of nothing is where it is seen.
        let seen = fit.misses();
        for (patch, seen) in fit.patches.iter_mut().zip(seen) {
            for ((_, pixel), seen) in patch.points.iter_mut().zip(seen) {
                let noise = DVec2::new(any(&mut random), any(&mut random));
                *pixel = seen + noise * noise_px / UNIT_PX;
            }
        }
        fit.unequal = exact;
        fit
    }

    /// By how many of its standard deviations the focal length is off, rms over sheets.
    fn rms_off(unequal_prior: f64) -> f64 {
        let squares = (0..40).map(|seed| {
            let mut fit = sheet(seed, UNEQUAL, 0.15);
            fit.unequal_prior = unequal_prior;
            let fit = fit.refined(LEAST_SIGMA).expect("a camera");
            ((fit.log_focal - FOCAL.ln()) / fit.focal_sigma()).powi(2)
        });
        (squares.sum::<f64>() / 40.0).sqrt()
    }

    #[test]
    fn squares_that_are_not_quite_equal_leave_the_focal_length_as_open_as_is_said() {
        let (own, as_equal) = (rms_off(UNEQUAL), rms_off(OF_ONE_BOARD));
        assert!((0.5..1.2).contains(&own), "{own}");
        assert!(as_equal > 1.3 * own, "control: {as_equal} {own}");
    }

    #[test]
    fn a_corner_is_as_unsure_as_it_is_off_though_the_fit_follows_it() {
        let (mut own, mut as_if_free) = (0.0, 0.0);
        for seed in 0..10 {
            let fit = (sheet(seed, 0.0, 0.3).refined(LEAST_SIGMA)).expect("a camera");
            own += 0.1 * fit.sigma * UNIT_PX;
            as_if_free += 0.1 * fit.spread(0.0) * UNIT_PX;
        }
        assert!((0.23..0.34).contains(&own), "{own}");
        assert!(as_if_free < 0.2, "control: {as_if_free}");
    }
}
