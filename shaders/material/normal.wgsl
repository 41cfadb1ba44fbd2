// Twin of src/material/normal.rs: the same operations in the same order.

import package::math::{cross3, dot3};

fn unit(v: vec3<f32>) -> vec3<f32> {
    let length2 = dot3(v, v);
    if length2 > 1e-36 && length2 < 1e36 {
        return v * (1.0 / sqrt(length2));
    }
    return vec3<f32>(0.0, 0.0, 1.0);
}

fn tangent_from_uv(e1: vec3<f32>, e2: vec3<f32>, d1: vec2<f32>, d2: vec2<f32>, normal: vec3<f32>) -> vec4<f32> {
    let det = d1.x * d2.y - d2.x * d1.y;
    let along_u = (e1 * d2.y - e2 * d1.y) * det;
    let along_v = (e2 * d1.x - e1 * d2.x) * det;
    if dot3(along_u, along_u) <= 0.0 {
        return vec4<f32>(0.0);
    }
    let handedness = select(1.0, -1.0, dot3(cross3(normal, along_u), along_v) > 0.0);
    return vec4<f32>(unit(along_u), handedness);
}

fn mapped_normal(normal: vec3<f32>, tangent: vec4<f32>, texel: vec3<f32>, scale: f32) -> vec3<f32> {
    if tangent.w == 0.0 {
        return normal;
    }
    let t_raw = tangent.xyz;
    let t_flat = t_raw - normal * dot3(normal, t_raw);
    if dot3(t_flat, t_flat) <= 1e-12 {
        return normal;
    }
    let t = unit(t_flat);
    let b = cross3(normal, t) * tangent.w;
    let x = (2.0 * texel.x - 1.0) * scale;
    let y = (2.0 * texel.y - 1.0) * scale;
    let z = 2.0 * texel.z - 1.0;
    let mapped = t * x + b * y + normal * z;
    if dot3(mapped, mapped) > 1e-12 {
        return unit(mapped);
    }
    return normal;
}

fn valid_shading_normal(ng: vec3<f32>, ns: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let wo_z = dot3(wo, ng);
    if wo_z <= 0.0 {
        return ng;
    }
    let threshold = min(0.9 * wo_z, 0.01);
    let wo_n = dot3(wo, ns);
    let mirror_z = 2.0 * wo_n * dot3(ns, ng) - wo_z;
    if wo_n > 0.0 && mirror_z >= threshold {
        return ns;
    }
    let across = ns - ng * dot3(ns, ng);
    if dot3(across, across) <= 1e-12 {
        return ng;
    }
    let x = unit(across);
    let wo_x = dot3(wo, x);
    let r2 = wo_x * wo_x + wo_z * wo_z;
    let rest = sqrt(max(r2 - threshold * threshold, 0.0));
    let sin_2phi = (wo_x * threshold + wo_z * rest) / r2;
    let cos_2phi = (wo_z * threshold - wo_x * rest) / r2;
    let corrected = x * max(sin_2phi, 0.0) + ng * (1.0 + cos_2phi);
    if dot3(corrected, corrected) <= 1e-6 {
        return ng;
    }
    let n = unit(corrected);
    return select(ng, n, dot3(n, wo) > 0.0);
}
