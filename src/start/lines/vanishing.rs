//! Three directions at right angles that the straight lines of a picture point along, and the focal length that makes them so.
//!
//! Lengths are in units of the picture's half diagonal about its centre, x right, y down; a direction (x, y, z) with z ahead vanishes at f (x, y) / z.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use super::segments::Segment;

/// Lines that are looked at, the longest.
pub const MOST_LINES: usize = 250;
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
/// Standard deviation of an end across its line, pixels, and of a line that is as long as you like, radians: real edges are not straight.
const END_SIGMA_PX: f64 = 0.5;
const BEND_SIGMA: f64 = 0.0025;
/// Standard deviations from which on a line points elsewhere.
const MOST_SIGMAS: f64 = 3.0;
/// Focal lengths from 130 down to 12 degrees across the diagonal.
pub const FOCAL: std::ops::Range<f64> = 0.47..9.5;
/// Of the logarithm of the focal length, where nothing is known, about a normal lens.
pub const FOCAL_PRIOR: (f64, f64) = (1.6, 0.5);
/// A third axis is one only with so many of the second one's bits: else it takes up what points there by chance.
const LEAST_THIRD: f64 = 0.4;
/// Of the lens's bending: p / (1 + bend |p|^2) is where a pinhole sees p.
pub const BEND_PRIOR: f64 = 0.08;

/// What is known of a focal length before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownFocal {
    pub focal_px: f64,
    /// Standard deviation of its logarithm.
    pub sigma: f64,
}

/// A line of a picture.
#[derive(Clone, Copy, Debug)]
struct Line {
    ends: [DVec2; 2],
    sigma: f64,
}

/// A camera for which the lines run along three axes.
#[derive(Clone, Debug)]
pub struct Axes {
    pub focal_px: f64,
    /// Columns are the axes; x right, y down, z ahead.
    pub axes: DMat3,
    /// Standard deviations: of the logarithm of the focal length, and of the axes' direction, radians.
    pub focal_sigma: f64,
    pub axis_sigma: DVec3,
    /// Of each line of [`MOST_LINES`], the axis that it runs along.
    pub runs_along: Vec<Option<usize>>,
    /// How much more often than by chance lines run along each.
    pub bits: [f64; 3],
    /// Of the lines that run along one, in standard deviations of a line.
    pub rms: f64,
}

#[derive(Clone, Copy, Debug)]
struct State {
    rotation: DQuat,
    log_focal: f64,
    bend: f64,
}

impl State {
    fn changed(&self, step: &SVector<f64, 5>) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2]));
        Self {
            rotation: (turn * self.rotation).normalize(),
            log_focal: self.log_focal + step[3],
            bend: self.bend + step[4],
        }
    }
}

impl Line {
    fn of(segment: &Segment, centre: DVec2, unit_px: f64) -> Self {
        let length_px = segment.length();
        // Both ends are off, on either side.
        let of_ends = END_SIGMA_PX * std::f64::consts::SQRT_2 / length_px;
        Self {
            ends: [segment.from, segment.to].map(|end| (end - centre) / unit_px),
            sigma: of_ends.hypot(BEND_SIGMA),
        }
    }

    /// How far it points past where `vanishing` (x, y, w) is, in standard deviations.
    fn misses(&self, vanishing: DVec3, bend: f64) -> f64 {
        let [p, q] = self
            .ends
            .map(|end| end / (1.0 + bend * end.length_squared()));
        let towards = vanishing.truncate() - 0.5 * (p + q) * vanishing.z;
        let along = q - p;
        towards.perp_dot(along) / (towards.length() * along.length()).max(1e-300) / self.sigma
    }
}

fn vanishing(axis: DVec3, focal: f64) -> DVec3 {
    DVec3::new(axis.x * focal, axis.y * focal, axis.z)
}

/// 1 for a line that hits, 0 for one that misses by [`MOST_SIGMAS`].
fn hit(misses: f64) -> f64 {
    (1.0 - (misses / MOST_SIGMAS).powi(2)).max(0.0)
}

