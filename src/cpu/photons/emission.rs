//! Where photons begin: a light, a point of it, and a direction towards a sphere about smooth virtual surfaces. WGSL twin:
//! `shaders/cpu/photons/emission.wgsl`.
//!
//! Spheres are chosen by the solid angle, or for parallel light by the area, that they show; the density counts all that hold the ray.

use glam::Vec3;

use crate::cpu::state::SIDE_NONE;
use crate::light::environment::{env_sample, share_left_to_eye};
use crate::light::lights::spot_falloff;
use crate::material::triangle_emission;
use crate::math::{PI, TAU, cross3, dot3, length3, orthonormal_basis, safe_sqrt, sincos_2pi};
use crate::packed::{
    Frame, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT, Light, NONE,
    PackedScene, xyz,
};
use crate::shared::shared;

shared! {
    /// Spheres that are nearer than this many radii are aimed at in all directions.
    const NEAR_RADII2: f32 = 1.0001;
    /// Bound on the error of a point on a light, relative to its coordinates and edges.
    const LIGHT_POINT_ERROR: f32 = 1e-6;
}

/// A photon that leaves its light.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    pub position: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Unit normal of the light where it lies on a surface, times the position's error bound; else zero.
    pub offset: Vec3,
    /// The light's world, or [`SIDE_NONE`] where it has no surface.
    pub side: u32,
    /// The light is infinitely far away, and `position` only a point of the way.
    pub distant: bool,
    /// Power per photon, before the number of photons divides it; zero: none starts.
    pub flux: Vec3,
}

const NO_EMISSION: Emission = Emission {
    position: Vec3::ZERO,
    direction: Vec3::Z,
    offset: Vec3::ZERO,
    side: SIDE_NONE,
    distant: false,
    flux: Vec3::ZERO,
};

/// A direction or a line towards the spheres.
#[derive(Clone, Copy, Debug)]
struct Aim {
    /// Unit direction; for parallel light, a point of the line.
    towards: Vec3,
    /// 1 / density: per solid angle, for parallel light per area across it; 0: there is nothing to aim at.
    inv_pdf: f32,
}

