//! Learns from photons by which points of smooth virtual surfaces light comes to a place.

use std::collections::BTreeMap;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::path::{Landing, PhotonNumber, first_landing};
use crate::light::guide::{GUIDE_LOBES, guide_cell, guide_place};
use crate::packed::{PackedScene, Taught};

/// Photons, as a share of the samples of the whole picture, and within these bounds. That share where few rays a pixel are to come soon, and up to
/// `MOST_MORE` times as much where there are more than `MANY_RAYS`.
const PHOTONS_OF_SAMPLES: f64 = 1.0 / 64.0;
const MANY_RAYS: f64 = 8.0;
const MOST_MORE: f64 = 4.0;
const FEWEST: u32 = 1 << 12;
const MOST: u32 = 1 << 18;
/// Side of the narrowest cells in mean radii of the spheres that photons are sent to.
const CELL_OF_RADIUS: f32 = 0.5;
/// Landings of a cell that are looked at.
const LANDINGS: usize = 128;
/// Half-angles of lobes, radians: the narrowest and the widest.
const NARROWEST: f32 = 0.03;
const WIDEST: f32 = 0.6;
/// That of a lobe of one landing, in those at which lights show, and at the most.
const LONE_OF_LIGHT: f32 = 3.0;
const LONE_WIDEST: f32 = 0.3;
/// A lobe reaches this much further than the landings that it was made for.
const WIDENING: f32 = 1.25;
const MOST_CELLS: usize = 1 << 15;
/// How often targets and what belongs to them are found from each other.
const REFINEMENTS: usize = 2;
/// Keeps a target by the surface where nearly parallel rays leave its distance open.
const FIRMNESS: f32 = 1e-4;

/// Fills the scene's guide. Its photons are those of the frame's seed. They are traced once as long as no more than the camera changes: where they
/// land does not depend on it.
pub fn learn(scene: &mut PackedScene) {
    let rays = f64::from(scene.frame.rays_total);
    let share = PHOTONS_OF_SAMPLES * (rays / MANY_RAYS).clamp(1.0, MOST_MORE);
    let samples = rays * scene.pixels.len() as f64;
    let count = (samples * share).clamp(f64::from(FEWEST), f64::from(MOST)) as u32;
    let frame = &scene.frame;
    let photons = [count, frame.seed, frame.flags, frame.max_bounces];
    let known = (scene.taught.take()).filter(|known| known.photons == photons);
    if let Some(known) = &known {
        scene.guide.clone_from(&known.guide);
        scene.frame.guide_cell_count = known.guide_cell_count;
        scene.frame.guide_cells_per_m = known.guide_cells_per_m;
    } else {
        learn_from(scene, count);
    }
    let found = || Taught {
        photons,
        guide: scene.guide.clone(),
        guide_cell_count: scene.frame.guide_cell_count,
        guide_cells_per_m: scene.frame.guide_cells_per_m,
    };
    scene.taught = Some(known.unwrap_or_else(found));
}

fn learn_from(scene: &mut PackedScene, photons: u32) {
    let frame = &mut scene.frame;
    let spheres = &frame.photon_spheres[..frame.photon_sphere_count as usize];
    let radius = spheres.iter().map(|s| s[3]).sum::<f32>() / spheres.len().max(1) as f32;
    if !(radius > 0.0) {
        return;
    }
    frame.guide_cells_per_m = 1.0 / (CELL_OF_RADIUS * radius);
    let landings: Vec<Landing> = (0..photons)
        .into_par_iter()
        .filter_map(|place| {
            let number = PhotonNumber {
                sequence: 0,
                place,
                window: [0.0, 1.0],
            };
            first_landing(scene, number)
        })
        .collect();
    let mut cells: BTreeMap<[u32; 4], Vec<Landing>> = BTreeMap::new();
    for landing in landings {
        let place = guide_place(scene, landing.position);
        let found = cells.entry(place).or_default();
        if found.len() < LANDINGS {
            found.push(landing);
        }
    }
    let mut cells: Vec<Vec<Landing>> = cells.into_values().collect();
    // Of cells with the same hash the one stays that more light reaches.
    cells.sort_by_key(|landings| std::cmp::Reverse(landings.len()));
    cells.truncate(MOST_CELLS);
    if cells.is_empty() {
        return;
    }
    let count = (2 * cells.len()).next_power_of_two();
    scene.frame.guide_cell_count = count as u32;
    scene.guide = vec![[0.0; 4]; count * GUIDE_LOBES as usize];
    for landings in cells {
        let first = guide_cell(scene, landings[0].position) as usize;
        if scene.guide[first][3] == 0.0 {
            for (place, lobe) in lobes(&landings, scene.photon_light_radius)
                .into_iter()
                .enumerate()
            {
                scene.guide[first + place] = lobe;
            }
        }
    }
}

