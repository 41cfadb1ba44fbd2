//! Writes binary glTF 2.0.

use std::path::Path;

use serde_json::{Value, json};

use crate::mesh::Mesh;

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;

/// Writes one mesh with a primitive a part, each with a glTF material or none. Texture coordinates are left out.
pub fn write(path: &Path, parts: &[(&Mesh, Option<Value>)]) -> std::io::Result<()> {
    let mut file = File::default();
    let mut materials = Vec::new();
    let mut primitives = Vec::new();
    for (mesh, material) in parts {
        let mut primitive = file.push_mesh(mesh);
        if let Some(material) = material {
            primitive["material"] = json!(materials.len());
            materials.push(material.clone());
        }
        primitives.push(primitive);
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": "mixray generate_scenes" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": primitives }],
        "buffers": [{ "byteLength": file.bytes.len() }],
        "bufferViews": file.views,
        "accessors": file.accessors,
    });
    if !materials.is_empty() {
        document["extensionsUsed"] = json!(["KHR_materials_clearcoat"]);
        document["materials"] = json!(materials);
    }
    std::fs::write(path, container(&document, &file.bytes))
}

#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    fn push_mesh(&mut self, mesh: &Mesh) -> Value {
        let positions: Vec<[f32; 3]> = mesh
            .positions
            .iter()
            .map(|p| p.as_vec3().to_array())
            .collect();
        let normals: Vec<[f32; 3]> = mesh
            .normals
            .iter()
            .map(|n| n.as_vec3().to_array())
            .collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            positions
                .iter()
                .copied()
                .reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])])
        };
        let (low, high) = (bound(f32::min), bound(f32::max));
        let indices: Vec<u16> = mesh
            .triangles
            .as_flattened()
            .iter()
            .map(|index| *index as u16)
            .collect();
        assert!(
            positions.len() <= usize::from(u16::MAX),
            "the indices have 16 bits"
        );
        let position = self.push(
            bytemuck::cast_slice(&positions),
            FLOAT,
            "VEC3",
            positions.len(),
        );
        self.accessors[position]["min"] = json!(low);
        self.accessors[position]["max"] = json!(high);
        let normal = self.push(bytemuck::cast_slice(&normals), FLOAT, "VEC3", normals.len());
        let index = self.push(
            bytemuck::cast_slice(&indices),
            UNSIGNED_SHORT,
            "SCALAR",
            indices.len(),
        );
        json!({ "attributes": { "POSITION": position, "NORMAL": normal }, "indices": index })
    }

    fn push(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }),
        );
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1,
            "componentType": component,
            "type": kind,
            "count": count,
        }));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.accessors.len() - 1
    }
}

/// Header, JSON chunk padded with spaces, binary chunk.
fn container(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut glb = b"glTF".to_vec();
    glb.extend(2_u32.to_le_bytes());
    glb.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_slice()), (b"BIN\0", binary)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}
