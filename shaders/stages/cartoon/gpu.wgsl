// Kernels of the cartoon, run by src/stages/cartoon/gpu.rs: one thread a pixel of the shrunk or of the full picture.

import package::stages::cartoon::tap;
import package::stages::cartoon::edges::{image_gradients, response, simplified_gradients, smoothstep_};
import package::stages::cartoon::flow::{across, along, blurred, minor_eigenvector, place, tensor};
import package::stages::cartoon::planes::{rgb_from_yuv, yuv_at};
import package::stages::cartoon::simplify::{filter_, shrink, simplified_at};

@group(0) @binding(0) var<uniform> params: CartoonParams;
// Encoded, clamped to 0..=1, three words a pixel.
@group(0) @binding(1) var<storage, read> image: array<f32>;
// Y, U, V and the response of the simplified picture.
@group(0) @binding(2) var<storage, read> simplified: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> next: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> lines: array<f32>;
// Three words a pixel, then three planes: responses of the simplified and of the original picture, silhouettes.
@group(0) @binding(5) var<storage, read_write> result: array<f32>;

// What the flow style adds.
@group(1) @binding(0) var<uniform> flow: FlowParams;
@group(1) @binding(1) var<storage, read> weights: array<f32>;
@group(1) @binding(2) var<storage, read> field: array<vec4<f32>>;
@group(1) @binding(3) var<storage, read_write> next_field: array<vec4<f32>>;
@group(1) @binding(4) var<storage, read_write> lines_out: array<f32>;
// Brightness.
@group(1) @binding(5) var<storage, read_write> luma: array<f32>;

fn inside(id: vec3<u32>) -> bool {
    return id.x < params.width && id.y < params.height;
}

fn inside_small(id: vec3<u32>) -> bool {
    return id.x < params.small_width && id.y < params.small_height;
}

@compute @workgroup_size(8, 8)
fn stage_shrink(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside_small(id) {
        next[id.y * params.small_width + id.x] = vec4<f32>(shrink(id.x, id.y), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn stage_filter(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside_small(id) {
        next[id.y * params.small_width + id.x] = vec4<f32>(filter_(i32(id.x), i32(id.y)), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn stage_respond(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside_small(id) {
        let x = i32(id.x);
        let y = i32(id.y);
        let edge = response(simplified_gradients(x, y));
        next[id.y * params.small_width + id.x] = vec4<f32>(simplified_at(x, y).xyz, edge);
    }
}

@compute @workgroup_size(8, 8)
fn stage_compose(@builtin(global_invocation_id) id: vec3<u32>) {
    if !inside(id) {
        return;
    }
    let index = id.y * params.width + id.x;
    let at_x = tap(id.x, params.width, params.small_width);
    let at_y = tap(id.y, params.height, params.small_height);
    let x = i32(at_x);
    let y = i32(at_y);
    let weight_x = at_x - f32(x);
    let weight_y = at_y - f32(y);
    let left = simplified_at(x, y) + (simplified_at(x, y + 1) - simplified_at(x, y)) * weight_y;
    let right = simplified_at(x + 1, y) + (simplified_at(x + 1, y + 1) - simplified_at(x + 1, y)) * weight_y;
    let color = left + (right - left) * weight_x;
    let original = response(image_gradients(i32(id.x), i32(id.y)));
    var silhouette = (1.0 - params.beta) * smoothstep_(params.s0, params.s1, color.w)
        + params.beta * smoothstep_(params.a0, params.a1, original);
    if params.flow != 0u {
        silhouette = lines[index];
    }
    let rgb = rgb_from_yuv(color.xyz) * (1.0 - silhouette);
    result[3u * index] = rgb.x;
    result[3u * index + 1u] = rgb.y;
    result[3u * index + 2u] = rgb.z;
    let count = params.width * params.height;
    result[3u * count + index] = color.w;
    result[4u * count + index] = original;
    result[5u * count + index] = silhouette;
}

@compute @workgroup_size(8, 8)
fn stage_tensor(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside(id) {
        let x = i32(id.x);
        let y = i32(id.y);
        next_field[place(x, y)] = vec4<f32>(tensor(x, y), 0.0);
        luma[place(x, y)] = yuv_at(x, y).x;
    }
}

@compute @workgroup_size(8, 8)
fn stage_blur_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside(id) {
        next_field[place(i32(id.x), i32(id.y))] = blurred(i32(id.x), i32(id.y), 1, 0);
    }
}

@compute @workgroup_size(8, 8)
fn stage_blur_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside(id) {
        next_field[place(i32(id.x), i32(id.y))] = blurred(i32(id.x), i32(id.y), 0, 1);
    }
}

// Tangent x, y and the difference of Gaussians across it.
@compute @workgroup_size(8, 8)
fn stage_across(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside(id) {
        let here = place(i32(id.x), i32(id.y));
        let t = minor_eigenvector(field[here].x, field[here].y, field[here].z);
        next_field[here] = vec4<f32>(t, across(id.x, id.y, t), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn stage_along(@builtin(global_invocation_id) id: vec3<u32>) {
    if inside(id) {
        lines_out[place(i32(id.x), i32(id.y))] = smoothstep_(flow.t0, flow.t1, -along(id.x, id.y));
    }
}
