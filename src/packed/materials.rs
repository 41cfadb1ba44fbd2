//! Materials and textures in packed form, each packed once however often it is used.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{
    MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MATERIAL_LAMBERTIAN, MATERIAL_NORMAL_MAPPED,
    MATERIAL_PHOTO_ALBEDO, MATERIAL_QUAD_LIGHT, MATERIAL_TEXTURED, MATERIAL_THIN_WALLED,
    MATERIAL_UNLIT, NONE, PackedScene, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_UV1,
    TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT, TextureRef, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};
use crate::scene::{self, AlphaMode, Texture, Wrap};
use crate::shared::shared;

shared! {
    /// A surface's material; factors as in [`scene::Material`].
    #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
    pub struct Material {
        pub base_color: [f32; 4],
        pub emissive: [f32; 3],
        pub normal_scale: f32,
        pub metallic: f32,
        pub roughness: f32,
        pub ior: f32,
        pub specular: f32,
        pub specular_color: [f32; 3],
        pub transmission: f32,
        /// Absorption coefficient inside the volume, 1/m a channel.
        pub sigma_a: [f32; 3],
        pub clearcoat: f32,
        pub clearcoat_roughness: f32,
        pub clearcoat_normal_scale: f32,
        pub alpha_cutoff: f32,
        /// Metres; see `scene::Object::self_shadow_bias_m`.
        pub self_shadow_bias: f32,
        pub flags: u32,
        /// Indices into `texture_refs`, or NONE.
        pub base_color_texture: u32,
        pub metallic_roughness_texture: u32,
        pub normal_texture: u32,
        pub emissive_texture: u32,
        pub specular_texture: u32,
        pub specular_color_texture: u32,
        pub transmission_texture: u32,
        pub clearcoat_texture: u32,
        pub clearcoat_roughness_texture: u32,
        pub clearcoat_normal_texture: u32,
        /// First float of its glass in `PackedScene::facet_tables`, 0 for metal; NONE: what facets send to each other is lost.
        pub facet_table: u32,
    }
}

/// What makes two uses of a material the same packed record.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct MaterialKey {
    material: usize,
    self_shadow_bias_bits: u32,
    from_photo: bool,
}

impl MaterialKey {
    pub fn new(material: &Arc<scene::Material>, self_shadow_bias_m: f32, from_photo: bool) -> Self {
        Self {
            material: Arc::as_ptr(material) as usize,
            self_shadow_bias_bits: self_shadow_bias_m.to_bits(),
            from_photo,
        }
    }
}

/// Remembers what is packed already. Keeps the sources alive, so that an address means one material.
#[derive(Default)]
pub struct MaterialTable {
    materials: HashMap<MaterialKey, (Arc<scene::Material>, u32)>,
    textures: HashMap<usize, (Arc<Texture>, u32)>,
}

impl MaterialTable {
    /// The packed index of a material, packing it if it is new.
    pub(crate) fn index_of(
        &mut self,
        packed: &mut PackedScene,
        material: &Arc<scene::Material>,
        key: MaterialKey,
    ) -> u32 {
        if let Some((_, index)) = self.materials.get(&key) {
            return *index;
        }
        let index = packed.materials.len() as u32;
        let record = self.pack(packed, material, &key);
        packed.materials.push(record);
        self.materials.insert(key, (material.clone(), index));
        index
    }

    /// Packs a virtual object's material in the place of another that nothing else is made of; nothing happens where that was never packed.
    pub(crate) fn replace(
        &mut self,
        packed: &mut PackedScene,
        before: &Arc<scene::Material>,
        material: &Arc<scene::Material>,
    ) {
        let key = |material| MaterialKey::new(material, 0.0, false);
        if let Some((_, index)) = self.materials.remove(&key(before)) {
            let key = key(material);
            packed.materials[index as usize] = self.pack(packed, material, &key);
            self.materials.insert(key, (material.clone(), index));
        }
    }

    /// Index of a material that is packed already.
    pub fn known(&self, key: &MaterialKey) -> Option<u32> {
        self.materials.get(key).map(|(_, index)| *index)
    }

