//! `material = { ... }` of an object.

use toml_edit::{Array, InlineTable, Item, TableLike, Value};

use super::set;
use crate::preview::material_form::MaterialForm;
use crate::preview::quantity::decimal;
use crate::scene::Material;

/// Writes what differs; what was not there differs from the plain material.
pub(super) fn write(
    object: &mut dyn TableLike,
    was: Option<MaterialForm>,
    is: Option<MaterialForm>,
) {
    let Some(is) = is else {
        object.remove("material");
        return;
    };
    let was = was.unwrap_or_else(|| MaterialForm::of(&Material::default()));
    let item = object
        .entry("material")
        .or_insert(Item::Value(Value::InlineTable(InlineTable::new())));
    let Some(table) = item.as_table_like_mut() else {
        return;
    };
    for (key, was, is) in [
        ("metallic", was.metallic, is.metallic),
        ("roughness", was.roughness, is.roughness),
        ("specular", was.specular, is.specular),
        ("ior", was.ior, is.ior),
        ("transmission", was.transmission, is.transmission),
        (
            "attenuation_distance_m",
            was.attenuation_distance_m,
            is.attenuation_distance_m,
        ),
        ("clearcoat", was.clearcoat, is.clearcoat),
        (
            "clearcoat_roughness",
            was.clearcoat_roughness,
            is.clearcoat_roughness,
        ),
    ] {
        if was != is {
            set(table, key, decimal(is));
        }
    }
    if was.base_color != is.base_color {
        let channels = if is.base_color[3] < 1.0 { 4 } else { 3 };
        set(table, "base_color", numbers(&is.base_color[..channels]));
    }
    for (key, was, is) in [
        ("specular_color", was.specular_color, is.specular_color),
        (
            "attenuation_color",
            was.attenuation_color,
            is.attenuation_color,
        ),
        ("emissive", was.emissive, is.emissive),
    ] {
        if was != is {
            set(table, key, numbers(&is));
        }
    }
    for (key, was, is) in [
        ("thin_walled", was.thin_walled, is.thin_walled),
        ("unlit", was.unlit, is.unlit),
    ] {
        if was != is {
            set(table, key, is);
        }
    }
}

fn numbers(values: &[f32]) -> Array {
    values.iter().map(|value| decimal(*value)).collect()
}
