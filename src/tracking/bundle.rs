//! Bundle adjustment: poses, lens and board together. Poses are eliminated as blocks of 6 x 6 (Schur's complement); what all frames share, the lens and
//! the points, stays as one dense system, whose inverse is the shared part of every covariance.

use glam::DVec3;
use nalgebra::{DMatrix, DVector, Dyn, Matrix6, OMatrix, U6, Vector6};

use super::frame_pose::{COVARIANCE_SHARE, Observation, project, robust};
use super::lens::{LENS_PARAMETERS, Lens};
use super::pose::Pose;
use crate::least_squares::{Descending, Descent};

/// A frame and what is seen in it.
#[derive(Clone, Debug)]
pub struct View {
    pub pose: Pose,
    pub observations: Vec<Observation>,
}

/// What is known besides the frames, of the shared parameters: the lens's eight, then three for each point.
#[derive(Clone, Debug)]
pub enum Prior {
    /// A weighted sum of parameters.
    Sum {
        terms: Vec<(usize, f64)>,
        target: f64,
        sigma: f64,
    },
    /// Between two points, metres.
    Distance {
        points: [usize; 2],
        metres: f64,
        sigma: f64,
    },
}

fn place_of(point: usize, axis: usize) -> usize {
    LENS_PARAMETERS + 3 * point + axis
}

impl Prior {
    /// A coordinate of a point.
    pub fn place(point: usize, axis: usize, target: f64, sigma: f64) -> Self {
        Self::Sum {
            terms: vec![(place_of(point, axis), 1.0)],
            target,
            sigma,
        }
    }

    /// Of four points from `first` on: the middles of their diagonals are one.
    pub fn closure(first: usize, axis: usize, sigma: f64) -> Self {
        let signs = [1.0, -1.0, 1.0, -1.0];
        let terms = (first..)
            .zip(signs)
            .map(|(p, sign)| (place_of(p, axis), sign));
        Self::Sum {
            terms: terms.collect(),
            target: 0.0,
            sigma,
        }
    }

    /// Error in standard deviations and its slopes.
    fn error(&self, shared: &[f64]) -> (f64, Vec<(usize, f64)>) {
        match self {
            Self::Sum {
                terms,
                target,
                sigma,
            } => {
                let sum: f64 = terms.iter().map(|(index, by)| shared[*index] * by).sum();
                let slopes = terms.iter().map(|(index, by)| (*index, by / sigma));
                ((sum - target) / sigma, slopes.collect())
            }
            Self::Distance {
                points: [a, b],
                metres,
                sigma,
            } => {
                let at = |point: usize| DVec3::from_slice(&shared[place_of(point, 0)..][..3]);
                let between = at(*a) - at(*b);
                let length = between.length();
                let along = between / length.max(1e-12) / *sigma;
                let axes = along.to_array().into_iter().enumerate();
                let slopes = axes.flat_map(|(axis, slope)| {
                    [(place_of(*a, axis), slope), (place_of(*b, axis), -slope)]
                });
                ((length - metres) / sigma, slopes.collect())
            }
        }
    }
}

/// What is solved for, and from what.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    pub views: Vec<View>,
    pub lens: Lens,
    /// Which of the lens's parameters are.
    pub free_lens: [bool; LENS_PARAMETERS],
    pub points: Vec<DVec3>,
    pub free_points: bool,
    pub priors: &'a [Prior],
    /// First guess of a corner's standard deviation, pixels.
    pub noise_px: f64,
}

/// Where the cost is least.
#[derive(Clone, Debug)]
pub struct Solution {
    pub views: Vec<View>,
    pub lens: Lens,
    pub points: Vec<DVec3>,
    /// Standard deviation of a corner along an axis, pixels, by the median of the errors.
    pub noise_px: f64,
    /// Of all errors, as lengths.
    pub rms_px: f64,
    /// Of the lens's eight parameters, then of the points; 0 for what is fixed.
    pub covariance: DMatrix<f64>,
}

/// A frame's pose, to be eliminated.
pub struct Block {
    information: Matrix6<f64>,
    slope: Vector6<f64>,
    /// Shared parameters that the frame depends on.
    columns: Vec<usize>,
    mixed: OMatrix<f64, U6, Dyn>,
}

