// Twin of src/material/ggx.rs: the same operations in the same order.

import package::math::{INV_PI, dot3, orthonormal_basis, sincos_2pi};
import package::material::normal::unit;

fn transmits_unblurred(alpha: f32, ior: f32) -> bool {
    return alpha < DELTA_ALPHA || alpha * abs(ior - 1.0) < DELTA_BEND;
}

fn smith_l(alpha: f32, c: f32) -> f32 {
    let a2 = alpha * alpha;
    return c + sqrt(a2 + (1.0 - a2) * c * c);
}

fn ggx_d(alpha: f32, normal: vec3<f32>, sum: vec3<f32>) -> f32 {
    let z = dot3(sum, normal);
    let across = sum - normal * z;
    let a2 = alpha * alpha;
    let t = (dot3(across, across) / a2 + z * z) / dot3(sum, sum);
    return INV_PI / (a2 * t * t);
}

const NOTHING = GgxEval(0.0, 0.0, 1.0);

fn ggx_reflect(alpha: f32, normal: vec3<f32>, wo: vec3<f32>, wi: vec3<f32>) -> GgxEval {
    let ni = dot3(normal, wi);
    let sum = wo + wi;
    let length2 = dot3(sum, sum);
    if ni <= 0.0 || length2 < 1e-13 {
        return NOTHING;
    }
    let no = max(dot3(normal, wo), MIN_COS);
    let d = ggx_d(alpha, normal, sum);
    let lo = smith_l(alpha, no);
    let li = smith_l(alpha, ni);
    return GgxEval(d * ni / (lo * li), d / (2.0 * lo), 0.5 * sqrt(length2));
}

fn ggx_refract(alpha: f32, normal: vec3<f32>, wo: vec3<f32>, wi: vec3<f32>, eta: f32) -> GgxEval {
    let ni = -dot3(normal, wi);
    let across = wo + wi * eta;
    let length2 = dot3(across, across);
    if ni <= 0.0 || length2 < 1e-13 {
        return NOTHING;
    }
    let sum = select(across, -across, dot3(across, normal) < 0.0);
    let inv_length = 1.0 / sqrt(length2);
    let oh = dot3(wo, sum) * inv_length;
    let ih = -dot3(wi, sum) * inv_length;
    if oh <= 0.0 || ih <= 0.0 {
        return NOTHING;
    }
    let no = max(dot3(normal, wo), MIN_COS);
    let d = ggx_d(alpha, normal, sum);
    let lo = smith_l(alpha, no);
    let li = smith_l(alpha, ni);
    let pdf = 2.0 * d * oh * ih * eta * eta / (lo * length2);
    return GgxEval(pdf * 2.0 * ni / li, pdf, min(oh, 1.0));
}

fn ggx_sample_half(alpha: f32, normal: vec3<f32>, wo: vec3<f32>, u0: f32, u1: f32) -> vec3<f32> {
    let basis = orthonormal_basis(normal);
    let z = max(dot3(normal, wo), MIN_COS);
    let stretched = unit(vec3<f32>(alpha * dot3(basis.t, wo), alpha * dot3(basis.b, wo), z));
    let phi = sincos_2pi(u0);
    let one_minus = u1 * (1.0 + stretched.z);
    let sine = sqrt(max(one_minus * (2.0 - one_minus), 0.0));
    let h = vec3<f32>(
        alpha * (sine * phi.cos + stretched.x),
        alpha * (sine * phi.sin + stretched.y),
        max(1.0 - one_minus + stretched.z, 0.0),
    );
    return unit(basis.t * h.x + basis.b * h.y + normal * h.z);
}
