// The photograph as what lies behind virtual objects. Rust twin: src/light/backdrop.rs.

import package::gpu::buffers::{backdrop, frame};
import package::camera::lens::camera_project;
import package::light::environment::env_radiance;
import package::math::dot3;

fn backdrop_point(position: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let camera = frame.camera_position.xyz;
    let back = frame.camera_back.xyz;
    let inv_distance = frame.inv_backdrop_distance;
    let depth = dot3(camera - position, back) * inv_distance;
    let approach = -dot3(direction, back);
    if inv_distance == 0.0 || depth >= 1.0 || approach < LEAST_APPROACH { return camera + direction; }
    return position + direction * ((1.0 - depth) / (approach * inv_distance));
}

fn backdrop_texel(x: i32, y: i32) -> vec3<f32> {
    let column = u32(clamp(x, 0, i32(frame.width) - 1));
    let row = u32(clamp(y, 0, i32(frame.height) - 1));
    return backdrop_of_pixel(row * frame.width + column);
}

fn backdrop_of_pixel(pixel: u32) -> vec3<f32> {
    let at = 3u * pixel;
    return vec3<f32>(backdrop[at], backdrop[at + 1u], backdrop[at + 2u]) / frame.exposure_scale;
}

fn backdrop_radiance(position: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let environment = env_radiance(direction);
    let seen = camera_project(backdrop_point(position, direction));
    if !seen.valid { return environment; }
    let width = f32(frame.width);
    let height = f32(frame.height);
    let border = min(min(seen.px, width - seen.px), min(seen.py, height - seen.py));
    let share = min(border / (BACKDROP_FADE * width), 1.0);
    let x = seen.px - 0.5;
    let y = seen.py - 0.5;
    let column = floor(x);
    let row = floor(y);
    let i = i32(column);
    let j = i32(row);
    let c00 = backdrop_texel(i, j);
    let c10 = backdrop_texel(i + 1, j);
    let c01 = backdrop_texel(i, j + 1);
    let c11 = backdrop_texel(i + 1, j + 1);
    let top = c00 + (c10 - c00) * (x - column);
    let bottom = c01 + (c11 - c01) * (x - column);
    let photograph = top + (bottom - top) * (y - row);
    return environment + (photograph - environment) * share;
}
