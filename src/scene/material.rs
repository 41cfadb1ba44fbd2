//! `material = { ... }` of an object: replaces what its mesh brought.

use super::error::Result;
use super::reader::{Node, is_not_negative, is_unit};
use super::{AlphaMode, Material};

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
