//! Scattering at a [`Surface`], whatever it is: nothing, Lambert's law, or the lobes of the glTF material.

use glam::Vec3;

use super::interface::{max3, surface_index, thin_walled};
use super::lobes::{
    lobes_albedo, lobes_are_delta, lobes_are_diffuse, lobes_are_glossy, lobes_are_polished,
    lobes_bound, lobes_eval, lobes_sample, lobes_straight,
};
use super::scatter::{
    BsdfEval, BsdfSample, EVAL_NOTHING, SAMPLE_NOTHING, kept_at_terminator, lambert_cos,
    sample_lambert,
};
use super::surface::Surface;
use crate::math::INV_PI;
use crate::packed::{MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_UNLIT};

fn scatters_nothing(s: &Surface) -> bool {
    s.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT) != 0
}

/// Scattering from `wi` to `wo` (unit, both pointing away from the surface, `wo` on the side of `ng`) by the non-delta lobes.
pub fn bsdf_eval(s: &Surface, wo: Vec3, wi: Vec3) -> BsdfEval {
    if scatters_nothing(s) {
        return EVAL_NOTHING;
    }
    if bsdf_is_lambertian(s) {
        let pdf = lambert_cos(s.ng, s.ns, wi) * INV_PI;
        return BsdfEval {
            f_cos: s.base_color * (pdf * kept_at_terminator(s, wi)),
            pdf,
        };
    }
    lobes_eval(s, wo, wi)
}

/// Draws a direction: `u[0]` chooses the lobe (and reflection or refraction), `u[1]`, `u[2]` the direction in it.
pub fn bsdf_sample(s: &Surface, wo: Vec3, u: [f32; 3]) -> BsdfSample {
    if scatters_nothing(s) {
        return SAMPLE_NOTHING;
    }
    if !bsdf_is_lambertian(s) {
        return lobes_sample(s, wo, u);
    }
    let wi = sample_lambert(s, u[1], u[2]);
    let pdf = lambert_cos(s.ng, s.ns, wi) * INV_PI;
    if pdf <= 0.0 {
        return SAMPLE_NOTHING;
    }
    BsdfSample {
        wi,
        weight: s.base_color * kept_at_terminator(s, wi),
        pdf,
        delta: false,
        transmitted: false,
        valid: true,
    }
}

/// Nothing but delta lobes (or nothing at all): no direction to a light can be worth a shadow ray.
pub fn bsdf_is_delta(s: &Surface) -> bool {
    if scatters_nothing(s) {
        return true;
    }
    if bsdf_is_lambertian(s) {
        return false;
    }
    lobes_are_delta(s)
}

/// Some of the light that it scatters goes everywhere.
pub fn bsdf_is_diffuse(s: &Surface) -> bool {
    bsdf_is_lambertian(s) || lobes_are_diffuse(s)
}

/// Nothing but lobes that mirror or bend light with little blur: photons that land there are not seen well.
pub fn bsdf_is_polished(s: &Surface) -> bool {
    !scatters_nothing(s) && !bsdf_is_lambertian(s) && lobes_are_polished(s)
}

/// The same with some blur: light that comes by way of it is found better by photons.
pub fn bsdf_is_glossy(s: &Surface) -> bool {
    !scatters_nothing(s) && !bsdf_is_lambertian(s) && lobes_are_glossy(s)
}

/// What a smooth interface lets through goes straight on: it bends nothing.
pub fn bsdf_passes_straight(s: &Surface) -> bool {
    thin_walled(s) || surface_index(s).eta2_minus_1 == 0.0
}

/// Share of the light from straight behind that comes through unbent and unblurred.
pub fn bsdf_straight(s: &Surface, wo: Vec3) -> Vec3 {
    if scatters_nothing(s) || bsdf_is_lambertian(s) || !bsdf_passes_straight(s) {
        return Vec3::ZERO;
    }
    lobes_straight(s, wo)
}

/// Index of the volume beyond the surface over that on the side of the ray.
pub fn bsdf_index_ratio(s: &Surface) -> f32 {
    if thin_walled(s) {
        1.0
    } else {
        surface_index(s).eta
    }
}

/// f = base colour / pi, whatever the directions.
pub fn bsdf_is_lambertian(s: &Surface) -> bool {
    s.flags & MATERIAL_LAMBERTIAN != 0
}

/// Approximate share of light from everywhere that leaves towards `wo`, transmission included: exact for Lambertian and smooth
/// surfaces, elsewhere good enough for roulette and the albedo plane.
pub fn bsdf_albedo(s: &Surface, wo: Vec3) -> Vec3 {
    if scatters_nothing(s) {
        return Vec3::ZERO;
    }
    if bsdf_is_lambertian(s) {
        return s.base_color;
    }
    lobes_albedo(s, wo)
}

/// Bound on the share of light that any channel sends in any direction. It may exceed 1: see the note on energy in `lobes`.
pub fn bsdf_directional_albedo_bound(s: &Surface) -> f32 {
    if scatters_nothing(s) {
        return 0.0;
    }
    if bsdf_is_lambertian(s) {
        return max3(s.base_color);
    }
    lobes_bound(s)
}
