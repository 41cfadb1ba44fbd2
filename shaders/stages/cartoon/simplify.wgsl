// Twin of src/stages/cartoon/simplify.rs.

import package::stages::cartoon::gpu::{params, simplified};
import package::stages::cartoon::planes::{rgb_at, yuv_from_rgb, PAD};

fn overlap(part: u32, pixel: u32, large: u32, small: u32) -> f32 {
    let covered = min((part + 1u) * large, (pixel + 1u) * small) - max(part * large, pixel * small);
    return f32(covered) / f32(large);
}

// Y, U and V of a pixel of the shrunk picture.
fn shrink(column: u32, row: u32) -> vec3<f32> {
    let left = column * params.width / params.small_width;
    let right = ((column + 1u) * params.width + params.small_width - 1u) / params.small_width;
    let top = row * params.height / params.small_height;
    let bottom = ((row + 1u) * params.height + params.small_height - 1u) / params.small_height;
    var rgb = vec3<f32>(0.0);
    for (var x = left; x < right; x++) {
        var sum = vec3<f32>(0.0);
        for (var y = top; y < bottom; y++) {
            sum += overlap(row, y, params.height, params.small_height) * rgb_at(y * params.width + x);
        }
        rgb += overlap(column, x, params.width, params.small_width) * sum;
    }
    return yuv_from_rgb(rgb);
}

// One pass of the filter.
fn filter_(x: i32, y: i32) -> vec3<f32> {
    let center = simplified_at(x, y);
    var sum = vec3<f32>(0.0);
    var norm = 0.0;
    let reach = i32(PAD);
    for (var dy = -reach; dy <= reach; dy++) {
        for (var dx = -reach; dx <= reach; dx++) {
            let near = simplified_at(x + dx, y + dy).xyz;
            let du = near.y - center.y;
            let dv = near.z - center.z;
            let weight = gaussian((du * du + dv * dv) * params.factor);
            norm += weight;
            sum += weight * near;
        }
    }
    return sum * (1.0 / norm);
}

// e^x for x <= 0.
fn gaussian(x: f32) -> f32 {
    let t = max(x, LEAST_EXPONENT) * LOG2_E;
    let whole = i32(t - 0.5);
    let r = t - f32(whole);
    let p = (((((1.540353e-4 * r + 1.3333558e-3) * r + 9.618129e-3) * r + 0.05550411) * r + 0.2402265) * r
        + LN_2) * r + 1.0;
    return p * bitcast<f32>(u32(whole + 127) << 23u);
}

fn simplified_at(x: i32, y: i32) -> vec4<f32> {
    let column = u32(clamp(x, 0, i32(params.small_width) - 1));
    let row = u32(clamp(y, 0, i32(params.small_height) - 1));
    return simplified[row * params.small_width + column];
}
