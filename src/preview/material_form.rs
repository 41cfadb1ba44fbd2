//! `material = { ... }` of an object, as its numbers stand in the scene file.

use std::sync::Arc;

use crate::scene::{AlphaMode, Choice, Material, Object};

/// All that the table has; textures a mesh alone can bring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialForm {
    /// Linear Rec.709 and opacity, 0 to 1.
    pub base_color: [f32; 4],
    pub metallic: f32,
    pub roughness: f32,
    pub specular: f32,
    pub specular_color: [f32; 3],
    pub ior: f32,
    pub transmission: f32,
    pub thin_walled: bool,
    pub attenuation_color: [f32; 3],
    /// Infinity: clear.
    pub attenuation_distance_m: f32,
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    /// Radiance.
    pub emissive: [f32; 3],
    pub unlit: bool,
}

impl MaterialForm {
    /// The factors of a material, without its textures.
    pub fn of(material: &Material) -> Self {
        Self {
            base_color: material.base_color,
            metallic: material.metallic,
            roughness: material.roughness,
            specular: material.specular,
            specular_color: material.specular_color,
            ior: material.ior,
            transmission: material.transmission,
            thin_walled: material.thin_walled,
            attenuation_color: material.attenuation_color,
            attenuation_distance_m: material.attenuation_distance_m,
            clearcoat: material.clearcoat,
            clearcoat_roughness: material.clearcoat_roughness,
            emissive: material.emissive,
            unlit: material.unlit,
        }
    }

    /// As the reader makes it for an object of that name.
    pub fn material(&self, name: String) -> Material {
        Material {
            name,
            base_color: self.base_color,
            alpha_mode: match self.base_color[3] < 1.0 {
                true => AlphaMode::Blend,
                false => AlphaMode::Opaque,
            },
            metallic: self.metallic,
            roughness: self.roughness,
            specular: self.specular,
            specular_color: self.specular_color,
            ior: self.ior,
            transmission: self.transmission,
            thin_walled: self.thin_walled,
            attenuation_color: self.attenuation_color,
            attenuation_distance_m: self.attenuation_distance_m,
            clearcoat: self.clearcoat,
            clearcoat_roughness: self.clearcoat_roughness,
            emissive: self.emissive,
            unlit: self.unlit,
            ..Material::default()
        }
    }

    /// Every part of the object is made of it.
    pub fn apply(&self, object: &mut Object) {
        let material = Arc::new(self.material(object.name.clone()));
        for instance in &mut object.instances {
            instance.material = material.clone();
        }
    }
}

/// A number of a material by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialNumber {
    Red,
    Green,
    Blue,
    Metallic,
    Roughness,
    Specular,
    Ior,
    Transmission,
    Clearcoat,
    ClearcoatRoughness,
}

impl Choice for MaterialNumber {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("red", Self::Red),
        ("green", Self::Green),
        ("blue", Self::Blue),
        ("metallic", Self::Metallic),
        ("roughness", Self::Roughness),
        ("specular", Self::Specular),
        ("ior", Self::Ior),
        ("transmission", Self::Transmission),
        ("clearcoat", Self::Clearcoat),
        ("clearcoat_roughness", Self::ClearcoatRoughness),
    ];
}

impl MaterialNumber {
    fn place(self, form: &mut MaterialForm) -> &mut f32 {
        match self {
            Self::Red => &mut form.base_color[0],
            Self::Green => &mut form.base_color[1],
            Self::Blue => &mut form.base_color[2],
            Self::Metallic => &mut form.metallic,
            Self::Roughness => &mut form.roughness,
            Self::Specular => &mut form.specular,
            Self::Ior => &mut form.ior,
            Self::Transmission => &mut form.transmission,
            Self::Clearcoat => &mut form.clearcoat,
            Self::ClearcoatRoughness => &mut form.clearcoat_roughness,
        }
    }

    pub fn of(self, form: &MaterialForm) -> f32 {
        *self.place(&mut form.clone())
    }

    /// Kept within what a scene file may say.
    pub fn set(self, form: &mut MaterialForm, value: f32) {
        let (least, most) = match self {
            Self::Ior => (1.0, 100.0),
            _ => (0.0, 1.0),
        };
        *self.place(form) = value.clamp(least, most);
    }
}
