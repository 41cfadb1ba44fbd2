//! Outlines that are quadrilaterals.

use glam::DVec2;

use super::light::LightImage;
use super::line::Line;
use super::outline::{Sums, area, dark_outlines};

/// Corners, clockwise in the picture; pixels, corner origin.
pub type Quad = [DVec2; 4];

/// Half sides of the squares whose mean is the threshold: small markers between light neighbours, and large ones.
const RADII: [usize; 2] = [8, 20];
/// Square pixels.
const LEAST_AREA: f64 = 60.0;
/// Pixels that an outline's point may lie off its side; a quarter of them may lie further.
const FARTHEST_OFF: f64 = 1.6;
/// Corners of two quads that are one.
const SAME_PX: f64 = 4.0;

/// Dark quadrilaterals to about a pixel.
pub fn find_quads(image: &LightImage) -> Vec<Quad> {
    let mut quads: Vec<Quad> = Vec::new();
    let sums = Sums::of(image);
    for radius in RADII {
        for outline in dark_outlines(image, &sums, radius) {
            if let Some(quad) = quad_of(&outline)
                && !quads.iter().any(|other| is_same(other, &quad))
            {
                quads.push(quad);
            }
        }
    }
    quads
}

fn is_same(a: &Quad, b: &Quad) -> bool {
    (0..4).any(|turn| (0..4).all(|k| a[k].distance(b[(k + turn) % 4]) < SAME_PX))
}

/// The index that makes the most of `measure`.
fn farthest(points: &[DVec2], measure: impl Fn(DVec2) -> f64) -> usize {
    let ranked = points.iter().map(|p| measure(*p)).enumerate();
    ranked
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(index, _)| index)
}

fn quad_of(outline: &[DVec2]) -> Option<Quad> {
    let own_area = area(outline);
    if own_area < LEAST_AREA {
        return None;
    }
    let centre = outline.iter().sum::<DVec2>() / outline.len() as f64;
    let first = farthest(outline, |p| p.distance_squared(centre));
    let second = farthest(outline, |p| p.distance_squared(outline[first]));
    let diagonal = outline[second] - outline[first];
    let side = |p: DVec2| (p - outline[first]).perp_dot(diagonal);
    let mut corners = [
        first,
        second,
        farthest(outline, side),
        farthest(outline, |p| -side(p)),
    ];
    corners.sort_unstable();
    if corners.windows(2).any(|pair| pair[1] - pair[0] < 4) {
        return None;
    }
    let rough = corners.map(|index| outline[index]);
    if !(0.7..1.3).contains(&(area(&rough) / own_area)) {
        return None;
    }
    let mut lines = Vec::with_capacity(4);
    for k in 0..4 {
        let (from, to) = match k {
            3 => (corners[3], corners[0] + outline.len()),
            _ => (corners[k], corners[k + 1]),
        };
        let cut = ((to - from) / 8).max(1);
        let points: Vec<DVec2> = (from + cut..to - cut)
            .map(|index| outline[index % outline.len()])
            .collect();
        if points.len() < 4 {
            return None;
        }
        let line = Line::robust(&points);
        let off = points.iter().filter(|p| line.distance(**p) > FARTHEST_OFF);
        if off.count() * 4 > points.len() {
            return None;
        }
        lines.push(line);
    }
    let mut quad = [DVec2::ZERO; 4];
    for k in 0..4 {
        quad[k] = lines[(k + 3) % 4].crossing(&lines[k])?;
    }
    let share = area(&quad) / own_area;
    (is_convex(&quad) && (0.8..1.2).contains(&share)).then_some(quad)
}

/// And clockwise.
pub fn is_convex(quad: &Quad) -> bool {
    (0..4).all(|k| {
        let (a, b, c) = (quad[k], quad[(k + 1) % 4], quad[(k + 2) % 4]);
        (b - a).perp_dot(c - b) > 0.0
    })
}

/// Pixels.
pub fn shortest_side(quad: &Quad) -> f64 {
    (0..4)
        .map(|k| quad[k].distance(quad[(k + 1) % 4]))
        .fold(f64::INFINITY, f64::min)
}