/// How often a line that points anywhere hits a given point.
fn chance(line: &Line) -> f64 {
    (2.0 * MOST_SIGMAS * line.sigma / std::f64::consts::PI).min(0.5)
}

/// Which axis each line runs along and by how much it misses it, and the axes' bits beyond chance.
struct Assignment {
    of_lines: Vec<Option<(usize, f64)>>,
    bits: [f64; 3],
}

impl Assignment {
    fn of(lines: &[Line], state: &State) -> Self {
        let focal = state.log_focal.exp();
        let axes = DMat3::from_quat(state.rotation);
        let points = [0, 1, 2].map(|i| vanishing(axes.col(i), focal));
        let mut of_lines: Vec<Option<(usize, f64)>> = (lines.iter())
            .map(|line| {
                let misses = points.map(|point| line.misses(point, state.bend));
                let best = (0..3).min_by(|a, b| misses[*a].abs().total_cmp(&misses[*b].abs()))?;
                (misses[best].abs() < MOST_SIGMAS).then_some((best, misses[best]))
            })
            .collect();
        let mut bits = [0, 1, 2].map(|axis| {
            let own = (lines.iter().zip(&of_lines)).filter_map(|(line, along)| match along {
                Some((along, misses)) if *along == axis => Some((hit(*misses), chance(line))),
                _ => None,
            });
            let share = own.clone().map(|(hit, _)| hit).sum::<f64>() / lines.len() as f64;
            own.map(|(hit, chance)| hit * (share / chance).log2())
                .sum::<f64>()
                .max(0.0)
        });
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| bits[*b].total_cmp(&bits[*a]));
        if bits[order[2]] < LEAST_THIRD * bits[order[1]] {
            bits[order[2]] = 0.0;
            for along in &mut of_lines {
                if along.is_some_and(|(axis, _)| axis == order[2]) {
                    *along = None;
                }
            }
        }
        Self { of_lines, bits }
    }

    fn score(&self) -> f64 {
        self.bits.iter().sum()
    }
}

/// The axes that most of the lines run along; `None`: no three at right angles can be told.
pub fn find_axes(
    segments: &[Segment],
    (width, height): (f64, f64),
    known: Option<KnownFocal>,
) -> Option<Axes> {
    let centre = 0.5 * DVec2::new(width, height);
    let unit_px = centre.length();
    let lines: Vec<Line> = (segments.iter().take(MOST_LINES))
        .map(|segment| Line::of(segment, centre, unit_px))
        .collect();
    if lines.len() < 6 {
        return None;
    }
    let prior = match known {
        Some(known) => ((known.focal_px / unit_px).ln(), known.sigma),
        None => (FOCAL_PRIOR.0.ln(), FOCAL_PRIOR.1),
    };
    let points = vanishing_points(&lines);
    let mut starts: Vec<(f64, State)> = Vec::new();
    for (i, a) in points.iter().enumerate() {
        for b in &points[..i] {
            starts.extend(
                start(*a, *b, known.map(|_| prior.0.exp()))
                    .map(|state| (Assignment::of(&lines, &state).score(), state)),
            );
        }
    }
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let refined = starts.iter().take(FINALISTS).filter_map(|(_, state)| {
        let (state, covariance) = refine(&lines, *state, prior)?;
        Some((Assignment::of(&lines, &state).score(), state, covariance))
    });
    let (_, state, covariance) = refined.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(finish(&lines, state, &covariance, unit_px))
}

/// The places that many lines point to, the best first.
fn vanishing_points(lines: &[Line]) -> Vec<DVec3> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let through = |line: &Line| line.ends[0].extend(1.0).cross(line.ends[1].extend(1.0));
    let mut tried: Vec<(f64, DVec3)> = (0..PAIRS)
        .filter_map(|_| {
            let [a, b] = [(); 2].map(|()| &lines[random.random_range(0..lines.len())]);
            let point = through(a).cross(through(b)).try_normalize()?;
            let support = |line: &Line| -chance(line).log2() * hit(line.misses(point, 0.0));
            Some((lines.iter().map(support).sum(), point))
        })
        .collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let runs_to = |point: DVec3| -> Vec<bool> {
        let hits = |line: &Line| hit(line.misses(point, 0.0)) > 0.0;
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
    })
}

