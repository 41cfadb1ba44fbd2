//! Learns from photons by which points of smooth virtual surfaces light comes to a place.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use super::path::{Landing, PhotonNumber, first_landing};
use crate::light::guide::{GUIDE_LOBES, guide_cell, guide_place};
use crate::packed::{PackedScene, Taught};

/// Photons, as a share of the samples of the whole picture, and within these bounds.
const PHOTONS_OF_SAMPLES: f64 = 1.0 / 64.0;
const FEWEST: u32 = 1 << 12;
const MOST: u32 = 1 << 16;
/// Side of the narrowest cells in mean radii of the spheres that photons are sent to.
const CELL_OF_RADIUS: f32 = 0.25;
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

/// Fills the scene's guide. Its photons are those of the frame's seed. They are traced once as long as no more than the camera changes: where they
/// land does not depend on it.
pub fn learn(scene: &mut PackedScene) {
    let samples = f64::from(scene.frame.rays_total) * scene.pixels.len() as f64;
    let count = (samples * PHOTONS_OF_SAMPLES).clamp(f64::from(FEWEST), f64::from(MOST)) as u32;
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

/// Points and 1 - cos of half-angles so that each landing's direction lies in the lobe of the nearest point: greedy k-centres (Gonzalez 1985).
/// `light_radius`: half-angle at which lights show, radians.
fn lobes(landings: &[Landing], light_radius: f32) -> Vec<[f32; 4]> {
    let directions: Vec<Vec3> = landings
        .iter()
        .map(|landing| (landing.from - landing.position).normalize_or_zero())
        .collect();
    let angle = |a: Vec3, b: Vec3| 2.0 * (0.5 * a.distance(b)).min(1.0).asin();
    let mut centres = vec![0];
    let mut nearest: Vec<(usize, f32)> = (directions.iter())
        .map(|&d| (0, angle(d, directions[0])))
        .collect();
    while centres.len() < GUIDE_LOBES as usize {
        let (farthest, &(_, apart)) = (nearest.iter().enumerate())
            .max_by(|(_, a), (_, b)| a.1.total_cmp(&b.1))
            .expect("a cell has landings");
        if apart <= NARROWEST {
            break;
        }
        for (own, &d) in nearest.iter_mut().zip(&directions) {
            let apart = angle(d, directions[farthest]);
            if apart < own.1 {
                *own = (centres.len(), apart);
            }
        }
        centres.push(farthest);
    }
    let half_angle = |centre: usize| {
        let members = nearest.iter().filter(|(of, _)| *of == centre);
        let (count, reach) = members.fold((0.0, 0.0_f32), |(count, reach), (_, apart)| {
            (count + 1.0, reach.max(*apart))
        });
        // The fewer landings, the less is known.
        let unknown = (LONE_OF_LIGHT * light_radius).min(LONE_WIDEST) / f32::sqrt(count);
        (WIDENING * reach).max(unknown).clamp(NARROWEST, WIDEST)
    };
    (centres.iter().enumerate())
        .map(|(centre, &landing)| {
            let [x, y, z] = landings[landing].from.to_array();
            let half = 0.5 * half_angle(centre);
            [x, y, z, 2.0 * half.sin() * half.sin()]
        })
        .collect()
}
