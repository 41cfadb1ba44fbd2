// The estimator as a state machine. Rust twin: src/cpu/estimator.rs, where the method is described.

import package::gpu::buffers::{frame, pixels};
import package::packed::records::{FRAME_AOVS, FRAME_ENV_DRAWN, FRAME_SHUTTER, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_SHARES};
import package::shared::NONE;
import package::material::bsdf::bsdf_albedo;
import package::light::backdrop::{backdrop_of_pixel, backdrop_radiance};
import package::light::cones::{cone_pdf, cones_at};
import package::cpu::contribution::{accumulate, density_weight, events_after, left_to_photons, sample_key, sees_backdrop};
import package::light::environment::{env_radiance, share_left_to_eye};
import package::camera::lens::camera_ray_from;
import package::light::lights::env_arriving;
import package::math::{dot3, hash_combine, hash_u32};
import package::camera::sampler::sample_4d;
import package::camera::shutter::{camera_pose, camera_pose_at, shutter_share};
import package::cpu::state::{
    COINCIDENCE, DELTA_DENSITY, EVENT_AT_POLISHED, EVENT_FROM_LENS, EVENT_FROM_SHARED, EVENT_PASSED, EVENT_SCATTERED, FAR, FirstHit, Hits, MODE_DIFFERENCE, MODE_MIXED, MODE_REAL, MODE_SHARED, PENDING_DIFFERENCE,
    PENDING_BEHIND_PANE, PENDING_LIGHT, PENDING_NEXT, PENDING_REAL, PENDING_SHADOW, PENDING_VERTEX, PathState, REQUEST_CLOSEST_EACH, REQUEST_CLOSEST_MIXED,
    REQUEST_CLOSEST_REAL, REQUEST_CLOSEST_VIRTUAL, REQUEST_REAL_UNLESS_COVERED, REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_PAIR,
    REQUEST_VIRTUAL_THEN_REAL, RealPath, STAGE_DIFFERENCE_BSDF, STAGE_DIFFERENCE_CONE, STAGE_DIFFERENCE_SHADOW, STAGE_DONE,
    STAGE_PAPER_BEHIND, STAGE_PATH, STAGE_PATH_SHADOW, STAGE_PRIMARY_REAL, STAGE_PRIMARY_VIRTUAL, STAGE_REAL_PASS, Segment,
    path_differences, path_first_hits, path_nexts, path_passed_m, path_radiances_real, path_reals, path_results, path_state,
};
import package::material::surface::{Surface, surface_at};
import package::accel::trace::Hit;
import package::cpu::panes::{is_pane, open_share, open_share_real};
import package::cpu::points::{end_capture, end_cone_capture};
import package::cpu::sharing_tile::tile_of;
import package::cpu::vertex::shade_vertex;

fn difference_turn(pixel: u32, index: u32) -> u32 {
    let period = pixels[pixel].difference_period;
    if period <= 1u { return index; }
    let offset = turn_offset(pixel, period);
    if (index + offset) % period == period - 1u { return (index + offset) / period; }
    return NONE;
}

fn turn_offset(pixel: u32, period: u32) -> u32 {
    var taking_turns = pixel;
    if (pixels[pixel].flags & PIXEL_SHARES) != 0u { taking_turns = tile_of(frame.width, pixel); }
    return hash_u32(hash_combine(frame.seed ^ TURN_SALT, taking_turns)) % period;
}

fn evaluation(pixel: u32, index: u32) -> u32 {
    @if(paper) { return index; }
    @else { return difference_turn(pixel, index); }
}

