//! What the light tests share: small scenes, random numbers, and the chi-squared test of a density over directions.

mod cones;
mod environment;
mod gpu;
mod lights;
mod quads;

use crate::work::Watcher;
use std::f64::consts::TAU;
use std::sync::Arc;

use glam::Vec3;

use crate::camera::chi_squared::critical;
use crate::math::{hash_combine, hash_u32, uniform_from_bits};
use crate::pack::test_scene;
use crate::packed::PackedScene;
use crate::scene::{Environment, EnvironmentMap, Light, LightKind, Side};

/// Counter-based, so that every test draws the same numbers each time.
pub struct Random {
    stream: u32,
    next: u32,
}

impl Random {
    pub fn new(stream: u32) -> Self {
        Self { stream, next: 0 }
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f32 {
        self.next += 1;
        uniform_from_bits(hash_u32(hash_combine(self.next, self.stream)))
    }

    pub fn uniforms<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.uniform())
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        let [a, b] = self.uniforms();
        direction_of(f64::from(a) * 2.0 - 1.0, f64::from(b))
    }
}

fn direction_of(y: f64, turns: f64) -> Vec3 {
    let r = (1.0 - y * y).max(0.0).sqrt();
    let (sin, cos) = (turns * TAU).sin_cos();
    Vec3::new((r * cos) as f32, y as f32, (r * sin) as f32)
}

pub fn map_environment(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Environment {
    Environment {
        map: EnvironmentMap::LatLong {
            width,
            height,
            texels: Arc::new(texels),
        },
        rotation_deg: 0.0,
        scale: 1.0,
    }
}

/// A scene of nothing but these lights.
pub fn lit_by(environment: Option<Environment>, lights: &[LightKind]) -> PackedScene {
    let mut scene = test_scene();
    scene.environment = environment;
    scene.lights = lights
        .iter()
        .map(|&kind| Light {
            kind,
            side: Side::Real,
        })
        .collect();
    PackedScene::build(&scene, &Watcher::none()).expect("packs")
}

const ROWS: usize = 24;
const COLUMNS: usize = 48;

/// Outcome of a chi-squared test over directions.
pub struct Fit {
    pub statistic: f64,
    pub limit: f64,
    /// Of the density, over the sphere.
    pub integral: f64,
}

impl Fit {
    pub fn holds(&self) -> bool {
        self.statistic < self.limit
    }
}

/// Counts `samples` directions of `draw` in cells of equal solid angle against `density` integrated over each cell.
pub fn fit(
    samples: usize,
    mut draw: impl FnMut() -> Option<Vec3>,
    density: impl Fn(Vec3) -> f64,
) -> Fit {
    const SIDE: usize = 24;
    let mut expected = vec![0.0; ROWS * COLUMNS];
    for (cell, mass) in expected.iter_mut().enumerate() {
        let (row, column) = (cell / COLUMNS, cell % COLUMNS);
        for k in 0..SIDE * SIDE {
            let at = |cell: usize, k: usize| cell as f64 + (k as f64 + 0.5) / SIDE as f64;
            let y = 2.0 * at(row, k / SIDE) / ROWS as f64 - 1.0;
            *mass += density(direction_of(y, at(column, k % SIDE) / COLUMNS as f64));
        }
        *mass *= 2.0 * TAU / (ROWS * COLUMNS * SIDE * SIDE) as f64;
    }
    let integral = expected.iter().sum();
    let mut counts = vec![0.0; ROWS * COLUMNS];
    for direction in (0..samples).filter_map(|_| draw()) {
        let d = direction.as_dvec3();
        let turns = d.z.atan2(d.x) / TAU;
        let row = ((d.y + 1.0) * 0.5 * ROWS as f64) as usize;
        let column = ((turns - turns.floor()) * COLUMNS as f64) as usize;
        counts[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
    }
    let expected: Vec<f64> = expected.iter().map(|m| m * samples as f64).collect();
    let (statistic, limit) = pearson(&counts, &expected);
    Fit {
        statistic,
        limit,
        integral,
    }
}

/// Pearson's statistic and the value that chance exceeds once in a million times; cells of small expectation are pooled.
pub fn pearson(counts: &[f64], expected: &[f64]) -> (f64, f64) {
    let mut statistic = 0.0;
    let mut cells = 1;
    let mut pool = (0.0, 0.0);
    let term = |count: f64, mean: f64| (count - mean) * (count - mean) / mean;
    for (&count, &mean) in counts.iter().zip(expected) {
        if mean >= 8.0 {
            statistic += term(count, mean);
            cells += 1;
        } else {
            pool = (pool.0 + count, pool.1 + mean);
        }
    }
    // A pool that expects next to nothing must hold next to nothing.
    statistic += term(pool.0, pool.1.max(1.0)).max(0.0);
    (statistic, critical(cells.max(2)))
}
