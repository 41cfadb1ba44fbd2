//! Light that facets of a rough surface send to each other. The GGX lobes count what a facet sends off at once, and lose the rest: of a white metal of
//! roughness 1 two thirds. So each lobe is scaled by what it keeps, which a table tells (Turquin 2019, "Practical multiple scattering compensation for
//! microfacet models"): white metal and clear glass then lose nothing, and coloured metal saturates. WGSL twin: `shaders/material/facets.wgsl`.

use glam::Vec3;
use rayon::prelude::*;

use super::fresnel::{RelativeIndex, fresnel_dielectric, refract_about, relative_index};
use super::ggx::{DELTA_ALPHA, ggx_sample_half, smith_l};
use super::normal::unit;
use crate::packed::PackedScene;
use crate::shared::shared;

shared! {
    /// Entries of a table in either direction: roughness from 0 to 1, square root of the cosine from 0 to 1.
    const TABLE_SIDE: u32 = 32;
    /// A table's floats.
    pub const TABLE_SIZE: u32 = TABLE_SIDE * TABLE_SIDE;
}

/// Facets of an entry's quadrature, in either direction.
const FACETS: u32 = 48;
/// Cosines are taken as no smaller than this.
const LEAST_COSINE: f32 = 1e-3;

/// Shares that the lobe keeps, roughness by roughness; `ior`: of the glass, seen from outside and then from inside. Without one all facets mirror, as
/// those of a metal do; those of a thin wall keep as much.
pub fn table_of(ior: Option<f32>) -> Vec<f32> {
    let sides = match ior {
        None => vec![None],
        Some(ior) => [true, false]
            .map(|entering| Some(relative_index(ior, entering)))
            .to_vec(),
    };
    let at = |i: u32| i as f32 / (TABLE_SIDE - 1) as f32;
    let entry = |i: u32, index: Option<RelativeIndex>| {
        let (roughness, root) = (at(i / TABLE_SIDE), at(i % TABLE_SIDE));
        let alpha = (roughness * roughness).max(DELTA_ALPHA);
        kept(alpha, (root * root).max(LEAST_COSINE), index)
    };
    (sides.into_par_iter())
        .flat_map(|index| {
            (0..TABLE_SIZE)
                .into_par_iter()
                .map(move |i| entry(i, index))
        })
        .collect()
}

/// By quadrature over the facets that are seen.
fn kept(alpha: f32, cos: f32, index: Option<RelativeIndex>) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let unmasked = |z: f32| {
        if z > 0.0 {
            f64::from(2.0 * z / smith_l(alpha, z))
        } else {
            0.0
        }
    };
    let mut sum = 0.0;
    for i in 0..FACETS * FACETS {
        let [u0, v] = [i % FACETS, i / FACETS].map(|i| (i as f32 + 0.5) / FACETS as f32);
        // The few facets that lose most light are the steepest: u1 near 1.
        let weight = f64::from(2.0 * v);
        let h = ggx_sample_half(alpha, Vec3::Z, wo, u0, 1.0 - v * v);
        let cos_half = wo.dot(h);
        let mirrored = unmasked(h.z * (2.0 * cos_half) - wo.z);
        let Some(index) = index else {
            sum += weight * mirrored;
            continue;
        };
        let fresnel = fresnel_dielectric(cos_half, index);
        let reflected = if fresnel.total {
            1.0
        } else {
            f64::from(fresnel.reflectance)
        };
        let through = unit(refract_about(wo, h, cos_half, index, fresnel.g));
        sum += weight * reflected * mirrored;
        if !fresnel.total {
            sum += weight * (1.0 - reflected) * unmasked(-through.z);
        }
    }
    (sum / f64::from(FACETS * FACETS)) as f32
}

fn table_entry(scene: &PackedScene, first: u32, row: u32, column: u32) -> f32 {
    scene.facet_tables[(first + row * TABLE_SIDE + column) as usize]
}

/// What the table that begins at `first` says of a lobe of that GGX alpha, seen at `cos`.
pub fn kept_by_facets(scene: &PackedScene, first: u32, alpha: f32, cos: f32) -> f32 {
    let last = (TABLE_SIDE - 1) as f32;
    let (y, x) = (alpha.sqrt() * last, cos.sqrt() * last);
    let (row, column) = (
        (y as u32).min(TABLE_SIDE - 2),
        (x as u32).min(TABLE_SIDE - 2),
    );
    let (fy, fx) = (y - row as f32, x - column as f32);
    let c00 = table_entry(scene, first, row, column);
    let c10 = table_entry(scene, first, row, column + 1);
    let c01 = table_entry(scene, first, row + 1, column);
    let c11 = table_entry(scene, first, row + 1, column + 1);
    let top = c00 + (c10 - c00) * fx;
    let bottom = c01 + (c11 - c01) * fx;
    top + (bottom - top) * fy
}
