// Twin of src/material/bsdf.rs: the same operations in the same order.

import package::packed::records::{MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_UNLIT};
import package::material::interface::{max3, surface_index, thin_walled};
import package::material::lobes::{lobes_albedo, lobes_are_delta, lobes_are_diffuse, lobes_are_glossy, lobes_are_polished, lobes_bound, lobes_eval, lobes_sample, lobes_straight};
import package::material::scatter::{BsdfEval, BsdfSample, EVAL_NOTHING, SAMPLE_NOTHING, kept_at_terminator, lambert_cos, sample_lambert};
import package::math::INV_PI;
import package::material::surface::Surface;

fn scatters_nothing(s: Surface) -> bool {
    return (s.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT)) != 0u;
}

fn bsdf_eval(s: Surface, wo: vec3<f32>, wi: vec3<f32>) -> BsdfEval {
    if scatters_nothing(s) {
        return EVAL_NOTHING;
    }
    @if(rough_specular) {
        if !bsdf_is_lambertian(s) {
            return lobes_eval(s, wo, wi);
        }
    }
    let pdf = lambert_cos(s.ng, s.ns, wi) * INV_PI;
    return BsdfEval(s.base_color * (pdf * kept_at_terminator(s, wi)), pdf);
}

fn bsdf_sample(s: Surface, wo: vec3<f32>, u: vec3<f32>) -> BsdfSample {
    if scatters_nothing(s) {
        return SAMPLE_NOTHING;
    }
    @if(rough_specular) {
        if !bsdf_is_lambertian(s) {
            return lobes_sample(s, wo, u);
        }
    }
    let wi = sample_lambert(s, u.y, u.z);
    let pdf = lambert_cos(s.ng, s.ns, wi) * INV_PI;
    if pdf <= 0.0 {
        return SAMPLE_NOTHING;
    }
    return BsdfSample(wi, s.base_color * kept_at_terminator(s, wi), pdf, false, false, true);
}

fn bsdf_is_delta(s: Surface) -> bool {
    if scatters_nothing(s) {
        return true;
    }
    if bsdf_is_lambertian(s) {
        return false;
    }
    return lobes_are_delta(s);
}

fn bsdf_is_diffuse(s: Surface) -> bool {
    return bsdf_is_lambertian(s) || lobes_are_diffuse(s);
}

fn bsdf_is_polished(s: Surface) -> bool {
    return !scatters_nothing(s) && !bsdf_is_lambertian(s) && lobes_are_polished(s);
}

fn bsdf_is_glossy(s: Surface) -> bool {
    return !scatters_nothing(s) && !bsdf_is_lambertian(s) && lobes_are_glossy(s);
}

fn bsdf_passes_straight(s: Surface) -> bool {
    return thin_walled(s) || surface_index(s).eta2_minus_1 == 0.0;
}

fn bsdf_straight(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    if scatters_nothing(s) || bsdf_is_lambertian(s) || !bsdf_passes_straight(s) {
        return vec3<f32>(0.0);
    }
    return lobes_straight(s, wo);
}

fn bsdf_index_ratio(s: Surface) -> f32 {
    if thin_walled(s) { return 1.0; }
    return surface_index(s).eta;
}

fn bsdf_is_lambertian(s: Surface) -> bool {
    return (s.flags & MATERIAL_LAMBERTIAN) != 0u;
}

fn bsdf_albedo(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    if scatters_nothing(s) {
        return vec3<f32>(0.0);
    }
    @if(rough_specular) {
        if !bsdf_is_lambertian(s) {
            return lobes_albedo(s, wo);
        }
    }
    return s.base_color;
}

fn bsdf_directional_albedo_bound(s: Surface) -> f32 {
    if scatters_nothing(s) {
        return 0.0;
    }
    if bsdf_is_lambertian(s) {
        return max3(s.base_color);
    }
    return lobes_bound(s);
}
