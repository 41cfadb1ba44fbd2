//! Poses made smooth by as much as their covariances leave open: where corners say clearly where the camera was it stays there, and where they do not
//! its neighbours say more.
//!
//! Least squares over the frames of a run without gaps: each pose's way from where it was seen, weighted by its own covariance, and the changes of speed.
//! These count as much as they may while poses move by no more than their covariances let expect.

use glam::DQuat;
use nalgebra::{Matrix6, Vector6};

use super::pose::Pose;
use super::session::Session;
use super::tracker::rms_px;

/// Poses that no change of speed can be told from.
const SHORTEST_RUN: usize = 5;
/// Of turns that are not small: what is linear is linear again.
const ROUNDS: usize = 4;
/// The least change of speed between frames that counts as the camera's: radians, and metres.
const LEAST_TURN: f64 = 1e-6;
const LEAST_SHIFT_M: f64 = 1e-7;

/// The least share of the changes seen, squared, that is taken for the camera's; the search for it.
const LEAST_SHARE_LOG10: f64 = -8.0;
const HALVINGS: usize = 10;
/// How far poses may be moved, in squared standard deviations; noise alone is 1.
const MOST_MOVED: f64 = 0.8;

impl Session {
    /// Smooths all poses, and notes how far each was moved: `None` where a frame has no pose, or is one of too few in a row.
    pub fn smooth(&mut self) {
        let tracked = &mut self.tracked;
        let mut moved = vec![None; tracked.frames.len()];
        let posed: Vec<bool> = tracked.frames.iter().map(|f| f.pose.is_ok()).collect();
        let mut end = 0;
        for run in posed.chunk_by(|a, b| a == b) {
            let start = end;
            end += run.len();
            let known: Vec<Known> = (tracked.frames[start..end].iter())
                .filter_map(|frame| frame.pose.as_ref().ok())
                .map(|pose| Known {
                    pose: pose.fit.pose,
                    covariance: pose.own_covariance,
                })
                .collect();
            let smooth = smoothed(&known);
            for ((frame, moved), pose) in (tracked.frames[start..end].iter_mut())
                .zip(&mut moved[start..end])
                .zip(smooth)
            {
                let Ok(own) = &mut frame.pose else { continue };
                *moved = Some(own.fit.pose.way_to(&pose));
                own.fit.pose = pose;
                own.rms_px = rms_px(&own.fit, &frame.sighting, &tracked.solution);
            }
        }
        self.moved = moved;
    }
}

/// A pose and what its own corners leave open of it.
#[derive(Clone, Debug)]
struct Known {
    pose: Pose,
    covariance: Matrix6<f64>,
}

/// The smooth poses of frames that follow one another; none of too few, or where a covariance has no inverse.
fn smoothed(known: &[Known]) -> Vec<Pose> {
    let weights: Option<Vec<Matrix6<f64>>> =
        known.iter().map(|k| k.covariance.try_inverse()).collect();
    let (Some(weights), true) = (weights, known.len() >= SHORTEST_RUN) else {
        return Vec::new();
    };
    let seen = changes_seen(known);
    let with = |share_log10: f64| {
        let stiffness = seen.map(|change| 1.0 / (change * change * 10_f64.powf(share_log10)));
        solved(known, &weights, &stiffness)
    };
    // Of the changes that are seen, squared, what share is the camera's.
    let (mut too_small, mut enough) = (LEAST_SHARE_LOG10, 0.0);
    for _ in 0..HALVINGS {
        let share = 0.5 * (too_small + enough);
        match moved_by(known, &weights, &with(share)) > MOST_MOVED {
            true => too_small = share,
            false => enough = share,
        }
    }
    with(enough)
}

/// The squared way from where a pose was seen, in standard deviations, for each of the six axes: mean of all, so that no single one goes far.
fn moved_by(known: &[Known], weights: &[Matrix6<f64>], poses: &[Pose]) -> f64 {
    if poses.is_empty() {
        return f64::INFINITY;
    }
    let ways = known.iter().zip(weights).zip(poses);
    let squares = ways.map(|((known, weight), pose)| {
        let way = step(&known.pose, pose);
        way.dot(&(weight * way)) / 6.0
    });
    squares.sum::<f64>() / poses.len() as f64
}

