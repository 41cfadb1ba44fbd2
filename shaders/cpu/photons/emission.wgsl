// Where photons begin. Rust twin: src/cpu/photons/emission.rs, where the densities are described.

import package::gpu::buffers::{frame, has_photon_sphere, lights};
import package::packed::records::{LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT, Light};
import package::shared::NONE;
import package::math::{PI, TAU, cross3, dot3, length3, orthonormal_basis, safe_sqrt, sincos_2pi};
import package::cpu::state::SIDE_NONE;
import package::light::environment::{env_sample, share_left_to_eye};
@if(delta_lights) import package::light::lights::spot_falloff;
@if(area_lights) import package::material::surface::triangle_emission;

struct Emission {
    position: vec3<f32>,
    direction: vec3<f32>,
    offset: vec3<f32>,
    side: u32,
    distant: bool,
    flux: vec3<f32>,
}

fn no_emission() -> Emission {
    return Emission(vec3<f32>(0.0), vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(0.0), SIDE_NONE, false, vec3<f32>(0.0));
}

struct Aim {
    towards: vec3<f32>,
    inv_pdf: f32,
}

fn photon_light(u: f32) -> u32 {
    var low = 0u;
    var high = frame.light_count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if u < lights[middle].photon_cdf { high = middle; } else { low = middle + 1u; }
    }
    return low;
}

fn emit(choice: vec2<f32>, on_light: vec2<f32>, direction: vec2<f32>) -> Emission {
    let light = lights[photon_light(choice.x)];
    var emission = no_emission();
    if light.photon_pdf <= 0.0 { return emission; }
    if light.kind == LIGHT_ENVIRONMENT {
        emission = emit_environment(choice.y, on_light, direction);
    }
    @if(delta_lights) {
        if light.kind == LIGHT_DIRECTIONAL {
            emission = emit_parallel(light.axis_u.xyz, light.radiance.xyz, choice.y, direction);
        }
        if light.kind == LIGHT_POINT || light.kind == LIGHT_SPOT {
            emission = emit_point(light, choice.y, direction);
        }
    }
    @if(area_lights) {
        if light.kind >= LIGHT_QUAD && light.kind != LIGHT_ENVIRONMENT {
            emission = emit_area(light, choice.y, on_light, direction);
        }
    }
    emission.flux *= 1.0 / light.photon_pdf;
    return emission;
}

fn emit_environment(choice: f32, u: vec2<f32>, across: vec2<f32>) -> Emission {
    let s = env_sample(u.x, u.y);
    let traced = 1.0 - share_left_to_eye(s.direction);
    if s.pdf <= 0.0 || traced <= 0.0 { return no_emission(); }
    let radiance = s.radiance * (traced / s.pdf);
    return emit_parallel(-s.direction, radiance, choice, across);
}

fn emit_parallel(travel: vec3<f32>, radiance: vec3<f32>, choice: f32, u: vec2<f32>) -> Emission {
    let aim = aim_parallel(travel, choice, u);
    var start = dot3(aim.towards, travel);
    for (var i = 0u; has_photon_sphere(i); i++) {
        let sphere = frame.photon_spheres[i];
        start = min(start, dot3(sphere.xyz, travel) - sphere.w);
    }
    var emission = no_emission();
    emission.position = aim.towards + travel * (start - dot3(aim.towards, travel));
    emission.direction = travel;
    emission.distant = true;
    emission.flux = radiance * aim.inv_pdf;
    return emission;
}

@if(delta_lights)
fn emit_point(light: Light, choice: f32, u: vec2<f32>) -> Emission {
    let position = light.position.xyz;
    let aim = aim_from(position, vec3<f32>(0.0), choice, u);
    var emission = no_emission();
    emission.position = position;
    emission.direction = aim.towards;
    emission.flux = light.radiance.xyz * aim.inv_pdf;
    if light.kind == LIGHT_SPOT {
        emission.flux *= spot_falloff(light, dot3(aim.towards, light.axis_u.xyz));
    }
    return emission;
}

@if(area_lights)
fn emit_area(light: Light, choice: f32, on_light: vec2<f32>, u: vec2<f32>) -> Emission {
    let axis_u = light.axis_u.xyz;
    let axis_v = light.axis_v.xyz;
    let is_quad = light.kind == LIGHT_QUAD;
    var a = on_light.x;
    var b = on_light.y;
    if !is_quad {
        let root = safe_sqrt(on_light.x);
        a = root * (1.0 - on_light.y);
        b = root * on_light.y;
    }
    let corner = light.position.xyz;
    let position = corner + (axis_u * a + axis_v * b);
    let cross = cross3(axis_u, axis_v);
    let normal = cross / max(length3(cross), 1e-30);
    var front = normal;
    if !is_quad { front = vec3<f32>(0.0); }
    let aim = aim_from(position, front, choice, u);
    var cos = dot3(aim.towards, normal);
    if !is_quad { cos = abs(cos); }
    if cos <= 0.0 || aim.inv_pdf <= 0.0 { return no_emission(); }
    var radiance = light.radiance.xyz;
    if light.triangle != NONE {
        radiance = triangle_emission(light.triangle, a, b);
    }
    let size = abs(corner) + abs(axis_u) + abs(axis_v);
    let error = LIGHT_POINT_ERROR * (size.x + size.y + size.z);
    return Emission(
        position,
        aim.towards,
        normal * error,
        light.side,
        false,
        radiance * (cos * light.radiance.w * aim.inv_pdf),
    );
}

