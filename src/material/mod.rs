//! What light does at a surface: textures, the shading point, and glTF's metallic-roughness scattering.
//!
//! [`surface_at`] turns a hit into a [`Surface`] with every texture read; [`bsdf_eval`] and [`bsdf_sample`] scatter light there.
//! Each file has a WGSL twin of the same name in `shaders/`.

pub(crate) mod bsdf;
pub(crate) mod facets;
pub(crate) mod fresnel;
pub(crate) mod ggx;
pub(crate) mod interface;
pub(crate) mod lobes;
mod normal;
pub(crate) mod scatter;
pub(crate) mod surface;
#[cfg(test)]
mod tests;
pub(crate) mod texture;

pub use bsdf::{
    bsdf_albedo, bsdf_directional_albedo_bound, bsdf_eval, bsdf_index_ratio, bsdf_is_delta,
    bsdf_is_diffuse, bsdf_is_glossy, bsdf_is_lambertian, bsdf_is_polished, bsdf_passes_straight,
    bsdf_sample, bsdf_straight,
};
pub use ggx::{DELTA_ALPHA, transmits_unblurred};
pub use lobes::GLOSSY_ALPHA;
pub use scatter::{BsdfEval, BsdfSample};
pub use surface::{Surface, surface_alpha, surface_at, triangle_emission};
pub use texture::{srgb_decode, texture_sample};
