//! Meshes: attributes and indices to clean indexed triangles.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use gltf::json;
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::container::{clip, malformed};
use super::deformable::read_deformable;
use super::document::Document;
use super::uv_sets::{self, UvSets, uv_sets};
use super::{Note, Notes, Problem};
use crate::scene::Primitive;
use crate::scene::deformation::{DeformableMesh, MorphTarget};

/// A primitive with the index of its material, if it names one.
#[derive(Clone)]
pub(super) struct DrawnPrimitive {
    pub primitive: Arc<Primitive>,
    /// What a skin or morph targets start from; `None`: the primitive keeps its shape.
    pub deformable: Option<Arc<DeformableMesh>>,
    pub material: Option<usize>,
}

/// Reads each mesh once, when it is first drawn.
pub(super) struct Meshes<'a> {
    document: &'a Document,
    read: HashMap<usize, Vec<DrawnPrimitive>>,
}

impl<'a> Meshes<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self {
            document,
            read: HashMap::new(),
        }
    }

    pub fn get(
        &mut self,
        index: usize,
        at: &str,
        notes: &mut Notes,
    ) -> Result<Vec<DrawnPrimitive>, Problem> {
        if let Some(mesh) = self.read.get(&index) {
            return Ok(mesh.clone());
        }
        let meshes = &self.document.meshes;
        let mesh = meshes.get(index).ok_or_else(|| {
            malformed(
                at,
                format!("refers to mesh {index}; there are {}", meshes.len()),
            )
        })?;
        let label = match &mesh.name {
            Some(name) if !name.is_empty() => clip(name),
            _ => format!("mesh {index}"),
        };
        let mut drawn = Vec::new();
        for (number, source) in mesh.primitives.iter().enumerate() {
            let name = format!("{label} / primitive {number}");
            let material = source.material.map(|material| material.value());
            let sets = match material.and_then(|index| self.document.materials.get(index)) {
                Some(material) => uv_sets(material, &name)?,
                None => uv_sets::PLAIN,
            };
            let read = read_primitive(self.document, source, &name, sets, notes)?;
            if let Some((primitive, deformable)) = read {
                drawn.push(DrawnPrimitive {
                    primitive: Arc::new(primitive),
                    deformable: deformable.map(Arc::new),
                    material,
                });
            }
        }
        self.read.insert(index, drawn.clone());
        Ok(drawn)
    }
}

/// None where nothing is left to draw; the notes say why.
fn read_primitive(
    document: &Document,
    source: &json::mesh::Primitive,
    name: &str,
    sets: UvSets,
    notes: &mut Notes,
) -> Result<Option<(Primitive, Option<DeformableMesh>)>, Problem> {
    let mode = match source.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        Checked::Valid(_) => {
            notes.add(Note::NotTriangles, 1, name);
            return Ok(None);
        }
        Checked::Invalid => return Err(malformed(name, "has an unknown mode; expected 0 to 6")),
    };
    require_uncompressed(document, source)?;
    let attribute = |semantic: Semantic| {
        source
            .attributes
            .get(&Checked::Valid(semantic))
            .map(|accessor| accessor.value())
    };
    let Some(position) = attribute(Semantic::Positions) else {
        notes.plain(format!("{name} has no positions and was left out"));
        return Ok(None);
    };
    let mut primitive = Primitive {
        name: name.to_string(),
        positions: document.vectors::<3>(position, &at(name, "POSITION"), 3, false)?,
        ..Primitive::default()
    };
    if let Some(index) = attribute(Semantic::Normals) {
        primitive.normals = document.vectors::<3>(index, &at(name, "NORMAL"), 3, false)?;
    }
    if let Some(index) = attribute(Semantic::Tangents) {
        primitive.tangents = document.vectors::<4>(index, &at(name, "TANGENT"), 4, false)?;
    }
    for (place, set) in sets.into_iter().enumerate() {
        if let Some(index) = attribute(Semantic::TexCoords(set)) {
            let at = at(name, &format!("TEXCOORD_{set}"));
            primitive.uvs[place] = document.vectors::<2>(index, &at, 2, false)?;
        }
    }
    if let Some(index) = attribute(Semantic::Colors(0)) {
        primitive.colors = document.vectors::<4>(index, &at(name, "COLOR_0"), 3, true)?;
    }
    check_attributes(&primitive)?;
    let deformable = read_deformable(document, source, name, primitive.positions.len())?;
    let indices = match source.indices {
        Some(index) => document.indices(index.value(), &at(name, "indices"))?,
        None => (0..primitive.positions.len() as u32).collect(),
    };
    let vertices = primitive.positions.len();
    if let Some(index) = indices.iter().find(|&&index| index as usize >= vertices) {
        return Err(malformed(
            at(name, "indices"),
            format!("index {index} is out of range; there are {vertices} vertices"),
        ));
    }
    let (triangles, left_over) = assemble(mode, &indices);
    if left_over > 0 {
        notes.add(Note::Incomplete, left_over as u64, name);
    }
    let given = triangles.len();
    primitive.triangles = triangles;
    drop_degenerate(&mut primitive);
    let dropped = given - primitive.triangles.len();
    if dropped > 0 {
        notes.add(Note::Degenerate, dropped as u64, name);
    }
    if primitive.triangles.is_empty() {
        notes.plain(format!("{name} has no triangles and was left out"));
        return Ok(None);
    }
    let is_flat = primitive.normals.is_empty();
    let order: Vec<u32> = primitive.triangles.iter().flatten().copied().collect();
    finish_normals(&mut primitive, notes);
    for color in primitive.colors.iter_mut().flatten() {
        *color = color.clamp(0.0, 1.0);
    }
    let deformable = deformable.map(|mesh| DeformableMesh {
        base: primitive.clone(),
        is_flat,
        ..match is_flat {
            true => gathered(&mesh, &order),
            false => mesh,
        }
    });
    Ok(Some((primitive, deformable)))
}

