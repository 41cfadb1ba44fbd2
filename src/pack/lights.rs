//! The list of lights and the probabilities of choosing them.

use glam::{DVec3, Vec2, Vec3};

use crate::light::rectangle::is_right_angle;
use crate::material::texture_sample;
use crate::math::{cross3, length3, luminance};
use crate::packed::{
    FRAME_LIGHTS_SUFFICE, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD,
    LIGHT_SPOT, LIGHT_TRIANGLE, Light, MATERIAL_QUAD_LIGHT, MATERIAL_UNLIT, Material, NONE,
    PackedScene, SIDE_REAL, SIDE_VIRTUAL, TEXTURE_UV1, xyz,
};
use crate::scene::{LightKind, Scene, Side};

/// Barycentric points at which the emission texture of a triangle is looked at.
const EMISSION_POINTS: [[f32; 2]; 7] = [
    [1.0 / 3.0, 1.0 / 3.0],
    [0.6, 0.2],
    [0.2, 0.6],
    [0.2, 0.2],
    [0.05, 0.05],
    [0.9, 0.05],
    [0.05, 0.9],
];

/// More lights than this are chosen between too blindly to leave all to the choice.
pub(crate) const FEW_LIGHTS: usize = 4;

/// Fills `packed.lights`, the triangles' light indices and the frame's light fields.
pub(super) fn pack_lights(packed: &mut PackedScene, scene: &Scene) {
    // The scene's lights come first, in their order: a quad's triangles already name theirs.
    for triangle in &mut packed.triangles {
        let flags = packed.materials[triangle.material as usize].flags;
        if flags & MATERIAL_QUAD_LIGHT == 0 {
            triangle.light = NONE;
        }
    }
    let mut lights = Vec::new();
    let mut powers = Vec::new();
    let radius = scene_radius(packed);
    let anchor = DVec3::from(packed.anchor_m);
    for light in &scene.lights {
        let side = match light.side {
            Side::Real => SIDE_REAL,
            Side::Virtual => SIDE_VIRTUAL,
        };
        let (record, power) = pack_light(&light.kind, side, anchor, radius);
        lights.push(record);
        powers.push(power);
    }
    add_emissive_triangles(packed, &mut lights, &mut powers);
    packed.frame.env_light = NONE;
    if packed.env_mean_luminance > 0.0 {
        packed.frame.env_light = lights.len() as u32;
        lights.push(blank(LIGHT_ENVIRONMENT, SIDE_REAL));
        powers.push(packed.env_mean_luminance * std::f64::consts::PI.powi(2) * radius * radius);
    }
    set_probabilities(&mut lights, &powers);
    lights.iter_mut().for_each(set_edges);
    packed.frame.light_count = lights.len() as u32;
    packed.frame.flags &= !FRAME_LIGHTS_SUFFICE;
    if lights_suffice(&lights, &packed.materials) {
        packed.frame.flags |= FRAME_LIGHTS_SUFFICE;
    }
    packed.lights = lights;
}

/// Whether light comes from a few point-like and rectangular lights alone: rectangles are drawn by solid angle, so that no point near them finds
/// them by chance better.
fn lights_suffice(lights: &[Light], materials: &[Material]) -> bool {
    lights.len() <= FEW_LIGHTS
        && lights.iter().all(|l| match l.kind {
            LIGHT_QUAD => is_right_angle(
                xyz(l.axis_u).normalize_or_zero(),
                xyz(l.axis_v).normalize_or_zero(),
            ),
            LIGHT_DIRECTIONAL | LIGHT_POINT | LIGHT_SPOT => true,
            _ => false,
        })
        && materials.iter().all(|m| {
            let emits = m.flags & MATERIAL_UNLIT != 0 || m.emissive.iter().any(|&c| c > 0.0);
            m.flags & MATERIAL_QUAD_LIGHT != 0 || !emits
        })
}

/// Radius about the anchor that holds three quarters of the vertices: outliers must not make the environment seem all-important.
fn scene_radius(packed: &PackedScene) -> f64 {
    let mut distances: Vec<f32> = (0..packed.vertices.len() as u32)
        .map(|v| packed.position(v).length())
        .collect();
    if distances.is_empty() {
        return 1.0;
    }
    let at = distances.len() * 3 / 4;
    f64::from(*distances.select_nth_unstable_by(at, f32::total_cmp).1)
}

