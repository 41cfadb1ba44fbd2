//! The fitted light in the text of the scene file: comments, order and everything else stay as they are.

use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::LightFit;
use crate::refusal::Refusal;

/// The text with the fitted light.
///
/// # Errors
/// It is no TOML, or writes its lights in a way that cannot be edited.
pub fn edited(text: &str, fit: &LightFit) -> Result<String, Refusal> {
    let mut document: DocumentMut =
        (text.parse()).map_err(|problem| Refusal::from(format!("{problem}")))?;
    edit_environment(&mut document, fit);
    edit_lights(&mut document, fit)?;
    Ok(document.to_string())
}

fn edit_environment(document: &mut DocumentMut, fit: &LightFit) {
    let item = document
        .entry("environment")
        .or_insert(Item::Table(Table::new()));
    let Some(table) = item.as_table_like_mut() else {
        return;
    };
    if fit.is_white_sky {
        table.remove("image");
        table.remove("rotation_deg");
        table.insert("radiance", value(numbers([1.0; 3])));
    }
    if !fit.scale.is_kept {
        set(table, "scale", fit.scale.is);
    }
    if let Some(rotation) = &fit.rotation_deg
        && !rotation.is_kept
    {
        set(table, "rotation_deg", rotation.is);
    }
}

/// Beside the value stay its comments.
fn set(table: &mut dyn toml_edit::TableLike, key: &str, number: f64) {
    let mut new = Value::from(rounded(number));
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        *new.decor_mut() = old.decor().clone();
    }
    table.insert(key, Item::Value(new));
}

/// The sun of the fit in place of those that the real world had.
fn edit_lights(document: &mut DocumentMut, fit: &LightFit) -> Result<(), Refusal> {
    match document.get_mut("light") {
        Some(Item::ArrayOfTables(lights)) => lights.retain(|light| !is_sun(light)),
        Some(Item::Value(Value::Array(lights))) => lights.retain(|light| {
            let table = light.as_inline_table();
            !table.is_some_and(|table| is_sun(table))
        }),
        _ => {}
    }
    let Some(sun) = &fit.sun else {
        return Ok(());
    };
    let direction = sun.direction.to_array();
    let irradiance = [sun.irradiance; 3];
    let comment = format!("\n# Fitted to the photograph: {}.\n", sun.sureness());
    match document.get_mut("light") {
        Some(Item::Value(Value::Array(lights))) if !lights.is_empty() => {
            let mut light = toml_edit::InlineTable::new();
            light.insert("kind", "directional".into());
            light.insert("direction", Value::Array(numbers(direction)));
            light.insert("irradiance", Value::Array(numbers(irradiance)));
            lights.push(light);
        }
        Some(Item::ArrayOfTables(lights)) => lights.push(table(direction, irradiance, &comment)),
        _ => {
            let mut lights = ArrayOfTables::new();
            lights.push(table(direction, irradiance, &comment));
            document.insert("light", Item::ArrayOfTables(lights));
        }
    }
    Ok(())
}

fn table(direction: [f64; 3], irradiance: [f64; 3], comment: &str) -> Table {
    let mut light = Table::new();
    light.insert("kind", value("directional"));
    light.insert("direction", value(numbers(direction)));
    light.insert("irradiance", value(numbers(irradiance)));
    light.decor_mut().set_prefix(comment);
    light
}

fn is_sun(light: &dyn toml_edit::TableLike) -> bool {
    let text = |key| light.get(key).and_then(Item::as_str);
    text("kind") == Some("directional") && text("side") != Some("virtual")
}

fn numbers<const N: usize>(numbers: [f64; N]) -> Array {
    numbers.map(rounded).into_iter().collect()
}

/// Six digits say more than a fit knows.
fn rounded(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}
