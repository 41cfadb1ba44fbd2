//! Light on the proxy from noisy estimates on a grid.
//!
//! What is smoothed is the light over what would arrive if nothing blocked it, which hardly depends on the normal: surfaces of other normals help,
//! and a bumpy scan keeps its bumps. Grid points are averaged with those around them whose light is the same within its noise (non-local means with
//! the variance of each estimate, Rousselle, Knaus and Zwicker 2012), so that the edges of shadows stay where they are; pixels lie between the grid
//! points nearest to them.

use glam::Vec3;
use rayon::prelude::*;

use super::unoccluded::Unoccluded;
use super::{DEPTH_TOLERANCE, Grid, GridPoint, Seen};
use crate::math::luminance;
use crate::packed::PackedScene;

/// Power of the cosine between normals.
const NORMAL_POWER: i32 = 4;
/// Grid points to either side that are averaged, and the standard deviation of their weights.
const AVERAGED: usize = 6;
const AVERAGED_SIGMA: f32 = 2.5;
/// Points to either side whose light is compared, with that of the points around the other.
const COMPARED: isize = 1;
/// Differences of this many standard deviations are taken for noise.
const TOLERATED: f32 = 1.6;
/// As for grid points, from them to pixels.
const SPREAD: usize = 3;
const SPREAD_SIGMA: f32 = 0.4;
/// Light from all around, over the mean light, that is taken for granted where nothing arrives unblocked.
const AMBIENT: f32 = 0.02;
const LEAST: f32 = 1e-12;

/// A grid point's light over what would arrive unblocked.
#[derive(Clone, Copy)]
struct Share {
    of_unblocked: Vec3,
    brightness: f32,
    /// Of the brightness.
    variance: f32,
}

/// Radiance per unit of albedo of every pixel with a wanted surface.
pub(super) fn light_on_surfaces(
    scene: &PackedScene,
    seen: &[Seen],
    grid: &Grid,
    pitch_px: usize,
) -> Vec<Vec3> {
    let width = scene.frame.width as usize;
    let unoccluded = Unoccluded::of(scene);
    let points = || grid.points.iter().flatten();
    let sum: Vec3 = points().map(|point| point.light).sum();
    let mean = sum / points().count().max(1) as f32;
    let ambient = Vec3::splat((AMBIENT * luminance(mean)).max(LEAST));
    let unblocked = |s: &Seen| unoccluded.light(scene, s.position, s.normal) + ambient;
    let there = |point: &GridPoint| &seen[point.y * width + point.x];
    let shares: Vec<Option<Share>> = (grid.points.par_iter())
        .map(|point| {
            let point = point.as_ref()?;
            Some(share(point, unblocked(there(point))))
        })
        .collect();
    let averaged = averaged(grid, &shares, there);
    seen.par_iter()
        .enumerate()
        .map(|(pixel, s)| {
            if s.depth_m <= 0.0 {
                return Vec3::ZERO;
            }
            let (x, y) = (pixel % width, pixel / width);
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for at in grid.around(x / pitch_px, y / pitch_px, SPREAD) {
                let (Some(point), Some(share)) = (&grid.points[at], averaged[at]) else {
                    continue;
                };
                let away = [point.x as f32 - x as f32, point.y as f32 - y as f32];
                let away = away.map(|px| px / pitch_px as f32);
                // Keeps a pixel whose neighbours are all unlike it defined.
                let weight = alike(s, there(point), away, SPREAD_SIGMA) + 1e-9;
                sum += share * weight;
                weights += weight;
            }
            match weights > 0.0 {
                true => sum / weights * unblocked(s),
                false => Vec3::ZERO,
            }
        })
        .collect()
}

fn share(point: &GridPoint, unblocked: Vec3) -> Share {
    let of_unblocked = point.light / unblocked;
    let brightness = luminance(of_unblocked);
    let groups = point.groups.map(|light| luminance(light / unblocked));
    let count = groups.len() as f32;
    let mean = groups.iter().sum::<f32>() / count;
    let squares: f32 = groups.iter().map(|x| (x - mean) * (x - mean)).sum();
    Share {
        of_unblocked,
        brightness,
        variance: squares / (count * (count - 1.0)),
    }
}

/// Of every grid point the mean over those around it that show the same.
fn averaged<'a>(
    grid: &Grid,
    shares: &[Option<Share>],
    there: impl Fn(&GridPoint) -> &'a Seen + Sync,
) -> Vec<Option<Vec3>> {
    let place = |at: usize| (at % grid.width, at / grid.width);
    // A variance from a few groups is itself uncertain.
    let shares: Vec<Option<Share>> = (0..shares.len())
        .map(|at| {
            let (x, y) = place(at);
            let near = grid.around(x, y, 1).filter_map(|at| shares[at]);
            let (sum, count) = near.fold((0.0, 0.0), |(sum, count), share| {
                (sum + share.variance, count + 1.0)
            });
            shares[at].map(|share| Share {
                variance: sum / count,
                ..share
            })
        })
        .collect();
    (0..shares.len())
        .into_par_iter()
        .map(|at| {
            let (own, own_share) = (grid.points[at].as_ref()?, shares[at]?);
            let (x, y) = place(at);
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for other in grid.around(x, y, AVERAGED) {
                let (Some(point), Some(share)) = (&grid.points[other], shares[other]) else {
                    continue;
                };
                let (other_x, other_y) = place(other);
                let away = [other_x as f32 - x as f32, other_y as f32 - y as f32];
                let weight = alike(there(own), there(point), away, AVERAGED_SIGMA)
                    * (-difference(grid, &shares, at, other)).exp();
                sum += share.of_unblocked * weight;
                weights += weight;
            }
            Some(match weights > 0.0 {
                true => sum / weights,
                false => own_share.of_unblocked,
            })
        })
        .collect()
}

/// Squared difference of the brightness about two grid points beyond what noise explains, in tolerated variances; at least 0.
fn difference(grid: &Grid, shares: &[Option<Share>], at: usize, other: usize) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    let compared = grid.pairs(at, other, COMPARED);
    for (a, b) in compared.filter_map(|(a, b)| Some((shares[a]?, shares[b]?))) {
        let apart = a.brightness - b.brightness;
        let tolerated = TOLERATED * TOLERATED * (a.variance + b.variance);
        let explained = a.variance + a.variance.min(b.variance);
        sum += (apart * apart - explained) / tolerated.max(f32::MIN_POSITIVE);
        count += 1.0;
    }
    f32::max(sum / f32::max(count, 1.0), 0.0)
}

/// How alike two surfaces are, `away` grid points from each other: 0 to 1.
fn alike(s: &Seen, there: &Seen, away: [f32; 2], sigma: f32) -> f32 {
    let away_squared = away[0] * away[0] + away[1] * away[1];
    let tolerance = s.depth_m * DEPTH_TOLERANCE * (1.0 + away_squared.sqrt());
    let depth_step = (there.depth_m - s.depth_m) / tolerance;
    (-away_squared / (2.0 * sigma * sigma)).exp()
        * (-depth_step * depth_step).exp()
        * there.normal.dot(s.normal).max(0.0).powi(NORMAL_POWER)
}

#[cfg(test)]
mod tests;
