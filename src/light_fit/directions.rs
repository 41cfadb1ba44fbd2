//! Directions spread evenly over the sphere, and the light that a map brings from about each of them.

use std::f64::consts::{PI, TAU};

use glam::Vec3;

use crate::math::luminance;
use crate::scene::{Environment, EnvironmentMap};

/// 4.5 degrees apart.
pub const COUNT: usize = 2048;
/// Rotations of a map that are tried, 5 degrees apart.
pub const ROTATIONS: usize = 72;
/// Of the grid that tells the nearest direction; a rotation is a whole number of its columns.
const COLUMNS: usize = 288;
const ROWS: usize = 144;
const COLUMNS_A_ROTATION: usize = COLUMNS / ROTATIONS;

/// A spiral of Fibonacci's (Gonzalez 2010, "Measurement of areas on a sphere using Fibonacci and latitude-longitude lattices").
pub fn directions() -> Vec<Vec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let y = 1.0 - (2.0 * i as f64 + 1.0) / COUNT as f64;
        let radius = (1.0 - y * y).sqrt();
        let (sin, cos) = (golden * i as f64).sin_cos();
        Vec3::new((radius * cos) as f32, y as f32, (radius * sin) as f32)
    };
    (0..COUNT).map(direction).collect()
}

/// Steradians about each direction.
pub const SOLID_ANGLE: f32 = (4.0 * PI / COUNT as f64) as f32;

/// By rotation and direction: luminance times solid angle of what arrives from about there, at scale 1. Rotation k is of k times 5 degrees; a
/// constant environment has one.
pub fn light_by_rotation(environment: &Environment, directions: &[Vec3]) -> Vec<Vec<f32>> {
    let EnvironmentMap::LatLong {
        width,
        height,
        texels,
    } = &environment.map
    else {
        let EnvironmentMap::Constant(radiance) = &environment.map else {
            return Vec::new();
        };
        return vec![vec![luminance((*radiance).into()) * SOLID_ANGLE; COUNT]];
    };
    let cells = cell_light((*width as usize, *height as usize), texels);
    let nearest = nearest(directions);
    (0..ROTATIONS)
        .map(|rotation| {
            let mut light = vec![0.0; COUNT];
            for (cell, value) in cells.iter().enumerate() {
                let (column, row) = (cell % COLUMNS, cell / COLUMNS);
                // A map that is turned by an angle about +Y has its columns so much further left.
                let column = (column + COLUMNS - COLUMNS_A_ROTATION * rotation) % COLUMNS;
                light[nearest[row * COLUMNS + column] as usize] += value;
            }
            light
        })
        .collect()
}

/// Luminance times solid angle by cell of the grid: each texel's goes to the cells that it covers, in proportion.
fn cell_light((width, height): (usize, usize), texels: &[[f32; 3]]) -> Vec<f32> {
    let mut light = vec![0.0; COLUMNS * ROWS];
    for (y, texel_row) in texels.chunks(width).enumerate() {
        for (row, top, bottom) in covered(y, height, ROWS) {
            let band = TAU * ((top * PI).cos() - (bottom * PI).cos());
            for (x, texel) in texel_row.iter().enumerate() {
                let radiance = f64::from(luminance((*texel).into()));
                for (column, left, right) in covered(x, width, COLUMNS) {
                    light[row * COLUMNS + column] += radiance * band * (right - left);
                }
            }
        }
    }
    light.into_iter().map(|light| light as f32).collect()
}

/// The cells, of so many, that one texel of a line of texels covers, each with the ends of what it covers of it, 0..1 along the line.
fn covered(texel: usize, texels: usize, cells: usize) -> impl Iterator<Item = (usize, f64, f64)> {
    let share = |index: usize, count: usize| index as f64 / count as f64;
    let (start, end) = (share(texel, texels), share(texel + 1, texels));
    // Whole numbers, so that no cell is missed by rounding.
    let (first, last) = (
        texel * cells / texels,
        ((texel + 1) * cells).div_ceil(texels),
    );
    (first..last).map(move |cell| {
        (
            cell,
            start.max(share(cell, cells)),
            end.min(share(cell + 1, cells)),
        )
    })
}

/// Of the centre of each cell of the grid, in the world's azimuths: the centre column is -Z.
fn nearest(directions: &[Vec3]) -> Vec<u16> {
    use rayon::prelude::*;
    (0..COLUMNS * ROWS)
        .into_par_iter()
        .map(|cell| {
            let azimuth = ((cell % COLUMNS) as f64 + 0.5) / COLUMNS as f64 * TAU - PI;
            let polar = ((cell / COLUMNS) as f64 + 0.5) / ROWS as f64 * PI;
            let (sin, cos) = polar.sin_cos();
            let centre = Vec3::new(
                (sin * azimuth.sin()) as f32,
                cos as f32,
                (-sin * azimuth.cos()) as f32,
            );
            let dots = directions.iter().map(|d| d.dot(centre));
            let best = dots.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            best.map_or(0, |(index, _)| index as u16)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn directions_are_even() {
        let directions = directions();
        // Irradiance of a white sky on planes that face anywhere.
        for normal in [Vec3::X, Vec3::Y, Vec3::new(0.6, -0.64, 0.48)] {
            let sum: f32 = directions.iter().map(|d| d.dot(normal).max(0.0)).sum();
            let irradiance = sum * SOLID_ANGLE;
            assert!((irradiance / std::f32::consts::PI - 1.0).abs() < 2e-3);
        }
    }

    #[test]
    fn light_of_a_map_arrives_from_where_it_is_turned_to() {
        // A lamp in the column of -Z, 30 degrees up, on black.
        let (width, height) = (360, 180);
        let mut texels = vec![[0.0; 3]; width * height];
        texels[60 * width + width / 2] = [1000.0; 3];
        let environment = Environment {
            map: EnvironmentMap::LatLong {
                width: width as u32,
                height: height as u32,
                texels: Arc::new(texels),
            },
            rotation_deg: 0.0,
            scale: 1.0,
        };
        let directions = directions();
        let light = light_by_rotation(&environment, &directions);
        for (rotation, azimuth) in [(0, Vec3::NEG_Z), (18, Vec3::NEG_X), (36, Vec3::Z)] {
            let all: f32 = light[rotation].iter().sum();
            let solid_angle = (1f64.to_radians()).powi(2) * 29.5f64.to_radians().cos();
            assert!((f64::from(all) / (1000.0 * solid_angle) - 1.0).abs() < 0.02);
            let mean: Vec3 = (light[rotation].iter().zip(&directions))
                .map(|(value, direction)| *direction * (*value / all))
                .sum();
            let wanted = azimuth * 0.866 + Vec3::Y * 0.5;
            assert!(mean.normalize().dot(wanted) > 0.998, "{rotation}: {mean}");
        }
    }
}
