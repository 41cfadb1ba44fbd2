//! The lobes of the glTF material at a [`Surface`]: what each reflects and lets through, and how likely it is to be chosen.

use glam::Vec3;

use crate::packed::{MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT};
use crate::shared::shared;

use super::fresnel::{
    RelativeIndex, fresnel_dielectric, normal_reflectance, relative_index, schlick,
};
use super::ggx::MIN_COS;
use super::surface::Surface;

shared! {
    /// GGX alpha under which a lobe counts as perfectly smooth: roughness 0.0316, a blur of a tenth of a degree.
    const DELTA_ALPHA: f32 = 1e-3;
    /// A rough interface bends light by about alpha * |ior - 1|; below this the bend is lost in f32 and light goes through unblurred.
    const DELTA_BEND: f32 = 1e-4;
    /// Reflectance of the clearcoat, index 1.5, at normal incidence.
    const COAT_F0: f32 = 0.04;
    /// Albedos up to this count as none: their reciprocal would overflow.
    pub const NO_ALBEDO: f32 = 1e-30;
}

/// Share of light that an interface facet reflects and lets through.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    pub reflected: Vec3,
    pub transmitted: Vec3,
    /// max(reflected) / (max(reflected) + max(transmitted)): the probability of reflection.
    pub reflect_probability: f32,
    /// 1 - reflect_probability, without cancellation.
    pub transmit_probability: f32,
    /// max(reflected) + max(transmitted).
    pub total: f32,
}

/// What lobe selection needs: approximate albedos, and the probabilities that follow from them.
#[derive(Clone, Copy, Debug)]
pub struct Lobes {
    /// Share that the coat reflects.
    pub coat: f32,
    /// The interface as it is at the shading normal.
    pub interface: Interface,
    /// What selection takes for the albedo of the interface.
    pub interface_albedo: f32,
    /// Sum of the approximate albedos.
    pub sum: f32,
    pub p_diffuse: f32,
    pub p_interface: f32,
    pub p_coat: f32,
}

pub fn max3(v: Vec3) -> f32 {
    v.x.max(v.y).max(v.z)
}

pub fn scatters_nothing(s: &Surface) -> bool {
    s.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT) != 0
}

pub fn thin_walled(s: &Surface) -> bool {
    s.flags & MATERIAL_THIN_WALLED != 0
}

pub fn surface_index(s: &Surface) -> RelativeIndex {
    relative_index(s.ior, s.front || thin_walled(s))
}

/// Whether a lobe of that GGX alpha counts as perfectly smooth.
pub fn is_smooth(alpha: f32) -> bool {
    alpha < DELTA_ALPHA
}

/// Whether the interface of a volume with that index, of a GGX alpha, lets light through unblurred.
pub fn transmits_unblurred(alpha: f32, ior: f32) -> bool {
    is_smooth(alpha) || alpha * (ior - 1.0).abs() < DELTA_BEND
}

pub fn reflects_delta(s: &Surface) -> bool {
    is_smooth(s.ggx_alpha)
}

pub fn transmits_delta(s: &Surface) -> bool {
    reflects_delta(s) || (!thin_walled(s) && transmits_unblurred(s.ggx_alpha, s.ior))
}

pub fn coat_delta(s: &Surface) -> bool {
    is_smooth(s.coat_alpha)
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
    let mut reflected = schlick(s.base_color, cos) * s.metallic
        + opaque_fresnel(s, cos) * (dielectric * (1.0 - s.transmission));
    let mut transmitted = Vec3::ZERO;
    if s.transmission > 0.0 {
        let share = dielectric * s.transmission;
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

/// Albedo of the diffuse lobe but for the interface above it.
pub fn diffuse_color(s: &Surface) -> Vec3 {
    s.base_color * ((1.0 - s.metallic) * (1.0 - s.transmission))
}

/// Approximate albedo of the diffuse lobe: the Fresnel factor is taken at the half vector towards the normal, as if that were where
/// light comes from, so that it stays in proportion at grazing angles.
pub fn diffuse_albedo(s: &Surface, cos: f32) -> Vec3 {
    let f = opaque_fresnel(s, (0.5 + 0.5 * cos).sqrt());
    diffuse_color(s) * (1.0 - max3(f))
}

fn coat_share(s: &Surface, wo: Vec3) -> f32 {
    if s.clearcoat > 0.0 {
        s.clearcoat * schlick(Vec3::splat(COAT_F0), cos_to(s.coat_ns, wo)).x
    } else {
        0.0
    }
}

pub fn lobes_at(s: &Surface, wo: Vec3) -> Lobes {
    let cos = cos_to(s.ns, wo);
    let coat = coat_share(s, wo);
    let interface = interface_at(s, cos);
    let under = 1.0 - coat;
    let diffuse = under * max3(diffuse_albedo(s, cos));
    // Facets seen at grazing angles reflect far more than the normal's: with this floor they stay bounded in weight.
    let interface_albedo = if reflects_delta(s) {
        interface.total
    } else {
        interface.total + (0.01 + 0.05 * s.ggx_alpha) * grazing_albedo(s)
    };
    let specular = under * interface_albedo;
    let sum = coat + diffuse + specular;
    let inv = if sum > NO_ALBEDO { 1.0 / sum } else { 0.0 };
    Lobes {
        coat,
        interface,
        interface_albedo,
        sum,
        p_diffuse: diffuse * inv,
        p_interface: specular * inv,
        p_coat: coat * inv,
    }
}

/// Cosine of Lambert's law for a shading normal that differs from the geometric one: directions of the shading hemisphere that lie
/// under the surface are mirrored up at it, so that no energy is lost and a white Lambertian mesh reflects all light.
pub fn lambert_cos(s: &Surface, wi: Vec3) -> f32 {
    let height = s.ng.dot(wi);
    if height <= 0.0 {
        return 0.0;
    }
    let direct = s.ns.dot(wi);
    let mirrored = direct - 2.0 * height * s.ng.dot(s.ns);
    direct.max(0.0) + mirrored.max(0.0)
}