impl Problem<'_> {
    fn shared(&self) -> Vec<f64> {
        let mut shared = self.lens.parameters().to_vec();
        shared.extend(self.points.iter().flat_map(|p| p.to_array()));
        shared
    }

    fn has_shared(&self) -> bool {
        self.free_points || self.free_lens.contains(&true)
    }

    fn is_free(&self, parameter: usize) -> bool {
        match self.free_lens.get(parameter) {
            Some(is_free) => *is_free,
            None => self.free_points,
        }
    }

    fn block(
        &self,
        view: &View,
        shared: &mut DMatrix<f64>,
        shared_slope: &mut DVector<f64>,
    ) -> Block {
        let columns = columns_of(&self.free_lens, self.free_points, &view.observations);
        let mut block = Block {
            information: Matrix6::zeros(),
            slope: Vector6::zeros(),
            mixed: OMatrix::<f64, U6, Dyn>::zeros(columns.len()),
            columns,
        };
        let variance = self.noise_px * self.noise_px;
        let lens_count = self.free_lens.iter().filter(|free| **free).count();
        for (index, o) in view.observations.iter().enumerate() {
            let Some(p) = project(&self.lens, &view.pose, self.points[o.point], o.pixel) else {
                continue;
            };
            let weight = robust(p.error.length_squared() / variance).1 / variance;
            let by_lens = self.lens.by_parameters(p.ideal);
            for (axis, by_lens) in by_lens.iter().enumerate() {
                let by_pose = Vector6::from(p.by_pose[axis]);
                let error = p.error[axis];
                block.information += weight * by_pose * by_pose.transpose();
                block.slope -= weight * error * by_pose;
                let own = slopes_of(&self.free_lens, self.free_points, by_lens, p.by_point[axis]);
                // Columns: the lens's first, then three for each observation in its order.
                let column = |k: usize| match k < lens_count {
                    true => k,
                    false => lens_count + 3 * index + (k - lens_count),
                };
                for (k, by_k) in own.iter().enumerate() {
                    let at = column(k);
                    let global = block.columns[at];
                    shared_slope[global] -= weight * error * by_k;
                    let mut mixed = block.mixed.column_mut(at);
                    mixed.axpy(weight * by_k, &by_pose, 1.0);
                    for (l, by_l) in own.iter().enumerate() {
                        // The lower half, as in `eliminate`.
                        let other = block.columns[column(l)];
                        if global >= other {
                            shared[(global, other)] += weight * by_k * by_l;
                        }
                    }
                }
            }
        }
        block
    }

    /// Share of the corners' errors that is left once all has been fitted to them: of a single marker in each frame, whose pose takes six of its eight
    /// coordinates, a quarter at the most.
    fn redundancy(&self) -> f64 {
        let seen: usize = self.views.iter().map(|view| view.observations.len()).sum();
        let lens = self.free_lens.iter().filter(|free| **free).count();
        // Points that are free have a prior for each coordinate, and take little.
        let fitted = 6 * self.views.len() + lens;
        let coordinates = 2 * seen;
        coordinates.saturating_sub(fitted).max(1) as f64 / coordinates.max(1) as f64
    }

    /// Absolute errors along both axes, ascending.
    fn sorted_errors(&self) -> Vec<f64> {
        let all = self.views.iter().flat_map(|view| {
            let project =
                |o: &Observation| project(&self.lens, &view.pose, self.points[o.point], o.pixel);
            view.observations
                .iter()
                .filter_map(project)
                .flat_map(|p| p.error.abs().to_array())
        });
        let mut errors: Vec<f64> = all.collect();
        errors.sort_by(f64::total_cmp);
        errors
    }

    /// Levenberg's and Marquardt's method, the noise estimated anew between rounds; `None`: the frames do not determine what is asked.
    pub fn solve(mut self) -> Option<Solution> {
        const ROUNDS: usize = 5;
        for _ in 0..ROUNDS {
            (self, _) = DESCENT.from(self);
            let errors = self.sorted_errors();
            let before = self.noise_px;
            // 1.4826 medians are a standard deviation; corners are never better than a thousandth of a pixel.
            let left = 1.4826 * errors.get(errors.len() / 2)?;
            self.noise_px = (left / self.redundancy().sqrt()).max(1e-3);
            if (self.noise_px / before - 1.0).abs() < 0.02 {
                break;
            }
        }
        let covariance = self.covariance()?;
        let errors = self.sorted_errors();
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        Some(Solution {
            rms_px: (2.0 * squares / errors.len() as f64).sqrt(),
            views: self.views,
            lens: self.lens,
            points: self.points,
            noise_px: self.noise_px,
            covariance,
        })
    }

    /// Blocks of the frames, and the shared system before they are eliminated, in which priors count so many times.
    fn system(&self, priors_by: f64) -> <Self as Descending>::Linearised {
        let size = LENS_PARAMETERS + 3 * self.points.len();
        let mut information = DMatrix::zeros(size, size);
        let mut slope = DVector::zeros(size);
        let mut blocks = Vec::with_capacity(self.views.len());
        for view in &self.views {
            blocks.push(self.block(view, &mut information, &mut slope));
        }
        let shared = self.shared();
        for prior in self.priors {
            let (error, slopes) = prior.error(&shared);
            for (i, by_i) in &slopes {
                slope[*i] -= priors_by * error * by_i;
                for (j, by_j) in &slopes {
                    information[(*i, *j)] += priors_by * by_i * by_j;
                }
            }
        }
        for fixed in (0..size).filter(|parameter| !self.is_free(*parameter)) {
            information.row_mut(fixed).fill(0.0);
            information.column_mut(fixed).fill(0.0);
            information[(fixed, fixed)] = 1.0;
            slope[fixed] = 0.0;
        }
        (blocks, information, slope)
    }

    fn covariance(&self) -> Option<DMatrix<f64>> {
        // Weights make too little of the frames' information, not of the priors'.
        let (blocks, mut reduced, _) = self.system(COVARIANCE_SHARE);
        for block in &blocks {
            let mixed = block.factor(0.0)?.solve(&block.mixed);
            block.eliminate(&mixed, &mut reduced);
        }
        let mut covariance = COVARIANCE_SHARE * reduced.cholesky()?.inverse();
        for fixed in (0..covariance.nrows()).filter(|k| !self.is_free(*k)) {
            covariance[(fixed, fixed)] = 0.0;
        }
        Some(covariance)
    }
}

