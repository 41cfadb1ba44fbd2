//! The light on the proxy if nothing stood between it and its lights: most of what makes the true light change from normal to normal, without noise.

use glam::Vec3;

use crate::light::environment::env_sample;
use crate::light::lights::light_sample;
use crate::math::INV_PI;
use crate::packed::{LIGHT_ENVIRONMENT, NONE, PackedScene, SIDE_REAL};

/// Coefficients of real spherical harmonics up to the second order, all that a cosine lets through (Ramamoorthi and Hanrahan 2001).
const COEFFICIENTS: usize = 9;
/// What the cosine leaves of each of them, over pi.
const COSINE_OVER_PI: [f32; COEFFICIENTS] = {
    let (first, second) = (2.0 / 3.0, 0.25);
    [
        1.0, first, first, first, second, second, second, second, second,
    ]
};
/// Directions from which the environment's coefficients are found.
const DIRECTIONS: u32 = 4096;
/// The fractional part of the golden ratio: with the number of the direction, evenly spread points (a Kronecker lattice).
const GOLDEN: f64 = 0.618_033_988_749_895;
/// With more lights than this, which emissive meshes bring, they are left out.
const MOST_LIGHTS: usize = 8;
/// Points of a light, the same for all surfaces.
const LIGHT_POINTS: [[f32; 2]; 4] = [[0.25, 0.125], [0.75, 0.375], [0.25, 0.625], [0.75, 0.875]];

/// Real lights and the environment.
pub(super) struct Unoccluded {
    environment: [Vec3; COEFFICIENTS],
    /// Indices into the scene's.
    lights: Vec<u32>,
}

impl Unoccluded {
    pub fn of(scene: &PackedScene) -> Self {
        let mut environment = [Vec3::ZERO; COEFFICIENTS];
        if scene.frame.env_light != NONE {
            for i in 0..DIRECTIONS {
                let u = (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
                let v = (f64::from(i) * GOLDEN).fract();
                let sample = env_sample(scene, u as f32, v as f32);
                if sample.pdf > 0.0 {
                    let weight = sample.radiance / (sample.pdf * DIRECTIONS as f32);
                    for (sum, basis) in environment.iter_mut().zip(harmonics(sample.direction)) {
                        *sum += weight * basis;
                    }
                }
            }
        }
        let is_lamp = |light: &u32| {
            let light = &scene.lights[*light as usize];
            light.side == SIDE_REAL && light.kind != LIGHT_ENVIRONMENT && light.select_pdf > 0.0
        };
        let mut lights: Vec<u32> = (0..scene.frame.light_count).filter(is_lamp).collect();
        if lights.len() > MOST_LIGHTS {
            lights.clear();
        }
        Self {
            environment,
            lights,
        }
    }

    /// Radiance per unit of albedo, of a surface at a place relative to the anchor with that unit normal: an estimate, as of the
    /// environment the second order leaves a tenth open.
    pub fn light(&self, scene: &PackedScene, position: Vec3, normal: Vec3) -> Vec3 {
        let coefficients = self.environment.iter().zip(COSINE_OVER_PI);
        let environment: Vec3 = (coefficients.zip(harmonics(normal)))
            .map(|((coefficient, cosine), basis)| *coefficient * (cosine * basis))
            .sum();
        let mut light = environment.max(Vec3::ZERO);
        for &index in &self.lights {
            let select_pdf = scene.lights[index as usize].select_pdf;
            for point in LIGHT_POINTS {
                let sample = light_sample(scene, index, position, point);
                let cos = sample.direction.dot(normal);
                if sample.pdf > 0.0 && cos > 0.0 {
                    let weight = INV_PI * select_pdf / LIGHT_POINTS.len() as f32;
                    light += sample.radiance * (cos * weight / sample.pdf);
                }
            }
        }
        light
    }
}

/// Real spherical harmonics in a unit direction, orthonormal over the sphere.
fn harmonics(d: Vec3) -> [f32; COEFFICIENTS] {
    let Vec3 { x, y, z } = d;
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

#[cfg(test)]
mod tests;