fn solved(known: &[Known], weights: &[Matrix6<f64>], stiffness: &[f64; 6]) -> Vec<Pose> {
    let mut poses: Vec<Pose> = known.iter().map(|k| k.pose).collect();
    for _ in 0..ROUNDS {
        let mut system = Banded::new(6 * poses.len());
        for (index, weight) in weights.iter().enumerate() {
            let slope = weight * step(&known[index].pose, &poses[index]);
            for i in 0..6 {
                system.right[6 * index + i] -= slope[i];
                for j in 0..=i {
                    system.add(6 * index + i, 6 * index + j, weight[(i, j)]);
                }
            }
        }
        for (first, change) in changes_of_speed(&poses).into_iter().enumerate() {
            // Of the steps of three frames; turns from frame to frame are small.
            const BY: [f64; 3] = [1.0, -2.0, 1.0];
            for i in 0..6 {
                for (a, by_a) in BY.into_iter().enumerate() {
                    let row = 6 * (first + a) + i;
                    system.right[row] -= stiffness[i] * by_a * change[i];
                    for (b, by_b) in BY.into_iter().enumerate().take(a + 1) {
                        system.add(row, 6 * (first + b) + i, stiffness[i] * by_a * by_b);
                    }
                }
            }
        }
        let Some(steps) = system.solved() else {
            return Vec::new();
        };
        for (pose, step) in poses.iter_mut().zip(steps.chunks_exact(6)) {
            *pose = pose.moved(std::array::from_fn(|k| step[k]));
        }
    }
    poses
}

