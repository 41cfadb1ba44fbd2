//! How many photons: as many as lower the picture's error most for what they cost.

use rayon::prelude::*;

use super::path::{PhotonNumber, trace_photon};
use crate::packed::PackedScene;
use crate::work::RayCounts;

/// Photons of the pilot, and of one of its tasks.
const PILOT_PHOTONS: u32 = 1 << 13;
const TASK_PHOTONS: u32 = 1 << 8;
/// What generating a photon and shading its vertices cost, in rays.
const COST_OF_A_PHOTON: f64 = 2.0;
/// Photons a pixel for every ray per pixel: where nothing is measured, and the least.
const UNMEASURED: f64 = 0.25;
const LEAST: f64 = 1.0 / 64.0;
/// They cost at most so many times what the eye's samples do.
const GREATEST_COST: f64 = 1.0;

/// The eye's samples are spread evenly, and leave so many times less error than independent ones: 1.8 to 4.8 times at 25 rays (docs/estimator.md).
const EVENNESS: f64 = 3.0;

/// What one does: a photon, or a ray per pixel with all its samples by the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Squared error that it leaves, summed over the pixels, mean of the channels.
    pub error: f64,
    /// In rays.
    pub cost: f64,
}

/// Photons for every ray per pixel where nothing was measured.
pub fn unmeasured(pixels: usize) -> u64 {
    (UNMEASURED * pixels as f64).ceil() as u64
}

/// Photons for every ray per pixel. N photons leave the squared error e / N for the cost c N, as many rays E / R for C R: for a given total
/// error the total cost is least where N / R is the root of (e / c) / (E / C) (Neyman 1934, with costs). `eye`: as if its samples were independent.
pub fn photons_per_ray(pixels: usize, photon: Effort, eye: Effort) -> u64 {
    let of_eye = (eye.error / EVENNESS / eye.cost).max(1e-30);
    let balanced = (photon.error / photon.cost / of_eye).sqrt();
    let most = (GREATEST_COST * eye.cost / photon.cost).max(1.0);
    let least = (LEAST * pixels as f64).min(most);
    balanced.clamp(least, most).ceil() as u64
}

/// What a photon does.
pub fn measure(scene: &PackedScene) -> Effort {
    let tasks: Vec<(f64, f64)> = (0..PILOT_PHOTONS / TASK_PHOTONS)
        .into_par_iter()
        .map(|task| measure_from(scene, task * TASK_PHOTONS))
        .collect();
    let photons = f64::from(PILOT_PHOTONS);
    let pixels = scene.pixels.len() as f64;
    let squares: f64 = tasks.iter().map(|(squares, _)| squares).sum();
    let rays: f64 = tasks.iter().map(|(_, rays)| rays).sum();
    Effort {
        error: squares * pixels * pixels / photons,
        cost: rays / photons + COST_OF_A_PHOTON,
    }
}

/// Sums over photons: squares of their splats, mean of the channels, and rays.
fn measure_from(scene: &PackedScene, first: u32) -> (f64, f64) {
    let (mut squares, mut rays) = (0.0, 0.0);
    for place in first..first + TASK_PHOTONS {
        let number = PhotonNumber {
            sequence: 0,
            place,
            window: [0.0, 1.0],
        };
        let st = trace_photon(scene, number, |splat| {
            let square = splat.value.as_dvec3().length_squared() / 3.0;
            if square.is_finite() {
                squares += square;
            }
        });
        rays += RayCounts::from(st.rays).traced() as f64;
    }
    (squares, rays)
}
