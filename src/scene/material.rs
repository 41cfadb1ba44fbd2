//! A material, and `material = { ... }` of an object, which replaces what its mesh brought.

use super::error::Result;
use super::fingerprint::content;
use super::reader::{Node, is_not_negative, is_unit};
use super::{AlphaMode, TextureRef};

/// glTF metallic-roughness with the extensions mixray knows. Factors as in glTF; colours linear.
#[derive(Clone, Debug)]
pub struct Material {
    pub name: String,
    pub base_color: [f32; 4],
    pub base_color_texture: Option<TextureRef>,
    pub metallic: f32,
    /// Perceptual roughness; GGX alpha is its square.
    pub roughness: f32,
    /// G roughness, B metallic.
    pub metallic_roughness_texture: Option<TextureRef>,
    pub normal_texture: Option<TextureRef>,
    pub normal_scale: f32,
    /// Radiance, emissive strength included.
    pub emissive: [f32; 3],
    pub emissive_texture: Option<TextureRef>,
    pub alpha_mode: AlphaMode,
    /// Emits its base colour and scatters nothing.
    pub unlit: bool,
    pub ior: f32,
    pub specular: f32,
    /// A channel.
    pub specular_texture: Option<TextureRef>,
    pub specular_color: [f32; 3],
    /// RGB, sRGB encoded.
    pub specular_color_texture: Option<TextureRef>,
    pub transmission: f32,
    /// R channel.
    pub transmission_texture: Option<TextureRef>,
    /// True: a sheet without inside (glTF thickness 0), light goes straight through; false: the mesh bounds a volume and refracts.
    pub thin_walled: bool,
    pub attenuation_color: [f32; 3],
    /// Infinity: clear.
    pub attenuation_distance_m: f32,
    pub clearcoat: f32,
    /// R channel.
    pub clearcoat_texture: Option<TextureRef>,
    pub clearcoat_roughness: f32,
    /// G channel.
    pub clearcoat_roughness_texture: Option<TextureRef>,
    pub clearcoat_normal_texture: Option<TextureRef>,
    pub clearcoat_normal_scale: f32,
}

impl Default for Material {
    /// A white dielectric, fully rough: what a scene file's `material = {}` starts from.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: [0.0; 3],
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            unlit: false,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            thin_walled: false,
            attenuation_color: [1.0; 3],
            attenuation_distance_m: f32::INFINITY,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            clearcoat_normal_scale: 1.0,
        }
    }
}

impl Material {
    /// All that it reads.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emissive_texture,
            &self.specular_texture,
            &self.specular_color_texture,
            &self.transmission_texture,
            &self.clearcoat_texture,
            &self.clearcoat_roughness_texture,
            &self.clearcoat_normal_texture,
        ]
        .into_iter()
        .flatten()
    }
}

content! {
    Material {
        base_color, base_color_texture, metallic, roughness, metallic_roughness_texture, normal_texture, normal_scale, emissive,
        emissive_texture, alpha_mode, unlit, ior, specular, specular_texture, specular_color, specular_color_texture, transmission,
        transmission_texture, thin_walled, attenuation_color, attenuation_distance_m, clearcoat, clearcoat_texture, clearcoat_roughness,
        clearcoat_roughness_texture, clearcoat_normal_texture, clearcoat_normal_scale; name }
}

const KEYS: &[&str] = &[
    "base_color",
    "metallic",
    "roughness",
    "specular",
    "specular_color",
    "ior",
    "transmission",
    "thin_walled",
    "attenuation_color",
    "attenuation_distance_m",
    "clearcoat",
    "clearcoat_roughness",
    "emissive",
    "unlit",
];

/// What is not given is [`Material::default`]'s.
pub(super) fn read_material(node: &Node, name: &str) -> Result<Material> {
    let table = node.table("material", KEYS)?;
    let plain = Material::default();
    let unit =
        |key, default| -> Result<f32> { Ok(table.optional(key, Node::unit)?.unwrap_or(default)) };
    let base_color = table
        .optional("base_color", read_base_color)?
        .unwrap_or(plain.base_color);
    Ok(Material {
        name: name.to_owned(),
        base_color,
        alpha_mode: if base_color[3] < 1.0 {
            AlphaMode::Blend
        } else {
            AlphaMode::Opaque
        },
        metallic: unit("metallic", plain.metallic)?,
        roughness: unit("roughness", plain.roughness)?,
        specular: unit("specular", plain.specular)?,
        specular_color: table
            .optional("specular_color", |node| {
                rgb(node, "a finite number of at least 0", is_not_negative)
            })?
            .unwrap_or(plain.specular_color),
        ior: table
            .optional("ior", |node| {
                node.number("a number from 1 to 100", |x| (1.0..=100.0).contains(&x))
            })?
            .map_or(plain.ior, |ior| ior as f32),
        transmission: unit("transmission", plain.transmission)?,
        thin_walled: table
            .optional("thin_walled", Node::boolean)?
            .unwrap_or(plain.thin_walled),
        attenuation_color: table
            .optional("attenuation_color", |node| {
                // Beer's law takes the logarithm of the colour.
                let accept = |x: f64| (1e-6..=1.0).contains(&x);
                rgb(node, "a number from 1e-6 to 1", accept)
            })?
            .unwrap_or(plain.attenuation_color),
        attenuation_distance_m: table
            .optional("attenuation_distance_m", |node| {
                node.number("a number of at least 1e-12, or inf", |x| x >= 1e-12)
            })?
            .map_or(plain.attenuation_distance_m, |distance| distance as f32),
        clearcoat: unit("clearcoat", plain.clearcoat)?,
        clearcoat_roughness: unit("clearcoat_roughness", plain.clearcoat_roughness)?,
        emissive: table
            .optional("emissive", Node::radiance)?
            .unwrap_or(plain.emissive),
        unlit: table
            .optional("unlit", Node::boolean)?
            .unwrap_or(plain.unlit),
        ..plain
    })
}

fn rgb(node: &Node, expected: &str, accept: impl Fn(f64) -> bool) -> Result<[f32; 3]> {
    Ok(node.numbers::<3>(expected, accept)?.map(|x| x as f32))
}

/// Three numbers, or four with an opacity.
fn read_base_color(node: &Node) -> Result<[f32; 4]> {
    let expected = "a number from 0 to 1";
    if node.len() == Some(4) {
        return Ok(node.numbers::<4>(expected, is_unit)?.map(|x| x as f32));
    }
    let [r, g, b] = rgb(node, expected, is_unit)?;
    Ok([r, g, b, 1.0])
}

/// A matt surface of one colour.
pub(super) fn lambertian(name: &str, albedo: f32) -> Material {
    Material {
        name: name.to_owned(),
        base_color: [albedo, albedo, albedo, 1.0],
        specular: 0.0,
        ..Material::default()
    }
}
