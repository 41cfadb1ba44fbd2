//! The sides of a dark quadrilateral to a few hundredths of a pixel: points where the light changes most, and lines through them.
//!
//! The points are kept: once the lens is known, lines are fitted to them in undistorted space, where sides are straight.

use glam::DVec2;

use super::lens::Lens;
use super::light::LightImage;
use super::line::Line;
use super::quad::{Quad, is_convex, shortest_side};

/// Points along the four sides, the first from corner 0 to corner 1; pixels, corner origin.
#[derive(Clone, Debug)]
pub struct Sides([Vec<DVec2>; 4]);

/// How far from the guess an edge is looked for, pixels, one round after the other.
const REACHES: [f64; 3] = [4.0, 3.0, 2.5];
/// Where along a side points are taken: corners are rounded by the blur.
const FROM: f64 = 0.08;
const TO: f64 = 0.92;
/// Of the samples across the edge, pixels.
const STEP: f64 = 0.5;
/// A corner that moves further was none.
const FARTHEST_MOVE: f64 = 6.0;

/// A side as the chord between its corners and how far its middle bends off it, outwards.
#[derive(Clone, Copy)]
struct Side {
    from: DVec2,
    to: DVec2,
    bend: f64,
}

impl Side {
    fn outwards(&self) -> DVec2 {
        // Clockwise in a picture whose y points down: the outside is to the left.
        let along = (self.to - self.from).normalize();
        DVec2::new(along.y, -along.x)
    }

    fn at(&self, t: f64) -> DVec2 {
        self.from.lerp(self.to, t) + self.outwards() * (self.bend * 4.0 * t * (1.0 - t))
    }
}

/// Rounds of looking closer, at most three.
pub fn refine(image: &LightImage, rough: &Quad, rounds: usize) -> Option<(Quad, Sides)> {
    let mut quad = *rough;
    let mut bends = [0.0; 4];
    let mut sides = None;
    for reach in REACHES.into_iter().take(rounds) {
        let reach = reach.min(0.11 * shortest_side(&quad)).max(1.5);
        let mut points: [Vec<DVec2>; 4] = Default::default();
        for k in 0..4 {
            let side = Side {
                from: quad[k],
                to: quad[(k + 1) % 4],
                bend: bends[k],
            };
            points[k] = edge_points(image, &side, reach);
            if points[k].len() < 6 {
                return None;
            }
        }
        let refined = corners(&points.each_ref().map(|p| Line::robust(p)))?;
        let moved = (0..4).any(|k| refined[k].distance(quad[k]) > FARTHEST_MOVE);
        if moved || !is_convex(&refined) {
            return None;
        }
        quad = refined;
        for k in 0..4 {
            bends[k] = bend(&points[k], quad[k], quad[(k + 1) % 4]);
        }
        sides = Some(Sides(points));
    }
    sides.map(|sides| (quad, sides))
}

/// Across the side at even distances: the mean place of what gets lighter outwards, weighted by the square of how much.
fn edge_points(image: &LightImage, side: &Side, reach: f64) -> Vec<DVec2> {
    let outwards = side.outwards();
    let count = (side.from.distance(side.to) as usize).clamp(12, 160);
    let half = (reach / STEP).round() as i32;
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let t = FROM + (TO - FROM) * (index as f64 + 0.5) / count as f64;
        let centre = side.at(t);
        let sample = |steps: f64| image.at(centre + outwards * (steps * STEP));
        let mut before = sample(-f64::from(half) - 0.5);
        let (mut sum, mut total) = (0.0, 0.0);
        for step in -half..=half {
            let value = sample(f64::from(step) + 0.5);
            let rise = f64::from(value - before).max(0.0);
            before = value;
            sum += rise * rise * f64::from(step) * STEP;
            total += rise * rise;
        }
        if total > 1e-6 {
            points.push(centre + outwards * (sum / total));
        }
    }
    points
}

/// How far the middle of the points bends off the chord, outwards, by least squares.
fn bend(points: &[DVec2], from: DVec2, to: DVec2) -> f64 {
    let chord = to - from;
    let outwards = DVec2::new(chord.y, -chord.x) / chord.length();
    // Even terms only: an offset and the bend about it; the line took care of the slope.
    let (mut n, mut s, mut ss, mut o, mut so) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for p in points {
        let t = (*p - from).dot(chord) / chord.length_squared();
        let shape = 4.0 * t * (1.0 - t);
        let off = (*p - from).dot(outwards);
        n += 1.0;
        s += shape;
        ss += shape * shape;
        o += off;
        so += shape * off;
    }
    let determinant = n * ss - s * s;
    match determinant > 1e-9 {
        true => (n * so - s * o) / determinant,
        false => 0.0,
    }
}

fn corners(lines: &[Line; 4]) -> Option<Quad> {
    let mut quad = [DVec2::ZERO; 4];
    for k in 0..4 {
        quad[k] = lines[(k + 3) % 4].crossing(&lines[k])?;
    }
    Some(quad)
}

impl Sides {
    /// The same sides, counted from another corner.
    pub fn turned(mut self, turn: usize) -> Self {
        self.0.rotate_left(turn % 4);
        self
    }

    /// Each point moved; `to` hears of its side, from 0.
    pub fn moved(&self, to: impl Fn(usize, DVec2) -> DVec2) -> Self {
        let mut sides = self.0.clone();
        for (side, points) in sides.iter_mut().enumerate() {
            points
                .iter_mut()
                .for_each(|point| *point = to(side, *point));
        }
        Self(sides)
    }

    /// Corners of the lines that are straight without the lens, as pixels of the photograph.
    pub fn corners(&self, lens: &Lens) -> Option<Quad> {
        let mut lines = Vec::with_capacity(4);
        for points in &self.0 {
            let mut near = lens.ideal_of(*points.first()?)?;
            let mut ideal = Vec::with_capacity(points.len());
            for p in points {
                near = lens.ideal_near(*p, near);
                ideal.push(near);
            }
            lines.push(Line::robust(&ideal));
        }
        let quad = corners(lines.as_slice().try_into().ok()?)?;
        Some(quad.map(|corner| lens.pixel_of(corner)))
    }
}