/// Targets of a cell's lobes, and 1 - cos of their half-angles, so that each landing's direction lies in a lobe: the landing that is farthest from the
/// lobes so far gets one of its own (greedy k-centres, Gonzalez 1985), until they are narrow, and each aims at where its landings' rays meet.
/// `light_radius`: half-angle at which lights show, radians.
fn lobes(landings: &[Landing], light_radius: f32) -> Vec<[f32; 4]> {
    let mut targets = vec![target_of(landings.iter())];
    let (mut nearest, mut farthest) = nearest_targets(landings, &targets);
    // A new target may take the place of another, so that their number need not grow.
    for _ in 1..GUIDE_LOBES {
        if nearest[farthest].1 <= NARROWEST {
            break;
        }
        targets.push(landings[farthest].from);
        for _ in 0..REFINEMENTS {
            (nearest, _) = nearest_targets(landings, &targets);
            targets = (0..targets.len())
                .map(|target| members(landings, &nearest, target))
                .filter(|members| members.clone().next().is_some())
                .map(target_of)
                .collect();
        }
        (nearest, farthest) = nearest_targets(landings, &targets);
    }
    let half_angle = |target: usize| {
        let apart = nearest.iter().filter(|(of, _)| *of == target);
        let (count, reach) = apart.fold((0.0, 0.0_f32), |(count, reach), (_, apart)| {
            (count + 1.0, reach.max(*apart))
        });
        // The fewer landings, the less is known.
        let unknown = (LONE_OF_LIGHT * light_radius).min(LONE_WIDEST) / f32::max(count, 1.0).sqrt();
        (WIDENING * reach).max(unknown).clamp(NARROWEST, WIDEST)
    };
    (targets.iter().enumerate())
        .map(|(number, target)| {
            let half = 0.5 * half_angle(number);
            target.extend(2.0 * half.sin() * half.sin()).to_array()
        })
        .collect()
}

/// The nearest target of each landing and how far its direction is from it, radians; the landing that is farthest.
fn nearest_targets(landings: &[Landing], targets: &[Vec3]) -> (Vec<(usize, f32)>, usize) {
    let nearest: Vec<(usize, f32)> = (landings.iter())
        .map(|landing| {
            (targets.iter().enumerate())
                .map(|(number, target)| (number, angle_from(landing, *target)))
                .min_by(|(_, a), (_, b)| a.total_cmp(b))
                .expect("there is a target")
        })
        .collect();
    let farthest = (nearest.iter().enumerate())
        .max_by(|(_, (_, a)), (_, (_, b))| a.total_cmp(b))
        .map_or(0, |(number, _)| number);
    (nearest, farthest)
}

fn members<'a>(
    landings: &'a [Landing],
    nearest: &'a [(usize, f32)],
    target: usize,
) -> impl Iterator<Item = &'a Landing> + Clone {
    let of_target = move |(_, (nearest, _)): &(&Landing, &(usize, f32))| *nearest == target;
    landings
        .iter()
        .zip(nearest)
        .filter(of_target)
        .map(|(landing, _)| landing)
}

fn direction(landing: &Landing) -> Vec3 {
    (landing.from - landing.position).normalize_or_zero()
}

fn angle_from(landing: &Landing, target: Vec3) -> f32 {
    let to = (target - landing.position).normalize_or_zero();
    2.0 * (0.5 * direction(landing).distance(to)).min(1.0).asin()
}

/// Where the rays of landings come from: the point that is nearest to all of them, such as the image of the sun behind a curved mirror, or the mean of
/// the points of smooth surfaces that they came by, whichever they point at better.
fn target_of<'a>(landings: impl Iterator<Item = &'a Landing> + Clone) -> Vec3 {
    let count = landings.clone().count() as f32;
    let mean = landings.clone().map(|landing| landing.from).sum::<Vec3>() / count;
    // Relative to the mean, so that small differences keep their digits.
    let (mut across, mut offset) = (
        Mat3::from_diagonal(Vec3::splat(FIRMNESS * count)),
        Vec3::ZERO,
    );
    for landing in landings.clone() {
        let d = direction(landing);
        let projection = Mat3::IDENTITY - Mat3::from_cols(d * d.x, d * d.y, d * d.z);
        across += projection;
        offset += projection * (landing.position - mean);
    }
    let meeting = mean + across.inverse() * offset;
    let error = |target: Vec3| -> f32 {
        let angles = landings.clone().map(|landing| angle_from(landing, target));
        angles.map(|angle| angle * angle).sum()
    };
    if error(meeting) < error(mean) {
        meeting
    } else {
        mean
    }
}

#[cfg(test)]
mod tests;
