// The estimator as a state machine. Rust twin: src/cpu/estimator.rs, where the method is described.

import package::packed::bindings::{NONE, frame, pixels, FRAME_AOVS, FRAME_ENV_DRAWN, FRAME_SHUTTER, PIXEL_BEAM_MAY_MEET_VIRTUAL};
import package::material::bsdf::bsdf_albedo;
import package::light::cones::cone_pdf;
import package::cpu::contribution::{accumulate, density_weight, sample_key};
import package::light::environment::env_radiance;
import package::camera::lens::camera_ray_from;
import package::light::lights::env_arriving;
import package::math::{dot3, hash_combine, hash_u32};
import package::camera::sampler::sample_4d;
import package::camera::shutter::{camera_pose, camera_pose_at, shutter_share};
import package::cpu::state::{
    COINCIDENCE, DELTA_DENSITY, FAR, MODE_DIFFERENCE, MODE_MIXED, MODE_REAL, MODE_SHARED, PENDING_DIFFERENCE, PENDING_NEXT, PENDING_REAL,
    PENDING_SHADOW, PENDING_VERTEX, PathState, REQUEST_CLOSEST_EACH, REQUEST_CLOSEST_MIXED, REQUEST_CLOSEST_REAL,
    REQUEST_CLOSEST_VIRTUAL, REQUEST_REAL_UNLESS_COVERED, REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_PAIR,
    REQUEST_VIRTUAL_THEN_REAL, STAGE_DIFFERENCE_BSDF, STAGE_DIFFERENCE_CONE, STAGE_DIFFERENCE_SHADOW, STAGE_DONE,
    STAGE_PAPER_BEHIND, STAGE_PATH, STAGE_PATH_SHADOW, STAGE_PRIMARY_REAL, STAGE_PRIMARY_VIRTUAL, STAGE_REAL_PASS, miss, path_state,
};
import package::material::surface::{Surface, surface_at};
import package::accel::trace::Hit;
import package::cpu::vertex::shade_vertex;

const TURN_SALT: u32 = 0x7f4a7c15u;

fn difference_turn(pixel: u32, index: u32) -> u32 {
    let period = pixels[pixel].difference_period;
    if period <= 1u { return index; }
    let offset = turn_offset(pixel, period);
    if (index + offset) % period == period - 1u { return (index + offset) / period; }
    return NONE;
}

fn turn_offset(pixel: u32, period: u32) -> u32 {
    return hash_u32(hash_combine(frame.seed ^ TURN_SALT, pixel)) % period;
}

