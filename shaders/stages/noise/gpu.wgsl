// Kernels of the noise, run by src/stages/noise/gpu.rs: one thread a pixel.

import package::stages::curve::{decode_, encode_rgb};
import package::stages::noise::field::{correlated, mixed, MARGIN};
import package::stages::noise::missing::missing_sigma;
import package::stages::noise::textures::variation;
import package::stages::noise::is_untouched;

@group(0) @binding(0) var<uniform> params: NoiseParams;
// Linear, three words a pixel; so are photo, ratio and variance.
@group(0) @binding(1) var<storage, read_write> picture: array<f32>;
@group(0) @binding(2) var<storage, read> photo: array<f32>;
@group(0) @binding(3) var<storage, read> mask: array<f32>;
@group(0) @binding(4) var<storage, read> ratio: array<f32>;
@group(0) @binding(5) var<storage, read> variance: array<f32>;
// Sigma by bin and channel, then the mix (3 x 3), then three kernels (7 x 7).
@group(0) @binding(6) var<storage, read> weights: array<f32>;
// The mixed deviates of the picture and its surroundings.
@group(0) @binding(7) var<storage, read_write> white: array<vec4<f32>>;
// By bin, row, column: three words a texel.
@group(0) @binding(8) var<storage, read> textures: array<f32>;

fn picture_at(index: u32) -> vec3<f32> {
    return vec3<f32>(picture[3u * index], picture[3u * index + 1u], picture[3u * index + 2u]);
}

@compute @workgroup_size(8, 8)
fn stage_white(@builtin(global_invocation_id) id: vec3<u32>) {
    let width = params.width + 2u * params.reach;
    if id.x >= width || id.y >= params.height + 2u * params.reach {
        return;
    }
    white[id.y * width + id.x] =
        vec4<f32>(mixed(id.x + MARGIN - params.reach, id.y + MARGIN - params.reach), 0.0);
}

@compute @workgroup_size(8, 8)
fn stage_missing(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let index = id.y * params.width + id.x;
    if is_untouched(index) {
        return;
    }
    let encoded = encode_rgb(picture_at(index));
    let sigma = missing_sigma(encoded, index);
    let noise = correlated(id.x, id.y);
    for (var c = 0u; c < 3u; c++) {
        if sigma[c] > 0.0 {
            picture[3u * index + c] =
                decode_(encoded[c] + params.scale * sigma[c] * noise[c] * (1.0 / 255.0));
        }
    }
}

@compute @workgroup_size(8, 8)
fn stage_textures(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let index = id.y * params.width + id.x;
    if mask[index] < 0.5 {
        return;
    }
    let encoded = encode_rgb(picture_at(index));
    let varied = variation(encoded, f32(id.x), f32(id.y));
    for (var c = 0u; c < 3u; c++) {
        picture[3u * index + c] = decode_(encoded[c] + params.scale * varied[c] * (1.0 / 255.0));
    }
}
