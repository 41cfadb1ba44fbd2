// Twin of src/stages/cartoon/planes.rs.

import package::stages::cartoon::{LUMA, U_MAX, V_MAX};
import package::stages::cartoon::gpu::{image, params};

fn yuv_from_rgb(rgb: vec3<f32>) -> vec3<f32> {
    let y = LUMA.x * rgb.x + LUMA.y * rgb.y + LUMA.z * rgb.z;
    return vec3<f32>(
        y,
        (rgb.z - y) * (U_MAX / (1.0 - LUMA.z)),
        (rgb.x - y) * (V_MAX / (1.0 - LUMA.x)),
    );
}

fn rgb_from_yuv(yuv: vec3<f32>) -> vec3<f32> {
    let r = yuv.x + yuv.z * ((1.0 - LUMA.x) / V_MAX);
    let b = yuv.x + yuv.y * ((1.0 - LUMA.z) / U_MAX);
    return vec3<f32>(r, (yuv.x - LUMA.x * r - LUMA.z * b) / LUMA.y, b);
}

fn rgb_at(index: u32) -> vec3<f32> {
    return vec3<f32>(image[3u * index], image[3u * index + 1u], image[3u * index + 2u]);
}

fn yuv_at(x: i32, y: i32) -> vec3<f32> {
    let column = u32(clamp(x, 0, i32(params.width) - 1));
    let row = u32(clamp(y, 0, i32(params.height) - 1));
    return yuv_from_rgb(rgb_at(row * params.width + column));
}
