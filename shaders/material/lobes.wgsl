// Twin of src/material/lobes.rs: the same operations in the same order.

import package::material::fresnel::{fresnel_dielectric, refract_about, schlick};
import package::material::ggx::{DELTA_ALPHA, ggx_reflect, ggx_refract, ggx_sample_half, GgxEval};
import package::material::interface::{
    Interface, NO_ALBEDO, cos_to, grazing_albedo, interface_at, max3, opaque_fresnel, reflects_delta, surface_index,
    thin_walled, transmits_delta,
};
import package::material::scatter::{
    BsdfEval, BsdfSample, EVAL_NOTHING, SAMPLE_NOTHING, delta_sample, kept_at_terminator, lambert_cos, mirrored_at, on_side, reflected_about,
    sample_lambert,
};
import package::math::{INV_PI, dot3};
import package::material::normal::unit;
import package::material::surface::Surface;

struct Lobes {
    coat: f32,
    interface_: Interface,
    interface_albedo: f32,
    sum: f32,
    p_diffuse: f32,
    p_interface: f32,
    p_coat: f32,
}

fn coat_delta(s: Surface) -> bool {
    return s.coat_alpha < DELTA_ALPHA;
}

fn diffuse_color(s: Surface) -> vec3<f32> {
    return s.base_color * ((1.0 - s.metallic) * (1.0 - s.transmission));
}

fn diffuse_albedo(s: Surface, cos: f32) -> vec3<f32> {
    let f = opaque_fresnel(s, sqrt(0.5 + 0.5 * cos));
    return diffuse_color(s) * (1.0 - max3(f));
}

fn coat_share(s: Surface, wo: vec3<f32>) -> f32 {
    @if(clearcoat) {
        if s.clearcoat > 0.0 {
            return s.clearcoat * schlick(vec3<f32>(COAT_F0), cos_to(s.coat_ns, wo)).x;
        }
    }
    return 0.0;
}

fn lobes_at(s: Surface, wo: vec3<f32>) -> Lobes {
    let cos = cos_to(s.ns, wo);
    let coat = coat_share(s, wo);
    let at_normal = interface_at(s, cos);
    let under = 1.0 - coat;
    let diffuse = under * max3(diffuse_albedo(s, cos));
    var interface_albedo = at_normal.total;
    if !reflects_delta(s) {
        interface_albedo = at_normal.total + (0.01 + 0.05 * s.ggx_alpha) * grazing_albedo(s);
    }
    let specular = under * interface_albedo;
    let sum = coat + diffuse + specular;
    var inv = 0.0;
    if sum > NO_ALBEDO {
        inv = 1.0 / sum;
    }
    return Lobes(coat, at_normal, interface_albedo, sum, diffuse * inv, specular * inv, coat * inv);
}

fn lobes_eval(s: Surface, wo: vec3<f32>, wi: vec3<f32>) -> BsdfEval {
    return eval_with(s, lobes_at(s, wo), wo, wi);
}

fn eval_with(s: Surface, lobes: Lobes, wo: vec3<f32>, wi: vec3<f32>) -> BsdfEval {
    if dot3(s.ng, wi) > 0.0 {
        return eval_reflection(s, lobes, wo, wi);
    }
    @if(transmission) {
        if s.transmission > 0.0 && !transmits_delta(s) && dot3(s.ng, wi) < 0.0 {
            return eval_transmission(s, lobes, wo, wi);
        }
    }
    return EVAL_NOTHING;
}

