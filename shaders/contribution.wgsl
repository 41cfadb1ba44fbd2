// What estimator and vertex share: random numbers of a decision, weights, accumulation. Rust twin: src/cpu/contribution.rs.

import package::bindings::frame;
import package::sampler::{SampleKey, sample_4d};
import package::state::{DELTA_DENSITY, MODE_REAL, MODE_SHARED, PathState};

const SET_PRIMARY_ROULETTE: u32 = 1u;
const SET_DIFFERENCE_LIGHT: u32 = 0u;
const SET_DIFFERENCE_BSDF: u32 = 1u;
const SET_DIFFERENCE_CONE: u32 = 2u;
const SET_PATH_LIGHT: u32 = 3u;
const SET_PATH_BSDF: u32 = 4u;
const SET_DIFFERENCE_CHOICE: u32 = 5u;
const SETS_PER_DEPTH: u32 = 6u;
const FIRST_DEPTH_SET: u32 = 2u;

fn draw(st: ptr<function, PathState>, purpose: u32) -> vec4<f32> {
    return draw_of(st, purpose, 0u, 1u);
}

fn draw_of(st: ptr<function, PathState>, purpose: u32, j: u32, count: u32) -> vec4<f32> {
    var key = sample_key(st);
    key.index = key.index * count + j;
    key.total *= count;
    let v = sample_4d(key, FIRST_DEPTH_SET + (*st).depth * SETS_PER_DEPTH + purpose);
    return vec4<f32>(v.z, v.x, v.y, v.w);
}

fn sample_key(st: ptr<function, PathState>) -> SampleKey {
    return SampleKey((*st).pixel, (*st).index, frame.rays_total, frame.seed, frame.sampler);
}

fn accumulate(st: ptr<function, PathState>, unclamped: vec3<f32>) {
    var light = unclamped;
    if (*st).indirect != 0u {
        let largest = max(max(abs(light.x), abs(light.y)), abs(light.z));
        if largest > frame.clamp_indirect { light *= frame.clamp_indirect / largest; }
    }
    @if(paper) {
        if (*st).mode != MODE_REAL { (*st).radiance += light; }
        if (*st).mode == MODE_REAL || (*st).mode == MODE_SHARED { (*st).radiance_real += light; }
    }
    @if(!paper) {
        (*st).radiance += light;
    }
}

fn density_weight(density: f32, pdf: f32) -> f32 {
    if density == DELTA_DENSITY { return 1.0; }
    let ratio = pdf / density;
    return 1.0 / (1.0 + ratio * ratio);
}