/// The step that takes one pose to another.
fn step(from: &Pose, to: &Pose) -> Vector6<f64> {
    let turn = DQuat::from_mat3(&(to.rotation * from.rotation.transpose())).to_scaled_axis();
    let shift = to.translation - from.translation;
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// Of every three frames that follow one another.
fn changes_of_speed(poses: &[Pose]) -> Vec<Vector6<f64>> {
    let three = poses.windows(3);
    three
        .map(|p| step(&p[1], &p[2]) - step(&p[0], &p[1]))
        .collect()
}

/// Changes of speed from frame to frame along each of the six axes, one standard deviation by their median: the camera's and the noise's.
fn changes_seen(known: &[Known]) -> [f64; 6] {
    let poses: Vec<Pose> = known.iter().map(|k| k.pose).collect();
    let changes = changes_of_speed(&poses);
    std::array::from_fn(|axis| {
        let least = if axis < 3 { LEAST_TURN } else { LEAST_SHIFT_M };
        let mut seen: Vec<f64> = changes.iter().map(|change| change[axis].abs()).collect();
        seen.sort_by(f64::total_cmp);
        (1.4826 * seen[seen.len() / 2]).max(least)
    })
}

/// A symmetric system whose rows reach no further than three poses.
struct Banded {
    /// Row by row, the last entry on the diagonal.
    lower: Vec<[f64; Banded::WIDTH]>,
    right: Vec<f64>,
}

impl Banded {
    const WIDTH: usize = 18;

    fn new(size: usize) -> Self {
        Self {
            lower: vec![[0.0; Self::WIDTH]; size],
            right: vec![0.0; size],
        }
    }

    fn add(&mut self, row: usize, column: usize, value: f64) {
        self.lower[row][column + Self::WIDTH - 1 - row] += value;
    }

    /// By a Cholesky factor; `None`: it is not positive.
    fn solved(mut self) -> Option<Vec<f64>> {
        let size = self.right.len();
        let first = |row: usize| row.saturating_sub(Self::WIDTH - 1);
        let at = |lower: &[[f64; Self::WIDTH]], row: usize, column: usize| {
            lower[row][column + Self::WIDTH - 1 - row]
        };
        for row in 0..size {
            for column in first(row)..=row {
                let common = first(row)..column;
                let sum: f64 = common
                    .map(|k| at(&self.lower, row, k) * at(&self.lower, column, k))
                    .sum();
                let rest = at(&self.lower, row, column) - sum;
                self.lower[row][column + Self::WIDTH - 1 - row] = match column == row {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return None,
                    false => rest / at(&self.lower, column, column),
                };
            }
            let known: f64 = (first(row)..row)
                .map(|k| at(&self.lower, row, k) * self.right[k])
                .sum();
            self.right[row] = (self.right[row] - known) / at(&self.lower, row, row);
        }
        for row in (0..size).rev() {
            let beyond = row + 1..(row + Self::WIDTH).min(size);
            let known: f64 = beyond
                .map(|k| at(&self.lower, k, row) * self.right[k])
                .sum();
            self.right[row] = (self.right[row] - known) / at(&self.lower, row, row);
        }
        Some(self.right)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::super::pose::Moved;
    use super::*;

    const FRAMES: usize = 60;

    fn truth(index: usize) -> Pose {
        let t = index as f64 / 20.0;
        Pose {
            rotation: DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(
                2.0 + 0.1 * t.sin(),
                0.2 * t,
                0.1 * t.cos(),
            ))),
            translation: DVec3::new(0.1 * t.sin(), 0.05 * t, 0.6 + 0.1 * t.cos()),
        }
    }

    /// Every fifth frame is known ten times worse than the others.
    fn sigma(index: usize) -> f64 {
        if index % 5 == 2 { 1e-2 } else { 1e-3 }
    }

    fn deviate(seed: &mut u64) -> f64 {
        let sum: f64 = (0..12)
            .map(|_| {
                *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (*seed >> 40) as f64 / (1_u64 << 24) as f64
            })
            .sum();
        sum - 6.0
    }

    fn seen(sigma_told: impl Fn(usize) -> f64) -> Vec<Known> {
        let mut seed = 9;
        let frames = (0..FRAMES).map(|index| {
            let noise = std::array::from_fn(|_| sigma(index) * deviate(&mut seed));
            Known {
                pose: truth(index).moved(noise),
                covariance: Matrix6::identity() * sigma_told(index).powi(2),
            }
        });
        frames.collect()
    }

    /// Root mean square errors, metres: of frames known well, and badly.
    fn errors(poses: &[Pose]) -> [f64; 2] {
        [false, true].map(|badly| {
            let those = (0..FRAMES).filter(|index| (index % 5 == 2) == badly);
            let squares: Vec<f64> = those
                .map(|index| {
                    let off = poses[index].translation - truth(index).translation;
                    off.length_squared()
                })
                .collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        })
    }

    #[test]
    fn what_is_known_badly_is_taken_from_its_neighbours() {
        let known = seen(sigma);
        let before: Vec<Pose> = known.iter().map(|k| k.pose).collect();
        let [well, badly] = errors(&before);
        let [well_after, badly_after] = errors(&smoothed(&known));
        assert!(badly_after < 0.25 * badly, "{badly_after} of {badly}");
        assert!(well_after < 0.9 * well, "{well_after} of {well}");
        // All weighted alike, the bad frames pull the good ones along.
        let [alike, _] = errors(&smoothed(&seen(|_| 3e-3)));
        assert!(alike > 1.5 * well_after, "control: {alike}");
    }

    #[test]
    fn poses_that_are_known_exactly_stay() {
        let known: Vec<Known> = (0..FRAMES)
            .map(|index| Known {
                pose: truth(index),
                covariance: Matrix6::identity() * 1e-14,
            })
            .collect();
        for (index, pose) in smoothed(&known).iter().enumerate() {
            let Moved { metres, radians } = truth(index).way_to(pose);
            assert!(metres < 1e-6 && radians < 1e-6, "{metres} {radians}");
        }
        assert!(smoothed(&known[..3]).is_empty(), "too few");
    }

    #[test]
    fn a_banded_system_is_solved() {
        let size = 30;
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 40.0 + i as f64,
            far if far < Banded::WIDTH => 1.0 / (1 + far + i.min(j)) as f64,
            _ => 0.0,
        };
        let answer: Vec<f64> = (0..size).map(|k| (k as f64).sin()).collect();
        let mut system = Banded::new(size);
        for i in 0..size {
            for (j, value) in answer.iter().enumerate() {
                system.right[i] += entry(i, j) * value;
                if j <= i && i - j < Banded::WIDTH {
                    system.add(i, j, entry(i, j));
                }
            }
        }
        let solved = system.solved().unwrap();
        let worst = solved.iter().zip(&answer).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-12);
    }
}
