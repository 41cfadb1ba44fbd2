//! From a photograph's edges to the point spread of its camera.

use super::PointSpread;
use super::edges::{BINS, Edge, FINE, crossing, edges_of};
use super::model::Sharpened;

/// Fewer edges tell nothing.
const FEWEST: usize = 12;
/// As many edges have to be surely (two standard deviations) as sharp as what counts as in focus: what is sharpest by chance is not.
const SUREST: usize = 5;
/// How much softer than those an edge in focus may be.
const IN_FOCUS: f64 = 1.2;
/// Sharpening shows nearer to an edge than this, pixels: farther away it is texture and noise.
const OVERSHOOT_PX: usize = 4;
/// Fewer edges in one half of the picture do not tell the centre from the corners.
const FEWEST_OF_HALF: usize = 40;
/// Fewer edges in focus do not tell lateral colour.
const FEWEST_OF_LATERAL: usize = 40;
/// How much softer the outer half has to be.
const SOFTER: f64 = 1.1;
/// Smallest shift of a channel in the corner that is told, pixels, and in its standard errors.
const LEAST_SHIFT_PX: f64 = 0.05;
const LEAST_ERRORS: f64 = 6.0;

/// What a photograph's edges show.
#[derive(Clone, Debug)]
pub struct Measured {
    pub spread: PointSpread,
    /// Edges that were found, and those of them that were in focus.
    pub edges: usize,
    pub in_focus: usize,
    /// From 10% to 90% of a step of green, pixels: of the edges in focus, and of the point spread.
    pub edge_spread_px: f64,
    pub fitted_spread_px: f64,
    /// How far the edges in focus go beyond 0 and 1 at most, mean of both sides at one distance; and of the point spread. What one side has alone is no
    /// filter's in linear light.
    pub overshoot: f64,
    pub fitted_overshoot: f64,
}

/// Why a photograph shows no sharpness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoEdges {
    #[error(
        "the photograph has {0} straight, isolated edges, and {FEWEST} are needed; give numbers, such as sigma_px = 0.8"
    )]
    TooFew(usize),
    #[error("there is no photograph to measure; give numbers, such as sigma_px = 0.8")]
    Unphotographed,
}

/// Measures the linear photograph's sharpness, row-major from the top left.
///
/// # Errors
/// Too few of its edges can be measured.
pub fn measure(linear: &[[f32; 3]], size: (u32, u32)) -> Result<Measured, NoEdges> {
    let mut edges = edges_of(linear, size);
    if edges.len() < FEWEST {
        return Err(NoEdges::TooFew(edges.len()));
    }
    edges.sort_by(|a, b| a.spread_px.total_cmp(&b.spread_px));
    let focused = in_focus(&edges);
    let profiles = [0, 1, 2].map(|c| mean_profile(focused, c));
    let green = Sharpened::fit(&profiles[1]);
    let of_channels = profiles.map(|profile| green.refit(&profile).sigma_px);
    let (centre, corner) = across_frame(&edges, size, green);
    let spread = PointSpread {
        sigma_px: of_channels.map(|sigma| (sigma * centre) as f32),
        corner_sigma_px: of_channels
            .map(|sigma| ((sigma * corner) as f32).min(PointSpread::MAX_PX)),
        sharpening: green.sharpening as f32,
        sharpening_radius_px: green.radius_px as f32,
        lateral_px: [0, 2].map(|c| lateral(focused, size, c)),
    };
    let fitted = green.profile();
    Ok(Measured {
        spread,
        edges: edges.len(),
        in_focus: focused.len(),
        edge_spread_px: edge_spread(&profiles[1]),
        fitted_spread_px: edge_spread(&fitted),
        overshoot: overshoot(&profiles[1]),
        fitted_overshoot: overshoot(&fitted),
    })
}

/// Those of the sorted `edges` that are in focus: softer ones are out of focus, or round.
fn in_focus(edges: &[Edge]) -> &[Edge] {
    let mut bounds: Vec<f64> = (edges.iter())
        .map(|edge| edge.spread_px + 2.0 * edge.spread_error_px)
        .collect();
    bounds.sort_by(f64::total_cmp);
    let Some(sharp) = bounds.get(SUREST - 1) else {
        return &[];
    };
    let count = edges.partition_point(|edge| edge.spread_px <= IN_FOCUS * sharp);
    &edges[..count]
}