fn begin_sample(pixel: u32, index: u32, is_real_pass: bool) -> PathState {
    var st = path_state(pixel, index);
    let may_meet_virtual = (pixels[pixel].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL) != 0u;
    @if(!paper) {
        if !is_real_pass && !may_meet_virtual {
            let turn = difference_turn(pixel, index);
            if turn != NONE {
                st.index = turn;
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
    st.position = ray.origin;
    st.direction = ray.direction;
    if is_real_pass {
        st.stage = STAGE_REAL_PASS;
        st.request = select(REQUEST_CLOSEST_REAL, REQUEST_CLOSEST_EACH, may_meet_virtual);
        return st;
    }
    @if(paper) {
        st.mode = MODE_SHARED;
        st.stage = STAGE_PATH;
        st.request = REQUEST_CLOSEST_MIXED;
    }
    @if(!paper) {
        if may_meet_virtual {
            st.stage = STAGE_PRIMARY_VIRTUAL;
            st.request = REQUEST_CLOSEST_VIRTUAL;
        }
    }
    return st;
}

// Consumes the hits in the state and either asks for the next ray or finishes the sample.
fn advance(st: ptr<function, PathState>) {
    var goes_on = true;
    switch (*st).stage {
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

fn virtual_is_nearer(hit_virtual: Hit, hit_real: Hit) -> bool {
    if hit_virtual.triangle == NONE { return false; }
    return hit_real.triangle == NONE || hit_virtual.t <= hit_real.t * (1.0 + COINCIDENCE);
}

fn primary_missed_virtual(st: ptr<function, PathState>, has_turn: bool) {
    let period = pixels[(*st).pixel].difference_period;
    (*st).weight = select(0.0, f32(period), has_turn);
    (*st).throughput = vec3<f32>((*st).weight);
    if has_turn || (frame.flags & FRAME_AOVS) != 0u {
        (*st).stage = STAGE_PRIMARY_REAL;
        (*st).request = REQUEST_CLOSEST_REAL;
        (*st).hit_virtual = miss();
    } else {
        (*st).stage = STAGE_DONE;
    }
}

// False: the state already asks for its next ray, or is done.
fn primary_virtual(st: ptr<function, PathState>) -> bool {
    if (*st).hit_virtual.triangle == NONE {
        primary_missed_virtual(st, difference_turn((*st).pixel, (*st).index) != NONE);
    } else {
        (*st).stage = STAGE_PRIMARY_REAL;
        (*st).request = REQUEST_CLOSEST_REAL;
        (*st).t_max = (*st).hit_virtual.t;
    }
    return false;
}

fn primary_real(st: ptr<function, PathState>) {
    (*st).depth = 1u;
    if virtual_is_nearer((*st).hit_virtual, (*st).hit_real) {
        (*st).mask = 1u;
        (*st).mode = MODE_MIXED;
        plan_vertex(st, (*st).hit_virtual);
    } else if (*st).hit_real.triangle != NONE {
        (*st).mode = MODE_DIFFERENCE;
        plan_vertex(st, (*st).hit_real);
    }
}

fn plan_vertex(st: ptr<function, PathState>, hit: Hit) {
    (*st).pending |= PENDING_VERTEX;
    (*st).vertex_hit = hit;
}

fn record_first_hit(st: ptr<function, PathState>, s: Surface) {
    (*st).depth_m = -dot3(s.position - frame.camera_position.xyz, frame.camera_back.xyz);
    (*st).normal = s.ns;
    (*st).albedo = bsdf_albedo(s, -(*st).direction);
}

fn resume(st: ptr<function, PathState>) {
    loop {
        if ((*st).pending & PENDING_VERTEX) != 0u {
            (*st).pending &= ~PENDING_VERTEX;
            let s = surface_at((*st).vertex_hit, (*st).direction);
            if (frame.flags & FRAME_AOVS) != 0u && (*st).depth == 1u && (*st).depth_m == FAR {
                record_first_hit(st, s);
            }
            shade_vertex(st, s);
            continue;
        }
        if ((*st).pending & PENDING_SHADOW) != 0u {
            (*st).pending &= ~PENDING_SHADOW;
            (*st).request = (*st).shadow_request;
            (*st).direction = (*st).shadow_direction;
            (*st).t_max = (*st).shadow_t_max;
            (*st).stage = select(STAGE_PATH_SHADOW, STAGE_DIFFERENCE_SHADOW, (*st).mode == MODE_DIFFERENCE);
            return;
        }
        if ((*st).pending & PENDING_NEXT) != 0u {
            (*st).pending &= ~PENDING_NEXT;
            (*st).direction = (*st).next_direction;
            (*st).density = (*st).next_density;
            (*st).throughput = (*st).next_throughput;
            (*st).medium = (*st).next_medium;
            if (*st).density != DELTA_DENSITY { (*st).indirect = 1u; }
            (*st).t_max = FAR;
            if (*st).mode == MODE_DIFFERENCE {
                (*st).stage = STAGE_DIFFERENCE_CONE;
                (*st).request = REQUEST_VIRTUAL_THEN_REAL;
            } else {
                (*st).stage = STAGE_PATH;
                (*st).request = select(REQUEST_CLOSEST_MIXED, REQUEST_CLOSEST_REAL, (*st).mode == MODE_REAL);
            }
            return;
        }
        if ((*st).pending & PENDING_REAL) != 0u {
            (*st).pending &= ~PENDING_REAL;
            (*st).mode = MODE_REAL;
            (*st).medium = (*st).real_medium;
            (*st).depth = (*st).real_depth;
            (*st).direction = (*st).real_direction;
            (*st).density = (*st).real_density;
            (*st).throughput = (*st).real_throughput;
            if (*st).density != DELTA_DENSITY { (*st).indirect = 1u; }
            plan_vertex(st, (*st).real_hit);
            continue;
        }
        @if(!paper) {
            if ((*st).pending & PENDING_DIFFERENCE) != 0u {
                (*st).pending &= ~PENDING_DIFFERENCE;
                (*st).mode = MODE_DIFFERENCE;
                (*st).medium = (*st).difference_medium;
                (*st).position = (*st).difference_position;
                (*st).offset = (*st).difference_offset;
                (*st).coincidence_ratio = (*st).difference_coincidence_ratio;
                (*st).side = 0u;
                (*st).real_t_min = (*st).difference_t_min;
                (*st).direction = (*st).difference_direction;
                (*st).density = (*st).difference_density;
                (*st).throughput = (*st).difference_throughput;
                (*st).indirect = 1u;
                (*st).depth = (*st).difference_depth;
                (*st).t_max = FAR;
                (*st).stage = STAGE_DIFFERENCE_BSDF;
                (*st).request = select(REQUEST_CLOSEST_EACH, REQUEST_REAL_UNLESS_COVERED, (*st).difference_left_to_cones != 0u);
                return;
            }
        }
        (*st).stage = STAGE_DONE;
        return;
    }
}

fn path_hit(st: ptr<function, PathState>) -> bool {
    let virtual_first = (*st).mode != MODE_REAL && virtual_is_nearer((*st).hit_virtual, (*st).hit_real);
    var hit = (*st).hit_real;
    if virtual_first { hit = (*st).hit_virtual; }
    (*st).depth += 1u;
    if hit.triangle == NONE {
        path_escape(st);
        return true;
    }
    @if(paper) {
        if (*st).mode == MODE_SHARED && virtual_first {
            if (*st).depth == 1u { (*st).mask = 1u; }
            (*st).stage = STAGE_PAPER_BEHIND;
            (*st).request = REQUEST_CLOSEST_REAL;
            return false;
        }
    }
    plan_vertex(st, hit);
    return true;
}

fn paper_behind(st: ptr<function, PathState>) {
    if (*st).hit_real.triangle != NONE {
        (*st).pending |= PENDING_REAL;
        (*st).real_hit = (*st).hit_real;
        (*st).real_direction = (*st).direction;
        (*st).real_density = (*st).density;
        (*st).real_throughput = (*st).throughput;
        (*st).real_medium = (*st).medium;
        (*st).real_depth = (*st).depth;
    } else {
        (*st).mode = MODE_REAL;
        path_escape(st);
    }
    (*st).mode = MODE_MIXED;
    plan_vertex(st, (*st).hit_virtual);
}

fn path_escape(st: ptr<function, PathState>) {
    if (*st).depth == 1u && (frame.flags & FRAME_ENV_DRAWN) == 0u { return; }
    accumulate(st, escaping_light(st));
}

fn escaping_light(st: ptr<function, PathState>) -> vec3<f32> {
    if (*st).density == DELTA_DENSITY { return (*st).throughput * env_radiance((*st).direction); }
    let arriving = env_arriving((*st).direction);
    return (*st).throughput * arriving.radiance * density_weight((*st).density, arriving.pdf);
}

fn path_shadow(st: ptr<function, PathState>) {
    let open_virtual = (*st).hit_virtual.triangle == NONE;
    let open_real = (*st).hit_real.triangle == NONE;
    @if(paper) {
        if (*st).mode == MODE_SHARED {
            if (*st).shadow_request == REQUEST_SHADOW_PAIR {
                if open_virtual { (*st).radiance += (*st).shadow_contribution; }
                if open_real { (*st).radiance_real += (*st).shadow_contribution; }
            } else if open_virtual && open_real {
                (*st).radiance += (*st).shadow_contribution;
            }
            return;
        }
    }
    if open_virtual && open_real { accumulate(st, (*st).shadow_contribution); }
}

fn difference_shadow(st: ptr<function, PathState>) {
    let open_real = (*st).hit_real.triangle == NONE;
    let open_virtual = (*st).hit_virtual.triangle == NONE;
    let blocked_alone = (*st).shadow_request == REQUEST_SHADOW_DIFFERENCE;
    if open_real && open_virtual != blocked_alone { (*st).radiance += (*st).shadow_contribution; }
}

fn difference_cone(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hit_virtual, (*st).hit_real) { split_difference(st); }
}

fn difference_bsdf(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hit_virtual, (*st).hit_real) {
        if (*st).difference_left_to_cones == 0u {
            if (*st).density != DELTA_DENSITY {
                let total = (*st).density + vertex_cone_density(st);
                (*st).throughput *= (*st).density / total;
                (*st).density = total;
            }
            split_difference(st);
        }
        return;
    }
    @if(multi_bounce) {
        if (*st).hit_real.triangle != NONE && (*st).depth < frame.max_bounces {
            (*st).depth += 1u;
            plan_vertex(st, (*st).hit_real);
        }
    }
}

fn vertex_cone_density(st: ptr<function, PathState>) -> f32 {
    if (*st).difference_cone_probability == 0.0 { return 0.0; }
    return (*st).difference_cone_probability * cone_pdf((*st).position, (*st).difference_normal, (*st).direction);
}

fn split_difference(st: ptr<function, PathState>) {
    if (*st).hit_real.triangle == NONE {
        (*st).radiance -= escaping_light(st);
    } else {
        (*st).pending |= PENDING_REAL;
        (*st).real_hit = (*st).hit_real;
        (*st).real_direction = (*st).direction;
        (*st).real_density = (*st).density;
        (*st).real_throughput = -(*st).throughput;
        (*st).real_medium = (*st).medium;
        (*st).real_depth = (*st).depth + 1u;
    }
    (*st).mode = MODE_MIXED;
    (*st).depth += 1u;
    plan_vertex(st, (*st).hit_virtual);
}

fn real_pass(st: ptr<function, PathState>) {
    if virtual_is_nearer((*st).hit_virtual, (*st).hit_real) { (*st).mask = 1u; }
    (*st).mode = MODE_REAL;
    (*st).depth = 1u;
    if (*st).hit_real.triangle == NONE {
        path_escape(st);
    } else {
        plan_vertex(st, (*st).hit_real);
    }
}
