//! Materials: metallic-roughness and the extensions that mixray draws.

use std::collections::HashMap;
use std::sync::Arc;

use gltf::json;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use serde::Deserialize;

use super::container::{clip, malformed};
use super::document::Document;
use super::image::Textures;
use super::slots::Slots;
use super::specular_glossiness;
use super::uv_sets::uv_sets;
use super::{Note, Notes, Problem};
use crate::scene::{AlphaMode, Material, Primitive};

/// Reads each material once, when a drawn primitive first uses it.
pub(super) struct Materials<'a> {
    document: &'a Document,
    textures: Textures<'a>,
    read: HashMap<Option<usize>, Arc<Material>>,
}

/// KHR_materials_clearcoat, which the crate passes on unread.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

impl<'a> Materials<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self {
            document,
            textures: Textures::new(document),
            read: HashMap::new(),
        }
    }

    /// The material of `primitive`; None is glTF's default material.
    pub fn get(
        &mut self,
        index: Option<usize>,
        primitive: &Primitive,
        notes: &mut Notes,
    ) -> Result<Arc<Material>, Problem> {
        let material = match (self.read.get(&index), index) {
            (Some(material), _) => material.clone(),
            (None, None) => Arc::new(self.read_material(
                &json::Material::default(),
                "the default material",
                notes,
            )?),
            (None, Some(number)) => {
                let materials = &self.document.materials;
                let source = materials.get(number).ok_or_else(|| {
                    malformed(
                        &primitive.name,
                        format!("refers to material {number}; there are {}", materials.len()),
                    )
                })?;
                let at = match &source.name {
                    Some(name) if !name.is_empty() => {
                        format!("materials[{number}] ({})", clip(name))
                    }
                    _ => format!("materials[{number}]"),
                };
                Arc::new(self.read_material(source, &at, notes)?)
            }
        };
        self.read.insert(index, material.clone());
        let lacks_uv = material
            .textures()
            .any(|texture| primitive.uvs[texture.uv_set as usize & 1].is_empty());
        if lacks_uv {
            notes.add(Note::MissingUv, 1, &primitive.name);
        }
        Ok(material)
    }

    fn read_material(
        &mut self,
        source: &json::Material,
        at: &str,
        notes: &mut Notes,
    ) -> Result<Material, Problem> {
        let mut slots = Slots {
            sets: uv_sets(source, at)?,
            textures: &mut self.textures,
            at,
            notes,
        };
        let pbr = &source.pbr_metallic_roughness;
        let mut material = Material {
            name: source.name.clone().unwrap_or_default(),
            base_color: slots.unit("baseColorFactor", pbr.base_color_factor.0)?,
            base_color_texture: slots.texture("baseColorTexture", &pbr.base_color_texture)?,
            metallic: slots.unit1("metallicFactor", pbr.metallic_factor.0)?,
            roughness: slots.unit1("roughnessFactor", pbr.roughness_factor.0)?,
            metallic_roughness_texture: slots
                .texture("metallicRoughnessTexture", &pbr.metallic_roughness_texture)?,
            emissive: slots.limited("emissiveFactor", source.emissive_factor.0, f32::MAX)?,
            emissive_texture: slots.texture("emissiveTexture", &source.emissive_texture)?,
            alpha_mode: alpha_mode(source, at)?,
            thin_walled: true,
            ..Material::default()
        };
        (material.normal_texture, material.normal_scale) =
            slots.normal("normalTexture", &source.normal_texture)?;
        if let Some(extensions) = &source.extensions {
            read_extensions(extensions, &mut material, &mut slots)?;
        }
        Ok(material)
    }
}