fn mean_profile(edges: &[Edge], channel: usize) -> [f64; BINS] {
    std::array::from_fn(|bin| {
        let values = edges.iter().map(|edge| edge.profiles[channel][bin]);
        values.sum::<f64>() / edges.len() as f64
    })
}

/// From 10% to 90%, pixels.
fn edge_spread(profile: &[f64; BINS]) -> f64 {
    let at = |level| crossing(profile, level).unwrap_or(f64::NAN);
    at(0.9) - at(0.1)
}

fn overshoot(profile: &[f64; BINS]) -> f64 {
    let middle = BINS / 2;
    let beyond = |out: usize| 0.5 * (profile[middle + out] - 1.0 - profile[middle - 1 - out]);
    (0..OVERSHOOT_PX * FINE as usize)
        .map(beyond)
        .fold(0.0, f64::max)
}

/// Half a diagonal from the centre is 1.
fn from_centre(edge: &Edge, (width, height): (u32, u32)) -> [f64; 2] {
    let (w, h) = (f64::from(width), f64::from(height));
    let half_diagonal = 0.5 * w.hypot(h);
    [
        (edge.centre_px[0] - 0.5 * w) / half_diagonal,
        (edge.centre_px[1] - 0.5 * h) / half_diagonal,
    ]
}

/// Factors on the deviation in the centre and in the corners, from the inner and the outer half of the edges; 1 where they tell no difference.
fn across_frame(edges: &[Edge], size: (u32, u32), green: Sharpened) -> (f64, f64) {
    let distance2 = |edge: &Edge| {
        let [x, y] = from_centre(edge, size);
        x * x + y * y
    };
    let mut all: Vec<f64> = edges.iter().map(distance2).collect();
    all.sort_by(f64::total_cmp);
    let border = all[all.len() / 2];
    let half = |is_outer: bool| {
        let edges: Vec<Edge> = (edges.iter())
            .filter(|edge| (distance2(edge) > border) == is_outer)
            .cloned()
            .collect();
        let focused = in_focus(&edges);
        let count = focused.len();
        let mean = focused.iter().map(distance2).sum::<f64>() / count.max(1) as f64;
        (count >= FEWEST_OF_HALF).then(|| {
            let sigma = green.refit(&mean_profile(focused, 1)).sigma_px;
            (mean, sigma)
        })
    };
    let (Some((near, inner)), Some((far, outer))) = (half(false), half(true)) else {
        return (1.0, 1.0);
    };
    if outer < SOFTER * inner || far < near + 0.1 {
        return (1.0, 1.0);
    }
    let slope = (outer * outer - inner * inner) / (far - near);
    let centre = (inner * inner - slope * near).max(0.0).sqrt();
    let corner = (inner * inner + slope * (1.0 - near)).sqrt();
    let whole = green.sigma_px.max(1e-3);
    (centre / whole, corner / whole)
}

/// How far out the channel lies in the corners, pixels; 0 where that is not certain.
fn lateral(edges: &[Edge], size: (u32, u32), channel: usize) -> f32 {
    let points: Vec<(f64, f64)> = edges
        .iter()
        .map(|edge| {
            let [x, y] = from_centre(edge, size);
            let along = x * edge.normal[0] + y * edge.normal[1];
            (along, edge.shift_px[channel])
        })
        .collect();
    let squares: f64 = points.iter().map(|(along, _)| along * along).sum();
    let shift = points
        .iter()
        .map(|(along, shift)| along * shift)
        .sum::<f64>()
        / squares;
    let rest = points.iter().map(|(along, s)| (s - shift * along).powi(2));
    let error = (rest.sum::<f64>() / points.len() as f64 / squares).sqrt();
    let is_known = points.len() >= FEWEST_OF_LATERAL;
    if !is_known || shift.abs() < LEAST_SHIFT_PX || shift.abs() < LEAST_ERRORS * error {
        return 0.0;
    }
    shift.clamp(-4.0, 4.0) as f32
}
