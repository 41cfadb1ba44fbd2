//! What scattering at a [`Surface`] gives, and the directions that it is made of.

use glam::Vec3;

use super::normal::unit;
use super::surface::Surface;
use crate::math::{orthonormal_basis, sincos_2pi};
use crate::packed::MATERIAL_NORMAL_MAPPED;
use crate::shared::shared;

shared! {
    /// A mirrored or refracted direction that rounding put on the wrong side of the surface is lifted to this height.
    const GRAZING_LIFT: f32 = 1e-4;
    /// Facets whose cosine is this much of the smooth surface's, or more, fade no light.
    const FADE: f32 = 0.5;

    /// Non-delta lobes for one pair of directions.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct BsdfEval {
        /// BSDF times |cos| of `wi`, 1/sr.
        pub f_cos: Vec3,
        /// Solid-angle density with which [`bsdf_sample`](super::bsdf_sample) draws `wi`; integrates to 1 less the probability of delta lobes and of
        /// samples that fall below the surface.
        pub pdf: f32,
    }

    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct BsdfSample {
        /// Unit.
        pub wi: Vec3,
        /// f cos / pdf of the whole non-delta mixture, or of the delta lobe over its selection probability.
        pub weight: Vec3,
        /// Solid angle; 0 if `delta`.
        pub pdf: f32,
        pub delta: bool,
        /// `wi` is on the other side of the surface.
        pub transmitted: bool,
        /// False: the path ends here.
        pub valid: bool,
    }
}

pub const EVAL_NOTHING: BsdfEval = BsdfEval {
    f_cos: Vec3::ZERO,
    pdf: 0.0,
};

pub const SAMPLE_NOTHING: BsdfSample = BsdfSample {
    wi: Vec3::Z,
    weight: Vec3::ZERO,
    pdf: 0.0,
    delta: false,
    transmitted: false,
    valid: false,
};

/// `v` mirrored at the plane of `normal`.
pub fn mirrored_at(normal: Vec3, v: Vec3) -> Vec3 {
    v - normal * (2.0 * v.dot(normal))
}

/// `wo` reflected about `h`.
pub fn reflected_about(h: Vec3, wo: Vec3) -> Vec3 {
    h * (2.0 * wo.dot(h)) - wo
}

/// `w`, lifted to the side of `ng` if `side` is 1, to the other if it is -1, where it is not there already.
pub fn on_side(ng: Vec3, side: f32, w: Vec3) -> Vec3 {
    let height = side * ng.dot(w);
    if height > 0.0 {
        w
    } else {
        unit(w + ng * (side * (GRAZING_LIFT - height)))
    }
}

pub fn delta_sample(wi: Vec3, weight: Vec3, transmitted: bool) -> BsdfSample {
    BsdfSample {
        wi,
        weight,
        pdf: 0.0,
        delta: true,
        transmitted,
        valid: true,
    }
}

/// Cosine of Lambert's law about the shading normal, of directions above the surface. What of the shading hemisphere lies under it is lost.
pub fn lambert_cos(ng: Vec3, ns: Vec3, wi: Vec3) -> f32 {
    if ng.dot(wi) <= 0.0 {
        return 0.0;
    }
    ns.dot(wi).max(0.0)
}

/// Share of the light that the facets of a smooth mesh keep, so that it fades towards the horizon of each instead of ending there. After Chiang, Li
/// and Burley 2019, "Taming the shadow terminator", but over half the cosine: over all of it 0.2% of the light from the side is lost by a sphere of
/// 160 segments. The tilt of a normal map is real, and fades nothing.
pub fn terminator(ng: Vec3, ns: Vec3, wi: Vec3) -> f32 {
    let of_facet = ng.dot(wi);
    let end = FADE * ns.dot(wi) * ng.dot(ns);
    if of_facet <= 0.0 || end <= 0.0 {
        return 0.0;
    }
    if of_facet >= end {
        return 1.0;
    }
    let g = of_facet / end;
    g * (1.0 + g - g * g)
}

/// [`terminator`] of a surface.
pub fn kept_at_terminator(s: &Surface, wi: Vec3) -> f32 {
    if s.flags & MATERIAL_NORMAL_MAPPED != 0 {
        return 1.0;
    }
    terminator(s.ng, s.ns, wi)
}

/// A direction about the shading normal by Lambert's law; it may lie under the surface.
pub fn sample_lambert(s: &Surface, u0: f32, u1: f32) -> Vec3 {
    let (tangent, bitangent) = orthonormal_basis(s.ns);
    let (sin_phi, cos_phi) = sincos_2pi(u0);
    let radius = u1.sqrt();
    let z = (1.0 - u1).max(0.0).sqrt();
    unit(tangent * (radius * cos_phi) + bitangent * (radius * sin_phi) + s.ns * z)
}
