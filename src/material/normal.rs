//! Shading normals: normal maps, and the correction that keeps mirror directions above the surface.

use glam::{Vec2, Vec3, Vec4};

use crate::math::cross3;

/// `v` scaled to length 1; zero and non-finite vectors become +Z.
pub fn unit(v: Vec3) -> Vec3 {
    let length2 = v.dot(v);
    // Ordered comparisons: a NaN length takes the fallback too.
    if length2 > 1e-36 && length2 < 1e36 {
        v * (1.0 / length2.sqrt())
    } else {
        Vec3::Z
    }
}

/// Tangent along +u and the handedness of the bitangent, which runs along -v (glTF's v runs down, green runs up).
/// w is 0 where the triangle's texture coordinates span no area.
pub fn tangent_from_uv(e1: Vec3, e2: Vec3, d1: Vec2, d2: Vec2, normal: Vec3) -> Vec4 {
    let det = d1.x * d2.y - d2.x * d1.y;
    let along_u = (e1 * d2.y - e2 * d1.y) * det;
    let along_v = (e2 * d1.x - e1 * d2.x) * det;
    // Only directions count, so the determinant enters by its sign and size cancels in the normalisation.
    if along_u.dot(along_u) <= 0.0 {
        return Vec4::ZERO;
    }
    let handedness = if cross3(normal, along_u).dot(along_v) > 0.0 {
        -1.0
    } else {
        1.0
    };
    unit(along_u).extend(handedness)
}

/// The normal that a normal map's texel `sample` (0..1) describes about `normal`, with a tangent frame as in glTF.
/// A tangent with w = 0 leaves `normal` as it is.
pub fn mapped_normal(normal: Vec3, tangent: Vec4, sample: Vec3, scale: f32) -> Vec3 {
    if tangent.w == 0.0 {
        return normal;
    }
    let t_raw = tangent.truncate();
    let t_flat = t_raw - normal * normal.dot(t_raw);
    if t_flat.dot(t_flat) <= 1e-12 {
        return normal;
    }
    let t = unit(t_flat);
    let b = cross3(normal, t) * tangent.w;
    let x = (2.0 * sample.x - 1.0) * scale;
    let y = (2.0 * sample.y - 1.0) * scale;
    let z = 2.0 * sample.z - 1.0;
    let mapped = t * x + b * y + normal * z;
    if mapped.dot(mapped) > 1e-12 {
        unit(mapped)
    } else {
        normal
    }
}

/// `ns` turned towards `ng`, within their plane, just so far that the mirror direction of `wo` rises from the surface by the smaller of
/// 0.01 and nine tenths of `wo`'s own height. A normal that needs no correction is returned as it is.
///
/// With phi the angle of the normal from `ng` and psi that of `wo` in that plane, the mirror direction has the height
/// r cos(2 phi - psi); it is solved for phi by half-angle formulas that hold at grazing angles.
pub fn valid_shading_normal(ng: Vec3, ns: Vec3, wo: Vec3) -> Vec3 {
    let wo_z = wo.dot(ng);
    if wo_z <= 0.0 {
        return ng;
    }
    let threshold = (0.9 * wo_z).min(0.01);
    let wo_n = wo.dot(ns);
    let mirror_z = 2.0 * wo_n * ns.dot(ng) - wo_z;
    if wo_n > 0.0 && mirror_z >= threshold {
        return ns;
    }
    let across = ns - ng * ns.dot(ng);
    if across.dot(across) <= 1e-12 {
        return ng;
    }
    let x = unit(across);
    let wo_x = wo.dot(x);
    let r2 = wo_x * wo_x + wo_z * wo_z;
    let rest = (r2 - threshold * threshold).max(0.0).sqrt();
    let sin_2phi = (wo_x * threshold + wo_z * rest) / r2;
    let cos_2phi = (wo_z * threshold - wo_x * rest) / r2;
    let corrected = x * sin_2phi.max(0.0) + ng * (1.0 + cos_2phi);
    if corrected.dot(corrected) <= 1e-6 {
        return ng;
    }
    let n = unit(corrected);
    if n.dot(wo) > 0.0 { n } else { ng }
}