fn begin_sample(lane: u32, pixel: u32, index: u32, is_real_pass: bool) -> PathState {
    var st = path_state(lane, pixel, index);
    let may_meet_virtual = (pixels[pixel].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL) != 0u;
    @if(!paper) {
        if !is_real_pass && !may_meet_virtual {
            let turn = difference_turn(pixel, index);
            if turn != NONE {
                st.path.index = turn;
            } else if (frame.flags & FRAME_AOVS) == 0u {
                return st;
            }
            primary_missed_virtual(&st, turn != NONE);
        }
    }
    st.rays.primary = select(1u, 0u, is_real_pass);
    let u = sample_4d(sample_key(&st), 0u);
    let x = f32(pixel % frame.width) + u.x;
    let y = f32(pixel / frame.width) + u.y;
    var pose = camera_pose();
    @if(shutter) {
        if (frame.flags & FRAME_SHUTTER) != 0u {
            pose = camera_pose_at(shutter_share(sample_key(&st), index, pixel / frame.width));
        }
    }
    let ray = camera_ray_from(pose, x, y, u.z, u.w);
    st.ray.origin.position = ray.origin;
    st.ray.direction = ray.direction;
    @if(alpha) {
        st.ray.opacity_seed = hash_combine(hash_combine(frame.seed, pixel), st.path.index);
    }
    if is_real_pass {
        st.path.stage = STAGE_REAL_PASS;
        st.ray.request = select(REQUEST_CLOSEST_REAL, REQUEST_CLOSEST_EACH, may_meet_virtual);
        return st;
    }
    @if(paper) {
        st.path.mode = MODE_SHARED;
        st.path.stage = STAGE_PATH;
        st.ray.request = REQUEST_CLOSEST_MIXED;
    }
    @if(!paper) {
        if may_meet_virtual {
            st.path.stage = STAGE_PRIMARY_VIRTUAL;
            st.ray.request = REQUEST_CLOSEST_VIRTUAL;
        }
    }
    return st;
}

// Consumes the hits in the state and either asks for the next ray or finishes the sample.
fn advance(st: ptr<function, PathState>) {
    var goes_on = true;
    switch (*st).path.stage {
        @if(!paper) case STAGE_PRIMARY_VIRTUAL: { goes_on = primary_virtual(st); }
        @if(!paper) case STAGE_PRIMARY_REAL: { primary_real(st); }
        case STAGE_PATH: { goes_on = path_hit(st); }
        case STAGE_PATH_SHADOW: { path_shadow(st); }
        @if(paper) case STAGE_PAPER_BEHIND: { paper_behind(st); }
        @if(!paper) case STAGE_DIFFERENCE_SHADOW: { difference_shadow(st); }
        @if(!paper) case STAGE_DIFFERENCE_CONE: { difference_cone(st); }
        @if(!paper) case STAGE_DIFFERENCE_BSDF: { difference_bsdf(st); }
        case STAGE_REAL_PASS: { real_pass(st); }
        default: {}
    }
    if goes_on { resume(st); }
}

fn virtual_is_nearer(hits: Hits) -> bool {
    return hits.in_virtual.triangle != NONE
        && (hits.in_real.triangle == NONE || hits.in_virtual.t <= hits.in_real.t * (1.0 + COINCIDENCE));
}

fn primary_missed_virtual(st: ptr<function, PathState>, has_turn: bool) {
    let period = pixels[(*st).path.pixel].difference_period;
    (*st).path.weight = select(0.0, f32(period), has_turn);
    (*st).path.throughput = vec3<f32>((*st).path.weight);
    if has_turn || (frame.flags & FRAME_AOVS) != 0u {
        (*st).path.stage = STAGE_PRIMARY_REAL;
        (*st).ray.request = REQUEST_CLOSEST_REAL;
    } else {
        (*st).path.stage = STAGE_DONE;
    }
}

// False: the state already asks for its next ray, or is done.
fn primary_virtual(st: ptr<function, PathState>) -> bool {
    if (*st).hits.in_virtual.triangle == NONE {
        let has_turn = difference_turn((*st).path.pixel, (*st).path.index) != NONE;
        primary_missed_virtual(st, has_turn);
    } else {
        (*st).path.stage = STAGE_PRIMARY_REAL;
        (*st).ray.request = REQUEST_CLOSEST_REAL;
        (*st).ray.t_max = (*st).hits.in_virtual.t;
    }
    return false;
}

