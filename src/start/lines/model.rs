//! Lines of a picture, a camera with axes at right angles, and by how much each line misses them.
//!
//! Lengths are in units of the picture's half diagonal about its centre, x right, y down; a direction (x, y, z) with z ahead vanishes at f (x, y) / z.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::edges::Edge;

/// Standard deviations from which on a line points elsewhere.
pub const MOST_SIGMAS: f64 = 3.0;
/// Focal lengths from 130 down to 12 degrees across the diagonal.
pub const FOCAL: std::ops::Range<f64> = 0.47..9.5;
/// Of the logarithm of the focal length, where nothing is known, about a normal lens.
pub const FOCAL_PRIOR: (f64, f64) = (1.6, 0.5);
/// Of the lens's bending: p / (1 + bend |p|^2) is where a pinhole sees p.
pub const BEND_PRIOR: f64 = 0.08;
/// Of where the lens's axis meets the picture.
pub const CENTRE_PRIOR: f64 = 0.03;
/// A third axis is one only with so many of the second one's bits: else it takes up what points there by chance.
const LEAST_THIRD: f64 = 0.4;

/// What is known of a focal length before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownFocal {
    pub focal_px: f64,
    /// Standard deviation of its logarithm.
    pub sigma: f64,
}

/// Standard deviations below which no line is taken to be: of an end across it, pixels, and of its direction, radians, as real edges are not straight.
#[derive(Clone, Copy, Debug)]
pub struct Exactness {
    pub end_px: f64,
    pub straight: f64,
}

/// A line of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub ends: [DVec2; 2],
    /// Standard deviation of its direction, radians.
    pub sigma: f64,
}

/// A camera and the axes that lines run along.
#[derive(Clone, Debug)]
pub struct State {
    pub rotation: DQuat,
    pub log_focal: f64,
    pub bend: f64,
    pub centre: DVec2,
    /// Which of the three axes is up: others are turned about it.
    pub up: usize,
    /// Angles of further pairs of axes at right angles to up and to each other, radians.
    pub turns: Vec<f64>,
}

/// Parameters besides the turns: turn, logarithm of the focal length, bend, centre.
pub const SHARED: usize = 7;

impl State {
    pub fn changed(&self, step: &[f64]) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2]));
        Self {
            rotation: (turn * self.rotation).normalize(),
            log_focal: self.log_focal + step[3],
            bend: self.bend + step[4],
            centre: self.centre + DVec2::new(step[5], step[6]),
            up: self.up,
            turns: (self.turns.iter().zip(&step[SHARED..]))
                .map(|(turn, step)| turn + step)
                .collect(),
        }
    }

    /// Three at right angles, then two for each turn.
    pub fn axes(&self) -> Vec<DVec3> {
        let axes = DMat3::from_quat(self.rotation);
        let [a, b] = [1, 2].map(|k| axes.col((self.up + k) % 3));
        let turned = self.turns.iter().flat_map(|turn| {
            let (sin, cos) = turn.sin_cos();
            [cos * a + sin * b, cos * b - sin * a]
        });
        (0..3).map(|k| axes.col(k)).chain(turned).collect()
    }

    /// Where they vanish.
    pub fn points(&self) -> Vec<DVec3> {
        let focal = self.log_focal.exp();
        let vanishing = |axis: &DVec3| DVec3::new(axis.x * focal, axis.y * focal, axis.z);
        self.axes().iter().map(vanishing).collect()
    }
}

impl Line {
    pub fn of(edge: &Edge, exactness: Exactness, centre: DVec2, unit_px: f64) -> Self {
        // Both ends are off, on either side.
        let end_sigma_px = edge.end_sigma_px.max(exactness.end_px);
        let of_ends = end_sigma_px * std::f64::consts::SQRT_2 / edge.segment.length();
        Self {
            ends: [edge.segment.from, edge.segment.to].map(|end| (end - centre) / unit_px),
            sigma: of_ends.hypot(exactness.straight),
        }
    }

    /// How far it points past where `vanishing` (x, y, w) is, in standard deviations.
    pub fn misses(&self, vanishing: DVec3, bend: f64, centre: DVec2) -> f64 {
        let [p, q] = (self.ends)
            .map(|end| end - centre)
            .map(|end| end / (1.0 + bend * end.length_squared()));
        let towards = vanishing.truncate() - 0.5 * (p + q) * vanishing.z;
        let along = q - p;
        towards.perp_dot(along) / (towards.length() * along.length()).max(1e-300) / self.sigma
    }

    /// How often a line that points anywhere hits a given point.
    pub fn chance(&self) -> f64 {
        (2.0 * MOST_SIGMAS * self.sigma / std::f64::consts::PI).min(0.5)
    }
}

/// 1 for a line that hits, 0 for one that misses by [`MOST_SIGMAS`].
pub fn hit(misses: f64) -> f64 {
    (1.0 - (misses / MOST_SIGMAS).powi(2)).max(0.0)
}

/// Which axis each line runs along and by how much it misses it, and the axes' bits beyond chance.
pub struct Assignment {
    pub of_lines: Vec<Option<(usize, f64)>>,
    pub bits: Vec<f64>,
}

impl Assignment {
    pub fn of(lines: &[Line], state: &State) -> Self {
        let points = state.points();
        let mut of_lines: Vec<Option<(usize, f64)>> = (lines.iter())
            .map(|line| {
                let misses = |point: &DVec3| line.misses(*point, state.bend, state.centre);
                let (best, misses) = (points.iter().map(misses).enumerate())
                    .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
                (misses.abs() < MOST_SIGMAS).then_some((best, misses))
            })
            .collect();
        let mut bits: Vec<f64> = (0..points.len())
            .map(|axis| {
                let own = (lines.iter().zip(&of_lines)).filter_map(|(line, along)| match along {
                    Some((along, misses)) if *along == axis => Some((hit(*misses), line.chance())),
                    _ => None,
                });
                let share = own.clone().map(|(hit, _)| hit).sum::<f64>() / lines.len() as f64;
                own.map(|(hit, chance)| hit * (share / chance).log2())
                    .sum::<f64>()
                    .max(0.0)
            })
            .collect();
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

    pub fn score(&self) -> f64 {
        self.bits.iter().sum()
    }

    /// Bits by which more lines run along axes than by chance, beyond what it takes to choose the camera and the lines.
    pub fn evidence(&self, lines: &[Line], axes: usize) -> f64 {
        // Turn and focal length, and the further turns.
        let chosen = 4.0 + (axes - 3) as f64 / 2.0;
        let hits = (lines.iter().zip(&self.of_lines)).filter(|(_, along)| along.is_some());
        let count = hits.clone().count();
        let bits: f64 = hits
            .map(|(line, _)| -(axes as f64 * line.chance()).min(1.0).log2())
            .sum();
        let ways: f64 = (0..count)
            .map(|k| ((lines.len() - k) as f64 / (k + 1) as f64).log2())
            .sum();
        bits * (1.0 - chosen / count.max(1) as f64).max(0.0) - ways
    }

    /// Root mean square of the misses, standard deviations.
    pub fn rms(&self) -> f64 {
        let hits = self.of_lines.iter().flatten();
        let squares: f64 = hits.clone().map(|(_, misses)| misses * misses).sum();
        (squares / hits.count().max(1) as f64).sqrt()
    }
}