const DESCENT: Descent = Descent {
    steps: 60,
    first_damping: 1e-4,
    least_damping: 1e-13,
    most_damping: 1e6,
    least_gain: 1e-9,
};

impl Descending for Problem<'_> {
    type Linearised = (Vec<Block>, DMatrix<f64>, DVector<f64>);

    fn cost(&self) -> f64 {
        let variance = self.noise_px * self.noise_px;
        let shared = self.shared();
        let priors: f64 = self.priors.iter().map(|p| p.error(&shared).0.powi(2)).sum();
        let views = self.views.iter().flat_map(|view| {
            view.observations.iter().map(|o| {
                project(&self.lens, &view.pose, self.points[o.point], o.pixel)
                    .map_or(1e4, |p| robust(p.error.length_squared() / variance).0)
            })
        });
        let known = if self.has_shared() { priors } else { 0.0 };
        known + views.sum::<f64>()
    }

    fn linearised(&self) -> Self::Linearised {
        self.system(1.0)
    }

    fn stepped(
        &self,
        (blocks, information, slope): &Self::Linearised,
        damping: f64,
    ) -> Option<Self> {
        let mut reduced = information.clone();
        let mut right = slope.clone();
        for k in 0..reduced.nrows() {
            reduced[(k, k)] *= 1.0 + damping;
        }
        let mut solved = Vec::with_capacity(blocks.len());
        for block in blocks {
            let factor = block.factor(damping)?;
            let own = factor.solve(&block.slope);
            let mixed = factor.solve(&block.mixed);
            block.eliminate(&mixed, &mut reduced);
            let moved = block.mixed.tr_mul(&own);
            for (k, column) in block.columns.iter().enumerate() {
                right[*column] -= moved[k];
            }
            solved.push((own, mixed));
        }
        let step = match self.has_shared() {
            true => reduced.cholesky()?.solve(&right),
            false => DVector::zeros(right.len()),
        };
        let mut next = self.clone();
        let mut shared = self.shared();
        for (k, value) in shared
            .iter_mut()
            .enumerate()
            .filter(|(k, _)| self.is_free(*k))
        {
            *value += step[k];
        }
        let lens: [f64; LENS_PARAMETERS] = std::array::from_fn(|k| shared[k]);
        next.lens.set_parameters(lens);
        next.points = shared[LENS_PARAMETERS..]
            .chunks_exact(3)
            .map(DVec3::from_slice)
            .collect();
        for ((view, block), (own, mixed)) in next.views.iter_mut().zip(blocks).zip(solved) {
            let picked =
                DVector::from_iterator(block.columns.len(), block.columns.iter().map(|c| step[*c]));
            let moved = own - mixed * picked;
            view.pose = view.pose.moved(moved.into());
        }
        Some(next)
    }
}