fn eval_reflection(s: Surface, lobes: Lobes, wo: vec3<f32>, wi: vec3<f32>) -> BsdfEval {
    var f_cos = vec3<f32>(0.0);
    var pdf = 0.0;
    let under = 1.0 - lobes.coat;
    if lobes.p_diffuse > 0.0 {
        let sum = wo + wi;
        let cos_half = 0.5 * sqrt(dot3(sum, sum));
        let cosine = lambert_cos(s.ng, s.ns, wi) * INV_PI;
        let passed = 1.0 - max3(opaque_fresnel(s, cos_half));
        let kept = kept_at_terminator(s, wi);
        f_cos += diffuse_color(s) * (under * passed * cosine * kept);
        pdf += lobes.p_diffuse * cosine;
    }
    if lobes.p_interface > 0.0 && !reflects_delta(s) {
        let g = ggx_reflect(s.ggx_alpha, s.ns, wo, wi);
        let facet = interface_at(s, g.cos_half);
        let chosen = select(facet.reflect_probability, lobes.interface_.reflect_probability, transmits_delta(s));
        f_cos += facet.reflected * (under * g.f_cos);
        pdf += lobes.p_interface * chosen * g.pdf;
    }
    @if(clearcoat) {
        if lobes.p_coat > 0.0 && !coat_delta(s) {
            let g = ggx_reflect(s.coat_alpha, s.coat_ns, wo, wi);
            f_cos += vec3<f32>(lobes.coat * g.f_cos);
            pdf += lobes.p_coat * g.pdf;
        }
    }
    return BsdfEval(f_cos, pdf);
}

fn eval_transmission(s: Surface, lobes: Lobes, wo: vec3<f32>, wi: vec3<f32>) -> BsdfEval {
    var g: GgxEval;
    if thin_walled(s) {
        g = ggx_reflect(s.ggx_alpha, s.ns, wo, mirrored_at(s.ns, wi));
    } else {
        g = ggx_refract(s.ggx_alpha, s.ns, wo, wi, surface_index(s).eta);
    }
    let facet = interface_at(s, g.cos_half);
    return BsdfEval(
        facet.transmitted * ((1.0 - lobes.coat) * g.f_cos),
        lobes.p_interface * facet.transmit_probability * g.pdf,
    );
}

fn mixture_sample(s: Surface, lobes: Lobes, wo: vec3<f32>, wi: vec3<f32>) -> BsdfSample {
    let eval = eval_with(s, lobes, wo, wi);
    if eval.pdf <= 0.0 {
        return SAMPLE_NOTHING;
    }
    return BsdfSample(wi, eval.f_cos * (1.0 / eval.pdf), eval.pdf, false, dot3(s.ng, wi) < 0.0, true);
}

fn lobes_sample(s: Surface, wo: vec3<f32>, u: vec3<f32>) -> BsdfSample {
    let lobes = lobes_at(s, wo);
    if lobes.sum <= NO_ALBEDO {
        return SAMPLE_NOTHING;
    }
    if u.x < lobes.p_diffuse {
        let wi = sample_lambert(s, u.y, u.z);
        if dot3(s.ng, wi) > 0.0 { return mixture_sample(s, lobes, wo, wi); }
        return SAMPLE_NOTHING;
    }
    let rest = u.x - lobes.p_diffuse;
    @if(clearcoat) {
        if !(rest < lobes.p_interface || lobes.p_coat == 0.0) {
            return sample_coat(s, lobes, wo, u);
        }
    }
    let choice = min(rest / max(lobes.p_interface, 1e-20), LARGEST_BELOW_1);
    return sample_interface(s, lobes, wo, choice, u);
}

fn sample_coat(s: Surface, lobes: Lobes, wo: vec3<f32>, u: vec3<f32>) -> BsdfSample {
    if coat_delta(s) {
        let wi = on_side(s.ng, 1.0, reflected_about(s.coat_ns, wo));
        return delta_sample(wi, vec3<f32>(lobes.sum), false);
    }
    let h = ggx_sample_half(s.coat_alpha, s.coat_ns, wo, u.y, u.z);
    let mirror = unit(reflected_about(h, wo));
    if dot3(s.coat_ns, mirror) > 0.0 && dot3(s.ng, mirror) > 0.0 {
        return mixture_sample(s, lobes, wo, mirror);
    }
    return SAMPLE_NOTHING;
}

