//! Fresnel reflectances: Schlick's for opaque surfaces, the exact one for surfaces that transmit.

use crate::shared::shared;
use glam::Vec3;

shared! {
    /// The ratio of the two indices that meet at an interface.
    #[derive(Clone, Copy, Debug)]
    pub value struct RelativeIndex {
        /// Index beyond the interface over the index on the side of `wo`.
        pub eta: f32,
        /// eta^2 - 1, computed without cancellation so that indices near 1 keep their reflectance.
        pub eta2_minus_1: f32,
    }

    #[derive(Clone, Copy, Debug)]
    pub value struct DielectricFresnel {
        /// Unpolarised reflectance, 1 under total internal reflection.
        pub reflectance: f32,
        /// eta times the cosine of the refracted direction; 0 under total internal reflection.
        pub g: f32,
        pub total: bool,
    }
}

/// Schlick's approximation (1994): `f0` at normal incidence, 1 at grazing. `cos` is clamped to 0..1.
pub fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    let m = 1.0 - cos.clamp(0.0, 1.0);
    let m2 = m * m;
    let m5 = m2 * m2 * m;
    f0 + (Vec3::ONE - f0) * m5
}

/// Reflectance at normal incidence between air and a medium of index `ior`; 1 for glTF's special index 0.
pub fn normal_reflectance(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// `entering`: `wo` is outside, in air. Indices below 0.001 are taken as 0.001.
pub fn relative_index(ior: f32, entering: bool) -> RelativeIndex {
    let n = ior.max(1e-3);
    let n2_minus_1 = (n - 1.0) * (n + 1.0);
    if entering {
        RelativeIndex {
            eta: n,
            eta2_minus_1: n2_minus_1,
        }
    } else {
        RelativeIndex {
            eta: 1.0 / n,
            eta2_minus_1: -n2_minus_1 / (n * n),
        }
    }
}

/// Exact unpolarised reflectance at `cos` >= 0 on the side of `wo`, in the form of Cook and Torrance (1982) with the difference
/// g - c written as eta2_minus_1 / (g + c): relative accuracy holds down to indices of 1.0001 and the result is exactly 0 at 1.
pub fn fresnel_dielectric(cos: f32, index: RelativeIndex) -> DielectricFresnel {
    let c = cos.clamp(0.0, 1.0);
    if index.eta2_minus_1 == 0.0 {
        return DielectricFresnel {
            reflectance: 0.0,
            g: c,
            total: false,
        };
    }
    let g2 = index.eta2_minus_1 + c * c;
    if g2 <= 0.0 {
        return DielectricFresnel {
            reflectance: 1.0,
            g: 0.0,
            total: true,
        };
    }
    let g = g2.sqrt();
    let sum = c + g;
    let rs = index.eta2_minus_1 / (sum * sum);
    let sin2 = (1.0 - c) * (1.0 + c);
    let ratio = (c * g - sin2) / (c * g + sin2);
    DielectricFresnel {
        reflectance: (0.5 * rs * rs * (1.0 + ratio * ratio)).min(1.0),
        g,
        total: false,
    }
}

/// Direction of `wo` refracted at a facet of normal `h` (unit, dot(wo, h) = `cos` >= 0), not under total internal reflection.
pub fn refract_about(wo: Vec3, h: Vec3, cos: f32, index: RelativeIndex, g: f32) -> Vec3 {
    if index.eta2_minus_1 == 0.0 {
        return -wo;
    }
    let c_minus_g = -index.eta2_minus_1 / (cos + g);
    (h * c_minus_g - wo) * (1.0 / index.eta)
}
