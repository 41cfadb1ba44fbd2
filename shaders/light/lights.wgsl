// Choosing a light and a point on it. Rust twin: src/light/lights.rs.

import package::gpu::buffers::{frame, lights};
import package::packed::records::{LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT, Light, SIDE_REAL};
import package::shared::NONE;
import package::light::environment::{env_evaluate, env_radiance, env_sample};
import package::math::{dot3, length3, safe_sqrt};
import package::cpu::state::FAR;
@if(area_lights) import package::light::rectangle::{rectangle_from, sample_rectangle};
@if(area_lights) import package::material::surface::triangle_emission;

fn no_light() -> LightSample {
    return LightSample(vec3<f32>(0.0, 0.0, 1.0), 0.0, vec3<f32>(0.0), 0.0, false, SIDE_REAL);
}

fn light_select(u: f32, coin: f32) -> u32 {
    let scaled = u * f32(frame.light_count);
    let index = min(u32(scaled), frame.light_count - 1u);
    if coin < lights[index].alias_threshold { return index; }
    return lights[index].alias_light;
}

fn light_sample(index: u32, position: vec3<f32>, u: vec2<f32>) -> LightSample {
    let light = lights[index];
    if light.kind == LIGHT_ENVIRONMENT {
        let s = env_sample(u.x, u.y);
        return LightSample(s.direction, FAR, s.radiance, s.pdf * light.select_pdf, false, light.side);
    }
    @if(delta_lights) {
        if light.kind == LIGHT_DIRECTIONAL {
            return LightSample(-light.axis_u.xyz, FAR, light.radiance.xyz, light.select_pdf, true, light.side);
        }
        if light.kind == LIGHT_POINT || light.kind == LIGHT_SPOT {
            return sample_point_light(light, position);
        }
    }
    @if(area_lights) {
        return sample_area_light(light, position, u.x, u.y);
    }
    return no_light();
}

@if(delta_lights)
fn sample_point_light(light: Light, position: vec3<f32>) -> LightSample {
    let to_light = light.position.xyz - position;
    let distance_squared = dot3(to_light, to_light);
    if distance_squared <= 0.0 { return no_light(); }
    let distance = safe_sqrt(distance_squared);
    let direction = to_light / distance;
    var radiance = light.radiance.xyz / distance_squared;
    if light.kind == LIGHT_SPOT {
        radiance *= spot_falloff(light, -dot3(direction, light.axis_u.xyz));
    }
    return LightSample(direction, distance, radiance, light.select_pdf, true, light.side);
}

@if(delta_lights)
fn spot_falloff(light: Light, cos: f32) -> f32 {
    let inner = light.axis_u.w;
    let outer = light.axis_v.w;
    let ramp = clamp((cos - outer) / max(inner - outer, 1e-4), 0.0, 1.0);
    return ramp * ramp;
}

@if(area_lights)
fn sample_area_light(light: Light, position: vec3<f32>, u0: f32, u1: f32) -> LightSample {
    let rectangle = rectangle_from(light, position);
    var a = u0;
    var b = u1;
    if light.kind != LIGHT_QUAD {
        let root = safe_sqrt(u0);
        a = root * (1.0 - u1);
        b = root * u1;
    }
    let by_solid_angle = rectangle.solid_angle > 0.0;
    var to_light: vec3<f32>;
    if by_solid_angle {
        to_light = sample_rectangle(rectangle, u0, u1);
    } else {
        to_light = (light.position.xyz - position) + (light.axis_u.xyz * a + light.axis_v.xyz * b);
    }
    let distance = length3(to_light);
    if distance <= 0.0 { return no_light(); }
    let direction = to_light / distance;
    var pdf: f32;
    if by_solid_angle {
        pdf = light.select_pdf / rectangle.solid_angle;
    } else {
        pdf = area_pdf(light, direction, distance);
    }
    if pdf <= 0.0 { return no_light(); }
    var radiance = light.radiance.xyz;
    if light.triangle != NONE {
        radiance = triangle_emission(light.triangle, a, b);
    }
    return LightSample(direction, distance, radiance, pdf, false, light.side);
}

@if(area_lights)
fn area_pdf(light: Light, direction: vec3<f32>, distance: f32) -> f32 {
    let area = light.radiance.w;
    var cos = -dot3(direction, light.normal.xyz) / light.normal.w;
    if light.kind != LIGHT_QUAD { cos = abs(cos); }
    if cos <= 0.0 { return 0.0; }
    return light.select_pdf * distance * distance / (area * cos);
}

@if(area_lights)
fn light_pdf_hit(light: u32, from_position: vec3<f32>, direction: vec3<f32>, distance: f32) -> f32 {
    if light == NONE { return 0.0; }
    let record = lights[light];
    let rectangle = rectangle_from(record, from_position);
    if rectangle.solid_angle > 0.0 { return record.select_pdf / rectangle.solid_angle; }
    return area_pdf(record, direction, distance);
}

struct EnvArriving {
    radiance: vec3<f32>,
    pdf: f32,
}

fn env_arriving(direction: vec3<f32>) -> EnvArriving {
    if frame.env_light == NONE { return EnvArriving(env_radiance(direction), 0.0); }
    let e = env_evaluate(direction);
    return EnvArriving(e.radiance, e.pdf * lights[frame.env_light].select_pdf);
}
