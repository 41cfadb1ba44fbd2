//! Which of two poses is meant where the picture alone does not say: the one that its neighbours in time go through.

use super::frame_pose::{Fit, Minima};

/// Squared standard deviations by which the worse minimum has to be worse.
const CLEAR_MARGIN: f64 = 12.0;
/// Frames to look to either side for one that is decided.
const REACH: usize = 5;
/// The meant pose turns at most by this share of what the other would.
const CLEAR_SHARE: f64 = 0.5;

/// For each frame its pose and whether neighbours decided it, or why there is none.
pub fn settle(frames: &[Option<&Minima>]) -> Vec<Result<(Fit, bool), String>> {
    let decided = |index: usize| {
        let minima = frames.get(index).copied().flatten()?;
        (minima.margin() > CLEAR_MARGIN).then_some(&minima.best)
    };
    let each = frames.iter().enumerate().map(|(index, frame)| {
        let Some(minima) = frame else {
            return Err("no pose".to_owned());
        };
        if minima.margin() > CLEAR_MARGIN {
            return Ok((minima.best.clone(), false));
        }
        let ahead = (1..=REACH).find_map(|step| decided(index + step));
        let behind = (1..=REACH.min(index)).find_map(|step| decided(index - step));
        let turns = |fit: &Fit| -> f64 {
            let neighbours = ahead.iter().chain(behind.iter());
            neighbours.map(|other| fit.pose.angle_to(&other.pose)).sum()
        };
        let other = minima
            .other
            .as_ref()
            .filter(|_| ahead.is_some() || behind.is_some());
        let two = "two poses fit alike, and no frame nearby says which is meant";
        let other = other.ok_or(two)?;
        let (of_best, of_other) = (turns(&minima.best), turns(other));
        if of_best < CLEAR_SHARE * of_other {
            Ok((minima.best.clone(), true))
        } else if of_other < CLEAR_SHARE * of_best {
            Ok((other.clone(), true))
        } else {
            Err(two.to_owned())
        }
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};
    use nalgebra::Matrix6;

    use super::super::pose::Pose;
    use super::*;

    fn fit(angle: f64, cost: f64) -> Fit {
        Fit {
            pose: Pose {
                rotation: DMat3::from_rotation_x(angle),
                translation: DVec3::Z,
            },
            cost,
            information: Matrix6::identity(),
        }
    }

    fn minima(best: f64, other: f64, margin: f64) -> Minima {
        Minima {
            best: fit(best, 1.0),
            other: Some(fit(other, 1.0 + margin)),
        }
    }

    #[test]
    fn neighbours_tell_the_mirror_from_the_pose() {
        let clear = minima(0.5, -0.5, 100.0);
        let mirrored = minima(-0.48, 0.52, 2.0);
        let settled = settle(&[Some(&clear), Some(&mirrored), None]);
        let (first, by_neighbours) = settled[0].clone().unwrap();
        assert!(first.pose.angle_to(&clear.best.pose) < 1e-12 && !by_neighbours);
        let (second, by_neighbours) = settled[1].clone().unwrap();
        assert!(second.cost == 3.0 && by_neighbours);
        assert!(settled[2].is_err());
        // Nothing decided nearby: none is meant.
        assert!(
            settle(&[Some(&mirrored), Some(&mirrored)])
                .iter()
                .all(Result::is_err)
        );
    }
}
