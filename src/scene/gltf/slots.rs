//! Factors and textures of a material, checked.

use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use serde::Deserialize;

use super::container::malformed;
use super::image::Textures;
use super::uv_sets::UvSets;
use super::{Note, Notes, Problem};
use crate::scene::TextureRef;

/// Reads the factors and textures of one material.
pub(super) struct Slots<'s, 'd> {
    pub sets: UvSets,
    pub textures: &'s mut Textures<'d>,
    pub at: &'s str,
    pub notes: &'s mut Notes,
}

impl Slots<'_, '_> {
    pub fn unit<const N: usize>(
        &mut self,
        name: &str,
        values: [f32; N],
    ) -> Result<[f32; N], Problem> {
        self.limited(name, values, 1.0)
    }

    pub fn unit1(&mut self, name: &str, value: f32) -> Result<f32, Problem> {
        self.limited1(name, value, 1.0)
    }

    pub fn limited1(&mut self, name: &str, value: f32, most: f32) -> Result<f32, Problem> {
        Ok(self.limited(name, [value], most)?[0])
    }

    /// Finite values, clamped to 0..=`most` with a note.
    pub fn limited<const N: usize>(
        &mut self,
        name: &str,
        values: [f32; N],
        most: f32,
    ) -> Result<[f32; N], Problem> {
        if !values.iter().all(|value| value.is_finite()) {
            return Err(malformed(self.at, format!("its {name} is not finite")));
        }
        let clamped = values.map(|value| value.clamp(0.0, most));
        if clamped != values {
            self.notes.add(Note::Clamped, 1, self.at);
        }
        Ok(clamped)
    }

    pub fn texture(
        &mut self,
        slot: &str,
        info: &Option<Info>,
    ) -> Result<Option<TextureRef>, Problem> {
        let Some(info) = info else { return Ok(None) };
        let transform = info
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.texture_transform.as_ref());
        self.reference(slot, info.index.value(), info.tex_coord, transform)
    }

    /// A normal texture and its scale.
    pub fn normal(
        &mut self,
        slot: &str,
        info: &Option<NormalTexture>,
    ) -> Result<(Option<TextureRef>, f32), Problem> {
        let Some(info) = info else {
            return Ok((None, 1.0));
        };
        if !info.scale.is_finite() {
            return Err(malformed(
                self.at,
                format!("the scale of its {slot} is not finite"),
            ));
        }
        // The crate types the transform on every texture but this kind.
        let transform = info
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.others.get("KHR_texture_transform"))
            .map(TextureTransform::deserialize)
            .transpose()
            .map_err(|error| malformed(format!("{}, {slot}", self.at), error.to_string()))?;
        let reference =
            self.reference(slot, info.index.value(), info.tex_coord, transform.as_ref())?;
        Ok((reference, info.scale))
    }

    fn reference(
        &mut self,
        slot: &str,
        texture: usize,
        tex_coord: u32,
        transform: Option<&TextureTransform>,
    ) -> Result<Option<TextureRef>, Problem> {
        let at = format!("{}, {slot}", self.at);
        let uv_set = transform
            .and_then(|transform| transform.tex_coord)
            .unwrap_or(tex_coord);
        let uv_set = u32::from(uv_set != self.sets[0]);
        let rows = transform.map_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0], transform_rows);
        if !rows.iter().all(|value| value.is_finite()) {
            return Err(malformed(at, "its texture transform is not finite"));
        }
        let texture = self.textures.get(texture, &at, self.notes)?;
        Ok(texture.map(|texture| TextureRef {
            texture,
            uv_set,
            transform: rows,
        }))
    }
}

/// Offset * rotation * scale. The sense of rotation is the one that the sample model TextureTransformTest and the Khronos
/// viewer agree on: the image turns clockwise; the formula printed in the extension's text turns it the other way.
fn transform_rows(transform: &TextureTransform) -> [f32; 6] {
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    let [scale_u, scale_v] = transform.scale.0.map(f64::from);
    let [offset_u, offset_v] = transform.offset.0;
    [
        (cos * scale_u) as f32,
        (sin * scale_v) as f32,
        offset_u,
        (-sin * scale_u) as f32,
        (cos * scale_v) as f32,
        offset_v,
    ]
}
