//! PLY and OBJ: what scanners write, read as proxies. Positions in metres and triangles; normals where PLY has them. Colours, texture
//! coordinates and materials are left out: a proxy takes its colours from the photograph.
//!
//! The readers are our own: files of scanners hold millions of vertices and come from anywhere, so that nothing may be taken for a count
//! before the bytes for it are there, and errors name the line or the vertex. Crates for PLY keep a map of names for each vertex.

mod obj;
mod ply;

use std::path::Path;
use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};

use super::gltf::GltfScene;
use super::{Instance, Material, Primitive};
use crate::decode::{FileKind, read_file};
use crate::memory;

/// Largest file: vertices are counted in 32 bits.
const MAX_FILE_BYTES: u64 = 8 << 30;

/// Most bytes of memory that a byte of a file becomes, its own included: three corners with their normals for a face of a few bytes.
const BYTES_PER_BYTE: u64 = 12;

/// Of a triangle without normals: corners, positions and normals of its own.
const BYTES_PER_TRIANGLE: u64 = 12 + 3 * (12 + 12);

/// Vertices and faces as a file has them.
#[derive(Debug, Default)]
struct Mesh {
    positions: Vec<[f32; 3]>,
    /// Empty, or as many as positions.
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

type Result<T> = std::result::Result<T, String>;

/// A PLY or OBJ file as the one instance that it holds.
///
/// # Errors
/// "problem; expected ...; how to mend", without the path.
pub(crate) fn read(path: &Path, kind: FileKind) -> Result<GltfScene> {
    let bytes = read_file(path, MAX_FILE_BYTES).map_err(|problem| {
        format!("{problem}; expected a readable file; correct the path or the rights")
    })?;
    let needed = BYTES_PER_BYTE * bytes.len() as u64;
    memory::ensure(needed, "reading the mesh")
        .map_err(|shortage| format!("{shortage}; expected a smaller mesh; simplify it"))?;
    let mesh = match kind {
        FileKind::Ply => ply::read(&bytes)?,
        _ => obj::read(&bytes)?,
    };
    drop(bytes);
    let stem = path.file_stem().unwrap_or_default();
    finish(mesh, stem.to_string_lossy().into_owned())
}

fn finish(mut mesh: Mesh, name: String) -> Result<GltfScene> {
    let vertices = mesh.positions.len();
    let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite() && x.abs() < 1e15);
    if let Some(index) = mesh.positions.iter().position(|p| !finite(p)) {
        return Err(format!(
            "vertex {index} is at {:?}; expected finite metres; repair the mesh",
            mesh.positions[index]
        ));
    }
    if let Some(index) = mesh
        .triangles
        .iter()
        .flatten()
        .find(|i| **i as usize >= vertices)
    {
        return Err(format!(
            "a face asks for vertex {index} of {vertices}, counted from 0; expected one that is there; repair the mesh"
        ));
    }
    let given = mesh.triangles.len();
    if given == 0 {
        return Err(format!(
            "it has {vertices} vertices and no faces: a cloud of points; expected a mesh; reconstruct a surface, for example in MeshLab or CloudCompare"
        ));
    }
    memory::ensure(given as u64 * BYTES_PER_TRIANGLE, "its triangles")
        .map_err(|shortage| format!("{shortage}; expected a smaller mesh; simplify it"))?;
    let corners = |positions: &[[f32; 3]], triangle: [u32; 3]| {
        triangle.map(|vertex| Vec3::from(positions[vertex as usize]).as_dvec3())
    };
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let positions = &mesh.positions;
    (mesh.triangles).retain(|triangle| normal(corners(positions, *triangle)) != DVec3::ZERO);
    if mesh.triangles.is_empty() {
        return Err(
            "all its faces are without area; expected a surface; export it again".to_owned(),
        );
    }
    let mut warnings = Vec::new();
    let dropped = given - mesh.triangles.len();
    if dropped > 0 {
        warnings.push(format!("dropped {dropped} degenerate triangles"));
    }
    let has_normals = !mesh.normals.is_empty()
        && mesh.normals.iter().all(|n| {
            let length = Vec3::from(*n).length();
            length.is_finite() && length > 1e-6
        });
    let mut primitive = Primitive {
        name,
        ..Primitive::default()
    };
    if has_normals {
        let unit = |n: &[f32; 3]| Vec3::from(*n).normalize().to_array();
        primitive.normals = mesh.normals.iter().map(unit).collect();
        primitive.positions = mesh.positions;
        primitive.triangles = mesh.triangles;
    } else {
        // Flat, as glTF has meshes without normals.
        for triangle in &mesh.triangles {
            let corners = corners(&mesh.positions, *triangle);
            let normal = normal(corners).normalize().as_vec3().to_array();
            let first = primitive.positions.len() as u32;
            primitive.triangles.push([first, first + 1, first + 2]);
            for vertex in triangle {
                primitive.positions.push(mesh.positions[*vertex as usize]);
                primitive.normals.push(normal);
            }
        }
    }
    Ok(GltfScene {
        instances: vec![Instance {
            object_from_local: DMat4::IDENTITY,
            animation: None,
            deformation: None,
            primitive: Arc::new(primitive),
            material: Arc::new(Material::default()),
        }],
        warnings,
        ..GltfScene::default()
    })
}

/// Triangles around the first corner.
fn fan(corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    for pair in corners.windows(2).skip(1) {
        triangles.push([corners[0], pair[0], pair[1]]);
    }
}
