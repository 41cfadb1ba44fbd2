//! Learns what all frames share, lens and board, from some of them.

use glam::{DVec2, DVec3};

use super::board::{Board, Flatness};
use super::bundle::{Prior, Problem, Solution, View};
use super::frame_pose::{Observation, find_pose};
use super::homography;
use super::lens::{LENS_PARAMETERS, Lens};

/// What one frame shows of the board.
#[derive(Clone, Debug, Default)]
pub struct Sighting {
    pub observations: Vec<Observation>,
    /// Ranges of them that lie in planes of their own: each marker.
    pub groups: Vec<std::ops::Range<usize>>,
}

/// What is given of the lens.
#[derive(Clone, Copy, Debug)]
pub enum LensKnowledge {
    /// Nothing but the size of the frames.
    Unknown { width: usize, height: usize },
    /// A calibration to begin with.
    Start(Lens),
    /// A calibration that holds.
    Fixed(Lens),
}

/// Standard deviation of the focal length, as a share of it, from which frames do not determine it.
pub const MOST_FOCAL_SIGMA: f64 = 0.03;
/// Points that a frame needs to be learnt from.
const LEAST_POINTS: usize = 4;
/// First guess of a corner's error, pixels.
const FIRST_NOISE_PX: f64 = 1.0;

/// Lens, board and poses that fit the frames best; `None`: they determine none.
pub fn learn(
    sightings: &[&Sighting],
    board: &Board,
    flatness: Flatness,
    knowledge: LensKnowledge,
) -> Option<Solution> {
    let start = match knowledge {
        LensKnowledge::Start(lens) | LensKnowledge::Fixed(lens) => lens,
        LensKnowledge::Unknown { width, height } => {
            let guess = focal_of_planes(sightings, &board.points, width, height);
            Lens::ideal(width, height, guess.unwrap_or(1.1 * width as f64))
        }
    };
    let views = posed(sightings, &board.points, &start, FIRST_NOISE_PX);
    if views.is_empty() {
        return None;
    }
    let lens_priors = lens_priors(&start, matches!(knowledge, LensKnowledge::Start(_)));
    let none = [false; LENS_PARAMETERS];
    let rigid = |views, lens, free_lens, noise_px| Problem {
        views,
        lens,
        free_lens,
        points: board.points.clone(),
        free_points: false,
        priors: &lens_priors,
        noise_px,
    };
    let is_fixed = matches!(knowledge, LensKnowledge::Fixed(_));
    // Focal length and the first coefficient come first: the others follow only where poses are about right.
    let few = [true, true, false, false, true, false, false, false];
    let first = rigid(
        views,
        start,
        if is_fixed { none } else { few },
        FIRST_NOISE_PX,
    )
    .solve()?;
    let free_lens = [!is_fixed; LENS_PARAMETERS];
    let views = posed(sightings, &board.points, &first.lens, first.noise_px);
    let nominal = rigid(views, first.lens, free_lens, first.noise_px).solve()?;
    if flatness.is_rigid() {
        return Some(nominal);
    }
    let mut priors = lens_priors.clone();
    priors.extend(board.priors(flatness));
    let free = Problem {
        views: nominal.views,
        lens: nominal.lens,
        free_lens,
        points: board.points.clone(),
        free_points: true,
        priors: &priors,
        noise_px: nominal.noise_px,
    };
    free.solve()
}

/// Continues from a solution, with corners that are better known since.
pub fn learn_on(
    before: &Solution,
    sightings: &[&Sighting],
    board: &Board,
    flatness: Flatness,
    is_lens_fixed: bool,
) -> Option<Solution> {
    let views = posed(sightings, &before.points, &before.lens, before.noise_px);
    let mut priors = lens_priors(&before.lens, false);
    if !flatness.is_rigid() {
        priors.extend(board.priors(flatness));
    }
    let problem = Problem {
        views,
        lens: before.lens,
        free_lens: [!is_lens_fixed; LENS_PARAMETERS],
        points: before.points.clone(),
        free_points: !flatness.is_rigid(),
        priors: &priors,
        noise_px: before.noise_px,
    };
    problem.solve()
}

fn posed(sightings: &[&Sighting], points: &[DVec3], lens: &Lens, noise_px: f64) -> Vec<View> {
    let each = sightings
        .iter()
        .filter(|s| s.observations.len() >= LEAST_POINTS);
    let views = each.filter_map(|s| {
        let minima = find_pose(lens, points, &s.observations, &s.groups, noise_px)?;
        Some(View {
            pose: minima.best.pose,
            observations: s.observations.clone(),
        })
    });
    views.collect()
}