/// As [`make_flat`] gathers the primitive's own arrays.
fn gathered(mesh: &DeformableMesh, order: &[u32]) -> DeformableMesh {
    let targets = mesh.targets.iter().map(|target| MorphTarget {
        positions: gather(&target.positions, order),
        normals: Vec::new(),
        tangents: Vec::new(),
    });
    let influences = order.iter();
    DeformableMesh {
        targets: targets.collect(),
        influences: influences
            .filter_map(|vertex| mesh.influences.get(*vertex as usize).cloned())
            .collect(),
        ..DeformableMesh::default()
    }
}

fn at(name: &str, part: &str) -> String {
    format!("{name}, {part}")
}

/// A Draco primitive may carry the plain mesh beside the compressed one; only without it there is nothing to draw.
fn require_uncompressed(
    document: &Document,
    source: &json::mesh::Primitive,
) -> Result<(), Problem> {
    const DRACO: &str = "KHR_draco_mesh_compression";
    let compressed = source
        .extensions
        .as_ref()
        .is_some_and(|extensions| extensions.others.contains_key(DRACO));
    let mut accessors = source.attributes.values().chain(&source.indices);
    if compressed && !accessors.all(|accessor| document.accessor_is_backed(accessor.value())) {
        return Err(Problem::extension(DRACO));
    }
    Ok(())
}

fn check_attributes(primitive: &Primitive) -> Result<(), Problem> {
    let count = primitive.positions.len();
    let name = &primitive.name;
    let check = |part: &str, length: usize, bad: Option<usize>| {
        if length != 0 && length != count {
            return Err(malformed(
                at(name, part),
                format!("has {length} elements for {count} vertices"),
            ));
        }
        match bad {
            Some(vertex) => Err(malformed(
                at(name, part),
                format!("vertex {vertex} is not finite"),
            )),
            None => Ok(()),
        }
    };
    check("POSITION", count, first_bad(&primitive.positions))?;
    check(
        "NORMAL",
        primitive.normals.len(),
        first_bad(&primitive.normals),
    )?;
    check(
        "TANGENT",
        primitive.tangents.len(),
        first_bad(&primitive.tangents),
    )?;
    for (set, uvs) in primitive.uvs.iter().enumerate() {
        check(&format!("TEXCOORD_{set}"), uvs.len(), first_bad(uvs))?;
    }
    check(
        "COLOR_0",
        primitive.colors.len(),
        first_bad(&primitive.colors),
    )
}

fn first_bad<const N: usize>(vectors: &[[f32; N]]) -> Option<usize> {
    vectors
        .iter()
        .position(|vector| !vector.iter().all(|value| value.is_finite()))
}

/// Triangles in the orders of glTF 2.0 section 3.7.2.1, and how many indices were left over.
fn assemble(mode: Mode, indices: &[u32]) -> (Vec<[u32; 3]>, usize) {
    let whole = indices.len() >= 3;
    match mode {
        Mode::TriangleStrip if whole => {
            let strip = indices.windows(3).enumerate().map(|(number, three)| {
                if number % 2 == 0 {
                    [three[0], three[1], three[2]]
                } else {
                    [three[0], three[2], three[1]]
                }
            });
            (strip.collect(), 0)
        }
        Mode::TriangleFan if whole => {
            let fan = indices[1..]
                .windows(2)
                .map(|two| [two[0], two[1], indices[0]]);
            (fan.collect(), 0)
        }
        Mode::Triangles => {
            let triples = indices.chunks_exact(3);
            let left_over = triples.remainder().len();
            (
                triples
                    .map(|three| [three[0], three[1], three[2]])
                    .collect(),
                left_over,
            )
        }
        _ => (Vec::new(), indices.len()),
    }
}

