// Twin of src/material/scatter.rs: the same operations in the same order.

import package::math::{dot3, orthonormal_basis, sincos_2pi};
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

fn lambert_cos(s: Surface, wi: vec3<f32>) -> f32 {
    let height = dot3(s.ng, wi);
    if height <= 0.0 {
        return 0.0;
    }
    let direct = dot3(s.ns, wi);
    let mirrored = direct - 2.0 * height * dot3(s.ng, s.ns);
    return max(direct, 0.0) + max(mirrored, 0.0);
}

fn sample_lambert(s: Surface, u0: f32, u1: f32) -> vec3<f32> {
    let basis = orthonormal_basis(s.ns);
    let phi = sincos_2pi(u0);
    let radius = sqrt(u1);
    let z = sqrt(max(1.0 - u1, 0.0));
    let w = unit(basis.t * (radius * phi.cos) + basis.b * (radius * phi.sin) + s.ns * z);
    if dot3(s.ng, w) < 0.0 {
        return mirrored_at(s.ng, w);
    }
    return w;
}
