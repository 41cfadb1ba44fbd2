//! A surface as binary glTF 2.0, positions and triangles alone: the reader gives it normals, and its colours come from the photograph.

use serde_json::json;

use super::depth::Surface;

const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The bytes of a .glb file.
pub fn glb(surface: &Surface) -> Vec<u8> {
    let positions: Vec<[f32; 3]> = (surface.positions.iter())
        .map(|position| position.as_vec3().to_array())
        .collect();
    let bound = |start: f32, pick: fn(f32, f32) -> f32| {
        positions
            .iter()
            .fold([start; 3], |a, b| [0, 1, 2].map(|i| pick(a[i], b[i])))
    };
    let corners = bytemuck::cast_slice::<_, u8>(&positions);
    let indices = bytemuck::cast_slice::<_, u8>(&surface.triangles);
    let document = json!({
        "asset": { "version": "2.0", "generator": "mixray" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "byteLength": corners.len() + indices.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": corners.len() },
            { "buffer": 0, "byteOffset": corners.len(), "byteLength": indices.len() },
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": positions.len(),
                "min": bound(f32::INFINITY, f32::min), "max": bound(f32::NEG_INFINITY, f32::max),
            },
            { "bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3 * surface.triangles.len() },
        ],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary = corners.len() + indices.len();
    let length = HEADER_BYTES + 2 * CHUNK_HEADER_BYTES + text.len() + binary;
    let mut bytes = Vec::with_capacity(length);
    let number = |value: usize| (value as u32).to_le_bytes();
    bytes.extend(b"glTF");
    bytes.extend([number(2), number(length), number(text.len())].as_flattened());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend(number(binary));
    bytes.extend(b"BIN\0");
    bytes.extend(corners);
    bytes.extend(indices);
    bytes
}