fn blank(kind: u32, side: u32) -> Light {
    Light {
        position: [0.0; 4],
        axis_u: [0.0; 4],
        axis_v: [0.0; 4],
        unit_u: [0.0; 4],
        unit_v: [0.0; 4],
        normal: [0.0, 0.0, 0.0, 1.0],
        radiance: [0.0; 4],
        kind,
        side,
        select_pdf: 0.0,
        alias_threshold: 1.0,
        alias_light: NONE,
        triangle: NONE,
        photon_pdf: 0.0,
        photon_cdf: 0.0,
    }
}

/// Fills what the record of an area light says about its edges: looked up at every draw.
fn set_edges(light: &mut Light) {
    if !matches!(light.kind, LIGHT_QUAD | LIGHT_TRIANGLE) {
        return;
    }
    let (axis_u, axis_v) = (xyz(light.axis_u), xyz(light.axis_v));
    let (width, depth) = (length3(axis_u), length3(axis_v));
    let normal = cross3(axis_u, axis_v);
    light.unit_u = (axis_u / width).extend(width).to_array();
    light.unit_v = (axis_v / depth).extend(depth).to_array();
    light.normal = normal.extend(length3(normal).max(1e-30)).to_array();
}

/// The record of a scene light, and its power estimate.
fn pack_light(kind: &LightKind, side: u32, anchor: DVec3, radius: f64) -> (Light, f64) {
    use std::f64::consts::PI;
    let v4 = |v: Vec3, w: f32| [v.x, v.y, v.z, w];
    let relative = |p: [f64; 3]| v4((DVec3::from(p) - anchor).as_vec3(), 0.0);
    let unit = |d: [f64; 3]| DVec3::from(d).normalize_or_zero().as_vec3();
    let lum = |c: [f32; 3]| f64::from(luminance(Vec3::from(c)));
    match *kind {
        LightKind::Point {
            position,
            intensity,
        } => (
            Light {
                position: relative(position),
                radiance: v4(Vec3::from(intensity), 0.0),
                ..blank(LIGHT_POINT, side)
            },
            4.0 * PI * lum(intensity),
        ),
        LightKind::Spot {
            position,
            direction,
            intensity,
            inner_deg,
            outer_deg,
        } => {
            let cos = |deg: f64| deg.to_radians().cos();
            (
                Light {
                    position: relative(position),
                    axis_u: v4(unit(direction), cos(inner_deg) as f32),
                    axis_v: [0.0, 0.0, 0.0, cos(outer_deg) as f32],
                    radiance: v4(Vec3::from(intensity), 0.0),
                    ..blank(LIGHT_SPOT, side)
                },
                2.0 * PI * (1.0 - cos(outer_deg)) * lum(intensity),
            )
        }
        LightKind::Directional {
            direction,
            irradiance,
        } => (
            Light {
                axis_u: v4(unit(direction), 0.0),
                radiance: v4(Vec3::from(irradiance), 0.0),
                ..blank(LIGHT_DIRECTIONAL, side)
            },
            PI * radius * radius * lum(irradiance),
        ),
        LightKind::Quad {
            corner,
            edge_u,
            edge_v,
            radiance,
        } => {
            let area = DVec3::from(edge_u).cross(DVec3::from(edge_v)).length();
            (
                Light {
                    position: relative(corner),
                    axis_u: v4(DVec3::from(edge_u).as_vec3(), 0.0),
                    axis_v: v4(DVec3::from(edge_v).as_vec3(), 0.0),
                    radiance: v4(Vec3::from(radiance), area as f32),
                    ..blank(LIGHT_QUAD, side)
                },
                PI * area * lum(radiance),
            )
        }
    }
}