/// How lenses are, weakly: pixels are square to a percent, the axis meets the picture within a tenth of its width off the middle, and distortion is moderate.
/// Of a calibration to begin with: that it is about right.
fn lens_priors(lens: &Lens, is_known: bool) -> Vec<Prior> {
    let [fx, _, cx, cy, k @ ..] = lens.parameters();
    let of = |index: usize, target: f64, sigma: f64| Prior::Sum {
        terms: vec![(index, 1.0)],
        target,
        sigma,
    };
    let square_pixels = Prior::Sum {
        terms: vec![(0, 1.0), (1, -1.0)],
        target: lens.focal.x - lens.focal.y,
        sigma: 0.01 * fx,
    };
    let width = 2.0 * lens.centre.x;
    let share = if is_known { 0.2 } else { 1.0 };
    let mut priors = vec![
        square_pixels,
        of(2, cx, 0.1 * width * share),
        of(3, cy, 0.1 * width * share),
    ];
    let sigmas = [0.5, 1.0, 0.005, 0.005];
    let coefficients = (4..).zip(k).zip(sigmas);
    priors.extend(coefficients.map(|((index, value), sigma)| {
        let target = if is_known { value } else { 0.0 };
        of(index, target, sigma * share)
    }));
    if is_known {
        priors.push(of(0, fx, 0.1 * fx));
    }
    priors
}

/// Zhang's constraints of planes on the focal length, pixels square and the axis in the middle; pixels.
fn focal_of_planes(
    sightings: &[&Sighting],
    points: &[DVec3],
    width: usize,
    height: usize,
) -> Option<f64> {
    let scale = width as f64;
    let middle = 0.5 * DVec2::new(width as f64, height as f64);
    let (mut of_squares, mut of_products) = (0.0, 0.0);
    let mut add = |observations: &[Observation]| {
        let Some(origin) = observations.first().map(|o| points[o.point]) else {
            return;
        };
        let off = |o: &Observation| points[o.point] - origin;
        let Some(far) = observations
            .iter()
            .map(off)
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
        else {
            return;
        };
        let x = far.normalize_or_zero();
        let across = |o: &Observation| off(o) - off(o).dot(x) * x;
        let Some(y) = observations
            .iter()
            .map(across)
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
        else {
            return;
        };
        let (y, size) = (y.normalize_or_zero(), far.length());
        let normal = x.cross(y);
        let is_flat = observations
            .iter()
            .all(|o| off(o).dot(normal).abs() < 0.05 * size);
        if !is_flat || y == DVec3::ZERO {
            return;
        }
        let pairs: Vec<_> = observations
            .iter()
            .map(|o| {
                let on_plane = DVec2::new(off(o).dot(x), off(o).dot(y)) / size;
                (on_plane, (o.pixel - middle) / scale)
            })
            .collect();
        let Some(map) = homography::of_pairs(&pairs) else {
            return;
        };
        let (a, b) = (map.x_axis, map.y_axis);
        let length = (a.x * a.x + a.y * a.y + b.x * b.x + b.y * b.y).sqrt();
        let (a, b) = (a / length, b / length);
        // (a.xy . b.xy) / f^2 + a.z b.z = 0, and equal lengths.
        let constraints = [
            (a.x * b.x + a.y * b.y, a.z * b.z),
            (
                a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y,
                a.z * a.z - b.z * b.z,
            ),
        ];
        for (plane, depth) in constraints {
            of_squares += plane * plane;
            of_products -= plane * depth;
        }
    };
    for sighting in sightings {
        // Whole boards where they are flat, else each marker.
        add(&sighting.observations);
        for group in &sighting.groups {
            add(&sighting.observations[group.clone()]);
        }
    }
    let focal = scale * (of_squares / of_products).sqrt();
    (focal.is_finite() && (0.2..20.0).contains(&(focal / scale))).then_some(focal)
}

/// From single squares, where nothing else is known yet.
pub fn lens_of_squares(frames: &[&super::layout::Corners], width: usize, height: usize) -> Lens {
    let points = super::board::square(DVec2::splat(-0.5), 1.0, 0);
    let sightings: Vec<Sighting> = frames
        .iter()
        .flat_map(|corners| corners.iter())
        .map(|(_, quad)| Sighting {
            observations: (0..4)
                .map(|point| Observation {
                    point,
                    pixel: quad[point],
                })
                .collect(),
            groups: Vec::new(),
        })
        .collect();
    let all: Vec<&Sighting> = sightings.iter().collect();
    let guess = focal_of_planes(&all, &points, width, height);
    Lens::ideal(width, height, guess.unwrap_or(1.1 * width as f64))
}
