//! Scattering at a [`Surface`]: the glTF 2.0 metallic-roughness model (specification, appendix B) with its specular, ior,
//! transmission and clearcoat extensions.
//!
//! Three lobes, mixed:
//!
//! - diffuse: Lambert under the dielectric's interface, weighted by 1 - max F(wo, h) as the specification has it;
//! - interface: GGX with the metal's and the dielectric's Fresnel factors; of a transmitting dielectric it also refracts. One half
//!   vector is drawn from the visible normals, then reflection or refraction in proportion to what that facet does;
//! - coat: GGX of index 1.5 that takes clearcoat * F(wo, n) and leaves the rest to what lies under it.
//!
//! Energy: metal, glass and Lambertian surfaces never send out more than they receive. An opaque dielectric can, as the specification's
//! diffuse weight looks at the half vector only: smooth and white, index 1.5, it sends 1.02 at 60 degrees and 1.35 at 80, and 1.04 in
//! the mean over all directions.
//!
//! A lobe whose alpha is under 1e-3 is a perfect mirror or lens: sampled with `delta` set, absent from [`bsdf_eval`].
//! Radiance crosses an interface unscaled: what a path carries is radiance over index squared, so that light that enters and leaves
//! glass needs no factor and a clear glass body in a furnace is invisible (Walter et al. 2007, section 2; Veach 1997, section 5.2).
//! A thin-walled sheet has both its interfaces in one: R' = 2R/(1+R), and passes light straight on, blurred by its roughness.

use glam::Vec3;

use crate::math::{INV_PI, orthonormal_basis, sincos_2pi};
use crate::packed::MATERIAL_LAMBERTIAN;
use crate::shared::shared;

use super::fresnel::{fresnel_dielectric, refract_about};
use super::ggx::{ggx_reflect, ggx_refract, ggx_sample_half};
use super::lobes::{
    Lobes, NO_ALBEDO, coat_delta, cos_to, diffuse_albedo, diffuse_color, grazing_albedo,
    interface_at, lambert_cos, lobes_at, max3, opaque_fresnel, reflects_delta, scatters_nothing,
    surface_index, thin_walled, transmits_delta,
};
use super::normal::unit;
use super::surface::Surface;

shared! {
    /// A mirrored or refracted direction that rounding put on the wrong side of the surface is lifted to this height.
    const GRAZING_LIFT: f32 = 1e-4;
    const LARGEST_BELOW_1: f32 = 0.999_999_94;
}

/// Non-delta lobes for one pair of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfEval {
    /// BSDF times |cos| of `wi`, 1/sr.
    pub f_cos: Vec3,
    /// Solid-angle density with which [`bsdf_sample`] draws `wi`; integrates to 1 less the probability of delta lobes and of
    /// samples that fall below the surface.
    pub pdf: f32,
}

