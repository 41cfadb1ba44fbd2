//! Isotropic GGX with the separable Smith masking of glTF 2.0, appendix B (Walter et al. 2007).
//!
//! Everything works on world-space vectors and a unit normal. With L(c) = c + sqrt(alpha^2 + (1 - alpha^2) c^2) Smith's masking is
//! G1(c) = 2c / L(c), so that G1(c) / c = 2 / L(c) never divides by a small cosine.

use glam::Vec3;

use crate::math::{INV_PI, orthonormal_basis, sincos_2pi};
use crate::shared::shared;

use super::normal::unit;

shared! {
    /// GGX alpha under which a lobe counts as perfectly smooth: roughness 0.0316, a blur of a tenth of a degree.
    pub const DELTA_ALPHA: f32 = 1e-3;
    /// A rough interface bends light by about alpha * |ior - 1|; below this the bend is lost in f32 and light goes through unblurred.
    const DELTA_BEND: f32 = 1e-4;
    /// Cosines between `wo` and the normal are taken as no smaller than this.
    pub const MIN_COS: f32 = 1e-7;

    /// A reflection or transmission without its Fresnel factor.
    #[derive(Clone, Copy, Debug)]
    pub value struct GgxEval {
        /// BSDF times |cos| of `wi`, Fresnel factor left out.
        pub f_cos: f32,
        /// Solid-angle density of `ggx_sample_half` followed by reflection or refraction.
        pub pdf: f32,
        /// Cosine between `wo` and the half vector.
        pub cos_half: f32,
    }
}

/// Whether the interface of a volume with that index, of a GGX alpha, lets light through unblurred.
pub fn transmits_unblurred(alpha: f32, ior: f32) -> bool {
    alpha < DELTA_ALPHA || alpha * (ior - 1.0).abs() < DELTA_BEND
}

/// L(c) above, for c >= 0.
pub fn smith_l(alpha: f32, c: f32) -> f32 {
    let a2 = alpha * alpha;
    c + (a2 + (1.0 - a2) * c * c).sqrt()
}

/// Normal distribution at the direction of `sum`, which need not be unit. The sine is taken from the component across the normal:
/// 1 - cos^2 would lose it for smooth surfaces.
pub fn ggx_d(alpha: f32, normal: Vec3, sum: Vec3) -> f32 {
    let z = sum.dot(normal);
    let across = sum - normal * z;
    let a2 = alpha * alpha;
    let t = (across.dot(across) / a2 + z * z) / sum.dot(sum);
    INV_PI / (a2 * t * t)
}

const NOTHING: GgxEval = GgxEval {
    f_cos: 0.0,
    pdf: 0.0,
    cos_half: 1.0,
};

/// Reflection from `wo` to `wi`; nothing where `wi` is not above the normal's plane.
pub fn ggx_reflect(alpha: f32, normal: Vec3, wo: Vec3, wi: Vec3) -> GgxEval {
    let ni = normal.dot(wi);
    let sum = wo + wi;
    let length2 = sum.dot(sum);
    if ni <= 0.0 || length2 < 1e-13 {
        return NOTHING;
    }
    let no = normal.dot(wo).max(MIN_COS);
    let d = ggx_d(alpha, normal, sum);
    let lo = smith_l(alpha, no);
    let li = smith_l(alpha, ni);
    GgxEval {
        f_cos: d * ni / (lo * li),
        pdf: d / (2.0 * lo),
        cos_half: 0.5 * length2.sqrt(),
    }
}

/// Refraction from `wo` to `wi` on the other side, `eta` as in [`super::fresnel::RelativeIndex`].
///
/// This is Walter's BTDF (2007, eq. 21) without the factor 1/eta^2 by which radiance is compressed: what is carried along a path is
/// radiance over index squared, which only surfaces change, so a path that enters and leaves glass needs no correction.
pub fn ggx_refract(alpha: f32, normal: Vec3, wo: Vec3, wi: Vec3, eta: f32) -> GgxEval {
    let ni = -normal.dot(wi);
    let across = wo + wi * eta;
    let length2 = across.dot(across);
    if ni <= 0.0 || length2 < 1e-13 {
        return NOTHING;
    }
    let sum = if across.dot(normal) < 0.0 {
        -across
    } else {
        across
    };
    let inv_length = 1.0 / length2.sqrt();
    let oh = wo.dot(sum) * inv_length;
    let ih = -wi.dot(sum) * inv_length;
    if oh <= 0.0 || ih <= 0.0 {
        return NOTHING;
    }
    let no = normal.dot(wo).max(MIN_COS);
    let d = ggx_d(alpha, normal, sum);
    let lo = smith_l(alpha, no);
    let li = smith_l(alpha, ni);
    let pdf = 2.0 * d * oh * ih * eta * eta / (lo * length2);
    GgxEval {
        f_cos: pdf * 2.0 * ni / li,
        pdf,
        cos_half: oh.min(1.0),
    }
}

/// A half vector from the distribution of normals visible from `wo` (spherical caps, Dupuy and Benyoub 2023).
pub fn ggx_sample_half(alpha: f32, normal: Vec3, wo: Vec3, u0: f32, u1: f32) -> Vec3 {
    let (tangent, bitangent) = orthonormal_basis(normal);
    let z = normal.dot(wo).max(MIN_COS);
    let stretched = unit(Vec3::new(
        alpha * tangent.dot(wo),
        alpha * bitangent.dot(wo),
        z,
    ));
    let (sin_phi, cos_phi) = sincos_2pi(u0);
    // 1 - cos of the cap direction, so that its sine keeps precision near the pole.
    let one_minus = u1 * (1.0 + stretched.z);
    let sin = (one_minus * (2.0 - one_minus)).max(0.0).sqrt();
    let h = Vec3::new(
        alpha * (sin * cos_phi + stretched.x),
        alpha * (sin * sin_phi + stretched.y),
        (1.0 - one_minus + stretched.z).max(0.0),
    );
    unit(tangent * h.x + bitangent * h.y + normal * h.z)
}
