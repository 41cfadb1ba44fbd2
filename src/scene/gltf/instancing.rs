//! EXT_mesh_gpu_instancing: many copies of a node's mesh.

use glam::{DMat4, DQuat, DVec3};

use super::Problem;
use super::container::malformed;
use super::document::Document;
use super::nodes::{Attributes, Instancing};

/// Node-from-copy of each.
pub(super) fn copies(
    instancing: &Instancing,
    document: &Document,
    at: &str,
) -> Result<Vec<DMat4>, Problem> {
    let Attributes {
        translation,
        rotation,
        scale,
    } = instancing.attributes;
    let at = format!("{at}, EXT_mesh_gpu_instancing");
    let vectors = |accessor: Option<usize>| {
        let vectors = |index| document.vectors::<3>(index, &at, 3, false);
        accessor.map(vectors).transpose()
    };
    let (translations, scales) = (vectors(translation)?, vectors(scale)?);
    let rotations = rotation
        .map(|index| document.vectors::<4>(index, &at, 4, true))
        .transpose()?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let Some(count) = counts.into_iter().flatten().next() else {
        return Ok(vec![DMat4::IDENTITY]);
    };
    if counts.into_iter().flatten().any(|other| other != count) {
        return Err(malformed(&at, "its attributes differ in number"));
    }
    let wide = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
    let copies: Vec<DMat4> = (0..count)
        .map(|i| {
            let turned = rotations.as_ref().map(|all| all[i].map(f64::from));
            let turned = turned.map(DQuat::from_array).filter(|q| q.length() > 1e-6);
            DMat4::from_scale_rotation_translation(
                scales.as_ref().map_or(DVec3::ONE, |all| wide(&all[i])),
                turned.map_or(DQuat::IDENTITY, DQuat::normalize),
                translations
                    .as_ref()
                    .map_or(DVec3::ZERO, |all| wide(&all[i])),
            )
        })
        .collect();
    match copies.iter().all(DMat4::is_finite) {
        true => Ok(copies),
        false => Err(malformed(&at, "has a transform that is not finite")),
    }
}
