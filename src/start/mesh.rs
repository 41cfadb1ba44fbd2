//! Meshes of files: models, and scans that serve as proxies.

use std::path::Path;

use glam::{DMat4, DVec3};

use crate::refusal::Refusal;
use crate::scene::{Object, SceneError, Side, load_text};

/// A glTF file as an object in its own axes.
///
/// # Errors
/// It cannot be read.
pub fn read_mesh(path: &Path, side: Side) -> Result<Object, Refusal> {
    let absolute = std::path::absolute(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mesh = toml::Value::String(absolute.to_string_lossy().into_owned());
    let list = match side {
        Side::Real => "real",
        Side::Virtual => "virtual",
    };
    let text = format!(
        "[camera]\nwidth = 1\nheight = 1\nvertical_fov_deg = 1\n[[{list}]]\nmesh = {mesh}\n"
    );
    let scene = load_text(path, &text).map_err(|error| match error {
        SceneError::Invalid { message, .. } => message,
        other => other.to_string(),
    })?;
    (scene.objects.into_iter().next())
        .ok_or_else(|| format!("{}: it holds no mesh", path.display()).into())
}

/// World-space triangles of a proxy's file.
pub fn mesh_triangles(path: &Path, world_from_mesh: DMat4) -> Result<Vec<[DVec3; 3]>, Refusal> {
    let object = read_mesh(path, Side::Real)?;
    let world = |triangle: [DVec3; 3]| triangle.map(|p| world_from_mesh.transform_point3(p));
    Ok(triangles(&object).map(world).collect())
}

/// The box around an object's instances, in its own space; `None`: it has no triangle.
pub fn bounds(object: &Object) -> Option<(DVec3, DVec3)> {
    let corners = || {
        object.instances.iter().flat_map(|part| {
            let place = part.object_from_local;
            let positions = part.primitive.positions.iter();
            positions.map(move |p| place.transform_point3(DVec3::from(p.map(f64::from))))
        })
    };
    corners().next()?;
    Some((
        corners().fold(DVec3::INFINITY, DVec3::min),
        corners().fold(DVec3::NEG_INFINITY, DVec3::max),
    ))
}

/// World-space triangles of an object.
pub fn triangles(object: &Object) -> impl Iterator<Item = [DVec3; 3]> {
    object.instances.iter().flat_map(|part| {
        let place: DMat4 = object.world_from_object * part.object_from_local;
        part.primitive.triangles.iter().map(move |corners| {
            corners.map(|corner| {
                let position = part.primitive.positions[corner as usize];
                place.transform_point3(DVec3::from(position.map(f64::from)))
            })
        })
    })
}
