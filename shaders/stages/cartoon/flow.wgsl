// Twin of src/stages/cartoon/flow.rs.

import package::stages::cartoon::edges::image_gradients;
import package::stages::cartoon::gpu::{field, flow, luma, params, weights};

fn place(x: i32, y: i32) -> u32 {
    let column = u32(clamp(x, 0, i32(params.width) - 1));
    let row = u32(clamp(y, 0, i32(params.height) - 1));
    return row * params.width + column;
}

// The structure tensor: xx, xy, yy.
fn tensor(x: i32, y: i32) -> vec3<f32> {
    let g = image_gradients(x, y);
    let xx = g.x * g.x;
    let xy = g.x * g.y;
    let yy = g.y * g.y;
    return vec3<f32>(xx.x + xx.y + xx.z, xy.x + xy.y + xy.z, yy.x + yy.y + yy.z);
}

fn blurred(x: i32, y: i32, dx: i32, dy: i32) -> vec4<f32> {
    var sum = weights[0] * field[place(x, y)];
    for (var step = 1; step < i32(flow.tensor_count); step++) {
        sum += weights[step]
            * (field[place(x + step * dx, y + step * dy)] + field[place(x - step * dx, y - step * dy)]);
    }
    return sum;
}

// The difference of Gaussians across the contour's tangent `t`.
fn across(column: u32, row: u32, t: vec2<f32>) -> f32 {
    let x = f32(column);
    let y = f32(row);
    var sum = 0.0;
    for (var step = 0u; step < flow.outer_count; step++) {
        var inner = 0.0;
        if step < flow.inner_count {
            inner = weights[flow.tensor_count + step];
        }
        let outer = weights[flow.tensor_count + flow.inner_count + step];
        let weight = inner - flow.tau * outer;
        let s = f32(step);
        var value = luma_sample(x + s * t.y, y - s * t.x);
        if step != 0u {
            value += luma_sample(x - s * t.y, y + s * t.x);
        }
        sum += weight * value;
    }
    return sum;
}

// The differences averaged along the contour.
fn along(column: u32, row: u32) -> f32 {
    let here = field[place(i32(column), i32(row))];
    let first = flow.tensor_count + flow.inner_count + flow.outer_count;
    var sum = weights[first] * here.z;
    for (var side = 0; side < 2; side++) {
        var at = vec2<f32>(f32(column), f32(row));
        var direction = here.xy;
        if side == 1 {
            direction = -direction;
        }
        for (var step = 1u; step < flow.line_count; step++) {
            at += direction;
            sum += weights[first + step] * across_sample(at.x, at.y);
            // A contour has no direction of its own: keep going the same way.
            let near = tangent_nearest(at.x, at.y);
            if near.x * direction.x + near.y * direction.y < 0.0 {
                direction = -near;
            } else {
                direction = near;
            }
        }
    }
    return sum;
}

fn luma_sample(at_x: f32, at_y: f32) -> f32 {
    let x = clamp(at_x, 0.0, f32(params.width - 1u));
    let y = clamp(at_y, 0.0, f32(params.height - 1u));
    let column = i32(x);
    let row = i32(y);
    let fx = x - f32(column);
    let fy = y - f32(row);
    let upper = luma[place(column, row)] + (luma[place(column + 1, row)] - luma[place(column, row)]) * fx;
    let lower = luma[place(column, row + 1)]
        + (luma[place(column + 1, row + 1)] - luma[place(column, row + 1)]) * fx;
    return upper + (lower - upper) * fy;
}

fn across_sample(at_x: f32, at_y: f32) -> f32 {
    let x = clamp(at_x, 0.0, f32(params.width - 1u));
    let y = clamp(at_y, 0.0, f32(params.height - 1u));
    let column = i32(x);
    let row = i32(y);
    let fx = x - f32(column);
    let fy = y - f32(row);
    let upper = field[place(column, row)].z
        + (field[place(column + 1, row)].z - field[place(column, row)].z) * fx;
    let lower = field[place(column, row + 1)].z
        + (field[place(column + 1, row + 1)].z - field[place(column, row + 1)].z) * fx;
    return upper + (lower - upper) * fy;
}

fn tangent_nearest(x: f32, y: f32) -> vec2<f32> {
    let column = i32(clamp(x + 0.5, 0.0, f32(params.width - 1u)));
    let row = i32(clamp(y + 0.5, 0.0, f32(params.height - 1u)));
    return field[place(column, row)].xy;
}

fn minor_eigenvector(xx: f32, xy: f32, yy: f32) -> vec2<f32> {
    let difference = xx - yy;
    let root = sqrt(difference * difference + 4.0 * xy * xy);
    var x = root - difference;
    var y = -2.0 * xy;
    if difference > 0.0 {
        x = -2.0 * xy;
        y = difference + root;
    }
    let length = sqrt(x * x + y * y);
    if length > 0.0 {
        return vec2<f32>(x / length, y / length);
    }
    return vec2<f32>(1.0, 0.0);
}
