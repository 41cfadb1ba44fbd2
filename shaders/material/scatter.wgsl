// Twin of src/material/scatter.rs: the same operations in the same order.

import package::math::{dot3, orthonormal_basis, sincos_2pi};
import package::packed::records::MATERIAL_NORMAL_MAPPED;
import package::material::normal::unit;
import package::material::surface::Surface;

const EVAL_NOTHING = BsdfEval(vec3<f32>(0.0, 0.0, 0.0), 0.0);

const SAMPLE_NOTHING = BsdfSample(vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(0.0, 0.0, 0.0), 0.0, false, false, false);

fn mirrored_at(normal: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    return v - normal * (2.0 * dot3(v, normal));
}

fn reflected_about(h: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    return h * (2.0 * dot3(wo, h)) - wo;
}

fn on_side(ng: vec3<f32>, side: f32, w: vec3<f32>) -> vec3<f32> {
    let height = side * dot3(ng, w);
    if height > 0.0 {
        return w;
    }
    return unit(w + ng * (side * (GRAZING_LIFT - height)));
}

fn delta_sample(wi: vec3<f32>, weight: vec3<f32>, transmitted: bool) -> BsdfSample {
    return BsdfSample(wi, weight, 0.0, true, transmitted, true);
}

fn lambert_cos(ng: vec3<f32>, ns: vec3<f32>, wi: vec3<f32>) -> f32 {
    if dot3(ng, wi) <= 0.0 {
        return 0.0;
    }
    return max(dot3(ns, wi), 0.0);
}

fn terminator(ng: vec3<f32>, ns: vec3<f32>, wi: vec3<f32>) -> f32 {
    let of_facet = dot3(ng, wi);
    let end = FADE * dot3(ns, wi) * dot3(ng, ns);
    if of_facet <= 0.0 || end <= 0.0 {
        return 0.0;
    }
    if of_facet >= end {
        return 1.0;
    }
    let g = of_facet / end;
    return g * (1.0 + g - g * g);
}

fn kept_at_terminator(s: Surface, wi: vec3<f32>) -> f32 {
    if (s.flags & MATERIAL_NORMAL_MAPPED) != 0u {
        return 1.0;
    }
    return terminator(s.ng, s.ns, wi);
}

fn sample_lambert(s: Surface, u0: f32, u1: f32) -> vec3<f32> {
    let basis = orthonormal_basis(s.ns);
    let phi = sincos_2pi(u0);
    let radius = sqrt(u1);
    let z = sqrt(max(1.0 - u1, 0.0));
    return unit(basis.t * (radius * phi.cos) + basis.b * (radius * phi.sin) + s.ns * z);
}
