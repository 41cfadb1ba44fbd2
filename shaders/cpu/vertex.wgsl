// One vertex of any path: emission, next event, cone direction, continuation. Rust twin: src/cpu/vertex.rs.

import package::packed::bindings::{
    NONE, frame, materials, FRAME_BOTH_SHADOWS, FRAME_LIGHTS_SUFFICE, FRAME_NO_CONES, FRAME_NO_LAST_VERTEX, MATERIAL_QUAD_LIGHT,
    MATERIAL_THIN_WALLED, MATERIAL_UNLIT,
};
import package::material::bsdf::{bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_is_lambertian, bsdf_sample};
import package::light::cones::{cone_pdf, cone_sample, cone_solid_angle_fraction, direction_meets_spheres};
import package::cpu::contribution::{accumulate, density_weight, draw};
import package::cpu::contribution::{
    SET_DIFFERENCE_BSDF, SET_DIFFERENCE_CONE, SET_DIFFERENCE_LIGHT, SET_PATH_BSDF, SET_PATH_LIGHT,
};
import package::light::lights::{LightSample, light_pdf_hit, light_sample, light_select};
import package::math::{dot3, exp_, safe_sqrt};
import package::cpu::state::{
    COINCIDENCE, DELTA_DENSITY, FAR, MODE_DIFFERENCE, MODE_REAL, MODE_SHARED, PENDING_DIFFERENCE, PENDING_NEXT, PENDING_SHADOW, PathState,
    REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_MIXED, REQUEST_SHADOW_PAIR, REQUEST_SHADOW_REAL,
};
import package::material::surface::Surface;

const ROULETTE_FROM_DEPTH: u32 = 2u;
const ROULETTE_GAIN: f32 = 4.0;
const CONE_ROULETTE_GAIN: f32 = 8.0;
const CONE_ROULETTE_FLOOR: f32 = 0.1;
const RECURSION_ROULETTE_GAIN: f32 = 1.0;
const RECURSION_ROULETTE_FLOOR: f32 = 0.1;
const SHADOW_SHORTEN: f32 = 2e-5;
const SHADOW_SHORTEN_ERRORS: f32 = 4.0;

const EMITS_ONLY: u32 = MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;

struct Roulette {
    cone: f32,
    bsdf: f32,
}

