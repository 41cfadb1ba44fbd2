// Twin of src/stages/motion_blur/copies.rs.

import package::stages::motion_blur::gpu::{layer, params};

fn over(below: vec4<f32>, above: vec4<f32>, opacity: f32) -> vec4<f32> {
    let through = 1.0 - opacity * above.w;
    return vec4<f32>(below.xyz * through + opacity * above.xyz, 1.0 - (1.0 - below.w) * through);
}

fn layer_at(x: f32, y: f32) -> vec4<f32> {
    let left = floor(x);
    let top = floor(y);
    let along = x - left;
    let down = y - top;
    var sum = vec4<f32>(0.0);
    sum += (1.0 - along) * (1.0 - down) * texel(left, top);
    sum += along * (1.0 - down) * texel(left + 1.0, top);
    sum += (1.0 - along) * down * texel(left, top + 1.0);
    sum += along * down * texel(left + 1.0, top + 1.0);
    return sum;
}

fn texel(column: f32, row: f32) -> vec4<f32> {
    if column >= 0.0 && row >= 0.0 && column < f32(params.width) && row < f32(params.height) {
        return layer[u32(row) * params.width + u32(column)];
    }
    return vec4<f32>(0.0);
}
