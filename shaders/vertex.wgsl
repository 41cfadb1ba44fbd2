// One vertex of any path: emission, next event, cone direction, continuation. Rust twin: src/cpu/vertex.rs.

import package::bindings::{NONE, frame, materials, MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT};
import package::bsdf::{bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_is_lambertian, bsdf_sample};
import package::cones::{cone_pdf, cone_sample, cone_solid_angle_fraction, direction_meets_spheres};
import package::contribution::{accumulate, density_weight, draw, draw_of};
import package::contribution::{
    SET_DIFFERENCE_BSDF, SET_DIFFERENCE_CHOICE, SET_DIFFERENCE_CONE, SET_DIFFERENCE_LIGHT, SET_PATH_BSDF, SET_PATH_LIGHT,
};
import package::lights::{LightSample, light_pdf_hit, light_sample};
import package::math::exp_;
import package::state::{
    DELTA_DENSITY, FAR, MODE_DIFFERENCE, MODE_REAL, MODE_SHARED, PENDING_DIFFERENCE, PENDING_NEXT, PENDING_SHADOW, PathState,
    REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_MIXED, REQUEST_SHADOW_PAIR, REQUEST_SHADOW_REAL,
};
import package::surface::Surface;

const ROULETTE_FROM_DEPTH: u32 = 2u;
const ROULETTE_GAIN: f32 = 4.0;
const CONE_ROULETTE_GAIN: f32 = 8.0;
const CONE_ROULETTE_FLOOR: f32 = 0.1;
const RECURSION_ROULETTE_GAIN: f32 = 1.0;
const RECURSION_ROULETTE_FLOOR: f32 = 0.1;
const SHADOW_SHORTEN: f32 = 2e-5;
const SHADOW_SHORTEN_ERRORS: f32 = 4.0;

const DIFFERENCE_LIGHTS: u32 = 4u;
const EMITS_ONLY: u32 = MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;

struct Roulette {
    cone: f32,
    bsdf: f32,
}

