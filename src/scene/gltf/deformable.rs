//! Skins and morph targets as a file has them.

use std::sync::Arc;

use glam::DMat4;
use gltf::json;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::Problem;
use super::container::malformed;
use super::document::Document;
use crate::scene::deformation::{DeformableMesh, Joint, MorphTarget, Skin};

/// What shapes the vertices of a primitive, read before its own arrays are put in order; `base` is left empty.
pub(super) fn read_deformable(
    document: &Document,
    source: &json::mesh::Primitive,
    name: &str,
    vertices: usize,
) -> Result<Option<DeformableMesh>, Problem> {
    let influences = read_influences(document, source, name, vertices)?;
    let mut targets = Vec::new();
    for (number, target) in source.targets.iter().flatten().enumerate() {
        let deltas = |accessor: &Option<json::Index<json::Accessor>>, part: &str| {
            let Some(accessor) = accessor else {
                return Ok(Vec::new());
            };
            let at = format!("{name}, morph target {number}, {part}");
            let deltas = document.vectors::<3>(accessor.value(), &at, 3, false)?;
            let finite = deltas.as_flattened().iter().all(|x| x.is_finite());
            match finite && deltas.len() == vertices {
                true => Ok(deltas),
                false => Err(malformed(
                    at,
                    format!("is not one finite vector for each of {vertices} vertices"),
                )),
            }
        };
        targets.push(MorphTarget {
            positions: deltas(&target.positions, "POSITION")?,
            normals: deltas(&target.normals, "NORMAL")?,
            tangents: deltas(&target.tangents, "TANGENT")?,
        });
    }
    let shapes = !influences.is_empty() || !targets.is_empty();
    Ok(shapes.then(|| DeformableMesh {
        targets,
        influences,
        ..DeformableMesh::default()
    }))
}

/// Of all sets JOINTS_n and WEIGHTS_n.
fn read_influences(
    document: &Document,
    source: &json::mesh::Primitive,
    name: &str,
    vertices: usize,
) -> Result<Vec<Vec<(u32, f32)>>, Problem> {
    let accessor = |semantic| source.attributes.get(&Checked::Valid(semantic));
    let mut influences = Vec::new();
    for set in 0.. {
        let (Some(joints), Some(weights)) = (
            accessor(Semantic::Joints(set)),
            accessor(Semantic::Weights(set)),
        ) else {
            break;
        };
        let at = format!("{name}, JOINTS_{set}");
        let joints = document.vectors::<4>(joints.value(), &at, 4, false)?;
        let at = format!("{name}, WEIGHTS_{set}");
        let weights = document.vectors::<4>(weights.value(), &at, 4, true)?;
        let positive = weights
            .as_flattened()
            .iter()
            .all(|w| *w >= 0.0 && w.is_finite());
        if joints.len() != vertices || weights.len() != vertices || !positive {
            return Err(malformed(
                at,
                format!("is not four joints and weights from 0 for each of {vertices} vertices"),
            ));
        }
        influences.resize(vertices, Vec::new());
        for (vertex, (joints, weights)) in joints.iter().zip(&weights).enumerate() {
            let pairs = joints
                .iter()
                .zip(weights)
                .filter(|(_, weight)| **weight > 0.0);
            influences[vertex].extend(pairs.map(|(joint, weight)| (*joint as u32, *weight)));
        }
    }
    for pairs in &mut influences {
        let sum: f32 = pairs.iter().map(|(_, weight)| weight).sum();
        pairs.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    Ok(influences)
}

/// The skin of a node, held against the primitives that it bends.
pub(super) fn read_skin(
    document: &Document,
    index: usize,
    shapes: &[&DeformableMesh],
) -> Result<Arc<Skin>, Problem> {
    let at = format!("skins[{index}]");
    let skins = &document.skins;
    let source = skins
        .get(index)
        .ok_or_else(|| malformed(&at, format!("does not exist; there are {}", skins.len())))?;
    let inverse_binds = match source.inverse_bind_matrices {
        None => vec![DMat4::IDENTITY; source.joints.len()],
        Some(accessor) => document
            .vectors::<16>(accessor, &at, 16, false)?
            .iter()
            .map(|columns| DMat4::from_cols_array(&columns.map(f64::from)))
            .collect(),
    };
    if inverse_binds.len() < source.joints.len() || !inverse_binds.iter().all(DMat4::is_finite) {
        return Err(malformed(
            &at,
            "has not one finite inverse bind matrix for each joint",
        ));
    }
    let nodes = document.nodes.len();
    if let Some(joint) = source.joints.iter().find(|joint| **joint >= nodes) {
        return Err(malformed(
            &at,
            format!("refers to node {joint}; there are {nodes}"),
        ));
    }
    let used = shapes
        .iter()
        .flat_map(|shape| shape.influences.iter().flatten());
    if let Some((joint, _)) = used.max_by_key(|(joint, _)| *joint)
        && *joint as usize >= source.joints.len()
    {
        return Err(malformed(
            &at,
            format!(
                "a vertex refers to joint {joint}; there are {}",
                source.joints.len()
            ),
        ));
    }
    let joints = source.joints.iter().zip(inverse_binds);
    Ok(Arc::new(Skin {
        joints: joints
            .map(|(node, inverse_bind)| Joint {
                node: *node,
                inverse_bind,
            })
            .collect(),
    }))
}
