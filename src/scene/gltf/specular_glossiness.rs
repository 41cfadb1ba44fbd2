//! KHR_materials_pbrSpecularGlossiness: a diffuse colour under a reflection whose colour at normal incidence is given.
//!
//! A dielectric of infinite index reflects all of its specular colour, which is then just that colour; the rest reaches the diffuse one.

use std::sync::Arc;

use gltf::json::texture::Info;
use serde::Deserialize;

use super::Problem;
use super::container::malformed;
use super::slots::Slots;
use crate::scene::{Material, Texture, TextureRef};

pub(super) const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct SpecularGlossiness {
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<Info>,
    specular_factor: [f32; 3],
    glossiness_factor: f32,
    specular_glossiness_texture: Option<Info>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// Puts the extension in the place of what it replaces.
pub(super) fn convert(
    value: &serde_json::Value,
    material: &mut Material,
    slots: &mut Slots,
) -> Result<(), Problem> {
    let given = SpecularGlossiness::deserialize(value)
        .map_err(|error| malformed(format!("{}, {NAME}", slots.at), error.to_string()))?;
    let glossiness = slots.unit1("glossinessFactor", given.glossiness_factor)?;
    material.base_color = slots.unit("diffuseFactor", given.diffuse_factor)?;
    material.base_color_texture = slots.texture("diffuseTexture", &given.diffuse_texture)?;
    material.metallic = 0.0;
    material.ior = 0.0;
    material.specular_color = slots.unit("specularFactor", given.specular_factor)?;
    let texture = slots.texture(
        "specularGlossinessTexture",
        &given.specular_glossiness_texture,
    )?;
    material.roughness = match texture {
        Some(_) => 1.0,
        None => 1.0 - glossiness,
    };
    material.metallic_roughness_texture = texture.as_ref().map(|reference| TextureRef {
        texture: Arc::new(roughness_of(&reference.texture, glossiness)),
        ..reference.clone()
    });
    material.specular_color_texture = texture;
    Ok(())
}

/// Where metallic-roughness has it, in green, from the glossiness in alpha.
fn roughness_of(texture: &Texture, glossiness: f32) -> Texture {
    let roughness = |alpha: u8| 255 - (f32::from(alpha) * glossiness).round() as u8;
    Texture {
        rgba8: (texture.rgba8.iter())
            .map(|texel| [0, roughness(texel[3]), 0, 255])
            .collect(),
        ..texture.clone()
    }
}
