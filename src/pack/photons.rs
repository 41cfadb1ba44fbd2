//! What photons are sent to and from which lights.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::Vec3;

use crate::accel::{Cover, Mesh};
use crate::material::{DELTA_ALPHA, GLOSSY_ALPHA, transmits_unblurred};
use crate::math::luminance;
use crate::packed::materials::MaterialKey;
use crate::packed::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT, LIGHT_TRIANGLE,
    Light, MATERIAL_LAMBERTIAN, MATERIAL_QUAD_LIGHT, MATERIAL_TEXTURED, MATERIAL_THIN_WALLED,
    MATERIAL_UNLIT, MAX_PHOTON_SPHERES, Material, NONE, PackedScene, TracedEnvironment, xyz,
};
use crate::scene::{Instance, Object};

/// Light of the environment brighter than so many times its mean is sent as photons: the sun, lamps and windows. The eye's paths find the rest
/// well.
const TRACED_ABOVE_MEAN: f64 = 8.0;
/// Lights that show larger than this at a smooth object are left to the eye's paths. A lamp of 0.8 x 0.8 m at two metres, which gains by photons, shows
/// 0.16; a ceiling of 4 x 4 m, which loses, 4.
const LARGE_LIGHT_SR: f64 = 0.6;
/// Share of the photons that the lights share evenly, whatever the estimates say.
const EVEN_SHARE: f64 = 0.1;

impl PackedScene {
    /// Covers the smooth surfaces among the virtual triangles in `range`.
    pub(super) fn cover_smooth(&self, range: std::ops::Range<usize>) -> Cover {
        if range.is_empty() {
            return Cover::of(&Mesh::default(), MAX_PHOTON_SPHERES);
        }
        let smooth: Vec<bool> = (self.materials.iter())
            .map(|material| is_smooth_somewhere(self, material))
            .collect();
        let mesh = self.mesh(range, |triangle| smooth[triangle.material as usize]);
        Cover::of(&mesh, MAX_PHOTON_SPHERES)
    }

    /// Whether a part of an object that is packed has a smooth surface.
    pub(super) fn is_smooth_part(&self, object: &Object, part: &Instance) -> bool {
        let key = MaterialKey::new(
            &part.material,
            object.self_shadow_bias_m,
            object.albedo_from_photo,
        );
        let index = self.material_table.known(&key);
        index.is_some_and(|index| is_smooth_somewhere(self, &self.materials[index as usize]))
    }

    /// Fills the frame's spheres about smooth virtual surfaces and the lights' shares of the photons. Wants the lights packed.
    pub(super) fn pack_photons(&mut self) {
        self.taught = None;
        self.frame.photon_sphere_count = 0;
        self.frame.photon_spheres = [[0.0; 4]; MAX_PHOTON_SPHERES + 1];
        self.frame.env_traced_above = f32::INFINITY;
        let moving = self.cover_smooth(self.resting.triangles..self.triangles.len());
        let covers: Vec<&Cover> = (self.resting_smooth_covers.iter().chain([&moving])).collect();
        let mut spheres = Cover::spheres(&covers, MAX_PHOTON_SPHERES);
        // What has no extent draws no photons; shaders find the end of the list by its radius.
        spheres.retain(|sphere| sphere[3] > 0.0);
        let large = self.large_lights(&spheres);
        let powers: Vec<f64> = (self.lights.iter().zip(large))
            .map(|(light, is_large)| match is_large {
                true => 0.0,
                false => self.power_towards(light, &spheres),
            })
            .collect();
        let total: f64 = powers.iter().sum();
        if total <= 0.0 {
            return;
        }
        self.frame.photon_spheres[..spheres.len()].copy_from_slice(&spheres);
        self.frame.photon_sphere_count = spheres.len() as u32;
        let traced = powers.iter().filter(|&&power| power > 0.0).count() as f64;
        let mut sum = 0.0;
        for (light, power) in self.lights.iter_mut().zip(&powers) {
            let pdf = match *power > 0.0 {
                true => (1.0 - EVEN_SHARE) * power / total + EVEN_SHARE / traced,
                false => 0.0,
            };
            sum += pdf;
            light.photon_pdf = pdf as f32;
            light.photon_cdf = sum as f32;
        }
        // Rounding must not lead past the last light that has a share.
        let last = (self.lights.iter()).rposition(|light| light.photon_pdf > 0.0);
        for light in &mut self.lights[last.unwrap_or(0)..] {
            light.photon_cdf = 1.0;
        }
        if self.frame.env_light != NONE && powers[self.frame.env_light as usize] > 0.0 {
            self.frame.env_traced_above = self.env_traced.above as f32;
        }
        let radius = |light: &Light| {
            let shown = spheres.iter().map(|s| solid_angle_of(light, xyz(*s)));
            let largest = match light.kind {
                LIGHT_ENVIRONMENT => self.env_traced.solid_angle_sr,
                _ => shown.fold(0.0, f64::max),
            };
            f64::from(light.photon_pdf) * (largest / PI).sqrt()
        };
        self.photon_light_radius = self.lights.iter().map(radius).sum::<f64>() as f32;
    }