/// The light whose share of the photons holds `u`.
fn photon_light(scene: &PackedScene, u: f32) -> u32 {
    let (mut low, mut high) = (0, scene.frame.light_count - 1);
    while low < high {
        let middle = (low + high) / 2;
        if u < scene.lights[middle as usize].photon_cdf {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

/// Draws a light by the first number of `choice`, a sphere by the second, a point on the light and a direction.
pub fn emit(
    scene: &PackedScene,
    choice: [f32; 2],
    on_light: [f32; 2],
    direction: [f32; 2],
) -> Emission {
    let light = &scene.lights[photon_light(scene, choice[0]) as usize];
    if light.photon_pdf <= 0.0 {
        return NO_EMISSION;
    }
    let mut emission = match light.kind {
        LIGHT_ENVIRONMENT => emit_environment(scene, choice[1], on_light, direction),
        LIGHT_DIRECTIONAL => {
            let travel = xyz(light.axis_u);
            let radiance = xyz(light.radiance);
            emit_parallel(&scene.frame, travel, radiance, choice[1], direction)
        }
        LIGHT_POINT | LIGHT_SPOT => emit_point(&scene.frame, light, choice[1], direction),
        _ => emit_area(scene, light, choice[1], on_light, direction),
    };
    emission.flux *= 1.0 / light.photon_pdf;
    emission
}

fn emit_environment(scene: &PackedScene, choice: f32, u: [f32; 2], across: [f32; 2]) -> Emission {
    let s = env_sample(scene, u[0], u[1]);
    let traced = 1.0 - share_left_to_eye(scene, s.direction);
    if s.pdf <= 0.0 || traced <= 0.0 {
        return NO_EMISSION;
    }
    let radiance = s.radiance * (traced / s.pdf);
    emit_parallel(&scene.frame, -s.direction, radiance, choice, across)
}

/// `radiance`: what arrives per area across the direction of travel.
fn emit_parallel(
    frame: &Frame,
    travel: Vec3,
    radiance: Vec3,
    choice: f32,
    u: [f32; 2],
) -> Emission {
    let aim = aim_parallel(frame, travel, choice, u);
    let mut start = dot3(aim.towards, travel);
    for i in 0..frame.photon_sphere_count {
        let sphere = frame.photon_spheres[i as usize];
        start = start.min(dot3(xyz(sphere), travel) - sphere[3]);
    }
    Emission {
        position: aim.towards + travel * (start - dot3(aim.towards, travel)),
        direction: travel,
        distant: true,
        flux: radiance * aim.inv_pdf,
        ..NO_EMISSION
    }
}

fn emit_point(frame: &Frame, light: &Light, choice: f32, u: [f32; 2]) -> Emission {
    let position = xyz(light.position);
    let aim = aim_from(frame, position, Vec3::ZERO, choice, u);
    let mut flux = xyz(light.radiance) * aim.inv_pdf;
    if light.kind == LIGHT_SPOT {
        flux *= spot_falloff(light, dot3(aim.towards, xyz(light.axis_u)));
    }
    Emission {
        position,
        direction: aim.towards,
        flux,
        ..NO_EMISSION
    }
}

/// A point uniform by area.
fn emit_area(
    scene: &PackedScene,
    light: &Light,
    choice: f32,
    on_light: [f32; 2],
    u: [f32; 2],
) -> Emission {
    let (axis_u, axis_v) = (xyz(light.axis_u), xyz(light.axis_v));
    let is_quad = light.kind == LIGHT_QUAD;
    let (mut a, mut b) = (on_light[0], on_light[1]);
    if !is_quad {
        let root = safe_sqrt(on_light[0]);
        a = root * (1.0 - on_light[1]);
        b = root * on_light[1];
    }
    let corner = xyz(light.position);
    let position = corner + (axis_u * a + axis_v * b);
    let cross = cross3(axis_u, axis_v);
    let normal = cross / length3(cross).max(1e-30);
    let mut front = normal;
    if !is_quad {
        front = Vec3::ZERO;
    }
    let aim = aim_from(&scene.frame, position, front, choice, u);
    let mut cos = dot3(aim.towards, normal);
    if !is_quad {
        cos = cos.abs();
    }
    if cos <= 0.0 || aim.inv_pdf <= 0.0 {
        return NO_EMISSION;
    }
    let mut radiance = xyz(light.radiance);
    if light.triangle != NONE {
        radiance = triangle_emission(scene, light.triangle, a, b);
    }
    let size = corner.abs() + axis_u.abs() + axis_v.abs();
    let error = LIGHT_POINT_ERROR * (size.x + size.y + size.z);
    Emission {
        position,
        direction: aim.towards,
        offset: normal * error,
        side: light.side,
        distant: false,
        flux: radiance * (cos * light.radiance[3] * aim.inv_pdf),
    }
}

/// Solid angle of a sphere seen from `position`; 0 where it is wholly behind the plane of `front` (zero: there is none).
fn solid_angle_of(frame: &Frame, i: u32, position: Vec3, front: Vec3) -> f32 {
    let sphere = frame.photon_spheres[i as usize];
    let to_centre = xyz(sphere) - position;
    let distance2 = dot3(to_centre, to_centre);
    let radius2 = sphere[3] * sphere[3];
    let has_front = dot3(front, front) > 0.0;
    if has_front && dot3(to_centre, front) <= -sphere[3] {
        return 0.0;
    }
    if radius2 * NEAR_RADII2 >= distance2 {
        return 2.0 * TAU;
    }
    TAU * one_minus_cos(radius2 / distance2)
}

/// Of an angle below a right one, of its squared sine, without cancellation.
fn one_minus_cos(sin2: f32) -> f32 {
    sin2 / (1.0 + safe_sqrt(1.0 - sin2))
}

/// Whether a direction meets a sphere as it is drawn for.
fn holds(frame: &Frame, i: u32, position: Vec3, direction: Vec3) -> bool {
    let sphere = frame.photon_spheres[i as usize];
    let to_centre = xyz(sphere) - position;
    let radius2 = sphere[3] * sphere[3];
    if radius2 * NEAR_RADII2 >= dot3(to_centre, to_centre) {
        return true;
    }
    let across = cross3(direction, to_centre);
    dot3(direction, to_centre) > 0.0 && dot3(across, across) <= radius2
}

fn aim_from(frame: &Frame, position: Vec3, front: Vec3, choice: f32, u: [f32; 2]) -> Aim {
    let mut total = 0.0;
    for i in 0..frame.photon_sphere_count {
        total += solid_angle_of(frame, i, position, front);
    }
    let mut left = choice * total;
    let mut chosen = NONE;
    let mut chosen_angle = 0.0;
    for i in 0..frame.photon_sphere_count {
        let angle = solid_angle_of(frame, i, position, front);
        if angle > 0.0 && (chosen == NONE || left >= 0.0) {
            chosen = i;
            chosen_angle = angle;
        }
        left -= angle;
    }
    if chosen == NONE {
        return Aim {
            towards: Vec3::Z,
            inv_pdf: 0.0,
        };
    }
    // A cone, or for a near sphere all directions, uniformly.
    let to_centre = xyz(frame.photon_spheres[chosen as usize]) - position;
    let drop = u[0] * (chosen_angle / TAU);
    let cos = 1.0 - drop;
    let sin = safe_sqrt(drop * (2.0 - drop));
    let mut axis = Vec3::Z;
    if chosen_angle < 2.0 * TAU {
        axis = to_centre / length3(to_centre);
    }
    let (sin_phi, cos_phi) = sincos_2pi(u[1]);
    let (tangent, bitangent) = orthonormal_basis(axis);
    let towards = tangent * (sin * cos_phi) + bitangent * (sin * sin_phi) + axis * cos;
    let mut count = 0.0;
    for i in 0..frame.photon_sphere_count {
        let counts = i == chosen || holds(frame, i, position, towards);
        if counts && solid_angle_of(frame, i, position, front) > 0.0 {
            count += 1.0;
        }
    }
    Aim {
        towards,
        inv_pdf: total / count,
    }
}

fn aim_parallel(frame: &Frame, travel: Vec3, choice: f32, u: [f32; 2]) -> Aim {
    let mut total = 0.0;
    for i in 0..frame.photon_sphere_count {
        let radius = frame.photon_spheres[i as usize][3];
        total += PI * radius * radius;
    }
    let mut left = choice * total;
    let mut chosen = 0;
    for i in 0..frame.photon_sphere_count {
        if left >= 0.0 {
            chosen = i;
        }
        let radius = frame.photon_spheres[i as usize][3];
        left -= PI * radius * radius;
    }
    let sphere = frame.photon_spheres[chosen as usize];
    let (sin_phi, cos_phi) = sincos_2pi(u[1]);
    let (tangent, bitangent) = orthonormal_basis(travel);
    let radius = sphere[3] * safe_sqrt(u[0]);
    let towards = xyz(sphere) + (tangent * (radius * cos_phi) + bitangent * (radius * sin_phi));
    let mut count = 0.0;
    for i in 0..frame.photon_sphere_count {
        let other = frame.photon_spheres[i as usize];
        let across = cross3(towards - xyz(other), travel);
        if i == chosen || dot3(across, across) <= other[3] * other[3] {
            count += 1.0;
        }
    }
    Aim {
        towards,
        inv_pdf: total / count,
    }
}
