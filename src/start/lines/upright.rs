//! Which axis of a picture's lines is up.

use glam::DVec3;

use super::model::State;

/// A surface faces the camera like a wall if one of its axes leans by no more from the picture's vertical, as a cosine, and its normal is as level.
const WALL_VERTICAL: f64 = 0.94;
const WALL_FACES: f64 = 0.25;
/// Cameras are seldom rolled by more, as a sine: an axis that leans sideways by less is upright, if the surface's normal leans so many times more.
const MOST_ROLL: f64 = 0.08;
const LEAST_UPRIGHT: f64 = 0.6;
const TIMES: f64 = 3.0;
/// A surface that is looked down on so steeply faces the camera, unless up is up in the picture by so much.
const STEEP: f64 = 0.6;
const PLAINLY_UP: f64 = 0.75;

/// Of three axes, the one that leans least in the picture. Lines along two alone lie in one surface, which carries things, unless it faces the camera like
/// a wall, or one of the two is upright for a camera that is not rolled, as those of a wall behind a table.
pub fn upright(state: &State, bits: &[f64]) -> usize {
    let axes = state.axes();
    let lean = |i: usize| axes[i].y.abs();
    let least = (0..3)
        .max_by(|a, b| lean(*a).total_cmp(&lean(*b)))
        .unwrap_or(0);
    let Some(normal) = (0..3).find(|i| bits[*i] == 0.0) else {
        return least;
    };
    let most_upright = (0..3)
        .filter(|i| *i != normal)
        .max_by(|a, b| lean(*a).total_cmp(&lean(*b)))
        .unwrap_or(normal);
    let roll = |i: usize| axes[i].x.abs();
    let is_wall =
        least == most_upright && lean(least) >= WALL_VERTICAL && lean(normal) <= WALL_FACES;
    let is_level = roll(most_upright) < MOST_ROLL
        && lean(most_upright) > LEAST_UPRIGHT
        && roll(normal) > TIMES * roll(most_upright).max(0.5 * MOST_ROLL);
    match is_wall || is_level {
        true => most_upright,
        false => normal,
    }
}

/// The axis, or its opposite, that points away from the ground; x right, y up, z back.
pub fn away_from_ground(axis: DVec3) -> DVec3 {
    match axis.z.abs() > STEEP && axis.y.abs() < PLAINLY_UP {
        true => axis * axis.z.signum(),
        false => axis * axis.y.signum(),
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat, DVec2};

    use super::*;

    /// Axes along, up and ahead of a camera that looks down.
    fn state(turn: f64, down: f64, roll: f64) -> State {
        let axes = DMat3::from_rotation_z(roll)
            * DMat3::from_rotation_x(down)
            * DMat3::from_rotation_y(turn);
        State {
            rotation: DQuat::from_mat3(&axes),
            log_focal: 0.0,
            bend: 0.0,
            centre: DVec2::ZERO,
            up: 0,
            turns: Vec::new(),
        }
    }

    #[test]
    fn walls_stand_and_tables_lie() {
        // Lines along and up: of a wall behind a table, seen askew.
        assert_eq!(upright(&state(0.5, 0.4, 0.02), &[50.0, 50.0, 0.0]), 1);
        // Lines along and ahead: of the table.
        assert_eq!(upright(&state(0.5, 0.4, 0.02), &[50.0, 0.0, 50.0]), 1);
        // Rolled like that, it is a sheet of paper on a table.
        assert_eq!(upright(&state(0.5, 0.4, 0.5), &[50.0, 50.0, 0.0]), 2);
        assert_eq!(upright(&state(0.5, 0.4, 0.1), &[50.0, 50.0, 50.0]), 1);
    }

    #[test]
    fn up_is_away_from_the_ground() {
        let level = DVec3::new(0.0, 0.9, 0.43);
        assert_eq!(away_from_ground(-level), level);
        // Looked down on by a camera that is held the other way up.
        let steep = DVec3::new(0.3, -0.4, 0.866);
        assert_eq!(away_from_ground(-steep), steep);
        let ceiling = DVec3::new(0.0, 0.78, -0.626);
        assert_eq!(away_from_ground(-ceiling), ceiling);
    }
}