    /// Whether each light, or the object that it is a part of, shows so large at some sphere that the eye's paths find it as well as photons do.
    fn large_lights(&self, spheres: &[[f32; 4]]) -> Vec<bool> {
        let part_of = |light: &Light| match light.triangle {
            NONE => None,
            triangle => Some(self.triangles[triangle as usize].object),
        };
        let mut solid_angles: HashMap<(u32, usize), f64> = HashMap::new();
        let mut own = Vec::with_capacity(self.lights.len());
        for light in &self.lights {
            let shown = spheres.iter().map(|s| solid_angle_of(light, xyz(*s)));
            let shown: Vec<f64> = shown.collect();
            if let Some(object) = part_of(light) {
                for (sphere, angle) in shown.iter().enumerate() {
                    *solid_angles.entry((object, sphere)).or_default() += angle;
                }
            }
            own.push(shown);
        }
        let is_large = |(light, shown): (&Light, Vec<f64>)| {
            shown.iter().enumerate().any(|(sphere, own)| {
                let angle = match part_of(light) {
                    Some(object) => solid_angles[&(object, sphere)],
                    None => *own,
                };
                angle > LARGE_LIGHT_SR
            })
        };
        self.lights.iter().zip(own).map(is_large).collect()
    }

    /// Estimate of the power that a light sends to the spheres; 0 where it sends no photons.
    fn power_towards(&self, light: &Light, spheres: &[[f32; 4]]) -> f64 {
        use std::f64::consts::TAU;
        let brightness = f64::from(luminance(xyz(light.radiance)));
        let discs: f64 = spheres.iter().map(|s| PI * f64::from(s[3]).powi(2)).sum();
        let solid_angles = |from: Vec3| -> f64 {
            let each = spheres.iter().map(|sphere| {
                let distance2 = (xyz(*sphere) - from).as_dvec3().length_squared();
                let sin2 = (f64::from(sphere[3]).powi(2) / distance2.max(1e-30)).min(1.0);
                TAU * (1.0 - (1.0 - sin2).sqrt())
            });
            each.sum()
        };
        match light.kind {
            LIGHT_ENVIRONMENT => self.env_traced.mean_radiance * 4.0 * PI * discs,
            LIGHT_DIRECTIONAL => brightness * discs,
            LIGHT_POINT | LIGHT_SPOT => brightness * solid_angles(xyz(light.position)),
            _ => {
                let (u, v) = (xyz(light.axis_u), xyz(light.axis_v));
                let half = if light.triangle == NONE {
                    0.5
                } else {
                    1.0 / 3.0
                };
                let centre = xyz(light.position) + (u + v) * half;
                0.5 * brightness * f64::from(light.radiance[3]) * solid_angles(centre)
            }
        }
    }
}

