//! A camera and its axes fitted to lines, how sure they are, and further axes that stand on the same ground.

use glam::DVec2;
use nalgebra::{DMatrix, DVector};

use super::model::{Assignment, BEND_PRIOR, CENTRE_PRIOR, FOCAL, Line, SHARED, State, hit};

const STEPS: usize = 15;
/// Edges come in pairs, both sides of one thing, so that half of them say nothing new.
const EXCESS: f64 = 2.0;
/// Further pairs of axes: so many, each with lines and bits beyond chance.
const MOST_TURNS: usize = 2;
const LEAST_LINES: usize = 3;
const LEAST_BITS: f64 = 10.0;

/// Gauss and Newton's steps with Tukey's weights, and the parameters' covariance; `None`: they lead nowhere. `focal` is the logarithm of the focal length
/// and its standard deviation before.
pub fn refine(
    lines: &[Line],
    mut state: State,
    focal: (f64, f64),
) -> Option<(State, DMatrix<f64>)> {
    let mut covariance = DMatrix::zeros(0, 0);
    for _ in 0..STEPS {
        let (data, gradient, excess) = equations(lines, &state);
        let (prior, prior_gradient) = priors(&state, focal);
        let inverse = (&data + &prior).try_inverse()?;
        let step = -(inverse * (gradient + prior_gradient));
        // Small enough to stay with the lines that were chosen.
        let step = &step * (0.2 / step.norm()).min(1.0);
        state = state.changed(step.as_slice());
        covariance = (data / (EXCESS * excess) + prior).try_inverse()?;
        if step.norm() < 1e-7 {
            break;
        }
    }
    FOCAL
        .contains(&state.log_focal.exp())
        .then_some((state, covariance))
}

/// The lines' normal equations, and by how much more they miss than their standard deviations say.
fn equations(lines: &[Line], state: &State) -> (DMatrix<f64>, DVector<f64>, f64) {
    const STEP: f64 = 1e-5;
    let size = SHARED + state.turns.len();
    let mut normal = DMatrix::zeros(size, size);
    let mut gradient = DVector::zeros(size);
    let (mut squares, mut count) = (0.0, 0.0);
    let assignment = Assignment::of(lines, state);
    let mut step = vec![0.0; size];
    let mut changed = |i: usize, by: f64| {
        step[i] = by;
        let state = state.changed(&step);
        step[i] = 0.0;
        (state.points(), state.bend, state.centre)
    };
    let sides: Vec<_> = (0..size)
        .map(|i| (changed(i, STEP), changed(i, -STEP)))
        .collect();
    for (line, along) in lines.iter().zip(&assignment.of_lines) {
        let Some((axis, misses)) = *along else {
            continue;
        };
        let weight = hit(misses).powi(2);
        let slope = DVector::from_iterator(
            size,
            sides.iter().map(|(up, down)| {
                let at = |(points, bend, centre): &(Vec<_>, f64, DVec2)| {
                    line.misses(points[axis], *bend, *centre)
                };
                (at(up) - at(down)) / (2.0 * STEP)
            }),
        );
        normal += weight * &slope * slope.transpose();
        gradient += weight * misses * slope;
        squares += weight * misses * misses;
        count += weight;
    }
    let excess = (squares / f64::max(count - size as f64, 1.0)).max(1.0);
    (normal, gradient, excess)
}

fn priors(state: &State, (log_focal, focal_sigma): (f64, f64)) -> (DMatrix<f64>, DVector<f64>) {
    let size = SHARED + state.turns.len();
    // So little that it changes nothing but what the lines leave open.
    let mut normal = DMatrix::identity(size, size) * 1e-6;
    let mut gradient = DVector::zeros(size);
    for (i, off, sigma) in [
        (3, state.log_focal - log_focal, focal_sigma),
        (4, state.bend, BEND_PRIOR),
        (5, state.centre.x, CENTRE_PRIOR),
        (6, state.centre.y, CENTRE_PRIOR),
    ] {
        normal[(i, i)] += sigma.powi(-2);
        gradient[i] += off / (sigma * sigma);
    }
    (normal, gradient)
}

