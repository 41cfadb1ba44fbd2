// What estimator and vertex share: random numbers of a decision, weights, accumulation. Rust twin: src/cpu/contribution.rs.

import package::gpu::buffers::{frame, pixels};
import package::camera::sampler::{SampleKey, SampleSet, sample_set};
import package::packed::records::{FRAME_BACKDROP, FRAME_NO_PHOTONS, PIXEL_BEAM_MAY_MEET_VIRTUAL, SAMPLER_CMJ, SAMPLER_JITTERED, SIDE_VIRTUAL};
import package::material::bsdf::{bsdf_is_diffuse, bsdf_is_glossy, bsdf_is_polished};
import package::material::surface::Surface;
import package::cpu::sharing_tile::{MEMBERS, member_of, tile_of};
import package::cpu::state::{
    DELTA_DENSITY, EVENT_AT_POLISHED, EVENT_FROM_LENS, EVENT_REAL_CHAIN, EVENT_SCATTERED, EVENT_SEEN, EVENT_VIRTUAL_CHAIN, FIRST_DIFFERENCE, FIRST_NONE, MODE_MIXED, MODE_REAL, MODE_SHARED, POINT_NONE, PathState, path_firsts, path_radiances_real, path_results,
};

fn draw(st: ptr<function, PathState>, purpose: u32) -> SampleSet {
    return draw_one_of(st, purpose, 0u, 1u);
}

fn draw_one_of(st: ptr<function, PathState>, purpose: u32, number: u32, count: u32) -> SampleSet {
    let set_id = FIRST_DEPTH_SET + (*st).ray.depth * SETS_PER_DEPTH + purpose;
    var key = sample_key(st);
    @if(sharing) {
        // Chosen rather than branched on, here and below: a branch keeps a mask of lanes in scarce scalar registers.
        let for_tile = is_for_tile(st, purpose);
        key.index = select(key.index, index_in_tile(st, key), for_tile);
        key.pixel = select(key.pixel, tile_of(frame.width, key.pixel) | TILE_NUMBERS, for_tile);
    }
    key.index = key.index * count + number;
    key.total *= count;
    return sample_set(key, set_id);
}

fn sample_key(st: ptr<function, PathState>) -> SampleKey {
    return SampleKey((*st).path.pixel, (*st).path.index, frame.rays_total * pixels[(*st).path.pixel].sample_factor, frame.seed, frame.sampler);
}

fn is_for_tile(st: ptr<function, PathState>, purpose: u32) -> bool {
    let lane = (*st).lane;
    let of_lights = purpose == SET_DIFFERENCE_LIGHT || purpose == SET_PATH_LIGHT;
    let is_shared_direction = ((*st).ray.depth == 1u) & (path_firsts[lane].kept != FIRST_NONE) & !of_lights;
    let is_laid_out = (frame.sampler == SAMPLER_JITTERED) | (frame.sampler == SAMPLER_CMJ);
    return (is_shared_direction | (path_firsts[lane].capture != POINT_NONE)) & !is_laid_out;
}

fn index_in_tile(st: ptr<function, PathState>, key: SampleKey) -> u32 {
    let info = pixels[key.pixel];
    let is_difference = path_firsts[(*st).lane].kept == FIRST_DIFFERENCE;
    let by_turns = is_difference & ((info.flags & PIXEL_BEAM_MAY_MEET_VIRTUAL) != 0u);
    let count = key.total / select(1u, info.difference_period, is_difference);
    let index = key.index / select(1u, info.difference_period, by_turns);
    let run_bits = firstLeadingBit(max(count, 1u));
    let runs_before = (index >> run_bits) * MEMBERS + member_of(frame.width, key.pixel);
    return (runs_before << run_bits) + (index & ((1u << run_bits) - 1u));
}

fn accumulate(st: ptr<function, PathState>, unclamped: vec3<f32>) {
    var light = unclamped;
    if ((*st).path.events & EVENT_SCATTERED) != 0u {
        let limit = frame.clamp_indirect * (*st).path.weight;
        let largest = max(max(abs(light.x), abs(light.y)), abs(light.z));
        if largest > limit { light *= limit / largest; }
    }
    @if(paper) {
        if (*st).path.mode != MODE_REAL { path_results[(*st).lane].radiance += light; }
        if (*st).path.mode == MODE_REAL || (*st).path.mode == MODE_SHARED { path_radiances_real[(*st).lane] += light; }
    }
    @if(!paper) {
        path_results[(*st).lane].radiance += light;
    }
}

fn events_after(events: u32, depth: u32, side: u32, smooth_: bool) -> u32 {
    if !smooth_ {
        return (events & (EVENT_SEEN | EVENT_SCATTERED)) | select(0u, EVENT_SEEN, depth == 1u);
    }
    let before = select(events & ~EVENT_AT_POLISHED, events & EVENT_SCATTERED, depth == 1u);
    return before | select(EVENT_REAL_CHAIN, EVENT_VIRTUAL_CHAIN, side == SIDE_VIRTUAL);
}

fn is_smooth(s: Surface, side: u32, is_first: bool) -> bool {
    if is_first || side != SIDE_VIRTUAL || (frame.flags & FRAME_BACKDROP) != 0u { return bsdf_is_polished(s); }
    return bsdf_is_glossy(s);
}

fn left_to_photons(st: ptr<function, PathState>) -> bool {
    let chain = EVENT_SEEN | EVENT_VIRTUAL_CHAIN | EVENT_REAL_CHAIN;
    return photons_traced()
        && (*st).path.mode == MODE_MIXED
        && ((*st).path.events & chain) == (EVENT_SEEN | EVENT_VIRTUAL_CHAIN);
}

fn vertex_left_to_photons(st: ptr<function, PathState>, s: Surface) -> bool {
    return photons_traced()
        && (*st).path.mode == MODE_MIXED
        && (*st).ray.side == SIDE_VIRTUAL
        && ((*st).path.events & (EVENT_SEEN | EVENT_REAL_CHAIN)) == EVENT_SEEN
        && is_smooth(s, (*st).ray.side, false);
}

fn sees_backdrop(st: ptr<function, PathState>) -> bool {
    return (frame.flags & FRAME_BACKDROP) != 0u
        && (*st).path.mode == MODE_MIXED
        && ((*st).path.events & EVENT_FROM_LENS) != 0u;
}

fn from_lens_after(st: ptr<function, PathState>, s: Surface, delta: bool, smooth_: bool) -> u32 {
    let looks_through = (*st).ray.side == SIDE_VIRTUAL && (delta || !bsdf_is_diffuse(s));
    let left_to_photons_ = smooth_ && ((*st).path.events & EVENT_SEEN) != 0u;
    return select(0u, (*st).path.events & EVENT_FROM_LENS, looks_through && !left_to_photons_);
}

fn photons_traced() -> bool {
    @if(paper) {
        return false;
    }
    @else {
        return frame.photon_sphere_count > 0u && (frame.flags & FRAME_NO_PHOTONS) == 0u;
    }
}

fn density_weight(density: f32, pdf: f32) -> f32 {
    if density == DELTA_DENSITY { return 1.0; }
    let ratio = pdf / density;
    return 1.0 / (1.0 + ratio * ratio);
}
