//! The lobes that scatter light at a [`Surface`]: the glTF 2.0 metallic-roughness model (specification, appendix B) with its specular, ior,
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
//! A lobe whose alpha is under 1e-3 is a perfect mirror or lens: sampled with `delta` set, absent from [`lobes_eval`].
//! Radiance crosses an interface unscaled: what a path carries is radiance over index squared, so that light that enters and leaves
//! glass needs no factor and a clear glass body in a furnace is invisible (Walter et al. 2007, section 2; Veach 1997, section 5.2).
//! A thin-walled sheet has both its interfaces in one: R' = 2R/(1+R), and passes light straight on, blurred by its roughness.

use glam::Vec3;

use super::fresnel::{fresnel_dielectric, refract_about, schlick};
use super::ggx::{DELTA_ALPHA, ggx_reflect, ggx_refract, ggx_sample_half};
use super::interface::{
    Interface, NO_ALBEDO, cos_to, grazing_albedo, interface_at, max3, opaque_fresnel,
    reflects_delta, surface_index, thin_walled, transmits_delta,
};
use super::normal::unit;
use super::scatter::{
    BsdfEval, BsdfSample, EVAL_NOTHING, SAMPLE_NOTHING, delta_sample, kept_at_terminator,
    lambert_cos, mirrored_at, on_side, reflected_about, sample_lambert,
};
use super::surface::Surface;
use crate::math::INV_PI;
use crate::shared::shared;

shared! {
    /// GGX alpha under which a surface that has no other lobes counts as polished: roughness 0.3.
    pub const POLISHED_ALPHA: f32 = 0.09;
    /// And as glossy: roughness 0.45. What lamps send by way of it is found from their side.
    pub const GLOSSY_ALPHA: f32 = 0.2;
    /// Reflectance of the clearcoat, index 1.5, at normal incidence.
    const COAT_F0: f32 = 0.04;
    const LARGEST_BELOW_1: f32 = 0.999_999_94;
}

/// What lobe selection needs: approximate albedos, and the probabilities that follow from them.
#[derive(Clone, Copy, Debug)]
struct Lobes {
    /// Share that the coat reflects.
    coat: f32,
    /// The interface as it is at the shading normal.
    interface: Interface,
    /// What selection takes for the albedo of the interface.
    interface_albedo: f32,
    /// Sum of the approximate albedos.
    sum: f32,
    p_diffuse: f32,
    p_interface: f32,
    p_coat: f32,
}

fn coat_delta(s: &Surface) -> bool {
    s.coat_alpha < DELTA_ALPHA
}

/// Albedo of the diffuse lobe but for the interface above it.
fn diffuse_color(s: &Surface) -> Vec3 {
    s.base_color * ((1.0 - s.metallic) * (1.0 - s.transmission))
}

/// Approximate albedo of the diffuse lobe: the Fresnel factor is taken at the half vector towards the normal, as if that were where
/// light comes from, so that it stays in proportion at grazing angles.
fn diffuse_albedo(s: &Surface, cos: f32) -> Vec3 {
    let f = opaque_fresnel(s, (0.5 + 0.5 * cos).sqrt());
    diffuse_color(s) * (1.0 - max3(f))
}

fn coat_share(s: &Surface, wo: Vec3) -> f32 {
    if s.clearcoat > 0.0 {
        s.clearcoat * schlick(Vec3::splat(COAT_F0), cos_to(s.coat_ns, wo)).x
    } else {
        0.0
    }
}

fn lobes_at(s: &Surface, wo: Vec3) -> Lobes {
    let cos = cos_to(s.ns, wo);
    let coat = coat_share(s, wo);
    let interface = interface_at(s, cos);
    let under = 1.0 - coat;
    let diffuse = under * max3(diffuse_albedo(s, cos));
    // Facets seen at grazing angles reflect far more than the normal's: with this floor they stay bounded in weight.
    let interface_albedo = if reflects_delta(s) {
        interface.total
    } else {
        interface.total + (0.01 + 0.05 * s.ggx_alpha) * grazing_albedo(s)
    };
    let specular = under * interface_albedo;
    let sum = coat + diffuse + specular;
    let inv = if sum > NO_ALBEDO { 1.0 / sum } else { 0.0 };
    Lobes {
        coat,
        interface,
        interface_albedo,
        sum,
        p_diffuse: diffuse * inv,
        p_interface: specular * inv,
        p_coat: coat * inv,
    }
}

/// Non-delta lobes for one pair of directions.
pub fn lobes_eval(s: &Surface, wo: Vec3, wi: Vec3) -> BsdfEval {
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
        let cosine = lambert_cos(s.ng, s.ns, wi) * INV_PI;
        let passed = 1.0 - max3(opaque_fresnel(s, cos_half));
        let kept = kept_at_terminator(s, wi);
        f_cos += diffuse_color(s) * (under * passed * cosine * kept);
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

pub fn lobes_sample(s: &Surface, wo: Vec3, u: [f32; 3]) -> BsdfSample {
    let lobes = lobes_at(s, wo);
    if lobes.sum <= NO_ALBEDO {
        return SAMPLE_NOTHING;
    }
    if u[0] < lobes.p_diffuse {
        let wi = sample_lambert(s, u[1], u[2]);
        return if s.ng.dot(wi) > 0.0 {
            mixture_sample(s, &lobes, wo, wi)
        } else {
            SAMPLE_NOTHING
        };
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

/// Nothing but lobes that mirror or bend light with little blur.
pub fn lobes_are_polished(s: &Surface) -> bool {
    lobes_are_below(s, POLISHED_ALPHA)
}

/// The same with some blur.
pub fn lobes_are_glossy(s: &Surface) -> bool {
    lobes_are_below(s, GLOSSY_ALPHA)
}

fn lobes_are_below(s: &Surface, alpha: f32) -> bool {
    max3(diffuse_color(s)) == 0.0
        && s.ggx_alpha < alpha
        && (s.clearcoat == 0.0 || s.coat_alpha < alpha)
}

pub fn lobes_are_diffuse(s: &Surface) -> bool {
    max3(diffuse_color(s)) > 0.0
}

/// Nothing but delta lobes.
pub fn lobes_are_delta(s: &Surface) -> bool {
    max3(diffuse_color(s)) == 0.0 && reflects_delta(s) && (s.clearcoat == 0.0 || coat_delta(s))
}

/// What an interface that bends and blurs nothing lets through.
pub fn lobes_straight(s: &Surface, wo: Vec3) -> Vec3 {
    if !transmits_delta(s) {
        return Vec3::ZERO;
    }
    interface_at(s, cos_to(s.ns, wo)).transmitted * (1.0 - coat_share(s, wo))
}

/// Approximate share of light from everywhere that leaves towards `wo`, transmission included.
pub fn lobes_albedo(s: &Surface, wo: Vec3) -> Vec3 {
    let lobes = lobes_at(s, wo);
    let under = lobes.interface.reflected
        + lobes.interface.transmitted
        + diffuse_albedo(s, cos_to(s.ns, wo));
    (under * (1.0 - lobes.coat) + Vec3::splat(lobes.coat)).min(Vec3::ONE)
}

/// Bound on the share of light that any channel sends in any direction. It may exceed 1: see the module's note on energy.
pub fn lobes_bound(s: &Surface) -> f32 {
    let under = max3(diffuse_color(s)) + grazing_albedo(s);
    if s.clearcoat > 0.0 {
        under.max(1.0)
    } else {
        under
    }
}