/// With further pairs of axes about the one that is up, as of a crate that stands askew in a room.
pub fn with_turns(
    lines: &[Line],
    state: State,
    focal: (f64, f64),
) -> Option<(State, DMatrix<f64>)> {
    let mut best = refine(lines, state, focal)?;
    for _ in 0..MOST_TURNS {
        let Some(turned) = with_turn(lines, &best.0) else {
            break;
        };
        let Some(refined) = refine(lines, turned, focal) else {
            break;
        };
        best = refined;
    }
    Some(best)
}

fn with_turn(lines: &[Line], state: &State) -> Option<State> {
    let assignment = Assignment::of(lines, state);
    let rest: Vec<Line> = (lines.iter().zip(&assignment.of_lines))
        .filter(|(_, along)| along.is_none())
        .map(|(line, _)| *line)
        .collect();
    let axes = state.axes();
    let [a, b] = [1, 2].map(|k| axes[(state.up + k) % 3]);
    let focal = state.log_focal.exp();
    let gain = |turn: f64| -> (usize, f64) {
        let state = State {
            turns: vec![turn],
            ..state.clone()
        };
        let points = state.points();
        let hits = rest.iter().filter_map(|line| {
            let misses = |point: &glam::DVec3| line.misses(*point, state.bend, state.centre).abs();
            let least = points[3..].iter().map(misses).fold(f64::INFINITY, f64::min);
            (hit(least) > 0.0)
                .then(|| -hit(least) * (2.0 * line.chance() * lines.len() as f64).log2())
        });
        (hits.clone().count(), hits.sum())
    };
    let turns = rest.iter().map(|line| {
        let [p, q] = (line.ends)
            .map(|end| end - state.centre)
            .map(|end| (end / (1.0 + state.bend * end.length_squared())).extend(focal));
        // Level, and in the plane that the line is seen in.
        let level = p.cross(q).cross(axes[state.up]);
        level.dot(b).atan2(level.dot(a))
    });
    let (turn, (count, bits)) = turns
        .map(|turn| (turn, gain(turn)))
        .max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    (count >= LEAST_LINES && bits >= LEAST_BITS).then(|| {
        let mut turned = state.clone();
        turned.turns.push(turn);
        turned
    })
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat, DVec3};

    use super::*;

    /// What lies at a place of the scene, seen by a camera at its origin that looks down a little.
    fn camera() -> State {
        State {
            rotation: DQuat::from_mat3(
                &(DMat3::from_rotation_x(0.3) * DMat3::from_rotation_y(0.5)),
            ),
            log_focal: 1.4_f64.ln(),
            bend: 0.0,
            centre: DVec2::ZERO,
            up: 1,
            turns: vec![0.4],
        }
    }

    fn line(from: DVec3, along: DVec3) -> Line {
        let seen = |p: DVec3| 1.4 * p.truncate() / p.z;
        Line {
            ends: [seen(from), seen(from + 0.8 * along)],
            sigma: 0.001,
        }
    }

    /// Lines along the first `count` axes, four each.
    fn lines(count: usize) -> Vec<Line> {
        let places = [
            (-0.9, -0.5, 3.0),
            (0.8, 0.4, 3.5),
            (-0.3, 0.6, 2.8),
            (0.2, -0.4, 4.0),
        ];
        (camera().axes().into_iter().take(count))
            .flat_map(|axis| places.map(|place| line(DVec3::from(place), axis)))
            .collect()
    }

    #[test]
    fn a_crate_askew_in_a_room_is_taken_too() {
        let off = State {
            rotation: DQuat::from_rotation_x(0.002) * camera().rotation,
            log_focal: 1.41_f64.ln(),
            turns: Vec::new(),
            ..camera()
        };
        let focal = (1.6_f64.ln(), 0.5);
        let (of_room, wide) = with_turns(&lines(3), off.clone(), focal).unwrap();
        let (of_both, narrow) = with_turns(&lines(5), off, focal).unwrap();
        assert!(of_room.turns.is_empty());
        assert_eq!(of_both.turns.len(), 1);
        let turn = (of_both.turns[0] - 0.4).rem_euclid(std::f64::consts::FRAC_PI_2);
        assert!(
            turn.min(std::f64::consts::FRAC_PI_2 - turn) < 0.01,
            "{turn}"
        );
        for state in [&of_room, &of_both] {
            assert!((state.log_focal.exp() / 1.4 - 1.0).abs() < 0.01);
        }
        assert!(narrow[(3, 3)] < wide[(3, 3)]);
    }
}