fn primary_real(st: ptr<function, PathState>) {
    (*st).ray.depth = 1u;
    if virtual_is_nearer((*st).hits) {
        path_results[(*st).lane].mask = 1u;
        (*st).path.mode = MODE_MIXED;
        @if(backdrop) { (*st).path.events |= EVENT_FROM_LENS; }
        plan_vertex(st, (*st).hits.in_virtual);
    } else if (*st).hits.in_real.triangle != NONE {
        (*st).path.mode = MODE_DIFFERENCE;
        plan_vertex(st, (*st).hits.in_real);
    }
}

fn plan_vertex(st: ptr<function, PathState>, hit: Hit) {
    (*st).path.pending |= PENDING_VERTEX;
    (*st).vertex_hit = hit;
}

fn record_first_hit(st: ptr<function, PathState>, s: Surface) {
    path_first_hits[(*st).lane] = FirstHit(
        s.ns,
        -dot3(s.position - frame.camera_position.xyz, frame.camera_back.xyz),
        bsdf_albedo(s, -(*st).ray.direction),
        0u,
    );
}

fn resume(st: ptr<function, PathState>) {
    let lane = (*st).lane;
    loop {
        if ((*st).path.pending & PENDING_VERTEX) != 0u {
            (*st).path.pending &= ~PENDING_VERTEX;
            let s = surface_at((*st).vertex_hit, (*st).ray.direction);
            if (frame.flags & FRAME_AOVS) != 0u && (*st).ray.depth == 1u && path_first_hits[lane].depth_m == FAR {
                record_first_hit(st, s);
            }
            shade_vertex(st, s);
            continue;
        }
        if ((*st).path.pending & PENDING_SHADOW) != 0u {
            (*st).path.pending &= ~PENDING_SHADOW;
            (*st).path.stage = select(STAGE_PATH_SHADOW, STAGE_DIFFERENCE_SHADOW, (*st).path.mode == MODE_DIFFERENCE);
            return;
        }
        if (*st).path.pending >= PENDING_LIGHT {
            (*st).ray.direction = path_reals[lane].segment.direction;
            plan_vertex(st, path_reals[lane].hit);
            continue;
        }
        if ((*st).path.pending & PENDING_NEXT) != 0u {
            (*st).path.pending &= ~PENDING_NEXT;
            follow(st, path_nexts[lane]);
            if (*st).path.mode == MODE_DIFFERENCE {
                @if(photons) {
                    let smooth_ = ((*st).path.events & EVENT_AT_POLISHED) != 0u;
                    (*st).path.events = events_after((*st).path.events, (*st).ray.depth, (*st).ray.side, smooth_);
                }
                (*st).path.stage = STAGE_DIFFERENCE_CONE;
                (*st).ray.request = REQUEST_VIRTUAL_THEN_REAL;
            } else {
                (*st).path.stage = STAGE_PATH;
                (*st).ray.request = select(REQUEST_CLOSEST_MIXED, REQUEST_CLOSEST_REAL, (*st).path.mode == MODE_REAL);
            }
            return;
        }
        if ((*st).path.pending & PENDING_REAL) != 0u {
            let behind_pane = ((*st).path.pending & PENDING_BEHIND_PANE) != 0u;
            (*st).path.pending &= ~(PENDING_REAL | PENDING_BEHIND_PANE);
            end_cone_capture(st);
            let real = path_reals[lane];
            (*st).path.mode = MODE_REAL;
            follow(st, real.segment);
            @if(panes) {
                (*st).path.events = ((*st).path.events & ~EVENT_PASSED) | EVENT_FROM_SHARED;
                if behind_pane {
                    (*st).path.events |= EVENT_PASSED;
                    path_passed_m[lane] = 0.0;
                }
            }
            (*st).ray.depth = (*st).path.real_depth;
            plan_vertex(st, real.hit);
            continue;
        }
        @if(!paper) {
            if ((*st).path.pending & PENDING_DIFFERENCE) != 0u {
                (*st).path.pending &= ~PENDING_DIFFERENCE;
                end_cone_capture(st);
                (*st).path.mode = MODE_DIFFERENCE;
                follow(st, path_differences[lane].segment);
                (*st).path.events = path_differences[lane].events | EVENT_SCATTERED;
                (*st).ray.origin = path_differences[lane].origin;
                (*st).ray.side = 0u;
                (*st).ray.depth = path_differences[lane].depth;
                (*st).path.stage = STAGE_DIFFERENCE_BSDF;
                (*st).ray.request = path_differences[lane].request;
                return;
            }
        }
        end_capture(st);
        (*st).path.stage = STAGE_DONE;
        return;
    }
}

