// Twin of src/stages/noise/textures.rs.

import package::stages::noise::gpu::{params, textures};
import package::stages::noise::missing::bin_of;

fn variation(encoded: vec3<f32>, column: f32, row: f32) -> vec3<f32> {
    let x = column + 0.5;
    let y = row + 0.5;
    let u = (params.rotation_cos * x - params.rotation_sin * y + params.offset_x) / params.magnification;
    let v = (params.rotation_sin * x + params.rotation_cos * y + params.offset_y) / params.magnification;
    // A power of two: the low bits are the remainder, also of negative numbers.
    let low_bits = i32(params.texture_size) - 1;
    let texel_column = u32(i32(floor(u)) & low_bits);
    let texel_row = u32(i32(floor(v)) & low_bits);
    let texel = (bin_of(encoded) * params.texture_size + texel_row) * params.texture_size + texel_column;
    return vec3<f32>(textures[3u * texel], textures[3u * texel + 1u], textures[3u * texel + 2u]);
}
