//! Lights and the environment in Blender's terms: watts of all directions, colours of at most 1.

use std::f64::consts::PI;

use glam::DVec3;
use serde_json::{Value, json};

use super::numbers::Numbers;
use super::{lamp_pose, rows};
use crate::scene::{Environment, EnvironmentMap, Light, LightKind, Side};

pub(super) fn describe(
    light: &Light,
    index: usize,
    exposure: f64,
    notes: &mut Vec<String>,
) -> Value {
    let name = format!("light {}", index + 1);
    let mut entry = match light.kind {
        LightKind::Point {
            position,
            intensity,
        } => {
            let pose = lamp_pose(position.into(), DVec3::NEG_Y, None);
            lamp("POINT", intensity, 4.0 * PI * exposure, rows(pose))
        }
        LightKind::Spot {
            position,
            direction,
            intensity,
            inner_deg,
            outer_deg,
        } => {
            let pose = lamp_pose(position.into(), direction.into(), None);
            let mut entry = lamp("SPOT", intensity, 4.0 * PI * exposure, rows(pose));
            let [inner, outer] = [inner_deg, outer_deg].map(|deg| deg.to_radians().cos());
            // The penumbra of the same flux: a smoothstep, where mixray has a square.
            let blend = (inner - outer) / (0.75 * (1.0 - outer));
            if blend > 1.0 {
                notes.push(format!(
                    "{name}: the penumbra of its cone is narrower in Blender"
                ));
            }
            entry["angle_deg"] = json!(2.0 * outer_deg);
            entry["blend"] = json!(blend.min(1.0));
            entry
        }
        LightKind::Directional {
            direction,
            irradiance,
        } => {
            let pose = lamp_pose(DVec3::ZERO, direction.into(), None);
            lamp("SUN", irradiance, exposure, rows(pose))
        }
        LightKind::Quad {
            corner,
            edge_u,
            edge_v,
            radiance,
        } => {
            let [corner, u, v] = [corner, edge_u, edge_v].map(DVec3::from);
            let normal = u.cross(v);
            let (area, width) = (normal.length(), u.length());
            if u.dot(v).abs() > 1e-6 * width * v.length() {
                notes.push(format!(
                    "{name}: a parallelogram is taken as a rectangle of its area"
                ));
            }
            let pose = lamp_pose(corner + (u + v) * 0.5, normal, Some(u));
            let mut entry = lamp("AREA", radiance, PI * area * exposure, rows(pose));
            entry["size"] = json!([width, area / width]);
            entry
        }
    };
    entry["name"] = json!(name);
    entry["is_added"] = json!(light.side == Side::Virtual);
    entry
}

/// Strength in colour and watts (of a sun watts per square metre): `strength` times `factor` in all.
fn lamp(kind: &str, strength: [f32; 3], factor: f64, matrix: Value) -> Value {
    let strength = strength.map(f64::from);
    let largest = strength.into_iter().fold(0.0, f64::max);
    let color = match largest > 0.0 {
        true => strength.map(|channel| channel / largest),
        false => [0.0; 3],
    };
    json!({ "kind": kind, "color": color, "power_w": largest * factor, "matrix": matrix })
}

/// Blender's equirectangular images look along +X in their middle.
pub(super) fn describe_environment(
    environment: &Environment,
    exposure: f64,
    numbers: &mut Numbers,
) -> Value {
    let strength = environment.scale * exposure;
    match &environment.map {
        EnvironmentMap::Constant(radiance) => json!({ "color": radiance, "strength": strength }),
        EnvironmentMap::LatLong {
            width,
            height,
            texels,
        } => {
            let rows = texels.chunks(*width as usize).rev().flatten().copied();
            let rows: Vec<[f32; 3]> = rows.collect();
            json!({
                "width": width,
                "height": height,
                "pixels": numbers.add(rows.as_flattened()),
                "mapping_rotation_deg": -90.0 - environment.rotation_deg,
                "strength": strength,
            })
        }
    }
}
