//! Three directions at right angles that the straight lines of a picture point along, and the focal length that makes them so.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::DMatrix;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::edges::Edge;
use super::model::{Assignment, Exactness, FOCAL, FOCAL_PRIOR, KnownFocal, Line, State, hit};
use super::refine::{refine, with_turns};
use super::upright::upright;

/// Lines that are looked at, the longest.
const MOST_LINES: usize = 250;
/// How straight edges are taken to be by the search, and by the fit.
const ROUGH: Exactness = Exactness {
    end_px: 0.5,
    straight: 0.0025,
};
const EXACT: Exactness = Exactness {
    end_px: 0.0,
    straight: 0.0008,
};
const PAIRS: usize = 6000;
/// Vanishing points that are tried with each other: of so many bundles of lines, so many places for each.
const BUNDLES: usize = 10;
const PLACES: usize = 6;
/// Share of the lines of two vanishing points, of all that run to either, from which on they stand for one bundle.
const SAME_BUNDLE: f64 = 0.4;
/// Cosine of the angle between the first guesses of two axes.
const MOST_SKEW: f64 = 0.2;
/// Fits that are refined.
const FINALISTS: usize = 8;

/// A camera for which the lines run along axes.
#[derive(Clone, Debug)]
pub struct Axes {
    pub focal_px: f64,
    /// x right, y down, z ahead.
    pub up: DVec3,
    /// Standard deviation of the logarithm of the focal length, and root mean square of the angle by which up is off, radians.
    pub focal_sigma: f64,
    pub up_sigma: f64,
    /// Of each line of [`MOST_LINES`], the axis that it runs along.
    pub runs_along: Vec<Option<usize>>,
    /// Of the lines that run along one, in standard deviations of a line.
    pub rms: f64,
    /// Bits beyond chance of all that run along an axis.
    pub evidence: f64,
    /// Of the lines' length, what runs along an axis: exactly, and as straight as things are.
    pub share: f64,
    pub rough_share: f64,
    /// How much more often than by chance lines run along each axis, roughly.
    pub rough_bits: Vec<f64>,
}

/// The axes that most of the lines run along; `None`: no three at right angles can be told.
pub fn find_axes(
    edges: &[Edge],
    (width, height): (f64, f64),
    known: Option<KnownFocal>,
) -> Option<Axes> {
    let centre = 0.5 * DVec2::new(width, height);
    let unit_px = centre.length();
    let lines = |exactness: Exactness| -> Vec<Line> {
        (edges.iter().take(MOST_LINES))
            .map(|edge| Line::of(edge, exactness, centre, unit_px))
            .collect()
    };
    let (rough, exact) = (lines(ROUGH), lines(EXACT));
    if rough.len() < 6 {
        return None;
    }
    let focal = match known {
        Some(known) => ((known.focal_px / unit_px).ln(), known.sigma),
        None => (FOCAL_PRIOR.0.ln(), FOCAL_PRIOR.1),
    };
    let points = vanishing_points(&rough);
    let mut starts: Vec<(f64, State)> = Vec::new();
    for (i, a) in points.iter().enumerate() {
        for b in &points[..i] {
            starts.extend(
                start(*a, *b, known.map(|_| focal.0.exp()))
                    .map(|state| (Assignment::of(&rough, &state).score(), state)),
            );
        }
    }
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let refined = starts.into_iter().take(FINALISTS).filter_map(|(_, state)| {
        let (state, _) = refine(&rough, state, focal)?;
        Some((Assignment::of(&rough, &state).score(), state))
    });
    let (_, mut state) = refined.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let assignment = Assignment::of(&rough, &state);
    state.up = upright(&state, &assignment.bits);
    let (state, covariance) = with_turns(&exact, state, focal)?;
    Some(finish(&rough, &exact, &state, &covariance, unit_px))
}