    fn pack(
        &mut self,
        packed: &mut PackedScene,
        m: &scene::Material,
        key: &MaterialKey,
    ) -> Material {
        let mut slot = |texture: &Option<scene::TextureRef>, srgb: bool| match texture {
            Some(texture) => self.texture(packed, texture, srgb),
            None => NONE,
        };
        Material {
            base_color: m.base_color,
            // Unlit surfaces show their base colour alone, and as lights would be sampled for what they do not show.
            emissive: if m.unlit { [0.0; 3] } else { m.emissive },
            normal_scale: m.normal_scale,
            metallic: m.metallic,
            roughness: m.roughness,
            ior: m.ior,
            specular: m.specular,
            specular_color: m.specular_color,
            transmission: m.transmission,
            sigma_a: absorption(m.attenuation_color, m.attenuation_distance_m),
            clearcoat: m.clearcoat,
            clearcoat_roughness: m.clearcoat_roughness,
            clearcoat_normal_scale: m.clearcoat_normal_scale,
            alpha_cutoff: match m.alpha_mode {
                AlphaMode::Mask(cutoff) => cutoff,
                AlphaMode::Opaque | AlphaMode::Blend => 0.0,
            },
            self_shadow_bias: f32::from_bits(key.self_shadow_bias_bits),
            flags: flags(m, key.from_photo),
            base_color_texture: slot(&m.base_color_texture, true),
            metallic_roughness_texture: slot(&m.metallic_roughness_texture, false),
            normal_texture: slot(&m.normal_texture, false),
            emissive_texture: slot(&m.emissive_texture, true),
            specular_texture: slot(&m.specular_texture, false),
            specular_color_texture: slot(&m.specular_color_texture, true),
            transmission_texture: slot(&m.transmission_texture, false),
            clearcoat_texture: slot(&m.clearcoat_texture, false),
            clearcoat_roughness_texture: slot(&m.clearcoat_roughness_texture, false),
            clearcoat_normal_texture: slot(&m.clearcoat_normal_texture, false),
            facet_table: NONE,
        }
    }

    fn texture(&mut self, packed: &mut PackedScene, r: &scene::TextureRef, srgb: bool) -> u32 {
        let texture = &r.texture;
        let (_, offset) = self
            .textures
            .entry(Arc::as_ptr(texture) as usize)
            .or_insert_with(|| {
                let offset = packed.texels.len() as u32;
                packed
                    .texels
                    .extend(texture.rgba8.iter().map(|texel| u32::from_le_bytes(*texel)));
                (texture.clone(), offset)
            });
        let wrap = |w: Wrap| match w {
            Wrap::Repeat => WRAP_REPEAT,
            Wrap::Mirror => WRAP_MIRROR,
            Wrap::Clamp => WRAP_CLAMP,
        };
        let bit = |on: bool, bit: u32| if on { bit } else { 0 };
        let [a, b, c, d, e, f] = r.transform;
        packed.texture_refs.push(TextureRef {
            offset: *offset,
            width: texture.width,
            height: texture.height,
            flags: bit(srgb, TEXTURE_SRGB)
                | bit(texture.nearest, TEXTURE_NEAREST)
                | bit(r.uv_set == 1, TEXTURE_UV1)
                | wrap(texture.wrap_u) << TEXTURE_WRAP_U_SHIFT
                | wrap(texture.wrap_v) << TEXTURE_WRAP_V_SHIFT,
            transform_u: [a, b, c, 0.0],
            transform_v: [d, e, f, 0.0],
        });
        packed.texture_refs.len() as u32 - 1
    }

    /// A black surface that emits to its front.
    pub fn quad_light(radiance: [f32; 3]) -> Material {
        Material {
            base_color: [0.0, 0.0, 0.0, 1.0],
            emissive: radiance,
            normal_scale: 1.0,
            metallic: 0.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 0.0,
            specular_color: [0.0; 3],
            transmission: 0.0,
            sigma_a: [0.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_normal_scale: 1.0,
            alpha_cutoff: 0.0,
            self_shadow_bias: 0.0,
            flags: MATERIAL_QUAD_LIGHT | MATERIAL_LAMBERTIAN,
            base_color_texture: NONE,
            metallic_roughness_texture: NONE,
            normal_texture: NONE,
            emissive_texture: NONE,
            specular_texture: NONE,
            specular_color_texture: NONE,
            transmission_texture: NONE,
            clearcoat_texture: NONE,
            clearcoat_roughness_texture: NONE,
            clearcoat_normal_texture: NONE,
            facet_table: NONE,
        }
    }
}

fn flags(m: &scene::Material, from_photo: bool) -> u32 {
    let bit = |on: bool, bit: u32| if on { bit } else { 0 };
    let lambertian = from_photo
        || (m.specular == 0.0 && m.metallic == 0.0 && m.transmission == 0.0 && m.clearcoat == 0.0);
    bit(lambertian, MATERIAL_LAMBERTIAN)
        | bit(
            matches!(m.alpha_mode, AlphaMode::Mask(_)),
            MATERIAL_ALPHA_MASK,
        )
        | bit(m.alpha_mode == AlphaMode::Blend, MATERIAL_ALPHA_BLEND)
        | bit(m.unlit, MATERIAL_UNLIT)
        | bit(m.thin_walled, MATERIAL_THIN_WALLED)
        | bit(from_photo, MATERIAL_PHOTO_ALBEDO)
        | bit(m.textures().next().is_some(), MATERIAL_TEXTURED)
        | bit(m.normal_texture.is_some(), MATERIAL_NORMAL_MAPPED)
}

/// KHR_materials_volume: white light becomes `color` after `distance_m`. A black channel absorbs within a thousandth of it.
fn absorption(color: [f32; 3], distance_m: f32) -> [f32; 3] {
    color.map(|c| {
        if distance_m.is_finite() {
            -c.max(1e-30).ln() / distance_m.max(1e-30)
        } else {
            0.0
        }
    })
}