/// Drops triangles without area: a repeated vertex, or a cross product that is zero in f64.
fn drop_degenerate(primitive: &mut Primitive) {
    let positions = &primitive.positions;
    primitive.triangles.retain(|&[a, b, c]| {
        a != b && b != c && c != a && face_normal(positions, [a, b, c]) != DVec3::ZERO
    });
}

/// Twice the area times the unit normal.
fn face_normal(positions: &[[f32; 3]], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|vertex| Vec3::from(positions[vertex as usize]).as_dvec3());
    (b - a).cross(c - a)
}

/// Gives the primitive unit normals. Where the file has none, glTF 2.0 section 3.7.2.1 asks for flat ones, so that triangles no
/// longer share vertices, and for given tangents to be ignored.
fn finish_normals(primitive: &mut Primitive, notes: &mut Notes) {
    if primitive.normals.is_empty() {
        make_flat(primitive);
        return;
    }
    let mut zero = Vec::new();
    for (vertex, normal) in primitive.normals.iter_mut().enumerate() {
        match Vec3::from(*normal).as_dvec3().try_normalize() {
            Some(unit) => *normal = unit.as_vec3().to_array(),
            None => zero.push(vertex),
        }
    }
    if !zero.is_empty() {
        replace_zero_normals(primitive, &zero);
        notes.add(Note::ZeroNormals, zero.len() as u64, &primitive.name);
    }
    let mut usable = true;
    for tangent in &mut primitive.tangents {
        let [x, y, z, handedness] = *tangent;
        match DVec3::new(x.into(), y.into(), z.into()).try_normalize() {
            Some(unit) if handedness.abs() == 1.0 => {
                let [x, y, z] = unit.as_vec3().to_array();
                *tangent = [x, y, z, handedness];
            }
            _ => usable = false,
        }
    }
    if !usable {
        primitive.tangents = Vec::new();
        notes.add(Note::BadTangents, 1, &primitive.name);
    }
}

fn make_flat(primitive: &mut Primitive) {
    let order: Vec<u32> = primitive.triangles.iter().flatten().copied().collect();
    primitive.normals = primitive
        .triangles
        .iter()
        .flat_map(|&triangle| {
            let normal = face_normal(&primitive.positions, triangle).normalize();
            [normal.as_vec3().to_array(); 3]
        })
        .collect();
    primitive.tangents = Vec::new();
    primitive.positions = gather(&primitive.positions, &order);
    primitive.colors = gather(&primitive.colors, &order);
    for uvs in &mut primitive.uvs {
        *uvs = gather(uvs, &order);
    }
    primitive.triangles = (0..order.len() as u32 / 3)
        .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
        .collect();
}

fn gather<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    order.iter().map(|&index| values[index as usize]).collect()
}

/// The mean normal of the faces around each vertex of `zero`, by area.
fn replace_zero_normals(primitive: &mut Primitive, zero: &[usize]) {
    let mut sums: HashMap<usize, DVec3> =
        zero.iter().map(|&vertex| (vertex, DVec3::ZERO)).collect();
    for &triangle in &primitive.triangles {
        let normal = face_normal(&primitive.positions, triangle);
        for vertex in triangle {
            if let Some(sum) = sums.get_mut(&(vertex as usize)) {
                *sum += normal;
            }
        }
    }
    for (vertex, sum) in sums {
        // A vertex that no triangle uses, or whose faces cancel out, can point anywhere.
        primitive.normals[vertex] = sum.normalize_or(DVec3::Y).as_vec3().to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_alternate_and_fans_turn_about_their_first_vertex() {
        let strip = assemble(Mode::TriangleStrip, &[0, 1, 2, 3, 4]).0;
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan = assemble(Mode::TriangleFan, &[9, 1, 2, 3]).0;
        assert_eq!(fan, [[1, 2, 9], [2, 3, 9]]);
        assert_eq!(
            assemble(Mode::Triangles, &[0, 1, 2, 3]),
            (vec![[0, 1, 2]], 1)
        );
        assert_eq!(assemble(Mode::TriangleFan, &[0, 1]), (vec![], 2));
    }

    #[test]
    fn only_triangles_without_area_are_dropped() {
        let mut primitive = Primitive {
            positions: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [2.0, 0.0, 0.0],
                [1e-20, 1e-20, 0.0],
            ],
            triangles: vec![[0, 1, 2], [0, 1, 1], [0, 1, 3]],
            ..Primitive::default()
        };
        drop_degenerate(&mut primitive);
        assert_eq!(primitive.triangles, [[0, 1, 3]]);
    }
}