/// The places that many lines point to, the best first.
fn vanishing_points(lines: &[Line]) -> Vec<DVec3> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let through = |line: &Line| line.ends[0].extend(1.0).cross(line.ends[1].extend(1.0));
    let mut tried: Vec<(f64, DVec3)> = (0..PAIRS)
        .filter_map(|_| {
            let [a, b] = [(); 2].map(|()| &lines[random.random_range(0..lines.len())]);
            let point = through(a).cross(through(b)).try_normalize()?;
            let support =
                |line: &Line| -line.chance().log2() * hit(line.misses(point, 0.0, DVec2::ZERO));
            Some((lines.iter().map(support).sum(), point))
        })
        .collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let runs_to = |point: DVec3| -> Vec<bool> {
        let hits = |line: &Line| hit(line.misses(point, 0.0, DVec2::ZERO)) > 0.0;
        lines.iter().map(hits).collect()
    };
    let mut bundles: Vec<(Vec<bool>, Vec<DVec3>)> = Vec::new();
    for (_, point) in tried {
        let own = runs_to(point);
        let known = bundles
            .iter()
            .position(|(other, _)| overlap(&own, other) > SAME_BUNDLE);
        match known {
            Some(index) => {
                let places = &mut bundles[index].1;
                let apart = places
                    .iter()
                    .all(|place| place.cross(point).length() > 0.01);
                if apart && places.len() < PLACES {
                    places.push(point);
                }
            }
            None if bundles.len() < BUNDLES => bundles.push((own, vec![point])),
            None => {}
        }
    }
    bundles.into_iter().flat_map(|(_, places)| places).collect()
}

/// Of all that are in one, the share that is in both.
fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let count =
        |both: fn(bool, bool) -> bool| a.iter().zip(b).filter(|(a, b)| both(**a, **b)).count();
    count(|a, b| a && b) as f64 / count(|a, b| a || b).max(1) as f64
}

/// The camera that sees two vanishing points at right angles.
fn start(a: DVec3, b: DVec3, focal: Option<f64>) -> Option<State> {
    let squared = -a.truncate().dot(b.truncate()) / (a.z * b.z);
    let focal = focal.unwrap_or(squared.max(0.0).sqrt());
    // Points that are nearly at infinity tell none: the lines have to.
    let focal = if FOCAL.contains(&focal) {
        focal
    } else {
        FOCAL_PRIOR.0
    };
    let axis = |v: DVec3| DVec3::new(v.x / focal, v.y / focal, v.z).normalize();
    let (first, second) = (axis(a), axis(b));
    if first.dot(second).abs() > MOST_SKEW {
        return None;
    }
    let second = (second - first * first.dot(second)).normalize();
    let axes = DMat3::from_cols(first, second, first.cross(second));
    Some(State {
        rotation: DQuat::from_mat3(&axes),
        log_focal: focal.ln(),
        bend: 0.0,
        centre: DVec2::ZERO,
        up: 0,
        turns: Vec::new(),
    })
}

fn finish(
    rough: &[Line],
    exact: &[Line],
    state: &State,
    covariance: &DMatrix<f64>,
    unit_px: f64,
) -> Axes {
    let assignment = Assignment::of(exact, state);
    let of_rough = Assignment::of(rough, state);
    let up = state.axes()[state.up];
    // Turning about an axis leaves it.
    let turn = covariance.fixed_view::<3, 3>(0, 0);
    let axis = nalgebra::Vector3::from(up.to_array());
    let about = (axis.transpose() * turn * axis)[(0, 0)];
    let length = |line: &Line| line.ends[0].distance(line.ends[1]);
    let total: f64 = rough.iter().map(length).sum();
    let share = |assignment: &Assignment| {
        let along = rough.iter().zip(&assignment.of_lines);
        let along = along.filter(|(_, along)| along.is_some());
        along.map(|(line, _)| length(line)).sum::<f64>() / total
    };
    Axes {
        focal_px: state.log_focal.exp() * unit_px,
        up,
        focal_sigma: covariance[(3, 3)].sqrt(),
        up_sigma: (turn.trace() - about).max(0.0).sqrt(),
        rms: assignment.rms(),
        evidence: assignment.evidence(exact, state.axes().len()),
        share: share(&assignment),
        rough_share: share(&of_rough),
        runs_along: (of_rough.of_lines.iter())
            .map(|along| along.map(|(axis, _)| axis))
            .collect(),
        rough_bits: of_rough.bits,
    }
}
