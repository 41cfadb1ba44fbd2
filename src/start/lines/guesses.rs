//! First guesses of a camera that sees squares in a plane: planes and focal lengths are tried, and the squares flattened in each.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::squares::Patch;

/// Corners that are no further off, of a square's side, belong to a guess.
const ROUGH: f64 = 0.2;
/// Tilts and directions of the plane that are tried.
const TILTS_DEG: [f64; 5] = [3.0, 20.0, 35.0, 50.0, 65.0];
const AZIMUTHS: usize = 16;
/// Guesses that are worth to be refined.
const FINALISTS: usize = 8;

/// A plane and a focal length to begin with.
pub struct Guess {
    pub focal: f64,
    pub rotation: DQuat,
    /// What the plane's origin is seen along, at depth 1.
    pub ahead: DVec3,
    pub side: f64,
    pub places: Vec<DVec2>,
    pub turns: Vec<usize>,
    pub patches: Vec<Patch>,
}

/// By quarter turns.
pub fn turned(p: DVec2, quarter: usize) -> DVec2 {
    match quarter % 4 {
        0 => p,
        1 => p.perp(),
        2 => -p,
        _ => -p.perp(),
    }
}

/// Complex numbers: DVec2 as x + i y.
fn times(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

fn conjugate(a: DVec2) -> DVec2 {
    DVec2::new(a.x, -a.y)
}

/// A patch in a plane, flattened: its middle, its side as a complex number, and how far the rest is off, of the side.
struct Flat {
    middle: DVec2,
    side: DVec2,
    off: f64,
}

fn flatten(patch: &Patch, axes: &DMat3, ahead: DVec3, focal: f64) -> Option<Flat> {
    let normal = axes.col(2);
    let count = patch.points.len() as f64;
    let mut places = Vec::with_capacity(patch.points.len());
    for (_, pixel) in &patch.points {
        let ray = pixel.extend(focal);
        let depth = normal.dot(ahead) / normal.dot(ray);
        // Beyond the plane's horizon.
        if !(depth > 0.0) {
            return None;
        }
        let at = ray * depth - ahead;
        places.push(DVec2::new(at.dot(axes.col(0)), at.dot(axes.col(1))));
    }
    let centre: DVec2 = places.iter().sum::<DVec2>() / count;
    let grid_centre: DVec2 = patch.points.iter().map(|p| p.0).sum::<DVec2>() / count;
    let (mut sum, mut squares) = (DVec2::ZERO, 0.0);
    for ((grid, _), place) in patch.points.iter().zip(&places) {
        let g = *grid - grid_centre;
        sum += times(*place - centre, conjugate(g));
        squares += g.length_squared();
    }
    let side = sum / squares;
    let off: f64 = (patch.points.iter().zip(&places))
        .map(|((grid, _), place)| {
            (*place - centre - times(side, *grid - grid_centre)).length_squared()
        })
        .sum();
    Some(Flat {
        middle: centre - times(side, grid_centre),
        side,
        off: (off / count).sqrt() / side.length(),
    })
}

/// Turns the axis to z by the shortest way.
fn facing(normal: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, normal))
}

/// First guesses with as many patches as agree in the size and turn of their sides, the best first.
pub fn guesses(patches: &[Patch], focals: &[f64]) -> Vec<Guess> {
    let mut found: Vec<(f64, Guess)> = Vec::new();
    let middle =
        |patch: &Patch| patch.points.iter().map(|p| p.1).sum::<DVec2>() / patch.points.len() as f64;
    let all: DVec2 = patches.iter().map(middle).sum::<DVec2>() / patches.len() as f64;
    for focal in focals {
        let ahead = (all / *focal).extend(1.0);
        let view = facing(ahead.normalize());
        for tilt in TILTS_DEG {
            for k in 0..AZIMUTHS {
                let azimuth = std::f64::consts::TAU * k as f64 / AZIMUTHS as f64;
                let (sin, cos) = tilt.to_radians().sin_cos();
                let normal = view * DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
                let axes = facing(normal);
                let flats: Vec<Option<Flat>> = (patches.iter())
                    .map(|patch| {
                        flatten(patch, &axes, ahead, *focal).filter(|flat| flat.off < ROUGH)
                    })
                    .collect();
                found.extend(agreeing(patches, &flats, &axes, ahead, *focal));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found
        .into_iter()
        .map(|(_, guess)| guess)
        .take(FINALISTS)
        .collect()
}

fn agreeing(
    patches: &[Patch],
    flats: &[Option<Flat>],
    axes: &DMat3,
    ahead: DVec3,
    focal: f64,
) -> Option<(f64, Guess)> {
    let quarter = |side: DVec2, like: DVec2| -> (usize, f64) {
        (0..4)
            .map(|turn| (turn, (side - turned(like, turn)).length() / like.length()))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, f64::INFINITY))
    };
    let mut best: Option<(f64, DVec2)> = None;
    for reference in flats.iter().flatten() {
        let score: f64 = (flats.iter().flatten())
            .map(|flat| {
                let apart = quarter(flat.side, reference.side).1.hypot(flat.off);
                (1.0 - (apart / ROUGH).powi(2)).max(0.0)
            })
            .sum();
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, reference.side));
        }
    }
    let (score, like) = best?;
    let own: Vec<(usize, &Flat, usize)> = (flats.iter().enumerate())
        .filter_map(|(index, flat)| {
            let flat = flat.as_ref()?;
            let (turn, apart) = quarter(flat.side, like);
            (apart.hypot(flat.off) < ROUGH).then_some((index, flat, turn))
        })
        .collect();
    let along = DMat3::from_rotation_z(like.to_angle());
    let back = DVec2::from_angle(-like.to_angle());
    Some((
        score,
        Guess {
            focal,
            rotation: DQuat::from_mat3(&(*axes * along)),
            ahead,
            side: like.length(),
            places: own
                .iter()
                .map(|(_, flat, _)| times(flat.middle, back))
                .collect(),
            turns: own.iter().map(|(_, _, turn)| *turn).collect(),
            patches: own
                .iter()
                .map(|(index, _, _)| patches[*index].clone())
                .collect(),
        },
    ))
}
