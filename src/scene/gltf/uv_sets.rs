//! Which sets of texture coordinates a material uses: a mesh carries two, whatever their numbers.

use gltf::json;
use serde_json::Value;

use super::Problem;
use super::container::malformed;

/// The numbers of the sets that stand in the first and the second place.
pub(super) type UvSets = [u32; 2];

pub(super) const PLAIN: UvSets = [0, 1];

/// Sets 0 and 1 as they are, unless the material uses others.
pub(super) fn uv_sets(material: &json::Material, at: &str) -> Result<UvSets, Problem> {
    let mut used = Vec::new();
    if let Ok(value) = serde_json::to_value(material) {
        collect(&value, &mut used);
    }
    used.sort_unstable();
    used.dedup();
    match used.as_slice() {
        [] | [0] | [1] | [0, 1] => Ok(PLAIN),
        [one] => Ok([*one, *one]),
        [one, other] => Ok([*one, *other]),
        several => Err(malformed(
            at,
            format!(
                "uses {} sets of texture coordinates, {several:?}; mixray reads two a material; bake its textures to fewer",
                several.len()
            ),
        )),
    }
}

/// Every object with a texture's index; occlusion is not read.
fn collect(value: &Value, used: &mut Vec<u32>) {
    match value {
        Value::Object(fields) => {
            if fields.get("index").is_some_and(Value::is_u64) {
                let own = fields.get("texCoord");
                let transformed = value.pointer("/extensions/KHR_texture_transform/texCoord");
                let set = transformed.filter(|set| set.is_u64()).or(own);
                let set = set.and_then(Value::as_u64).unwrap_or(0);
                used.push(u32::try_from(set).unwrap_or(u32::MAX));
            }
            let read = fields.iter().filter(|(key, _)| *key != "occlusionTexture");
            read.for_each(|(_, value)| collect(value, used));
        }
        Value::Array(values) => values.iter().for_each(|value| collect(value, used)),
        _ => {}
    }
}
