//! Meshes, materials and where they stand.

use std::collections::HashMap;
use std::sync::Arc;

use serde_json::{Value, json};

use super::numbers::Numbers;
use super::rows;
use crate::scene::{AlphaMode, Material, Object, Primitive, Scene, Side, Texture, TextureRef};

/// What several parts share is written once.
struct Tables<'a> {
    numbers: &'a mut Numbers,
    notes: &'a mut Vec<String>,
    exposure: f64,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    places: HashMap<usize, usize>,
}

pub(super) fn describe(
    scene: &Scene,
    exposure: f64,
    numbers: &mut Numbers,
    notes: &mut Vec<String>,
) -> Value {
    let mut tables = Tables {
        numbers,
        notes,
        exposure,
        meshes: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        places: HashMap::new(),
    };
    let objects: Vec<Value> = scene
        .objects
        .iter()
        .map(|object| tables.object(object))
        .collect();
    json!({
        "objects": objects,
        "meshes": tables.meshes,
        "materials": tables.materials,
        "textures": tables.textures,
    })
}

impl Tables<'_> {
    fn object(&mut self, object: &Object) -> Value {
        let parts = object.instances.iter().map(|instance| {
            let material = (!object.albedo_from_photo).then(|| self.material(&instance.material));
            json!({
                "name": if object.instances.len() == 1 { &object.name } else { &instance.primitive.name },
                "mesh": self.mesh(&instance.primitive),
                "material": material,
                "matrix": rows(object.world_from_object * instance.object_from_local),
            })
        });
        json!({ "name": object.name, "is_real": object.side == Side::Real, "parts": parts.collect::<Vec<Value>>() })
    }

    fn mesh(&mut self, primitive: &Arc<Primitive>) -> usize {
        let key = Arc::as_ptr(primitive) as usize;
        if let Some(place) = self.places.get(&key) {
            return *place;
        }
        let numbers = &mut *self.numbers;
        self.meshes.push(json!({
            "name": primitive.name,
            "positions": numbers.add(primitive.positions.as_flattened()),
            "normals": numbers.add(primitive.normals.as_flattened()),
            "triangles": numbers.add(primitive.triangles.as_flattened()),
            "uvs": primitive.uvs.iter().filter(|uv| !uv.is_empty()).map(|uv| numbers.add(uv.as_flattened())).collect::<Vec<Value>>(),
        }));
        if !primitive.colors.is_empty() {
            self.notes
                .push(format!("{}: vertex colours", primitive.name));
        }
        self.places.insert(key, self.meshes.len() - 1);
        self.meshes.len() - 1
    }

    fn material(&mut self, material: &Arc<Material>) -> usize {
        let key = Arc::as_ptr(material) as usize;
        if let Some(place) = self.places.get(&key) {
            return *place;
        }
        let m = &**material;
        let lost = [
            (&m.specular_texture, "specular"),
            (&m.specular_color_texture, "specular colour"),
            (&m.transmission_texture, "transmission"),
            (&m.clearcoat_texture, "clear coat"),
            (&m.clearcoat_roughness_texture, "clear coat roughness"),
            (&m.clearcoat_normal_texture, "clear coat normal"),
        ];
        for (_, what) in lost.into_iter().filter(|(texture, _)| texture.is_some()) {
            self.notes
                .push(format!("material {}: its {what} texture", m.name));
        }
        if m.attenuation_distance_m.is_finite() {
            self.notes
                .push(format!("material {}: its attenuation", m.name));
        }
        if m.transmission > 0.0 && m.thin_walled {
            self.notes.push(format!(
                "material {}: thin walls bend light in Blender",
                m.name
            ));
        }
        let entry = json!({
            "name": m.name,
            "base_color": m.base_color,
            "base_color_texture": self.texture(&m.base_color_texture, m, true),
            "metallic": m.metallic,
            "roughness": m.roughness,
            "metallic_roughness_texture": self.texture(&m.metallic_roughness_texture, m, false),
            "normal_texture": self.texture(&m.normal_texture, m, false),
            "normal_scale": m.normal_scale,
            "emissive": m.emissive.map(|channel| f64::from(channel) * self.exposure),
            "emissive_texture": self.texture(&m.emissive_texture, m, true),
            "ior": m.ior,
            // Principled BSDF: 0.5 is the plain dielectric.
            "specular_level": 0.5 * m.specular,
            "specular_tint": m.specular_color,
            "transmission": m.transmission,
            "has_volume": m.transmission > 0.0 && !m.thin_walled,
            "coat": m.clearcoat,
            "coat_roughness": m.clearcoat_roughness,
            "has_alpha": m.alpha_mode != AlphaMode::Opaque,
            "unlit": m.unlit,
        });
        self.materials.push(entry);
        self.places.insert(key, self.materials.len() - 1);
        self.materials.len() - 1
    }

    fn texture(
        &mut self,
        reference: &Option<TextureRef>,
        material: &Material,
        is_srgb: bool,
    ) -> Value {
        let Some(reference) = reference else {
            return Value::Null;
        };
        if reference.transform != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            self.notes
                .push(format!("material {}: its texture transform", material.name));
        }
        json!({ "texture": self.image(&reference.texture, is_srgb), "uv_set": reference.uv_set })
    }

    fn image(&mut self, texture: &Arc<Texture>, is_srgb: bool) -> usize {
        // One image may be colours here and numbers there.
        let key = Arc::as_ptr(texture) as usize + usize::from(is_srgb);
        if let Some(place) = self.places.get(&key) {
            return *place;
        }
        let rows = texture
            .rgba8
            .chunks(texture.width as usize)
            .rev()
            .flatten()
            .copied();
        let rows: Vec<[u8; 4]> = rows.collect();
        self.textures.push(json!({
            "name": texture.name,
            "width": texture.width,
            "height": texture.height,
            "pixels": self.numbers.add(rows.as_flattened()),
            "is_srgb": is_srgb,
        }));
        self.places.insert(key, self.textures.len() - 1);
        self.textures.len() - 1
    }
}