/// Gauss and Newton's steps with Tukey's weights, and the covariance of turn, logarithm of the focal length, and bend.
fn refine(
    lines: &[Line],
    mut state: State,
    (log_focal, focal_sigma): (f64, f64),
) -> Option<(State, SMatrix<f64, 5, 5>)> {
    const STEP: f64 = 1e-5;
    let mut covariance = SMatrix::zeros();
    for _ in 0..12 {
        let mut normal = SMatrix::<f64, 5, 5>::zeros();
        let mut gradient = SVector::<f64, 5>::zeros();
        let (mut squares, mut count) = (0.0, 0.0);
        let assignment = Assignment::of(lines, &state);
        for (line, along) in lines.iter().zip(&assignment.of_lines) {
            let Some((axis, misses)) = *along else {
                continue;
            };
            let weight = hit(misses).powi(2);
            let at = |state: &State| {
                let axes = DMat3::from_quat(state.rotation);
                line.misses(vanishing(axes.col(axis), state.log_focal.exp()), state.bend)
            };
            let slope = SVector::<f64, 5>::from_fn(|i, _| {
                let mut step = SVector::zeros();
                step[i] = STEP;
                (at(&state.changed(&step)) - at(&state.changed(&-step))) / (2.0 * STEP)
            });
            normal += weight * slope * slope.transpose();
            gradient += weight * misses * slope;
            squares += weight * misses * misses;
            count += weight;
        }
        for (i, value, mean, sigma) in [
            (3, state.log_focal, log_focal, focal_sigma),
            (4, state.bend, 0.0, BEND_PRIOR),
        ] {
            normal[(i, i)] += sigma.powi(-2);
            gradient[i] += (value - mean) / (sigma * sigma);
        }
        let inverse = (normal + SMatrix::identity() * 1e-9).try_inverse()?;
        let step = -(inverse * gradient);
        // Small enough to stay with the lines that were chosen.
        let step = step * (0.2 / step.norm()).min(1.0);
        state = state.changed(&step);
        // Edges come in pairs, both sides of one thing, so that half of them say nothing new.
        let excess = (squares / f64::max(count - 5.0, 1.0)).max(1.0);
        covariance = 2.0 * excess * inverse;
        if step.norm() < 1e-7 {
            break;
        }
    }
    FOCAL
        .contains(&state.log_focal.exp())
        .then_some((state, covariance))
}

fn finish(lines: &[Line], state: State, covariance: &SMatrix<f64, 5, 5>, unit_px: f64) -> Axes {
    let axes = DMat3::from_quat(state.rotation);
    let assignment = Assignment::of(lines, &state);
    let hits = assignment.of_lines.iter().flatten();
    let squares: f64 = hits.clone().map(|(_, misses)| misses * misses).sum();
    let rms = (squares / hits.count().max(1) as f64).sqrt();
    // Turning about an axis leaves it.
    let turn = covariance.fixed_view::<3, 3>(0, 0);
    let axis_sigma = [0, 1, 2].map(|i| {
        let axis = nalgebra::Vector3::from(axes.col(i).to_array());
        let about = (axis.transpose() * turn * axis)[(0, 0)];
        (0.5 * (turn.trace() - about)).max(0.0).sqrt()
    });
    Axes {
        focal_px: state.log_focal.exp() * unit_px,
        axes,
        focal_sigma: covariance[(3, 3)].sqrt(),
        axis_sigma: DVec3::from(axis_sigma),
        runs_along: (assignment.of_lines.iter())
            .map(|along| along.map(|(axis, _)| axis))
            .collect(),
        bits: assignment.bits,
        rms,
    }
}