fn max_element(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// The `paper` estimator knows no such mode.
fn is_difference(st: ptr<function, PathState>) -> bool {
    @if(paper) {
        return false;
    }
    @else {
        return (*st).mode == MODE_DIFFERENCE;
    }
}

fn shade_vertex(st: ptr<function, PathState>, s: Surface) {
    let difference = is_difference(st);
    let wo = -(*st).direction;
    let distance = (*st).vertex_hit.t;
    @if(transmission) {
        if (*st).medium != NONE {
            let sigma = materials[(*st).medium].sigma_a;
            (*st).throughput *= vec3<f32>(exp_(-sigma.x * distance), exp_(-sigma.y * distance), exp_(-sigma.z * distance));
        }
    }
    if !difference {
        add_emission(st, s, distance);
    }
    if (*st).depth > frame.max_bounces || (s.flags & EMITS_ONLY) != 0u || all((*st).throughput == vec3<f32>(0.0)) {
        return;
    }
    let side = select(0u, 1u, (*st).vertex_hit.triangle >= frame.real_triangle_count);
    let leaves_coinciding_real = side == 1u && (*st).side == 0u && coincides(st, s, distance);
    let reach = 1.0 + COINCIDENCE * distance / s.error;
    (*st).coincidence_ratio = select(reach, -reach, leaves_coinciding_real);
    (*st).position = s.position;
    (*st).offset = s.ng * s.error;
    (*st).side = side;
    (*st).real_t_min = materials[s.material].self_shadow_bias;

    var roulette = Roulette(1.0, 1.0);
    @if(!paper) {
        if difference && (frame.flags & FRAME_NO_CONES) != 0u {
            roulette.cone = 0.0;
        } else if difference {
            let strength = max_element(abs((*st).throughput * bsdf_albedo(s, wo)));
            let reach = cone_solid_angle_fraction(s.position, s.ns);
            roulette.cone = clamp(CONE_ROULETTE_GAIN * strength * reach, CONE_ROULETTE_FLOOR, 1.0);
            if bsdf_is_lambertian(s) {
                roulette.bsdf = clamp(RECURSION_ROULETTE_GAIN * strength, RECURSION_ROULETTE_FLOOR, 1.0);
            }
        }
    }
    next_event(st, s, wo, roulette);
    if lights_suffice(st, s) { return; }
    @if(!paper) {
        if difference { plan_cone(st, s, wo, roulette); }
    }
    plan_continuation(st, s, wo, roulette);
}

fn lights_suffice(st: ptr<function, PathState>, s: Surface) -> bool {
    @if(paper) {
        return false;
    }
    @else {
        return (*st).depth >= frame.max_bounces
            && (frame.flags & (FRAME_LIGHTS_SUFFICE | FRAME_NO_LAST_VERTEX)) == FRAME_LIGHTS_SUFFICE
            && bsdf_is_lambertian(s);
    }
}

fn left_to_cones(s: Surface) -> bool {
    return bsdf_is_lambertian(s) && (frame.flags & FRAME_NO_CONES) == 0u;
}

fn coincides(st: ptr<function, PathState>, s: Surface, distance: f32) -> bool {
    let error2 = dot3((*st).offset, (*st).offset);
    let errors = 2.0 * (error2 * (1.0 + (*st).coincidence_ratio) + safe_sqrt(error2) * s.error);
    return abs(dot3((*st).direction, (*st).offset)) * distance <= errors;
}

fn add_emission(st: ptr<function, PathState>, s: Surface, distance: f32) {
    if max_element(s.emission) <= 0.0 { return; }
    var weight = 1.0;
    @if(area_lights) {
        if s.light != NONE && (*st).density != DELTA_DENSITY {
            let from_position = s.position - (*st).direction * distance;
            weight = density_weight((*st).density, light_pdf_hit(s.light, from_position, (*st).direction, distance));
        }
    }
    accumulate(st, (*st).throughput * s.emission * weight);
}

fn next_event(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette) {
    if frame.light_count == 0u || bsdf_is_delta(s) { return; }
    let difference = is_difference(st);
    let set_id = select(SET_PATH_LIGHT, SET_DIFFERENCE_LIGHT, difference);
    let u = draw(st, set_id);
    let l = light_sample(light_select(u.x, u.w), s.position, u.yz);
    let contribution = light_contribution(st, s, wo, roulette, l);
    if any(contribution != vec3<f32>(0.0)) {
        (*st).shadow_contribution = contribution;
        plan_shadow(st, s, l);
    }
}

fn light_contribution(
    st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette, l: LightSample,
) -> vec3<f32> {
    let difference = is_difference(st);
    let real_light = l.side == 0u;
    if l.pdf <= 0.0 || ((*st).mode == MODE_REAL && !real_light) { return vec3<f32>(0.0); }
    @if(!paper) {
        let asks_both = (frame.flags & FRAME_BOTH_SHADOWS) != 0u;
        if difference && real_light && !asks_both && !direction_meets_spheres(s.position, l.direction) { return vec3<f32>(0.0); }
    }
    let f = bsdf_eval(s, wo, l.direction);
    if max_element(f.f_cos) <= 0.0 { return vec3<f32>(0.0); }
    var weight = 1.0;
    if !l.delta && !lights_suffice(st, s) {
        var other = f.pdf;
        @if(!paper) {
            if difference {
                other = 0.0;
                if roulette.cone > 0.0 { other = roulette.cone * cone_pdf(s.position, s.ns, l.direction); }
                if !left_to_cones(s) { other += f.pdf; }
            }
        }
        weight = density_weight(l.pdf, other);
    }
    let sign = select(1.0, -1.0, difference && real_light);
    return (*st).throughput * f.f_cos * l.radiance * (sign * weight / l.pdf);
}

fn plan_shadow(st: ptr<function, PathState>, s: Surface, l: LightSample) {
    (*st).shadow_direction = l.direction;
    (*st).shadow_t_max = FAR;
    if l.distance < FAR {
        (*st).shadow_t_max = l.distance - SHADOW_SHORTEN * l.distance - SHADOW_SHORTEN_ERRORS * s.error;
    }
    let real_light = l.side == 0u;
    var request = REQUEST_SHADOW_MIXED;
    if is_difference(st) && real_light { request = REQUEST_SHADOW_DIFFERENCE; }
    if (*st).mode == MODE_REAL { request = REQUEST_SHADOW_REAL; }
    @if(paper) {
        if (*st).mode == MODE_SHARED && real_light { request = REQUEST_SHADOW_PAIR; }
    }
    (*st).shadow_request = request;
    (*st).pending |= PENDING_SHADOW;
}

fn plan_cone(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette) {
    let u = draw(st, SET_DIFFERENCE_CONE);
    if frame.sphere_count == 0u || u.w >= roulette.cone { return; }
    let c = cone_sample(s.position, s.ns, u.x, u.yz);
    if c.pdf <= 0.0 { return; }
    let f = bsdf_eval(s, wo, c.direction);
    if max_element(f.f_cos) <= 0.0 { return; }
    var density = roulette.cone * c.pdf;
    if !bsdf_is_lambertian(s) { density += f.pdf; }
    (*st).pending |= PENDING_NEXT;
    (*st).next_direction = c.direction;
    (*st).next_throughput = (*st).throughput * f.f_cos * (1.0 / density);
    (*st).next_density = density;
    (*st).next_medium = medium_along(st, s, c.direction);
}

fn medium_along(st: ptr<function, PathState>, s: Surface, direction: vec3<f32>) -> u32 {
    @if(transmission) {
        if (s.flags & MATERIAL_THIN_WALLED) == 0u && dot3(s.ng, direction) < 0.0 {
            return select(NONE, s.material, s.front);
        }
    }
    return (*st).medium;
}

fn plan_continuation(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette) {
    let difference = is_difference(st);
    if difference && left_to_cones(s) && (*st).depth >= frame.max_bounces { return; }
    let u = draw(st, select(SET_PATH_BSDF, SET_DIFFERENCE_BSDF, difference));
    if u.w >= roulette.bsdf { return; }
    let b = bsdf_sample(s, wo, u.xyz);
    if !b.valid { return; }
    let density = select(b.pdf, DELTA_DENSITY, b.delta);
    var throughput = (*st).throughput * b.weight;
    @if(!paper) {
        if difference {
            (*st).pending |= PENDING_DIFFERENCE;
            (*st).difference_position = (*st).position;
            (*st).difference_offset = (*st).offset;
            (*st).difference_coincidence_ratio = (*st).coincidence_ratio;
            (*st).difference_t_min = (*st).real_t_min;
            (*st).difference_depth = (*st).depth;
            (*st).difference_direction = b.wi;
            (*st).difference_left_to_cones = u32(left_to_cones(s));
            (*st).difference_normal = s.ns;
            (*st).difference_cone_probability = roulette.cone;
            (*st).difference_density = select(b.pdf, DELTA_DENSITY, b.delta);
            (*st).difference_throughput = throughput * (1.0 / roulette.bsdf);
            (*st).difference_medium = medium_along(st, s, b.wi);
            return;
        }
    }
    @if(multi_bounce) {
        if (*st).depth >= ROULETTE_FROM_DEPTH {
            let survival = min(ROULETTE_GAIN * max_element(abs(throughput)), 1.0);
            if u.w >= survival { return; }
            throughput *= 1.0 / survival;
        }
    }
    (*st).pending |= PENDING_NEXT;
    (*st).next_direction = b.wi;
    (*st).next_throughput = throughput;
    (*st).next_density = density;
    (*st).next_medium = medium_along(st, s, b.wi);
}