fn alpha_mode(source: &json::Material, at: &str) -> Result<AlphaMode, Problem> {
    use json::material::AlphaMode as Mode;
    match source.alpha_mode {
        Checked::Valid(Mode::Opaque) => Ok(AlphaMode::Opaque),
        Checked::Valid(Mode::Blend) => Ok(AlphaMode::Blend),
        Checked::Valid(Mode::Mask) => {
            let cutoff = source.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
            if cutoff.is_finite() {
                Ok(AlphaMode::Mask(cutoff))
            } else {
                Err(malformed(at, "its alphaCutoff is not finite"))
            }
        }
        Checked::Invalid => Err(malformed(at, "its alphaMode is not OPAQUE, MASK or BLEND")),
    }
}

fn read_extensions(
    extensions: &json::extensions::material::Material,
    material: &mut Material,
    slots: &mut Slots,
) -> Result<(), Problem> {
    material.unlit = extensions.unlit.is_some();
    if let Some(strength) = &extensions.emissive_strength {
        let strength =
            slots.limited1("emissiveStrength", strength.emissive_strength.0, f32::MAX)?;
        let emissive = material.emissive.map(|channel| channel * strength);
        material.emissive = slots.limited("emissiveStrength", emissive, f32::MAX)?;
    }
    if let Some(ior) = &extensions.ior {
        // 0 stands for an infinite index (a Fresnel term of 1); (ior - 1)^2 / (ior + 1)^2 gives just that.
        material.ior = slots.limited1("ior", ior.ior.0, f32::MAX)?;
        if material.ior > 0.0 && material.ior < 1.0 {
            slots.notes.add(Note::Clamped, 1, slots.at);
            material.ior = 1.0;
        }
    }
    if let Some(specular) = &extensions.specular {
        material.specular = slots.unit1("specularFactor", specular.specular_factor.0)?;
        material.specular_texture = slots.texture("specularTexture", &specular.specular_texture)?;
        material.specular_color = slots.limited(
            "specularColorFactor",
            specular.specular_color_factor.0,
            f32::MAX,
        )?;
        material.specular_color_texture =
            slots.texture("specularColorTexture", &specular.specular_color_texture)?;
    }
    if let Some(transmission) = &extensions.transmission {
        material.transmission =
            slots.unit1("transmissionFactor", transmission.transmission_factor.0)?;
        material.transmission_texture =
            slots.texture("transmissionTexture", &transmission.transmission_texture)?;
    }
    if let Some(volume) = &extensions.volume {
        // Rays measure the thickness in the mesh itself: the factor only says whether there is an inside, and its texture nothing.
        material.thin_walled =
            slots.limited1("thicknessFactor", volume.thickness_factor.0, f32::MAX)? == 0.0;
        material.attenuation_color = slots.unit("attenuationColor", volume.attenuation_color.0)?;
        let distance = volume.attenuation_distance.0;
        if distance.is_nan() || distance <= 0.0 {
            return Err(malformed(
                slots.at,
                "its attenuationDistance is not positive",
            ));
        }
        material.attenuation_distance_m = distance;
    }
    if let Some(value) = extensions.others.get(specular_glossiness::NAME) {
        specular_glossiness::convert(value, material, slots)?;
    }
    if let Some(value) = extensions.others.get("KHR_materials_clearcoat") {
        let coat = Clearcoat::deserialize(value).map_err(|error| {
            malformed(
                format!("{}, KHR_materials_clearcoat", slots.at),
                error.to_string(),
            )
        })?;
        material.clearcoat = slots.unit1("clearcoatFactor", coat.clearcoat_factor)?;
        material.clearcoat_texture = slots.texture("clearcoatTexture", &coat.clearcoat_texture)?;
        material.clearcoat_roughness =
            slots.unit1("clearcoatRoughnessFactor", coat.clearcoat_roughness_factor)?;
        material.clearcoat_roughness_texture = slots.texture(
            "clearcoatRoughnessTexture",
            &coat.clearcoat_roughness_texture,
        )?;
        (
            material.clearcoat_normal_texture,
            material.clearcoat_normal_scale,
        ) = slots.normal("clearcoatNormalTexture", &coat.clearcoat_normal_texture)?;
    }
    Ok(())
}
