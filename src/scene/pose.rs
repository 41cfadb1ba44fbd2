//! Poses and transforms: rigid for the camera, T * R * S for objects.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use super::error::Result;
use super::reader::{Node, Table, is_finite};

/// How far R^T R may be from the identity: matrices are often printed with four digits.
const RIGID_TOLERANCE: f64 = 1e-3;

/// `world_from_camera`, or `position`, `look_at` and `up`; the identity without any of them.
pub(super) fn read_camera_pose(table: &Table) -> Result<DMat4> {
    for key in ["position", "look_at", "up"] {
        table.refuse_both("world_from_camera", key)?;
    }
    if let Some(pose) = table.optional("world_from_camera", read_rigid)? {
        return Ok(pose);
    }
    if ["position", "look_at", "up"]
        .iter()
        .all(|key| table.get(key).is_none())
    {
        return Ok(DMat4::IDENTITY);
    }
    let position = table.required("position", "position = [x, y, z]", |node| {
        node.vector::<3>()
    })?;
    let position = DVec3::from(position);
    let up = table.optional("up", Node::nonzero_vector)?;
    let up = up.map_or(DVec3::Y, DVec3::from).normalize();
    table.required("look_at", "look_at = [x, y, z]", |node| {
        let view = DVec3::from(node.vector::<3>()?) - position;
        let distance = view.length();
        if distance < 1e-12 {
            return Err(node.error(
                "`look_at` is `position`",
                "a point at a distance from it",
                "move one of them",
            ));
        }
        let backward = -view / distance;
        let right = up.cross(backward);
        if right.length() < 1e-6 {
            return Err(node.error(
                "the view runs along `up`",
                "an `up` across the view",
                "give another `up`, such as [0, 0, -1]",
            ));
        }
        let right = right.normalize();
        Ok(DMat4::from_cols(
            right.extend(0.0),
            backward.cross(right).extend(0.0),
            backward.extend(0.0),
            position.extend(1.0),
        ))
    })
}

/// A 4 x 4 matrix of rows that is a rotation and a translation.
fn read_rigid(node: &Node) -> Result<DMat4> {
    let rows = node.elements::<4>("4 rows of 4 numbers")?;
    let mut matrix = [[0.0; 4]; 4];
    for (numbers, row) in matrix.iter_mut().zip(&rows) {
        *numbers = row.vector::<4>()?;
    }
    rigid(&matrix).map_err(|problem| {
        node.error(
            format!("`{}` is not rigid: {problem}", node.label()),
            "a rotation and a translation, as 4 rows, the camera looking along its -Z",
            "correct the matrix (OpenCV poses need their y and z axes negated)",
        )
    })
}

/// The nearest rigid transform of a matrix of rows that is one within [`RIGID_TOLERANCE`], or why it is none. NaN is none.
pub(super) fn rigid(rows: &[[f64; 4]; 4]) -> std::result::Result<DMat4, String> {
    let pose = DMat4::from_cols_array_2d(rows).transpose();
    let rotation = DMat3::from_mat4(pose);
    let gram = rotation.transpose() * rotation - DMat3::IDENTITY;
    let off = gram
        .to_cols_array()
        .into_iter()
        .map(f64::abs)
        .fold(0.0, f64::max);
    let last_row = DVec4::from(rows[3]) - DVec4::W;
    if last_row.abs().max_element() > 1e-9 {
        Err("its last row is not 0 0 0 1".to_owned())
    } else if off > RIGID_TOLERANCE {
        Err(format!(
            "its columns are off unit length or right angles by {off:.2e}"
        ))
    } else if rotation.determinant() < 0.0 {
        Err("it mirrors".to_owned())
    } else {
        Ok(DMat4::from_mat3_translation(
            nearest_rotation(rotation),
            pose.w_axis.truncate(),
        ))
    }
}

/// Newton's iteration for the polar decomposition (Higham 1986); it converges quadratically from so near.
fn nearest_rotation(mut rotation: DMat3) -> DMat3 {
    for _ in 0..3 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    rotation
}

/// Scale, rotation and translation, which make T * R * S: `translation`, `rotation_deg` or `rotation`, and `scale`.
pub(super) fn read_placement(table: &Table) -> Result<(DVec3, DQuat, DVec3)> {
    table.refuse_both("rotation_deg", "rotation")?;
    let translation = table.optional("translation", |node| node.vector::<3>())?;
    let euler = table.optional("rotation_deg", |node| node.vector::<3>())?;
    let quaternion = table.optional("rotation", read_quaternion)?;
    let scale = table.optional("scale", read_scale)?;
    // Fixed axes X, then Y, then Z.
    let euler = euler.map(|deg| {
        let [x, y, z] = deg.map(f64::to_radians);
        DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
    });
    Ok((
        scale.unwrap_or(DVec3::ONE),
        quaternion.or(euler).unwrap_or(DQuat::IDENTITY),
        translation.map_or(DVec3::ZERO, DVec3::from),
    ))
}

fn read_quaternion(node: &Node) -> Result<DQuat> {
    let quaternion = DQuat::from_array(node.vector::<4>()?);
    let length = quaternion.length();
    if (length - 1.0).abs() > RIGID_TOLERANCE {
        return Err(node.error(
            format!("`{}` has length {length:.6}", node.label()),
            "a unit quaternion x, y, z, w",
            "divide it by its length, or use `rotation_deg`",
        ));
    }
    Ok(quaternion.normalize())
}

fn read_scale(node: &Node) -> Result<DVec3> {
    // Smaller factors make a transform that f32 cannot invert.
    let accept = |x: f64| is_finite(x) && x.abs() >= 1e-12;
    let expected = "a number other than 0 (1e-12 to 1e15 in size)";
    if node.is_array() {
        Ok(DVec3::from(node.numbers::<3>(expected, accept)?))
    } else {
        Ok(DVec3::splat(
            node.number(&format!("{expected}, or 3 of them"), accept)?,
        ))
    }
}
