// Twin of src/stages/cartoon/edges.rs.

import package::stages::cartoon::gpu::params;
import package::stages::cartoon::planes::yuv_at;
import package::stages::cartoon::simplify::simplified_at;

struct Gradients {
    x: vec3<f32>,
    y: vec3<f32>,
}

fn response(g: Gradients) -> f32 {
    let m = sqrt(g.x * g.x + g.y * g.y);
    return (1.0 - params.alpha) * m.x + 0.5 * params.alpha * m.y + 0.5 * params.alpha * m.z;
}

fn sobel(
    a0: vec3<f32>, a1: vec3<f32>, a2: vec3<f32>,
    h0: vec3<f32>, h2: vec3<f32>,
    b0: vec3<f32>, b1: vec3<f32>, b2: vec3<f32>,
) -> Gradients {
    let gx = (a2 - a0) + 2.0 * (h2 - h0) + (b2 - b0);
    let gy = (b0 - a0) + 2.0 * (b1 - a1) + (b2 - a2);
    return Gradients(gx * 0.25, gy * 0.25);
}

fn simplified_yuv(x: i32, y: i32) -> vec3<f32> {
    return simplified_at(x, y).xyz;
}

fn simplified_gradients(x: i32, y: i32) -> Gradients {
    return sobel(
        simplified_yuv(x - 1, y - 1), simplified_yuv(x, y - 1), simplified_yuv(x + 1, y - 1),
        simplified_yuv(x - 1, y), simplified_yuv(x + 1, y),
        simplified_yuv(x - 1, y + 1), simplified_yuv(x, y + 1), simplified_yuv(x + 1, y + 1),
    );
}

fn image_gradients(x: i32, y: i32) -> Gradients {
    return sobel(
        yuv_at(x - 1, y - 1), yuv_at(x, y - 1), yuv_at(x + 1, y - 1),
        yuv_at(x - 1, y), yuv_at(x + 1, y),
        yuv_at(x - 1, y + 1), yuv_at(x, y + 1), yuv_at(x + 1, y + 1),
    );
}

fn smoothstep_(low: f32, high: f32, x: f32) -> f32 {
    let t = clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
