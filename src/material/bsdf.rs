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
//! A lobe whose alpha is under [`DELTA_ALPHA`] is a perfect mirror or lens: sampled with `delta` set, absent from [`bsdf_eval`].
//! Radiance crosses an interface unscaled: what a path carries is radiance over index squared, so that light that enters and leaves
//! glass needs no factor and a clear glass body in a furnace is invisible (Walter et al. 2007, section 2; Veach 1997, section 5.2).
//! A thin-walled sheet has both its interfaces in one: R' = 2R/(1+R), and passes light straight on, blurred by its roughness.

use glam::Vec3;

use crate::math::{orthonormal_basis, sincos_2pi};
use crate::packed::{
    MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT,
};

use super::fresnel::{
    RelativeIndex, fresnel_dielectric, normal_reflectance, refract_about, relative_index, schlick,
};
use super::ggx::{MIN_COS, ggx_reflect, ggx_refract, ggx_sample_half};
use super::normal::unit;
use super::surface::Surface;

/// GGX alpha under which a lobe counts as perfectly smooth: roughness 0.0316, a blur of a tenth of a degree.
pub const DELTA_ALPHA: f32 = 1e-3;
/// A rough interface bends light by about alpha * |ior - 1|; below this the bend is lost in f32 and light goes through unblurred.
const DELTA_BEND: f32 = 1e-4;
/// Reflectance of the clearcoat, index 1.5, at normal incidence.
const COAT_F0: f32 = 0.04;
/// A mirrored or refracted direction that rounding put on the wrong side of the surface is lifted to this height.
const GRAZING_LIFT: f32 = 1e-4;

/// Albedos up to this count as none: their reciprocal would overflow.
const NO_ALBEDO: f32 = 1e-30;
const LARGEST_BELOW_1: f32 = 0.999_999_94;
const INV_PI: f32 = std::f32::consts::FRAC_1_PI;

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

/// Share of light that an interface facet reflects and lets through.
#[derive(Clone, Copy, Debug)]
struct Interface {
    reflected: Vec3,
    transmitted: Vec3,
    /// max(reflected) / (max(reflected) + max(transmitted)): the probability of reflection.
    reflect_probability: f32,
    /// 1 - reflect_probability, without cancellation.
    transmit_probability: f32,
    /// max(reflected) + max(transmitted).
    total: f32,
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

fn max3(v: Vec3) -> f32 {
    v.x.max(v.y).max(v.z)
}

fn scatters_nothing(s: &Surface) -> bool {
    s.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT) != 0
}

fn thin_walled(s: &Surface) -> bool {
    s.flags & MATERIAL_THIN_WALLED != 0
}

fn surface_index(s: &Surface) -> RelativeIndex {
    relative_index(s.ior, s.front || thin_walled(s))
}

fn reflects_delta(s: &Surface) -> bool {
    s.ggx_alpha < DELTA_ALPHA
}

fn transmits_delta(s: &Surface) -> bool {
    reflects_delta(s) || (!thin_walled(s) && s.ggx_alpha * (s.ior - 1.0).abs() < DELTA_BEND)
}

fn coat_delta(s: &Surface) -> bool {
    s.coat_alpha < DELTA_ALPHA
}

fn cos_to(normal: Vec3, wo: Vec3) -> f32 {
    normal.dot(wo).clamp(MIN_COS, 1.0)
}

/// Reflectance of the dielectric at normal incidence, per channel.
fn dielectric_f0(s: &Surface) -> Vec3 {
    (s.specular_color * normal_reflectance(s.ior)).min(Vec3::ONE)
}

/// Schlick reflectance of the opaque dielectric (KHR_materials_specular).
fn opaque_fresnel(s: &Surface, cos: f32) -> Vec3 {
    schlick(dielectric_f0(s), cos) * s.specular
}

/// Reflectance of the transmitting dielectric: the exact one, rescaled where KHR_materials_specular changes its ends.
fn transmitting_fresnel(s: &Surface, cos: f32) -> Vec3 {
    let exact = fresnel_dielectric(cos, surface_index(s));
    if exact.total {
        return Vec3::ONE;
    }
    let f0 = normal_reflectance(s.ior);
    let rise = ((exact.reflectance - f0) / (1.0 - f0).max(1e-6)).clamp(-1.0, 1.0);
    let low = dielectric_f0(s);
    let f = ((low + (Vec3::ONE - low) * rise) * s.specular).clamp(Vec3::ZERO, Vec3::ONE);
    if thin_walled(s) {
        f * 2.0 / (Vec3::ONE + f)
    } else {
        f
    }
}

fn interface_at(s: &Surface, cos: f32) -> Interface {
    let dielectric = 1.0 - s.metallic;
    let mut reflected = schlick(s.base_color, cos) * s.metallic
        + opaque_fresnel(s, cos) * (dielectric * (1.0 - s.transmission));
    let mut transmitted = Vec3::ZERO;
    if s.transmission > 0.0 {
        let share = dielectric * s.transmission;
        let f = transmitting_fresnel(s, cos);
        reflected += f * share;
        transmitted = s.base_color * (share * (1.0 - max3(f)));
    }
    let total = max3(reflected) + max3(transmitted);
    let inv = if total > NO_ALBEDO { 1.0 / total } else { 0.0 };
    Interface {
        reflected,
        transmitted,
        reflect_probability: max3(reflected) * inv,
        transmit_probability: max3(transmitted) * inv,
        total,
    }
}

/// What the interface reflects at grazing incidence.
fn grazing_albedo(s: &Surface) -> f32 {
    let dielectric = 1.0 - s.metallic;
    s.metallic + dielectric * (s.specular * (1.0 - s.transmission) + s.transmission)
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

/// Cosine of Lambert's law for a shading normal that differs from the geometric one: directions of the shading hemisphere that lie
/// under the surface are mirrored up at it, so that no energy is lost and a white Lambertian mesh reflects all light.
fn lambert_cos(s: &Surface, wi: Vec3) -> f32 {
    let height = s.ng.dot(wi);
    if height <= 0.0 {
        return 0.0;
    }
    let direct = s.ns.dot(wi);
    let mirrored = direct - 2.0 * height * s.ng.dot(s.ns);
    direct.max(0.0) + mirrored.max(0.0)
}

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
