//! Scanned proxies: `smooth_radius_m` and `self_shadow_bias_m`, asked for or called for by the noise of the mesh.

use std::sync::Arc;

use glam::{DMat3, DMat4};

use super::Object;
use super::error::Result;
use super::reader::{Node, Table};
use super::smooth::{detect_scanner_noise, smooth};

/// Self-shadow bias of a detected scan, as a share of its smoothing radius: what is left of the bumps after smoothing is lower.
const BIAS_PER_RADIUS: f64 = 0.5;

/// Smooths a proxy and sets its bias. Neither happens unless the scene file asks for it or, where `may_detect`, the mesh carries the
/// noise of a depth camera; the returned message then says so.
pub(super) fn settle_scan(
    table: &Table,
    object: &mut Object,
    may_detect: bool,
) -> Result<Option<String>> {
    let given_radius = table.optional("smooth_radius_m", Node::not_negative)?;
    let given_bias = table.optional("self_shadow_bias_m", Node::not_negative)?;
    let detected = match given_radius {
        None if may_detect => detect(object),
        _ => None,
    };
    let radius_m = given_radius.or(detected).unwrap_or(0.0);
    let bias_m = given_bias
        .or(detected.map(|radius| radius * BIAS_PER_RADIUS))
        .unwrap_or(0.0);
    if radius_m > 0.0 {
        smooth_instances(object, radius_m);
    }
    object.self_shadow_bias_m = bias_m as f32;
    Ok(detected.map(|_| {
        format!(
            "{}: smoothed as a depth camera's mesh, by smooth_radius_m = {radius_m:.4} and self_shadow_bias_m = {bias_m:.4}; smooth_radius_m = 0 leaves it as it is",
            object.name
        )
    }))
}

/// The largest radius that a part calls for, metres.
fn detect(object: &Object) -> Option<f64> {
    object
        .instances
        .iter()
        .filter_map(|instance| {
            let noise = detect_scanner_noise(&instance.primitive)?;
            Some(noise.radius_m * mean_scale(object.world_from_object * instance.object_from_local))
        })
        .max_by(f64::total_cmp)
}

fn smooth_instances(object: &mut Object, radius_m: f64) {
    for instance in &mut object.instances {
        let scale = mean_scale(object.world_from_object * instance.object_from_local);
        smooth(Arc::make_mut(&mut instance.primitive), radius_m / scale);
    }
}

/// Geometric mean of the lengths that the axes are scaled by.
fn mean_scale(world_from_local: DMat4) -> f64 {
    DMat3::from_mat4(world_from_local)
        .determinant()
        .abs()
        .cbrt()
}
