//! Whether anything shines, and on something.

use glam::DVec3;

use super::Finding;
use crate::scene::check::Check;
use crate::scene::{Environment, EnvironmentMap, Light, LightKind, Object, Scene, Side};

pub(super) fn findings(scene: &Scene) -> Vec<Finding> {
    let mut findings = Vec::new();
    if !has_light(scene) {
        let message = "nothing shines: there is no [environment], [[light]] or emissive mesh that is not black; add one";
        findings.push(Finding::new(Check::NoLight, message.to_owned()));
    }
    for (index, light) in scene.lights.iter().enumerate() {
        if shines_away(scene, light) {
            let message = format!(
                "[[light]] number {} shines away from everything: a quad shines to the side of edge_u x edge_v; exchange its edges, or move it",
                index + 1
            );
            findings.push(Finding::new(Check::LightFacesAway, message));
        }
    }
    findings
}

fn has_light(scene: &Scene) -> bool {
    let shines = |rgb: &[f32]| rgb.iter().any(|channel| *channel > 0.0);
    let of_environment = |environment: &Environment| {
        environment.scale > 0.0
            && match &environment.map {
                EnvironmentMap::Constant(radiance) => shines(radiance),
                EnvironmentMap::LatLong { texels, .. } => shines(texels.as_flattened()),
            }
    };
    let of_light = |light: &Light| match &light.kind {
        LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => shines(intensity),
        LightKind::Directional { irradiance, .. } => shines(irradiance),
        LightKind::Quad { radiance, .. } => shines(radiance),
    };
    let of_object = |object: &Object| {
        let mut materials = object.instances.iter().map(|instance| &instance.material);
        materials.any(|material| shines(&material.emissive) || material.unlit)
    };
    scene.environment.as_ref().is_some_and(of_environment)
        || scene.lights.iter().any(of_light)
        || scene.objects.iter().any(of_object)
}

/// A quad with nothing before its front: no object and, if it is itself to be seen, not the camera.
fn shines_away(scene: &Scene, light: &Light) -> bool {
    let LightKind::Quad {
        corner,
        edge_u,
        edge_v,
        ..
    } = light.kind
    else {
        return false;
    };
    let normal = DVec3::from(edge_u).cross(edge_v.into()).normalize_or_zero();
    let height = |point: DVec3| (point - DVec3::from(corner)).dot(normal);
    // Beside the rounding of coordinates.
    let is_before = |point: DVec3| height(point) > 1e-6 * (1.0 + point.abs().max_element());
    let mut corners = scene.objects.iter().flat_map(|object| {
        let instances = object.instances.iter();
        instances.flat_map(move |instance| {
            let transform = object.world_from_object * instance.object_from_local;
            let corners = instance.corners().into_iter();
            corners.map(move |corner| transform.transform_point3(corner))
        })
    });
    let camera = scene.camera.world_from_camera.w_axis.truncate();
    !(corners.any(is_before) || light.side == Side::Virtual && is_before(camera))
}
