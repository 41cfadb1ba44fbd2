// Twin of src/stages/noise/{field,missing,textures}.rs: one thread a pixel.

import package::math::{hash_combine, log_, sincos_2pi, uniform_from_bits};
import package::stages::curve::{decode_, decode_slope, encode_};

const MARGIN: u32 = 16u;
const LAGS: u32 = 3u;
const KERNEL_SIDE: u32 = 7u;
const BIN_SHIFT: f32 = 0.01;

struct NoiseParams {
    width: u32,
    height: u32,
    bins: u32,
    seed: u32,
    frame: u32,
    // 0: the noise is white, else 3.
    reach: u32,
    has_photo: u32,
    texture_size: u32,
    scale: f32,
    magnification: f32,
    rotation_sin: f32,
    rotation_cos: f32,
    offset_x: f32,
    offset_y: f32,
    pad0: u32,
    pad1: u32,
}

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

fn box_muller(bits_a: u32, bits_b: u32) -> vec2<f32> {
    let u = 1.0 - uniform_from_bits(bits_a);
    let radius = sqrt(max(-2.0 * log_(u), 0.0));
    let turn = sincos_2pi(uniform_from_bits(bits_b));
    return vec2<f32>(radius * turn.cos, radius * turn.sin);
}

fn white_deviates(seed: u32, frame: u32, x: u32, y: u32) -> vec3<f32> {
    let key = hash_combine(hash_combine(hash_combine(seed, frame), y), x);
    let first = box_muller(hash_combine(key, 0u), hash_combine(key, 1u));
    let second = box_muller(hash_combine(key, 2u), hash_combine(key, 3u));
    return vec3<f32>(first, second.x);
}

fn mixed(x: u32, y: u32) -> vec3<f32> {
    let deviates = white_deviates(params.seed, params.frame, x, y);
    let at = 3u * params.bins;
    var out: vec3<f32>;
    for (var c = 0u; c < 3u; c++) {
        out[c] = weights[at + 3u * c] * deviates.x + weights[at + 3u * c + 1u] * deviates.y
            + weights[at + 3u * c + 2u] * deviates.z;
    }
    return out;
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

fn correlated(x: u32, y: u32) -> vec3<f32> {
    let width = params.width + 2u * params.reach;
    if params.reach == 0u {
        return white[y * width + x].xyz;
    }
    let at = 3u * params.bins + 9u;
    var out = vec3<f32>(0.0);
    for (var dy = 0u; dy < KERNEL_SIDE; dy++) {
        for (var dx = 0u; dx < KERNEL_SIDE; dx++) {
            let deviate = white[(y + dy) * width + x + dx].xyz;
            let weight = at + dy * KERNEL_SIDE + dx;
            let side2 = KERNEL_SIDE * KERNEL_SIDE;
            out += vec3<f32>(weights[weight], weights[weight + side2], weights[weight + 2u * side2])
                * deviate;
        }
    }
    return out;
}

fn bin_of(encoded: vec3<f32>) -> u32 {
    let sum = encoded.x + encoded.y + encoded.z;
    let intensity = sum * (255.0 / 3.0) + BIN_SHIFT;
    let bin = intensity * (f32(params.bins) * (1.0 / 256.0));
    return min(u32(max(bin, 0.0)), params.bins - 1u);
}

fn sigma_of(encoded: vec3<f32>) -> vec3<f32> {
    let bin = bin_of(encoded);
    return vec3<f32>(weights[3u * bin], weights[3u * bin + 1u], weights[3u * bin + 2u]);
}

fn encoded_of(linear: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(encode_(linear.x), encode_(linear.y), encode_(linear.z));
}

fn missing_sigma(encoded: vec3<f32>, index: u32) -> vec3<f32> {
    let wanted = sigma_of(encoded);
    let encoded_photo = encoded_of(vec3<f32>(photo[3u * index], photo[3u * index + 1u], photo[3u * index + 2u]));
    let photo_sigma = sigma_of(encoded_photo);
    var share = 0.0;
    if params.has_photo != 0u {
        share = 1.0 - mask[index];
    }
    var sigma: vec3<f32>;
    for (var c = 0u; c < 3u; c++) {
        let here = decode_slope(encoded[c]) * (1.0 / 255.0);
        let there = decode_slope(encoded_photo[c]) * (1.0 / 255.0);
        let carried = share * ratio[3u * index + c] * photo_sigma[c] * there;
        let present = (carried * carried + variance[3u * index + c]) / (here * here);
        sigma[c] = sqrt(max(wanted[c] * wanted[c] - present, 0.0));
    }
    return sigma;
}

fn is_untouched(index: u32) -> bool {
    if params.has_photo == 0u {
        return false;
    }
    for (var c = 0u; c < 3u; c++) {
        if bitcast<u32>(photo[3u * index + c]) != bitcast<u32>(picture[3u * index + c]) {
            return false;
        }
    }
    return true;
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
    let encoded = encoded_of(
        vec3<f32>(picture[3u * index], picture[3u * index + 1u], picture[3u * index + 2u]));
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
    let encoded = encoded_of(
        vec3<f32>(picture[3u * index], picture[3u * index + 1u], picture[3u * index + 2u]));
    let x = f32(id.x) + 0.5;
    let y = f32(id.y) + 0.5;
    let u = (params.rotation_cos * x - params.rotation_sin * y + params.offset_x) / params.magnification;
    let v = (params.rotation_sin * x + params.rotation_cos * y + params.offset_y) / params.magnification;
    let low_bits = i32(params.texture_size) - 1;
    let column = u32(i32(floor(u)) & low_bits);
    let row = u32(i32(floor(v)) & low_bits);
    let texel = (bin_of(encoded) * params.texture_size + row) * params.texture_size + column;
    for (var c = 0u; c < 3u; c++) {
        picture[3u * index + c] =
            decode_(encoded[c] + params.scale * textures[3u * texel + c] * (1.0 / 255.0));
    }
}