fn add_emissive_triangles(
    packed: &mut PackedScene,
    lights: &mut Vec<Light>,
    powers: &mut Vec<f64>,
) {
    for id in 0..packed.triangles.len() {
        let triangle = packed.triangles[id];
        let material = &packed.materials[triangle.material as usize];
        if material.flags & MATERIAL_QUAD_LIGHT != 0 || material.emissive.iter().all(|&c| c <= 0.0)
        {
            continue;
        }
        let emission = mean_emission(packed, id);
        let [a, b, c] = triangle.vertices.map(|v| packed.position(v));
        let area = 0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length();
        let power = 2.0 * std::f64::consts::PI * area * f64::from(luminance(emission));
        if power <= 0.0 {
            // Only paths that happen on it find what little it may emit.
            continue;
        }
        packed.triangles[id].light = lights.len() as u32;
        let v4 = |v: Vec3, w: f32| [v.x, v.y, v.z, w];
        lights.push(Light {
            position: v4(a, 0.0),
            axis_u: v4(b - a, 0.0),
            axis_v: v4(c - a, 0.0),
            radiance: v4(emission, area as f32),
            triangle: id as u32,
            ..blank(
                LIGHT_TRIANGLE,
                u32::from(id >= packed.frame.real_triangle_count as usize),
            )
        });
        powers.push(power);
    }
}

fn mean_emission(packed: &PackedScene, triangle: usize) -> Vec3 {
    let record = &packed.triangles[triangle];
    let material = &packed.materials[record.material as usize];
    let factor = Vec3::from(material.emissive);
    if material.emissive_texture == NONE {
        return factor;
    }
    let texture = &packed.texture_refs[material.emissive_texture as usize];
    let uvs = record.vertices.map(|v| {
        let vertex = &packed.vertices[v as usize];
        if texture.flags & TEXTURE_UV1 != 0 {
            Vec2::new(vertex.uv1[0], vertex.uv1[1])
        } else {
            Vec2::new(vertex.position_u0[3], vertex.normal_v0[3])
        }
    });
    let sum: Vec3 = EMISSION_POINTS
        .iter()
        .map(|&[u, v]| {
            texture_sample(
                &packed.texels,
                texture,
                uvs[0] * (1.0 - u - v) + uvs[1] * u + uvs[2] * v,
            )
            .truncate()
        })
        .sum();
    factor * sum / EMISSION_POINTS.len() as f32
}

/// Share of the choice that follows the power estimates; the rest is uniform over the lights, all emissive triangles together counting as
/// one, so that no light is left out and a finely meshed one does not draw all the rays.
const POWER_SHARE: f64 = 0.8;

/// Probabilities of choosing each light, and their alias table after Vose.
fn set_probabilities(lights: &mut [Light], powers: &[f64]) {
    let n = lights.len() as f64;
    let total: f64 = powers.iter().sum();
    let is_triangle = |l: &Light| l.kind == LIGHT_TRIANGLE;
    let triangles = lights.iter().zip(powers).filter(|(l, _)| is_triangle(l));
    let triangle_power: f64 = triangles.map(|(_, p)| p).sum();
    let count =
        lights.iter().filter(|l| !is_triangle(l)).count() as f64 + f64::from(triangle_power > 0.0);
    let mut scaled: Vec<f64> = lights
        .iter()
        .zip(powers)
        .map(|(light, power)| {
            let unit = if is_triangle(light) {
                power / triangle_power
            } else {
                1.0
            };
            let uniform = n * unit / count;
            if total > 0.0 {
                (1.0 - POWER_SHARE) * uniform + POWER_SHARE * n * power / total
            } else {
                uniform
            }
        })
        .collect();
    for (light, p) in lights.iter_mut().zip(&scaled) {
        light.select_pdf = (p / n) as f32;
    }
    let (mut small, mut large): (Vec<usize>, Vec<usize>) =
        (0..lights.len()).partition(|&i| scaled[i] < 1.0);
    while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
        small.pop();
        lights[s].alias_threshold = scaled[s] as f32;
        lights[s].alias_light = l as u32;
        scaled[l] -= 1.0 - scaled[s];
        if scaled[l] < 1.0 {
            large.pop();
            small.push(l);
        }
    }
    for rest in small.into_iter().chain(large) {
        lights[rest].alias_threshold = 1.0;
        lights[rest].alias_light = rest as u32;
    }
}