const EVAL_NOTHING: BsdfEval = BsdfEval {
    f_cos: Vec3::ZERO,
    pdf: 0.0,
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
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

const SAMPLE_NOTHING: BsdfSample = BsdfSample {
    wi: Vec3::Z,
    weight: Vec3::ZERO,
    pdf: 0.0,
    delta: false,
    transmitted: false,
    valid: false,
};

/// Scattering from `wi` to `wo` (unit, both pointing away from the surface, `wo` on the side of `ng`) by the non-delta lobes.
pub fn bsdf_eval(s: &Surface, wo: Vec3, wi: Vec3) -> BsdfEval {
    if scatters_nothing(s) {
        return EVAL_NOTHING;
    }
    if bsdf_is_lambertian(s) {
        let pdf = lambert_cos(s, wi) * INV_PI;
        return BsdfEval {
            f_cos: s.base_color * pdf,
            pdf,
        };
    }
    eval_with(s, &lobes_at(s, wo), wo, wi)
}

fn eval_with(s: &Surface, lobes: &Lobes, wo: Vec3, wi: Vec3) -> BsdfEval {
    if s.ng.dot(wi) > 0.0 {
        eval_reflection(s, lobes, wo, wi)
    } else if s.transmission > 0.0 && !transmits_delta(s) && s.ng.dot(wi) < 0.0 {
        eval_transmission(s, lobes, wo, wi)
    } else {
        EVAL_NOTHING
    }
}

fn eval_reflection(s: &Surface, lobes: &Lobes, wo: Vec3, wi: Vec3) -> BsdfEval {
    let mut f_cos = Vec3::ZERO;
    let mut pdf = 0.0;
    let under = 1.0 - lobes.coat;
    if lobes.p_diffuse > 0.0 {
        let sum = wo + wi;
        let cos_half = 0.5 * sum.dot(sum).sqrt();
        let cosine = lambert_cos(s, wi) * INV_PI;
        let passed = 1.0 - max3(opaque_fresnel(s, cos_half));
        f_cos += diffuse_color(s) * (under * passed * cosine);
        pdf += lobes.p_diffuse * cosine;
    }
    if lobes.p_interface > 0.0 && !reflects_delta(s) {
        let g = ggx_reflect(s.ggx_alpha, s.ns, wo, wi);
        let facet = interface_at(s, g.cos_half);
        let chosen = if transmits_delta(s) {
            lobes.interface.reflect_probability
        } else {
            facet.reflect_probability
        };
        f_cos += facet.reflected * (under * g.f_cos);
        pdf += lobes.p_interface * chosen * g.pdf;
    }
    if lobes.p_coat > 0.0 && !coat_delta(s) {
        let g = ggx_reflect(s.coat_alpha, s.coat_ns, wo, wi);
        f_cos += Vec3::splat(lobes.coat * g.f_cos);
        pdf += lobes.p_coat * g.pdf;
    }
    BsdfEval { f_cos, pdf }
}

fn eval_transmission(s: &Surface, lobes: &Lobes, wo: Vec3, wi: Vec3) -> BsdfEval {
    let g = if thin_walled(s) {
        ggx_reflect(s.ggx_alpha, s.ns, wo, mirrored_at(s.ns, wi))
    } else {
        ggx_refract(s.ggx_alpha, s.ns, wo, wi, surface_index(s).eta)
    };
    let facet = interface_at(s, g.cos_half);
    BsdfEval {
        f_cos: facet.transmitted * ((1.0 - lobes.coat) * g.f_cos),
        pdf: lobes.p_interface * facet.transmit_probability * g.pdf,
    }
}

/// `v` mirrored at the plane of `normal`.
fn mirrored_at(normal: Vec3, v: Vec3) -> Vec3 {
    v - normal * (2.0 * v.dot(normal))
}

/// `wo` reflected about `h`.
fn reflected_about(h: Vec3, wo: Vec3) -> Vec3 {
    h * (2.0 * wo.dot(h)) - wo
}

/// `w`, lifted to the side of `ng` if `side` is 1, to the other if it is -1, where it is not there already.
fn on_side(ng: Vec3, side: f32, w: Vec3) -> Vec3 {
    let height = side * ng.dot(w);
    if height > 0.0 {
        w
    } else {
        unit(w + ng * (side * (GRAZING_LIFT - height)))
    }
}

fn delta_sample(wi: Vec3, weight: Vec3, transmitted: bool) -> BsdfSample {
    BsdfSample {
        wi,
        weight,
        pdf: 0.0,
        delta: true,
        transmitted,
        valid: true,
    }
}

/// The whole mixture's weight for a direction that one of its non-delta lobes drew.
fn mixture_sample(s: &Surface, lobes: &Lobes, wo: Vec3, wi: Vec3) -> BsdfSample {
    let eval = eval_with(s, lobes, wo, wi);
    if eval.pdf <= 0.0 {
        return SAMPLE_NOTHING;
    }
    BsdfSample {
        wi,
        weight: eval.f_cos * (1.0 / eval.pdf),
        pdf: eval.pdf,
        delta: false,
        transmitted: s.ng.dot(wi) < 0.0,
        valid: true,
    }
}

/// A direction about the shading normal by Lambert's law, mirrored up where it is under the surface.
fn sample_lambert(s: &Surface, u0: f32, u1: f32) -> Vec3 {
    let (tangent, bitangent) = orthonormal_basis(s.ns);
    let (sin_phi, cos_phi) = sincos_2pi(u0);
    let radius = u1.sqrt();
    let z = (1.0 - u1).max(0.0).sqrt();
    let w = unit(tangent * (radius * cos_phi) + bitangent * (radius * sin_phi) + s.ns * z);
    if s.ng.dot(w) < 0.0 {
        mirrored_at(s.ng, w)
    } else {
        w
    }
}

/// Draws a direction: `u[0]` chooses the lobe (and reflection or refraction), `u[1]`, `u[2]` the direction in it.
pub fn bsdf_sample(s: &Surface, wo: Vec3, u: [f32; 3]) -> BsdfSample {
    if scatters_nothing(s) {
        return SAMPLE_NOTHING;
    }
    if !bsdf_is_lambertian(s) {
        return sample_layers(s, wo, u);
    }
    let wi = sample_lambert(s, u[1], u[2]);
    let pdf = lambert_cos(s, wi) * INV_PI;
    if pdf <= 0.0 {
        return SAMPLE_NOTHING;
    }
    BsdfSample {
        wi,
        weight: s.base_color,
        pdf,
        delta: false,
        transmitted: false,
        valid: true,
    }
}

fn sample_layers(s: &Surface, wo: Vec3, u: [f32; 3]) -> BsdfSample {
    let lobes = lobes_at(s, wo);
    if lobes.sum <= NO_ALBEDO {
        return SAMPLE_NOTHING;
    }
    if u[0] < lobes.p_diffuse {
        return mixture_sample(s, &lobes, wo, sample_lambert(s, u[1], u[2]));
    }
    let rest = u[0] - lobes.p_diffuse;
    if !(rest < lobes.p_interface || lobes.p_coat == 0.0) {
        return sample_coat(s, &lobes, wo, u);
    }
    let choice = (rest / lobes.p_interface.max(1e-20)).min(LARGEST_BELOW_1);
    sample_interface(s, &lobes, wo, choice, u)
}

fn sample_coat(s: &Surface, lobes: &Lobes, wo: Vec3, u: [f32; 3]) -> BsdfSample {
    if coat_delta(s) {
        let wi = on_side(s.ng, 1.0, reflected_about(s.coat_ns, wo));
        // coat / p_coat
        return delta_sample(wi, Vec3::splat(lobes.sum), false);
    }
    let h = ggx_sample_half(s.coat_alpha, s.coat_ns, wo, u[1], u[2]);
    let mirror = unit(reflected_about(h, wo));
    if s.coat_ns.dot(mirror) > 0.0 && s.ng.dot(mirror) > 0.0 {
        mixture_sample(s, lobes, wo, mirror)
    } else {
        SAMPLE_NOTHING
    }
}

/// `choice` in 0..1 decides between reflection and refraction.
fn sample_interface(s: &Surface, lobes: &Lobes, wo: Vec3, choice: f32, u: [f32; 3]) -> BsdfSample {
    let smooth = lobes.interface;
    if reflects_delta(s) || transmits_delta(s) {
        let reflect = choice < smooth.reflect_probability;
        if !reflect {
            // transmitted / (p_interface transmit_probability), in a form that is exactly the tint where nothing else is.
            let tint = smooth.transmitted / max3(smooth.transmitted).max(NO_ALBEDO);
            let scale = smooth.total / lobes.interface_albedo * lobes.sum;
            return delta_sample(transmit_straight(s, wo), tint * scale, true);
        }
        if reflects_delta(s) {
            // For a smooth interface total and interface_albedo are one.
            let tint = smooth.reflected / max3(smooth.reflected).max(NO_ALBEDO);
            let wi = on_side(s.ng, 1.0, reflected_about(s.ns, wo));
            return delta_sample(wi, tint * lobes.sum, false);
        }
    }
    let h = ggx_sample_half(s.ggx_alpha, s.ns, wo, u[1], u[2]);
    let cos_half = wo.dot(h);
    if cos_half <= 0.0 {
        return SAMPLE_NOTHING;
    }
    let mirror = unit(reflected_about(h, wo));
    if transmits_delta(s) || choice < interface_at(s, cos_half).reflect_probability {
        // Lost under either plane, where the lobe's own density is 0: neither a transmission nor a sample of another lobe.
        return if s.ns.dot(mirror) > 0.0 && s.ng.dot(mirror) > 0.0 {
            mixture_sample(s, lobes, wo, mirror)
        } else {
            SAMPLE_NOTHING
        };
    }
    let through = if thin_walled(s) {
        mirrored_at(s.ns, mirror)
    } else {
        let index = surface_index(s);
        let fresnel = fresnel_dielectric(cos_half, index);
        unit(refract_about(wo, h, cos_half, index, fresnel.g))
    };
    if s.ns.dot(through) < 0.0 && s.ng.dot(through) < 0.0 {
        mixture_sample(s, lobes, wo, through)
    } else {
        SAMPLE_NOTHING
    }
}

/// The direction in which a smooth interface lets `wo`'s light in.
fn transmit_straight(s: &Surface, wo: Vec3) -> Vec3 {
    let index = surface_index(s);
    if thin_walled(s) || index.eta2_minus_1 == 0.0 {
        return -wo;
    }
    let cos = cos_to(s.ns, wo);
    let fresnel = fresnel_dielectric(cos, index);
    let wi = refract_about(wo, s.ns, cos, index, fresnel.g);
    on_side(s.ng, -1.0, unit(wi))
}

/// Nothing but delta lobes (or nothing at all): no direction to a light can be worth a shadow ray.
pub fn bsdf_is_delta(s: &Surface) -> bool {
    if scatters_nothing(s) {
        return true;
    }
    if bsdf_is_lambertian(s) {
        return false;
    }
    max3(diffuse_color(s)) == 0.0 && reflects_delta(s) && (s.clearcoat == 0.0 || coat_delta(s))
}

/// What a smooth interface lets through goes straight on: it bends nothing.
pub fn bsdf_passes_straight(s: &Surface) -> bool {
    thin_walled(s) || surface_index(s).eta2_minus_1 == 0.0
}

/// f = base colour / pi, whatever the directions.
pub fn bsdf_is_lambertian(s: &Surface) -> bool {
    s.flags & MATERIAL_LAMBERTIAN != 0
}

/// Approximate share of light from everywhere that leaves towards `wo`, transmission included: exact for Lambertian and smooth
/// surfaces, elsewhere good enough for roulette and the albedo plane.
pub fn bsdf_albedo(s: &Surface, wo: Vec3) -> Vec3 {
    if scatters_nothing(s) {
        return Vec3::ZERO;
    }
    if bsdf_is_lambertian(s) {
        return s.base_color;
    }
    let lobes = lobes_at(s, wo);
    let under = lobes.interface.reflected
        + lobes.interface.transmitted
        + diffuse_albedo(s, cos_to(s.ns, wo));
    (under * (1.0 - lobes.coat) + Vec3::splat(lobes.coat)).min(Vec3::ONE)
}

/// Bound on the share of light that any channel sends in any direction. It may exceed 1: see the module's note on energy.
pub fn bsdf_directional_albedo_bound(s: &Surface) -> f32 {
    if scatters_nothing(s) {
        return 0.0;
    }
    if bsdf_is_lambertian(s) {
        return max3(s.base_color);
    }
    let under = max3(diffuse_color(s)) + grazing_albedo(s);
    if s.clearcoat > 0.0 {
        under.max(1.0)
    } else {
        under
    }
}
