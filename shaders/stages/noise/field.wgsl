// Twin of src/stages/noise/field.rs.

import package::math::{hash_combine, log_, sincos_2pi, uniform_from_bits};
import package::stages::noise::gpu::{params, weights, white};
import package::stages::noise::kernel::KERNEL_SIDE;

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

fn white_deviates(seed: u32, frame: u32, x: u32, y: u32) -> vec3<f32> {
    let key = hash_combine(hash_combine(hash_combine(seed, frame), y), x);
    let first = box_muller(hash_combine(key, 0u), hash_combine(key, 1u));
    let second = box_muller(hash_combine(key, 2u), hash_combine(key, 3u));
    return vec3<f32>(first, second.x);
}

fn box_muller(bits_a: u32, bits_b: u32) -> vec2<f32> {
    let u = 1.0 - uniform_from_bits(bits_a);
    let radius = sqrt(max(-2.0 * log_(u), 0.0));
    let turn = sincos_2pi(uniform_from_bits(bits_b));
    return vec2<f32>(radius * turn.cos, radius * turn.sin);
}