impl Block {
    fn factor(&self, damping: f64) -> Option<nalgebra::Cholesky<f64, U6>> {
        let mut damped = self.information;
        for k in 0..6 {
            damped[(k, k)] = damped[(k, k)] * (1.0 + damping) + 1e-9;
        }
        damped.cholesky()
    }

    /// Takes the pose out of the shared system; `mixed`: its information's inverse times the mixed block.
    fn eliminate(&self, mixed: &OMatrix<f64, U6, Dyn>, reduced: &mut DMatrix<f64>) {
        // The lower half: all that a Cholesky factor reads.
        for (l, column) in self.columns.iter().enumerate() {
            let solved = mixed.column(l);
            for (k, row) in self.columns.iter().enumerate() {
                if row >= column {
                    reduced[(*row, *column)] -= self.mixed.column(k).dot(&solved);
                }
            }
        }
    }
}

/// Shared parameters that observations depend on: the lens's free ones, then three for each observation.
fn columns_of(
    free_lens: &[bool; LENS_PARAMETERS],
    free_points: bool,
    observations: &[Observation],
) -> Vec<usize> {
    let lens = (0..LENS_PARAMETERS).filter(|k| free_lens[*k]);
    let points = observations.iter().filter(|_| free_points);
    lens.chain(points.flat_map(|o| (0..3).map(|axis| place_of(o.point, axis))))
        .collect()
}

fn slopes_of(
    free_lens: &[bool; LENS_PARAMETERS],
    free_points: bool,
    by_lens: &[f64; LENS_PARAMETERS],
    by_point: DVec3,
) -> Vec<f64> {
    let lens = (0..LENS_PARAMETERS)
        .filter(|k| free_lens[*k])
        .map(|k| by_lens[k]);
    let point = by_point.to_array().into_iter().filter(|_| free_points);
    lens.chain(point).collect()
}

impl Solution {
    /// The part of a pose's covariance that all frames share: what lens and points, not known exactly, do to it.
    pub fn shared_covariance(
        &self,
        view: &View,
        information: &Matrix6<f64>,
    ) -> Option<Matrix6<f64>> {
        let is_free = |k: usize| self.covariance[(k, k)] > 0.0;
        let free_lens: [bool; LENS_PARAMETERS] = std::array::from_fn(is_free);
        let problem = Problem {
            views: Vec::new(),
            lens: self.lens,
            free_lens,
            points: self.points.clone(),
            free_points: (LENS_PARAMETERS..self.covariance.nrows()).any(is_free),
            priors: &[],
            noise_px: self.noise_px,
        };
        let size = self.covariance.nrows();
        let (mut ignored, mut ignored_slope) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let block = problem.block(view, &mut ignored, &mut ignored_slope);
        let by_shared = information.cholesky()?.solve(&block.mixed);
        let count = block.columns.len();
        let picked = DMatrix::from_fn(count, count, |i, j| {
            self.covariance[(block.columns[i], block.columns[j])]
        });
        let covariance = &by_shared * picked * by_shared.transpose();
        Some(covariance)
    }
}

#[cfg(test)]
mod tests;
