//! Saddles put in rows and columns.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::PI;

use glam::DVec2;

use super::saddle::{Saddle, wrapped};

/// Saddles by column and row, from any first one.
pub type Lattice = BTreeMap<(i32, i32), usize>;

/// How far a neighbour may lie off the direction of an edge, radians.
const MOST_OFF: f64 = 0.3;
/// How much edges turn from one corner to the next, radians.
const MOST_TURN: f64 = 0.4;
const WAYS: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Lattices of two by two or more, the largest first; no saddle is in two.
pub fn find_lattices(saddles: &[Saddle]) -> Vec<Lattice> {
    let mut taken = vec![false; saddles.len()];
    let mut lattices = Vec::new();
    for start in 0..saddles.len() {
        if taken[start] {
            continue;
        }
        let lattice = grow(saddles, start, &taken);
        for index in lattice.values() {
            taken[*index] = true;
        }
        if lattice.len() >= 4 {
            lattices.push(lattice);
        }
    }
    lattices.sort_by_key(|lattice| std::cmp::Reverse(lattice.len()));
    lattices
}

fn grow(saddles: &[Saddle], start: usize, taken: &[bool]) -> Lattice {
    let mut lattice = Lattice::from([((0, 0), start)]);
    let mut queue = VecDeque::from([((0, 0), saddles[start].edges)]);
    while let Some(((column, row), edges)) = queue.pop_front() {
        let own = lattice[&(column, row)];
        for (k, (dx, dy)) in WAYS.into_iter().enumerate() {
            let at = (column + dx, row + dy);
            if lattice.contains_key(&at) {
                continue;
            }
            let angle = edges[k % 2] + if k >= 2 { PI } else { 0.0 };
            // The square on the other side tells how far to go.
            let before = lattice.get(&(column - dx, row - dy));
            let pitch = before.map(|other| saddles[*other].place.distance(saddles[own].place));
            let next = neighbour(saddles, own, angle, pitch);
            let Some(next) = next.filter(|n| !taken[*n] && !lattice.values().any(|used| used == n))
            else {
                continue;
            };
            let Some(own_edges) = aligned(saddles[next].edges, edges) else {
                continue;
            };
            lattice.insert(at, next);
            queue.push_back((at, own_edges));
        }
    }
    lattice
}

/// The nearest saddle in a direction.
fn neighbour(saddles: &[Saddle], own: usize, angle: f64, pitch: Option<f64>) -> Option<usize> {
    let from = saddles[own].place;
    let mut nearest = f64::INFINITY;
    let mut best: Option<(f64, usize)> = None;
    for (index, saddle) in saddles
        .iter()
        .enumerate()
        .filter(|(index, _)| *index != own)
    {
        let way = saddle.place - from;
        let distance = way.length();
        nearest = nearest.min(distance);
        let off = wrapped(way.to_angle() - angle).abs();
        let is_near = pitch.is_none_or(|pitch| (0.6..1.5).contains(&(distance / pitch)));
        let cost = distance * (1.0 + 8.0 * off * off);
        if off < MOST_OFF && is_near && best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, index));
        }
    }
    let (cost, index) = best?;
    (pitch.is_some() || cost < 3.5 * nearest).then_some(index)
}

/// A neighbour's edges in the order and the sense of ours; `None`: they run elsewhere.
fn aligned(edges: [f64; 2], like: [f64; 2]) -> Option<[f64; 2]> {
    let off = |edge: f64, like: f64| {
        let turned = wrapped(edge - like);
        match turned.abs() > 0.5 * PI {
            true => (wrapped(turned + PI).abs(), edge + PI),
            false => (turned.abs(), edge),
        }
    };
    let straight = [off(edges[0], like[0]), off(edges[1], like[1])];
    let crossed = [off(edges[1], like[0]), off(edges[0], like[1])];
    let best = match straight[0].0 + straight[1].0 <= crossed[0].0 + crossed[1].0 {
        true => straight,
        false => crossed,
    };
    let is_alike = best.iter().all(|(off, _)| *off < MOST_TURN);
    is_alike.then_some(best.map(|(_, edge)| edge))
}

/// Columns and rows that it spans, and its first ones.
pub fn span(lattice: &Lattice) -> ((i32, i32), (usize, usize)) {
    let columns = lattice.keys().map(|(column, _)| *column);
    let rows = lattice.keys().map(|(_, row)| *row);
    let first = (
        columns.clone().min().unwrap_or(0),
        rows.clone().min().unwrap_or(0),
    );
    let last = (columns.max().unwrap_or(0), rows.max().unwrap_or(0));
    let size = (
        (last.0 - first.0 + 1) as usize,
        (last.1 - first.1 + 1) as usize,
    );
    (first, size)
}

/// It is seen from its front: columns and rows turn clockwise in the picture.
pub fn is_front(lattice: &Lattice, saddles: &[Saddle]) -> bool {
    let place = |at: (i32, i32)| lattice.get(&at).map(|index| saddles[*index].place);
    let turns = lattice.keys().filter_map(|(column, row)| {
        let own = place((*column, *row))?;
        let right: DVec2 = place((column + 1, *row))? - own;
        let down: DVec2 = place((*column, row + 1))? - own;
        Some(right.perp_dot(down).signum())
    });
    turns.sum::<f64>() > 0.0
}