fn follow(st: ptr<function, PathState>, segment: Segment) {
    (*st).ray.direction = segment.direction;
    (*st).ray.t_max = FAR;
    (*st).path.density = segment.density;
    (*st).path.throughput = segment.throughput;
    (*st).path.medium = segment.medium;
    if segment.density != DELTA_DENSITY { (*st).path.events |= EVENT_SCATTERED; }
}

fn followed(st: ptr<function, PathState>) -> Segment {
    return Segment((*st).ray.direction, (*st).path.density, (*st).path.throughput, (*st).path.medium);
}

fn path_hit(st: ptr<function, PathState>) -> bool {
    let virtual_first = (*st).path.mode != MODE_REAL && virtual_is_nearer((*st).hits);
    var hit = (*st).hits.in_real;
    if virtual_first { hit = (*st).hits.in_virtual; }
    (*st).ray.depth += 1u;
    if hit.triangle == NONE {
        path_escape(st);
        return true;
    }
    @if(paper) {
        if (*st).path.mode == MODE_SHARED && virtual_first {
            if (*st).ray.depth == 1u { path_results[(*st).lane].mask = 1u; }
            (*st).path.stage = STAGE_PAPER_BEHIND;
            (*st).ray.request = REQUEST_CLOSEST_REAL;
            return false;
        }
    }
    plan_vertex(st, hit);
    return true;
}

fn paper_behind(st: ptr<function, PathState>) {
    if (*st).hits.in_real.triangle != NONE {
        (*st).path.pending |= PENDING_REAL;
        path_reals[(*st).lane] = RealPath(followed(st), (*st).hits.in_real);
        (*st).path.real_depth = (*st).ray.depth;
    } else {
        (*st).path.mode = MODE_REAL;
        path_escape(st);
    }
    (*st).path.mode = MODE_MIXED;
    @if(panes) { (*st).path.events |= EVENT_FROM_SHARED; }
    @if(backdrop) {
        if (*st).ray.depth == 1u { (*st).path.events |= EVENT_FROM_LENS; }
    }
    plan_vertex(st, (*st).hits.in_virtual);
}

fn path_escape(st: ptr<function, PathState>) {
    let seen_past_panes = ((*st).path.events & EVENT_PASSED) != 0u;
    if (*st).ray.depth == 1u && (frame.flags & FRAME_ENV_DRAWN) == 0u && !seen_past_panes { return; }
    var light = escaping_light(st);
    @if(photons) {
        if left_to_photons(st) { light *= share_left_to_eye((*st).ray.direction); }
    }
    accumulate(st, light);
}

fn escaping_light(st: ptr<function, PathState>) -> vec3<f32> {
    @if(backdrop) {
        if sees_backdrop(st) {
            var weight = 1.0;
            if (*st).path.density != DELTA_DENSITY {
                weight = density_weight((*st).path.density, env_arriving((*st).ray.direction).pdf);
            }
            return (*st).path.throughput * backdrop_behind(st) * weight;
        }
    }
    if (*st).path.density == DELTA_DENSITY { return (*st).path.throughput * env_radiance((*st).ray.direction); }
    let arriving = env_arriving((*st).ray.direction);
    return (*st).path.throughput * arriving.radiance * density_weight((*st).path.density, arriving.pdf);
}