fn max_element(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

fn shade_vertex(st: ptr<function, PathState>, s: Surface) {
    let difference = (*st).mode == MODE_DIFFERENCE;
    let wo = -(*st).direction;
    let distance = (*st).vertex_hit.t;
    if !difference {
        @if(transmission) {
            if (*st).medium != NONE {
                let sigma = materials[(*st).medium].sigma_a;
                (*st).throughput *= vec3<f32>(exp_(-sigma.x * distance), exp_(-sigma.y * distance), exp_(-sigma.z * distance));
            }
        }
        add_emission(st, s, distance);
    }
    if (*st).depth > frame.max_bounces || (s.flags & EMITS_ONLY) != 0u || all((*st).throughput == vec3<f32>(0.0)) {
        return;
    }
    (*st).position = s.position;
    (*st).offset = s.ng * s.error;
    (*st).side = select(0u, 1u, (*st).vertex_hit.triangle >= frame.real_triangle_count);
    (*st).real_t_min = materials[s.material].self_shadow_bias;

    var roulette = Roulette(1.0, 1.0);
    if difference {
        let strength = max_element(abs((*st).throughput * bsdf_albedo(s, wo)));
        let reach = cone_solid_angle_fraction(s.position, s.ns);
        roulette.cone = clamp(CONE_ROULETTE_GAIN * strength * reach, CONE_ROULETTE_FLOOR, 1.0);
        if bsdf_is_lambertian(s) {
            roulette.bsdf = clamp(RECURSION_ROULETTE_GAIN * strength, RECURSION_ROULETTE_FLOOR, 1.0);
        }
    }
    next_event(st, s, wo, roulette);
    if difference {
        plan_cone(st, s, wo, roulette);
    }
    plan_continuation(st, s, wo, roulette);
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

fn light_draws(st: ptr<function, PathState>) -> u32 {
    return select(1u, DIFFERENCE_LIGHTS, (*st).mode == MODE_DIFFERENCE && (*st).depth == 1u);
}

fn next_event(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette) {
    if frame.light_count == 0u || bsdf_is_delta(s) { return; }
    let difference = (*st).mode == MODE_DIFFERENCE;
    let set_id = select(SET_PATH_LIGHT, SET_DIFFERENCE_LIGHT, difference);
    let count = light_draws(st);
    var choice = vec4<f32>(0.0);
    if count > 1u { choice = draw(st, SET_DIFFERENCE_CHOICE); }
    var sum = 0.0;
    var chosen_size = 1.0;
    var contribution = vec3<f32>(0.0);
    for (var j = 0u; j < count; j++) {
        let l = light_sample(s.position, draw_of(st, set_id, j, count));
        let candidate = light_contribution(st, s, wo, roulette, l, f32(count));
        let size = max_element(abs(candidate));
        sum += size;
        if size > 0.0 && choice[j] * sum < size {
            contribution = candidate;
            chosen_size = size;
            plan_shadow(st, s, l);
        }
    }
    (*st).shadow_contribution = contribution * (sum / (chosen_size * f32(count)));
}

fn light_contribution(
    st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette, l: LightSample, count: f32,
) -> vec3<f32> {
    let difference = (*st).mode == MODE_DIFFERENCE;
    let real_light = l.side == 0u;
    if l.pdf <= 0.0 || ((*st).mode == MODE_REAL && !real_light) { return vec3<f32>(0.0); }
    if difference && real_light && !direction_meets_spheres(s.position, l.direction) { return vec3<f32>(0.0); }
    let f = bsdf_eval(s, wo, l.direction);
    if max_element(f.f_cos) <= 0.0 { return vec3<f32>(0.0); }
    var weight = 1.0;
    if !l.delta {
        var other = f.pdf;
        if difference {
            other = roulette.cone * cone_pdf(s.position, s.ns, l.direction);
            if !bsdf_is_lambertian(s) { other += f.pdf; }
        }
        weight = density_weight(count * l.pdf, other);
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
    if (*st).mode == MODE_DIFFERENCE && real_light { request = REQUEST_SHADOW_DIFFERENCE; }
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
    let c = cone_sample(s.position, s.ns, u.xyz);
    if c.pdf <= 0.0 { return; }
    let f = bsdf_eval(s, wo, c.direction);
    if max_element(f.f_cos) <= 0.0 { return; }
    var density = roulette.cone * c.pdf;
    if !bsdf_is_lambertian(s) { density += f.pdf; }
    (*st).pending |= PENDING_NEXT;
    (*st).next_direction = c.direction;
    (*st).next_throughput = (*st).throughput * f.f_cos * (1.0 / density);
    (*st).next_density = density / f32(light_draws(st));
}

fn plan_continuation(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, roulette: Roulette) {
    let difference = (*st).mode == MODE_DIFFERENCE;
    if difference && bsdf_is_lambertian(s) && (*st).depth >= frame.max_bounces { return; }
    let u = draw(st, select(SET_PATH_BSDF, SET_DIFFERENCE_BSDF, difference));
    if u.w >= roulette.bsdf { return; }
    let b = bsdf_sample(s, wo, u.xyz);
    if !b.valid { return; }
    let density = select(b.pdf, DELTA_DENSITY, b.delta);
    var throughput = (*st).throughput * b.weight;
    if difference {
        (*st).pending |= PENDING_DIFFERENCE;
        (*st).difference_position = (*st).position;
        (*st).difference_offset = (*st).offset;
        (*st).difference_t_min = (*st).real_t_min;
        (*st).difference_depth = (*st).depth;
        (*st).difference_direction = b.wi;
        (*st).difference_lambertian = u32(bsdf_is_lambertian(s));
        (*st).difference_normal = s.ns;
        (*st).difference_cone_probability = roulette.cone / f32(light_draws(st));
        (*st).difference_density = select(b.pdf / f32(light_draws(st)), DELTA_DENSITY, b.delta);
        (*st).difference_throughput = throughput * (1.0 / roulette.bsdf);
        return;
    }
    if (*st).depth >= ROULETTE_FROM_DEPTH {
        let survival = min(ROULETTE_GAIN * max_element(abs(throughput)), 1.0);
        if u.w >= survival { return; }
        throughput *= 1.0 / survival;
    }
    @if(transmission) {
        if b.transmitted && (s.flags & MATERIAL_THIN_WALLED) == 0u {
            (*st).medium = select(NONE, s.material, s.front);
        }
    }
    (*st).pending |= PENDING_NEXT;
    (*st).next_direction = b.wi;
    (*st).next_throughput = throughput;
    (*st).next_density = density;
}