fn sample_interface(s: Surface, lobes: Lobes, wo: vec3<f32>, choice: f32, u: vec3<f32>) -> BsdfSample {
    let at_normal = lobes.interface_;
    if reflects_delta(s) || transmits_delta(s) {
        let reflects = choice < at_normal.reflect_probability;
        @if(transmission) {
            if !reflects {
                let tint = at_normal.transmitted / max(max3(at_normal.transmitted), NO_ALBEDO);
                let scale = at_normal.total / lobes.interface_albedo * lobes.sum;
                return delta_sample(transmit_straight(s, wo), tint * scale, true);
            }
        }
        if reflects_delta(s) {
            let tint = at_normal.reflected / max(max3(at_normal.reflected), NO_ALBEDO);
            let wi = on_side(s.ng, 1.0, reflected_about(s.ns, wo));
            return delta_sample(wi, tint * lobes.sum, false);
        }
    }
    let h = ggx_sample_half(s.ggx_alpha, s.ns, wo, u.y, u.z);
    let cos_half = dot3(wo, h);
    if cos_half <= 0.0 {
        return SAMPLE_NOTHING;
    }
    let mirror = unit(reflected_about(h, wo));
    var reflects = true;
    @if(transmission) {
        reflects = transmits_delta(s) || choice < interface_at(s, cos_half).reflect_probability;
    }
    if reflects {
        if dot3(s.ns, mirror) > 0.0 && dot3(s.ng, mirror) > 0.0 {
            return mixture_sample(s, lobes, wo, mirror);
        }
        return SAMPLE_NOTHING;
    }
    @if(transmission) {
        var through: vec3<f32>;
        if thin_walled(s) {
            through = mirrored_at(s.ns, mirror);
        } else {
            let index = surface_index(s);
            through = unit(refract_about(wo, h, cos_half, index, fresnel_dielectric(cos_half, index).g));
        }
        if dot3(s.ns, through) < 0.0 && dot3(s.ng, through) < 0.0 {
            return mixture_sample(s, lobes, wo, through);
        }
    }
    return SAMPLE_NOTHING;
}

fn transmit_straight(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let index = surface_index(s);
    if thin_walled(s) || index.eta2_minus_1 == 0.0 {
        return -wo;
    }
    let cos = cos_to(s.ns, wo);
    let wi = refract_about(wo, s.ns, cos, index, fresnel_dielectric(cos, index).g);
    return on_side(s.ng, -1.0, unit(wi));
}

fn lobes_are_polished(s: Surface) -> bool {
    return lobes_are_below(s, POLISHED_ALPHA);
}

fn lobes_are_glossy(s: Surface) -> bool {
    return lobes_are_below(s, GLOSSY_ALPHA);
}

fn lobes_are_below(s: Surface, alpha: f32) -> bool {
    return max3(diffuse_color(s)) == 0.0
        && s.ggx_alpha < alpha
        && (s.clearcoat == 0.0 || s.coat_alpha < alpha);
}

fn lobes_are_diffuse(s: Surface) -> bool {
    return max3(diffuse_color(s)) > 0.0;
}

fn lobes_are_delta(s: Surface) -> bool {
    return max3(diffuse_color(s)) == 0.0 && reflects_delta(s) && (s.clearcoat == 0.0 || coat_delta(s));
}

fn lobes_straight(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    if !transmits_delta(s) {
        return vec3<f32>(0.0);
    }
    return interface_at(s, cos_to(s.ns, wo)).transmitted * (1.0 - coat_share(s, wo));
}

fn lobes_albedo(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let lobes = lobes_at(s, wo);
    let under = lobes.interface_.reflected + lobes.interface_.transmitted
        + diffuse_albedo(s, cos_to(s.ns, wo));
    return min(under * (1.0 - lobes.coat) + vec3<f32>(lobes.coat), vec3<f32>(1.0));
}

fn lobes_bound(s: Surface) -> f32 {
    let under = max3(diffuse_color(s)) + grazing_albedo(s);
    return select(under, max(under, 1.0), s.clearcoat > 0.0);
}