fn backdrop_behind(st: ptr<function, PathState>) -> vec3<f32> {
    if (*st).ray.depth == 1u { return backdrop_of_pixel((*st).path.pixel); }
    return backdrop_radiance((*st).ray.origin.position, (*st).ray.direction);
}

fn path_shadow(st: ptr<function, PathState>) {
    let open_real = open_share_real(st);
    let open_mixed = open_share((*st).hits.in_virtual) * open_real;
    let light = (*st).path.shadow_contribution;
    @if(paper) {
        if (*st).path.mode == MODE_SHARED {
            if any(open_mixed != vec3<f32>(0.0)) { path_results[(*st).lane].radiance += light * open_mixed; }
            if (*st).ray.request == REQUEST_SHADOW_PAIR && any(open_real != vec3<f32>(0.0)) {
                path_radiances_real[(*st).lane] += light * open_real;
            }
            return;
        }
    }
    if any(open_mixed != vec3<f32>(0.0)) { accumulate(st, light * open_mixed); }
}

fn difference_shadow(st: ptr<function, PathState>) {
    let open_virtual = open_share((*st).hits.in_virtual);
    var share = open_share_real(st);
    if (*st).ray.request == REQUEST_SHADOW_DIFFERENCE {
        share *= vec3<f32>(1.0) - open_virtual;
    } else {
        share *= open_virtual;
    }
    if any(share != vec3<f32>(0.0)) { path_results[(*st).lane].radiance += (*st).path.shadow_contribution * share; }
}

fn difference_cone(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hits) { split_difference(st); }
}

fn difference_bsdf(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hits) {
        let left_to_cones = (*st).ray.request == REQUEST_REAL_UNLESS_COVERED;
        if !left_to_cones {
            if (*st).path.density != DELTA_DENSITY {
                let total = (*st).path.density + vertex_cone_density(st);
                (*st).path.throughput *= (*st).path.density / total;
                (*st).path.density = total;
            }
            split_difference(st);
        }
        return;
    }
    @if(multi_bounce) {
        if (*st).hits.in_real.triangle != NONE && (*st).ray.depth < frame.max_bounces {
            (*st).ray.depth += 1u;
            plan_vertex(st, (*st).hits.in_real);
        }
    }
}

fn vertex_cone_density(st: ptr<function, PathState>) -> f32 {
    let probability = path_differences[(*st).lane].cone_probability;
    if probability == 0.0 { return 0.0; }
    return probability * cone_pdf(cones_at((*st).ray.origin.position, path_differences[(*st).lane].normal), (*st).ray.direction);
}

fn split_difference(st: ptr<function, PathState>) {
    if (*st).hits.in_real.triangle == NONE {
        path_results[(*st).lane].radiance -= escaping_light(st);
    } else {
        (*st).path.pending |= PENDING_REAL;
        @if(panes) {
            if is_pane((*st).hits.in_virtual, (*st).ray.direction) { (*st).path.pending |= PENDING_BEHIND_PANE; }
        }
        var segment = followed(st);
        segment.throughput = -segment.throughput;
        path_reals[(*st).lane] = RealPath(segment, (*st).hits.in_real);
        (*st).path.real_depth = (*st).ray.depth + 1u;
    }
    (*st).path.mode = MODE_MIXED;
    @if(panes) { (*st).path.events |= EVENT_FROM_SHARED; }
    (*st).ray.depth += 1u;
    plan_vertex(st, (*st).hits.in_virtual);
}

fn real_pass(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hits) { path_results[(*st).lane].mask = 1u; }
    (*st).path.mode = MODE_REAL;
    (*st).ray.depth = 1u;
    if (*st).hits.in_real.triangle == NONE {
        path_escape(st);
    } else {
        plan_vertex(st, (*st).hits.in_real);
    }
}
