//! What one facet of the glTF material reflects and lets through: the metal's Fresnel factors and the dielectric's.

use glam::Vec3;

use super::fresnel::{
    RelativeIndex, fresnel_dielectric, normal_reflectance, relative_index, schlick,
};
use super::ggx::{DELTA_ALPHA, MIN_COS, transmits_unblurred};
use super::surface::Surface;
use crate::packed::MATERIAL_THIN_WALLED;
use crate::shared::shared;

shared! {
    /// Albedos up to this count as none: their reciprocal would overflow.
    pub const NO_ALBEDO: f32 = 1e-30;

    /// Share of light that an interface facet reflects and lets through.
    #[derive(Clone, Copy, Debug)]
    pub value struct Interface {
        pub reflected: Vec3,
        pub transmitted: Vec3,
        /// max(reflected) / (max(reflected) + max(transmitted)): the probability of reflection.
        pub reflect_probability: f32,
        /// 1 - reflect_probability, without cancellation.
        pub transmit_probability: f32,
        /// max(reflected) + max(transmitted).
        pub total: f32,
    }
}

pub fn max3(v: Vec3) -> f32 {
    v.x.max(v.y).max(v.z)
}

pub fn thin_walled(s: &Surface) -> bool {
    s.flags & MATERIAL_THIN_WALLED != 0
}

pub fn surface_index(s: &Surface) -> RelativeIndex {
    relative_index(s.ior, s.front || thin_walled(s))
}

pub fn reflects_delta(s: &Surface) -> bool {
    s.ggx_alpha < DELTA_ALPHA
}

pub fn transmits_delta(s: &Surface) -> bool {
    reflects_delta(s) || (!thin_walled(s) && transmits_unblurred(s.ggx_alpha, s.ior))
}

pub fn cos_to(normal: Vec3, wo: Vec3) -> f32 {
    normal.dot(wo).clamp(MIN_COS, 1.0)
}

/// Reflectance of the dielectric at normal incidence, per channel.
fn dielectric_f0(s: &Surface) -> Vec3 {
    (s.specular_color * normal_reflectance(s.ior)).min(Vec3::ONE)
}

/// Schlick reflectance of the opaque dielectric (KHR_materials_specular).
pub fn opaque_fresnel(s: &Surface, cos: f32) -> Vec3 {
    schlick(dielectric_f0(s), cos) * s.specular
}

/// Reflectance of the transmitting dielectric: the exact one, rescaled where KHR_materials_specular changes its ends.
fn transmitting_fresnel(s: &Surface, cos: f32) -> Vec3 {
    let exact = fresnel_dielectric(cos, surface_index(s));
    if exact.total {
        return Vec3::ONE;
    }
    let f0 = normal_reflectance(s.ior);
    let rise = ((exact.reflectance - f0) / (1.0 - f0).max(1e-6)).clamp(-1.0, 1.0);
    let low = dielectric_f0(s);
    let f = ((low + (Vec3::ONE - low) * rise) * s.specular).clamp(Vec3::ZERO, Vec3::ONE);
    if thin_walled(s) {
        f * 2.0 / (Vec3::ONE + f)
    } else {
        f
    }
}

pub fn interface_at(s: &Surface, cos: f32) -> Interface {
    let dielectric = 1.0 - s.metallic;
    let metal = schlick(s.base_color, cos) * (Vec3::ONE + s.base_color * s.metal_gain);
    let mut reflected =
        metal * s.metallic + opaque_fresnel(s, cos) * (dielectric * (1.0 - s.transmission));
    let mut transmitted = Vec3::ZERO;
    if s.transmission > 0.0 {
        let share = dielectric * s.transmission * s.glass_gain;
        let f = transmitting_fresnel(s, cos);
        reflected += f * share;
        transmitted = s.base_color * (share * (1.0 - max3(f)));
    }
    let total = max3(reflected) + max3(transmitted);
    let inv = if total > NO_ALBEDO { 1.0 / total } else { 0.0 };
    Interface {
        reflected,
        transmitted,
        reflect_probability: max3(reflected) * inv,
        transmit_probability: max3(transmitted) * inv,
        total,
    }
}

/// What the interface reflects at grazing incidence.
pub fn grazing_albedo(s: &Surface) -> f32 {
    let dielectric = 1.0 - s.metallic;
    s.metallic + dielectric * (s.specular * (1.0 - s.transmission) + s.transmission)
}
