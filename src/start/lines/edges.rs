//! Segments made exact: points of the edge to fractions of a pixel, pieces of one edge joined, and how straight it is.

use glam::DVec2;

use super::segments::{Grey, Segment};

/// An edge, and how well it is known.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Its ends, on the arc that fits it.
    pub segment: Segment,
    /// Standard deviation of an end across the edge, pixels.
    pub end_sigma_px: f64,
}

/// How far across an edge is looked for, pixels.
const REACH: f64 = 2.0;
const STEP: f64 = 0.5;
/// Neighbours along an edge share pixels: so many of its points say one thing.
const ALIKE: f64 = 4.0;
/// Of an end, pixels: no edge is known better.
const LEAST_SIGMA_PX: f64 = 0.04;
/// Points that are further off than by so many times the middle one are none of the edge's.
const MOST_TIMES: f64 = 3.0;
/// Pieces of one edge: they lie no further off each other's line, pixels, and the gap is no longer than the shorter one by this.
const MOST_OFF_PX: f64 = 0.8;
const MOST_GAP: f64 = 2.0;
/// Gradients of two pieces agree.
const LEAST_AGREEMENT: f64 = 0.98;

/// The edges of segments of a picture, the longest first.
pub fn edges(grey: &Grey, segments: &[Segment]) -> Vec<Edge> {
    let mut joined: Vec<(Segment, DVec2)> = Vec::new();
    for segment in segments {
        let side = lighter_side(grey, *segment);
        let piece = joined.iter_mut().find(|(other, other_side)| {
            side.dot(*other_side) > LEAST_AGREEMENT && are_pieces(*other, *segment)
        });
        match piece {
            Some((other, _)) => *other = spanning(*other, *segment),
            None => joined.push((*segment, side)),
        }
    }
    let mut found: Vec<Edge> = (joined.iter())
        .filter_map(|(segment, side)| exact(grey, *segment, *side))
        .collect();
    found.sort_by(|a, b| b.segment.length().total_cmp(&a.segment.length()));
    found
}

/// Across the segment, towards where it is lighter; unit length.
fn lighter_side(grey: &Grey, segment: Segment) -> DVec2 {
    let across = (segment.to - segment.from).normalize().perp();
    let rise: f64 = (1..8)
        .map(|k| segment.from.lerp(segment.to, f64::from(k) / 8.0))
        .map(|place| grey.at(place + 1.5 * across) - grey.at(place - 1.5 * across))
        .sum();
    if rise < 0.0 { -across } else { across }
}

fn are_pieces(long: Segment, short: Segment) -> bool {
    let along = (long.to - long.from).normalize();
    let off = |p: DVec2| (p - long.from).perp_dot(along).abs();
    let ends = [short.from, short.to].map(|p| (p - long.from).dot(along));
    let (first, last) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let gap = (first - long.length()).max(-last);
    off(short.from).max(off(short.to)) < MOST_OFF_PX && gap < MOST_GAP * short.length()
}

fn spanning(a: Segment, b: Segment) -> Segment {
    let along = (a.to - a.from).normalize();
    let ends = [a.from, a.to, b.from, b.to];
    let at = |p: &DVec2| (*p - a.from).dot(along);
    let first = ends.iter().min_by(|p, q| at(p).total_cmp(&at(q)));
    let last = ends.iter().max_by(|p, q| at(p).total_cmp(&at(q)));
    match (first, last) {
        (Some(from), Some(to)) => Segment {
            from: *from,
            to: *to,
        },
        _ => a,
    }
}