fn solid_angle_of(i: u32, position: vec3<f32>, front: vec3<f32>) -> f32 {
    let sphere = frame.photon_spheres[i];
    let to_centre = sphere.xyz - position;
    let distance2 = dot3(to_centre, to_centre);
    let radius2 = sphere.w * sphere.w;
    let has_front = dot3(front, front) > 0.0;
    if has_front && dot3(to_centre, front) <= -sphere.w { return 0.0; }
    if radius2 * NEAR_RADII2 >= distance2 { return 2.0 * TAU; }
    return TAU * one_minus_cos(radius2 / distance2);
}

fn one_minus_cos(sin2: f32) -> f32 {
    return sin2 / (1.0 + safe_sqrt(1.0 - sin2));
}

fn holds(i: u32, position: vec3<f32>, direction: vec3<f32>) -> bool {
    let sphere = frame.photon_spheres[i];
    let to_centre = sphere.xyz - position;
    let radius2 = sphere.w * sphere.w;
    if radius2 * NEAR_RADII2 >= dot3(to_centre, to_centre) { return true; }
    let across = cross3(direction, to_centre);
    return dot3(direction, to_centre) > 0.0 && dot3(across, across) <= radius2;
}

fn aim_from(position: vec3<f32>, front: vec3<f32>, choice: f32, u: vec2<f32>) -> Aim {
    var total = 0.0;
    for (var i = 0u; has_photon_sphere(i); i++) {
        total += solid_angle_of(i, position, front);
    }
    var left = choice * total;
    var chosen = NONE;
    var chosen_angle = 0.0;
    for (var i = 0u; has_photon_sphere(i); i++) {
        let angle = solid_angle_of(i, position, front);
        if angle > 0.0 && (chosen == NONE || left >= 0.0) {
            chosen = i;
            chosen_angle = angle;
        }
        left -= angle;
    }
    if chosen == NONE { return Aim(vec3<f32>(0.0, 0.0, 1.0), 0.0); }
    let to_centre = frame.photon_spheres[chosen].xyz - position;
    let drop = u.x * (chosen_angle / TAU);
    let cos = 1.0 - drop;
    let sin = safe_sqrt(drop * (2.0 - drop));
    var axis = vec3<f32>(0.0, 0.0, 1.0);
    if chosen_angle < 2.0 * TAU { axis = to_centre / length3(to_centre); }
    let around = sincos_2pi(u.y);
    let basis = orthonormal_basis(axis);
    let towards = basis.t * (sin * around.cos) + basis.b * (sin * around.sin) + axis * cos;
    var count = 0.0;
    for (var i = 0u; has_photon_sphere(i); i++) {
        let counts = i == chosen || holds(i, position, towards);
        if counts && solid_angle_of(i, position, front) > 0.0 { count += 1.0; }
    }
    return Aim(towards, total / count);
}

fn aim_parallel(travel: vec3<f32>, choice: f32, u: vec2<f32>) -> Aim {
    var total = 0.0;
    for (var i = 0u; has_photon_sphere(i); i++) {
        let radius = frame.photon_spheres[i].w;
        total += PI * radius * radius;
    }
    var left = choice * total;
    var chosen = 0u;
    for (var i = 0u; has_photon_sphere(i); i++) {
        if left >= 0.0 { chosen = i; }
        let radius = frame.photon_spheres[i].w;
        left -= PI * radius * radius;
    }
    let sphere = frame.photon_spheres[chosen];
    let around = sincos_2pi(u.y);
    let basis = orthonormal_basis(travel);
    let radius = sphere.w * safe_sqrt(u.x);
    let towards = sphere.xyz + (basis.t * (radius * around.cos) + basis.b * (radius * around.sin));
    var count = 0.0;
    for (var i = 0u; has_photon_sphere(i); i++) {
        let other = frame.photon_spheres[i];
        let across = cross3(towards - other.xyz, travel);
        if i == chosen || dot3(across, across) <= other.w * other.w { count += 1.0; }
    }
    return Aim(towards, total / count);
}