/// In which a quad or an emissive triangle is seen from a point, as if it were small: steradians. 0 for other lights.
fn solid_angle_of(light: &Light, from: Vec3) -> f64 {
    if !matches!(light.kind, LIGHT_QUAD | LIGHT_TRIANGLE) {
        return 0.0;
    }
    let (u, v) = (xyz(light.axis_u).as_dvec3(), xyz(light.axis_v).as_dvec3());
    let half = if light.kind == LIGHT_QUAD {
        0.5
    } else {
        1.0 / 3.0
    };
    let to = xyz(light.position).as_dvec3() + (u + v) * half - from.as_dvec3();
    let area = f64::from(light.radiance[3]);
    let cos = to.normalize_or_zero().dot(u.cross(v).normalize_or_zero());
    area * cos.abs() / to.length_squared().max(1e-30)
}

/// Whether the surface has somewhere a lobe that mirrors or bends light without blurring it, or is polished.
fn is_smooth_somewhere(packed: &PackedScene, material: &Material) -> bool {
    if material.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT | MATERIAL_LAMBERTIAN) != 0 {
        return false;
    }
    let roughness = material.roughness * least_green(packed, material.metallic_roughness_texture);
    let coat =
        material.clearcoat_roughness * least_green(packed, material.clearcoat_roughness_texture);
    let alpha = roughness * roughness;
    let is_textured = material.flags & MATERIAL_TEXTURED != 0;
    let pure = material.metallic == 1.0
        || material.transmission == 1.0
        || material.base_color[..3] == [0.0; 3]
        || (is_textured && material.metallic.max(material.transmission) > 0.0);
    // Nothing but light that goes straight through.
    let is_invisible = material.ior == 1.0
        && material.transmission == 1.0
        && material.metallic == 0.0
        && !is_textured;
    let is_glossy = pure && alpha < GLOSSY_ALPHA && !is_invisible;
    let mirrors = alpha < DELTA_ALPHA
        && !is_invisible
        && (material.metallic > 0.0 || material.specular > 0.0 || material.transmission > 0.0);
    let bends = material.transmission > 0.0
        && material.flags & MATERIAL_THIN_WALLED == 0
        && material.ior != 1.0
        && transmits_unblurred(alpha, material.ior);
    is_glossy || mirrors || bends || (material.clearcoat > 0.0 && coat * coat < DELTA_ALPHA)
}

/// Least value of a texture's second channel, in 0..1; 1 where there is none.
fn least_green(packed: &PackedScene, texture: u32) -> f32 {
    let Some(texture) = packed.texture_refs.get(texture as usize) else {
        return 1.0;
    };
    let first = texture.offset as usize;
    let texels = &packed.texels[first..first + (texture.width * texture.height) as usize];
    let least = texels.iter().map(|texel| texel.to_le_bytes()[1]).min();
    f32::from(least.unwrap_or(255)) / 255.0
}

/// What photons bring of a map of three floats a texel, scaled; `mean`: its luminance over the sphere.
pub(super) fn traced_environment(
    width: u32,
    height: u32,
    texels: &[f32],
    scale: f64,
    mean: f64,
) -> TracedEnvironment {
    let above = TRACED_ABOVE_MEAN * mean;
    let (mut sum, mut area, mut brighter) = (0.0, 0.0, 0.0);
    for (row, texels) in texels.chunks(3 * width as usize).enumerate() {
        let middle = (row as f64 + 0.5) / f64::from(height) * PI;
        for texel in texels.chunks(3) {
            let brightness = f64::from(luminance(Vec3::from_slice(texel))) * scale;
            sum += (brightness - above).max(0.0) * middle.sin();
            area += middle.sin();
            if brightness > above {
                brighter += middle.sin();
            }
        }
    }
    TracedEnvironment {
        above,
        mean_radiance: sum / area.max(1e-30),
        solid_angle_sr: 4.0 * PI * brighter / area.max(1e-30),
    }
}