/// `None`: its points lie anyhow.
fn exact(grey: &Grey, segment: Segment, side: DVec2) -> Option<Edge> {
    let length = segment.length();
    let count = (length as usize).max(8);
    let mut points: Vec<(f64, f64)> = (0..count)
        .filter_map(|k| {
            // From -1 to 1 along it, ends left out: corners are round.
            let t = 0.94 * (2.0 * (k as f64 + 0.5) / count as f64 - 1.0);
            let place = segment.from.lerp(segment.to, 0.5 * (t + 1.0));
            Some((t, crossing(grey, place, side)?))
        })
        .collect();
    // An arc about the segment: offset, slope, bend; what is far off goes.
    for _ in 0..3 {
        if points.len() < count.div_ceil(2) {
            return None;
        }
        let arc = arc(&points)?;
        let off = |(t, y): &(f64, f64)| (y - arc.0 - arc.1 * t - arc.2 * t * t).abs();
        let mut all: Vec<f64> = points.iter().map(off).collect();
        all.sort_by(f64::total_cmp);
        let most = (MOST_TIMES * all[all.len() / 2]).max(0.05);
        points.retain(|point| off(point) <= most);
    }
    let (offset, slope, bend) = arc(&points)?;
    let squares: f64 = (points.iter())
        .map(|(t, y)| (y - offset - slope * t - bend * t * t).powi(2))
        .sum();
    let n = points.len() as f64;
    let spread = (squares / (n - 3.0).max(1.0)).sqrt();
    let at = |t: f64| offset + slope * t + bend * t * t;
    Some(Edge {
        segment: Segment {
            from: segment.from + at(-1.0) * side,
            to: segment.to + at(1.0) * side,
        },
        // Of an end of a line through evenly spread points: twice that of their mean.
        end_sigma_px: (2.0 * spread * (ALIKE / n).sqrt()).max(LEAST_SIGMA_PX),
    })
}

/// Where it gets lighter most, pixels across from `place`; `None`: it does not.
fn crossing(grey: &Grey, place: DVec2, side: DVec2) -> Option<f64> {
    let half = (REACH / STEP) as i32;
    let mut before = grey.at(place - side * (REACH + 0.5 * STEP));
    let (mut sum, mut total) = (0.0, 0.0);
    for step in -half..=half {
        let across = f64::from(step) * STEP;
        let value = grey.at(place + side * (across + 0.5 * STEP));
        let rise = (value - before).max(0.0);
        before = value;
        sum += rise * rise * across;
        total += rise * rise;
    }
    (total > 1e-3).then_some(sum / total)
}

/// Least squares of offset, slope and bend.
fn arc(points: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Vector3::<f64>::zeros();
    for (t, y) in points {
        let row = nalgebra::Vector3::new(1.0, *t, t * t);
        normal += row * row.transpose();
        right += row * *y;
    }
    let solved = normal.cholesky()?.solve(&right);
    Some((solved[0], solved[1], solved[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dark half plane below y = 50 + 0.1 (x - 60), without the columns of a gap.
    fn half_plane(gap: std::ops::Range<usize>) -> Grey {
        let codes = (0..120 * 100).map(|i| {
            let (x, y) = ((i % 120) as f64 + 0.5, (i / 120) as f64 + 0.5);
            let off = (y - 50.0 - 0.1 * (x - 60.0)) / 1.01_f64.sqrt();
            match gap.contains(&(i % 120)) {
                true => 120.0,
                false => (120.0 - 80.0 * off.clamp(-1.0, 1.0)) as f32,
            }
        });
        Grey {
            width: 120,
            height: 100,
            codes: codes.collect(),
        }
    }

    fn segment(from: (f64, f64), to: (f64, f64)) -> Segment {
        Segment {
            from: DVec2::from(from),
            to: DVec2::from(to),
        }
    }

    #[test]
    fn edges_are_exact_and_pieces_of_one_are_joined() {
        let grey = half_plane(55..60);
        let pieces = [
            segment((62.0, 50.5), (112.0, 55.4)),
            segment((10.0, 45.2), (53.0, 49.1)),
        ];
        let found = edges(&grey, &pieces);
        assert_eq!(found.len(), 1);
        let Edge {
            segment: edge,
            end_sigma_px,
        } = found[0];
        for end in [edge.from, edge.to] {
            assert!((end.y - 50.0 - 0.1 * (end.x - 60.0)).abs() < 0.05, "{end}");
        }
        assert!(edge.length() > 100.0 && end_sigma_px < 0.1);
        // The pieces themselves are off by more.
        assert!((pieces[0].from.y - 50.2).abs() > 0.2);
        // What lies beside the edge's line is another one.
        let apart = [pieces[0], segment((10.0, 43.2), (53.0, 47.1))];
        assert_eq!(edges(&grey, &apart).len(), 2);
    }

    #[test]
    fn where_it_gets_no_lighter_there_is_no_edge() {
        let flat = Grey {
            codes: vec![90.0; 12000],
            ..half_plane(0..0)
        };
        let somewhere = segment((20.0, 46.0), (100.0, 54.0));
        assert!(edges(&flat, &[somewhere]).is_empty());
        assert_eq!(edges(&half_plane(0..0), &[somewhere]).len(), 1);
    }
}
