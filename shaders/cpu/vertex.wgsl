// One vertex of any path: emission, next event, cone direction, continuation. Rust twin: src/cpu/vertex.rs.

import package::gpu::buffers::{frame, lights, materials};
import package::packed::records::{
    FRAME_BOTH_SHADOWS, FRAME_LIGHTS_SUFFICE, FRAME_NO_CONES, FRAME_NO_LAST_VERTEX, FRAME_PANES, LIGHT_ENVIRONMENT, MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED,
    MATERIAL_UNLIT, SIDE_REAL, SIDE_VIRTUAL,
};
import package::shared::NONE;
import package::material::scatter::BsdfSample;
import package::material::bsdf::{bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_is_diffuse, bsdf_is_lambertian, bsdf_is_polished, bsdf_passes_straight, bsdf_sample, bsdf_straight};
import package::camera::sampler::{SampleSet, fourth, pair, second_pair, third};
import package::light::backdrop::backdrop_radiance;
import package::light::cones::{cone_pdf, cone_sample, cone_solid_angle_fraction, cones_at, direction_meets_spheres};
import package::cpu::contribution::{
    accumulate, density_weight, draw, draw_one_of, events_after, from_lens_after, is_smooth, left_to_photons, sees_backdrop, vertex_left_to_photons,
};
import package::light::environment::share_left_to_eye;
import package::light::guide::{GUIDE_SHARE, guide_cell, guide_count, guide_pdf, guide_sample};
import package::cpu::panes::{distance_from_vertex, draw_at_pane, is_shared, may_leave_no_vertex, pass_straight, transmittance};
import package::cpu::points::{keep_first_vertex, offer_point};
import package::cpu::contribution::{
    SET_DIFFERENCE_BSDF, SET_DIFFERENCE_CONE, SET_DIFFERENCE_LIGHT, SET_PATH_BSDF, SET_PATH_LIGHT,
};
import package::light::lights::{LightSample, light_pdf_hit, light_sample, light_select};
import package::math::{dot3, safe_sqrt};
import package::cpu::state::{
    COINCIDENCE, DELTA_DENSITY, DifferenceRay, EVENT_AT_POLISHED, EVENT_FROM_LENS, EVENT_FROM_SHARED, EVENT_GUIDED, EVENT_LIGHT_LEFT_TO_PATH,
    EVENT_PASSED, EVENT_SCATTERED, FAR, MODE_DIFFERENCE, MODE_MIXED, MODE_REAL, MODE_SHARED, PENDING_DIFFERENCE, PENDING_LIGHT, PENDING_NEXT,
    PENDING_SHADOW, PathState, REQUEST_CLOSEST_EACH, REQUEST_REAL_UNLESS_COVERED, REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_MIXED,
    REQUEST_SHADOW_PAIR, REQUEST_SHADOW_REAL, RayOrigin, Segment, path_differences, path_nexts, path_reals,
};
import package::material::surface::Surface;

// The cones are seen anew for each question: there is arithmetic to spare, but no memory.
struct Techniques {
    cone_probability: f32,
    bsdf_probability: f32,
    lights: u32,
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
        return (*st).path.mode == MODE_DIFFERENCE;
    }
}

fn shade_vertex(st: ptr<function, PathState>, s: Surface) {
    let difference = is_difference(st);
    let wo = -(*st).ray.direction;
    let distance = (*st).vertex_hit.t;
    if (*st).path.pending < PENDING_LIGHT {
        @if(transmission) {
            (*st).path.throughput *= transmittance((*st).path.medium, distance);
        }
        if !difference {
            add_emission(st, s);
        }
    }
    let past_last = (*st).ray.depth > frame.max_bounces;
    if (past_last && (frame.flags & FRAME_PANES) == 0u) || (s.flags & EMITS_ONLY) != 0u || all((*st).path.throughput == vec3<f32>(0.0)) {
        return;
    }
    stand_at(st, s, distance);
    @if(panes) {
        if past_last {
            if may_leave_no_vertex(st, s, wo) {
                let direction = (*st).ray.direction;
                let throughput = (*st).path.throughput * bsdf_straight(s, wo);
                pass_straight(st, direction, throughput, medium_along(st, s, direction));
            }
            return;
        }
    }
    @if(sharing) { offer_point(st, s); }

    @if(photons) {
        if difference && is_smooth(s, (*st).ray.side, (*st).ray.depth == 1u) { (*st).path.events |= EVENT_AT_POLISHED; }
    }
    // Those of a path are played for certain.
    var techniques = Techniques(0.0, 1.0, path_lights(st, s));
    @if(!paper) {
        if difference {
            techniques = techniques_at(st, s, wo);
        }
    }
    @if(sharing) { keep_first_vertex(st, s, techniques.cone_probability, techniques.bsdf_probability); }
    draw_lights(st, s, wo, techniques);
    if (*st).path.pending >= PENDING_LIGHT || lights_suffice(st, s) { return; }
    @if(!paper) {
        if difference { plan_cone(st, s, wo, techniques); }
    }
    plan_continuation(st, s, wo, techniques);
}

fn stand_at(st: ptr<function, PathState>, s: Surface, distance: f32) {
    let side = select(0u, 1u, (*st).vertex_hit.triangle >= frame.real_triangle_count);
    let leaves_coinciding_real = side == SIDE_VIRTUAL && (*st).ray.side == SIDE_REAL && coincides(st, s, distance);
    let reach = 1.0 + COINCIDENCE * distance / s.error;
    (*st).ray.origin = RayOrigin(
        s.position,
        materials[s.material].self_shadow_bias,
        s.ng * s.error,
        select(reach, -reach, leaves_coinciding_real),
    );
    (*st).ray.side = side;
}

fn lights_suffice(st: ptr<function, PathState>, s: Surface) -> bool {
    @if(paper) {
        return false;
    }
    @else {
        return (*st).ray.depth >= frame.max_bounces
            && (frame.flags & (FRAME_LIGHTS_SUFFICE | FRAME_NO_LAST_VERTEX)) == FRAME_LIGHTS_SUFFICE
            && bsdf_is_lambertian(s);
    }
}

fn left_to_cones(s: Surface) -> bool {
    return bsdf_is_lambertian(s) && (frame.flags & FRAME_NO_CONES) == 0u;
}

fn techniques_at(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>) -> Techniques {
    if (frame.flags & FRAME_NO_CONES) != 0u { return Techniques(0.0, 1.0, 1u); }
    let strength = max_element(abs((*st).path.throughput * bsdf_albedo(s, wo)));
    let reach = cone_solid_angle_fraction(cones_at(s.position, s.ns));
    var cone_probability = 0.0;
    if frame.sphere_count > 0u { cone_probability = clamp(CONE_ROULETTE_GAIN * strength * reach, CONE_ROULETTE_FLOOR, 1.0); }
    var bsdf_probability = 1.0;
    if bsdf_is_lambertian(s) {
        bsdf_probability = clamp(RECURSION_ROULETTE_GAIN * strength, RECURSION_ROULETTE_FLOOR, 1.0);
    }
    let in_contact = (*st).ray.depth == 1u && reach >= CONTACT_REACH;
    return Techniques(cone_probability, bsdf_probability, select(1u, CONTACT_LIGHTS, in_contact));
}

fn coincides(st: ptr<function, PathState>, s: Surface, distance: f32) -> bool {
    let offset = (*st).ray.origin.offset;
    let error2 = dot3(offset, offset);
    let ratio = (*st).ray.origin.coincidence_ratio;
    let errors = 2.0 * (error2 * (1.0 + ratio) + safe_sqrt(error2) * s.error);
    return abs(dot3((*st).ray.direction, offset)) * distance <= errors;
}

fn add_emission(st: ptr<function, PathState>, s: Surface) {
    if max_element(s.emission) <= 0.0 { return; }
    var weight = 1.0;
    @if(area_lights) {
        @if(photons) {
            if s.light != NONE && lights[s.light].photon_pdf > 0.0 && left_to_photons(st) { return; }
        }
        if s.light != NONE && (*st).path.density != DELTA_DENSITY {
            let direction = (*st).ray.direction;
            let distance = distance_from_vertex(st);
            let from_position = s.position - direction * distance;
            let pdf = light_pdf_hit(s.light, from_position, direction, distance);
            weight = density_weight((*st).path.density, pdf);
        }
    }
    accumulate(st, (*st).path.throughput * s.emission * weight);
}

fn path_lights(st: ptr<function, PathState>, s: Surface) -> u32 {
    @if(paper) {
        return 1u;
    }
    @else {
        let seen_first = (*st).path.mode == MODE_MIXED && (*st).ray.depth == 1u;
        return select(1u, GLOSSY_LIGHTS, seen_first && !bsdf_is_diffuse(s) && !bsdf_is_polished(s));
    }
}

fn draw_lights(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, techniques: Techniques) {
    let count = techniques.lights;
    var left = (*st).path.pending / PENDING_LIGHT;
    (*st).path.pending %= PENDING_LIGHT;
    if left == 0u { left = count; }
    while left > 0u && ((*st).path.pending & PENDING_SHADOW) == 0u {
        next_event(st, s, wo, techniques, count - left, count);
        left -= 1u;
    }
    if left > 0u {
        (*st).path.pending |= left * PENDING_LIGHT;
        path_reals[(*st).lane].segment.direction = -wo;
        path_reals[(*st).lane].hit = (*st).vertex_hit;
    }
}

fn next_event(
    st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, techniques: Techniques, number: u32, count: u32,
) {
    if frame.light_count == 0u || bsdf_is_delta(s) { return; }
    let difference = is_difference(st);
    let set_id = select(SET_PATH_LIGHT, SET_DIFFERENCE_LIGHT, difference);
    let u = draw_one_of(st, set_id, number, count);
    var index = 0u;
    if frame.light_count > 1u {
        let choice_coin = second_pair(u);
        index = light_select(choice_coin.x, choice_coin.y);
    }
    var l = light_sample(index, s.position, pair(u));
    @if(backdrop) {
        if lights[index].kind == LIGHT_ENVIRONMENT && sees_backdrop(st) && from_lens_after(st, s, false, is_smooth(s, (*st).ray.side, (*st).ray.depth == 1u)) != 0u {
            l.radiance = backdrop_radiance(s.position, l.direction);
        }
    }
    var contribution = light_contribution(st, s, wo, techniques, l) * (1.0 / f32(count));
    @if(photons) {
        if vertex_left_to_photons(st, s) { contribution *= light_left_to_eye(index, l.direction); }
    }
    if any(contribution != vec3<f32>(0.0)) {
        plan_shadow(st, s, l, contribution);
    }
}

fn light_left_to_eye(index: u32, direction: vec3<f32>) -> f32 {
    if lights[index].kind == LIGHT_ENVIRONMENT { return share_left_to_eye(direction); }
    return select(1.0, 0.0, lights[index].photon_pdf > 0.0);
}

fn light_contribution(
    st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, techniques: Techniques, l: LightSample,
) -> vec3<f32> {
    let difference = is_difference(st);
    let real_light = l.side == SIDE_REAL;
    if l.pdf <= 0.0 || ((*st).path.mode == MODE_REAL && !real_light) { return vec3<f32>(0.0); }
    @if(!paper) {
        let asks_both = (frame.flags & FRAME_BOTH_SHADOWS) != 0u;
        if difference && real_light && !asks_both && !direction_meets_spheres(s.position, l.direction) { return vec3<f32>(0.0); }
    }
    let f = bsdf_eval(s, wo, l.direction);
    if max_element(f.f_cos) <= 0.0 { return vec3<f32>(0.0); }
    var weight = 1.0;
    if !l.delta && !lights_suffice(st, s) {
        var other = f.pdf;
        @if(guide) { other = path_pdf(st, s, l.direction, f.pdf); }
        @if(!paper) {
            if difference {
                other = 0.0;
                if techniques.cone_probability > 0.0 { other = techniques.cone_probability * cone_pdf(cones_at(s.position, s.ns), l.direction); }
                if !left_to_cones(s) { other += f.pdf; }
            }
        }
        weight = density_weight(l.pdf, other);
    }
    let sign = select(1.0, -1.0, difference && real_light);
    return (*st).path.throughput * f.f_cos * l.radiance * (sign * weight / l.pdf);
}

fn plan_shadow(st: ptr<function, PathState>, s: Surface, l: LightSample, contribution: vec3<f32>) {
    (*st).path.shadow_contribution = contribution;
    (*st).ray.direction = l.direction;
    (*st).ray.t_max = FAR;
    if l.distance < FAR {
        (*st).ray.t_max = l.distance - SHADOW_SHORTEN * l.distance - SHADOW_SHORTEN_ERRORS * s.error;
    }
    let real_light = l.side == SIDE_REAL;
    var request = REQUEST_SHADOW_MIXED;
    if is_difference(st) && real_light { request = REQUEST_SHADOW_DIFFERENCE; }
    if (*st).path.mode == MODE_REAL { request = REQUEST_SHADOW_REAL; }
    @if(paper) {
        if (*st).path.mode == MODE_SHARED && real_light { request = REQUEST_SHADOW_PAIR; }
    }
    (*st).ray.request = request;
    @if(panes) {
        (*st).path.events &= ~EVENT_LIGHT_LEFT_TO_PATH;
        if is_shared(st) && !l.delta { (*st).path.events |= EVENT_LIGHT_LEFT_TO_PATH; }
    }
    (*st).path.pending |= PENDING_SHADOW;
}

fn plays(u: SampleSet, probability: f32) -> bool {
    return probability >= 1.0 || fourth(u) < probability;
}

fn plan_cone(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, techniques: Techniques) {
    let u = draw(st, SET_DIFFERENCE_CONE);
    if !plays(u, techniques.cone_probability) { return; }
    let c = cone_sample(cones_at(s.position, s.ns), third(u), pair(u));
    if c.pdf <= 0.0 { return; }
    let f = bsdf_eval(s, wo, c.direction);
    if max_element(f.f_cos) <= 0.0 { return; }
    var density = techniques.cone_probability * c.pdf;
    if !bsdf_is_lambertian(s) { density += f.pdf; }
    (*st).path.pending |= PENDING_NEXT;
    path_nexts[(*st).lane] = Segment(
        c.direction,
        density,
        (*st).path.throughput * f.f_cos * (1.0 / density),
        medium_along(st, s, c.direction),
    );
}

fn medium_along(st: ptr<function, PathState>, s: Surface, direction: vec3<f32>) -> u32 {
    @if(transmission) {
        if (s.flags & MATERIAL_THIN_WALLED) == 0u && dot3(s.ng, direction) < 0.0 {
            return select(NONE, s.material, s.front);
        }
    }
    return (*st).path.medium;
}

fn guided_share(st: ptr<function, PathState>, s: Surface) -> f32 {
    if frame.guide_cell_count == 0u
        || (*st).path.mode != MODE_MIXED
        || (*st).ray.depth == 1u
        || ((*st).path.events & EVENT_SCATTERED) != 0u
        || bsdf_is_polished(s)
        || guide_count(guide_cell(s.position)) == 0u {
        return 0.0;
    }
    return GUIDE_SHARE;
}

fn path_pdf(st: ptr<function, PathState>, s: Surface, direction: vec3<f32>, bsdf_pdf: f32) -> f32 {
    let share = guided_share(st, s);
    if share == 0.0 { return bsdf_pdf; }
    return (1.0 - share) * bsdf_pdf + share * guide_pdf(guide_cell(s.position), s.position, direction);
}

fn path_sample(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, u: vec3<f32>, share: f32) -> BsdfSample {
    var b = bsdf_sample(s, wo, u);
    if share == 0.0 { return b; }
    let by_guide = draw(st, SET_DIFFERENCE_CONE);
    if third(by_guide) < share {
        b.wi = guide_sample(guide_cell(s.position), s.position, fourth(by_guide), pair(by_guide));
        b.delta = false;
    } else if !b.valid {
        return b;
    }
    if b.delta {
        b.weight *= 1.0 / (1.0 - share);
        return b;
    }
    let f = bsdf_eval(s, wo, b.wi);
    b.pdf = path_pdf(st, s, b.wi, f.pdf);
    b.valid = b.pdf > 0.0 && max_element(f.f_cos) > 0.0;
    b.weight = f.f_cos * (1.0 / max(b.pdf, MIN_POSITIVE));
    return b;
}

fn plan_continuation(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>, techniques: Techniques) {
    let difference = is_difference(st);
    let leaves_to_cones = left_to_cones(s);
    if difference && leaves_to_cones && (*st).ray.depth >= frame.max_bounces { return; }
    var u = draw(st, select(SET_PATH_BSDF, SET_DIFFERENCE_BSDF, difference));
    @if(panes) let at_pane = may_leave_no_vertex(st, s, wo);
    @if(panes) {
        if at_pane { u = draw_at_pane(st); }
    }
    if !plays(u, techniques.bsdf_probability) { return; }
    var lobe = 0.0;
    if !bsdf_is_lambertian(s) { lobe = third(u); }
    let v = vec3<f32>(lobe, pair(u));
    @if(guide) let share = guided_share(st, s);
    @if(guide) let b = path_sample(st, s, wo, v, share);
    @if(!guide) let b = bsdf_sample(s, wo, v);
    if !b.valid { return; }
    let throughput = (*st).path.throughput * b.weight;
    let medium = medium_along(st, s, b.wi);
    let straight = b.delta && b.transmitted && bsdf_passes_straight(s);
    @if(panes) {
        if at_pane && straight {
            pass_straight(st, b.wi, throughput, medium);
            return;
        }
    }
    var events = (*st).path.events;
    @if(backdrop) let from_lens = from_lens_after(st, s, b.delta, b.delta || is_smooth(s, (*st).ray.side, (*st).ray.depth == 1u));
    @if(photons || backdrop) {
        let smooth_ = b.delta || is_smooth(s, (*st).ray.side, (*st).ray.depth == 1u);
        if !straight {
            events = events_after(events, (*st).ray.depth, (*st).ray.side, smooth_);
        }
    }
    @if(guide) {
        if share > 0.0 { events |= EVENT_GUIDED; }
    }
    @if(panes) { events &= ~(EVENT_PASSED | EVENT_FROM_SHARED); }
    @if(backdrop) { events = (events & ~EVENT_FROM_LENS) | from_lens; }
    var segment = Segment(b.wi, select(b.pdf, DELTA_DENSITY, b.delta), throughput, medium);
    @if(!paper) {
        if difference {
            segment.throughput *= 1.0 / techniques.bsdf_probability;
            (*st).path.pending |= PENDING_DIFFERENCE;
            path_differences[(*st).lane] = DifferenceRay(
                (*st).ray.origin,
                segment,
                s.ns,
                techniques.cone_probability,
                (*st).ray.depth,
                select(REQUEST_CLOSEST_EACH, REQUEST_REAL_UNLESS_COVERED, leaves_to_cones),
                events,
                0u,
            );
            return;
        }
    }
    @if(multi_bounce) {
        if (*st).ray.depth >= ROULETTE_FROM_DEPTH && (events & EVENT_GUIDED) == 0u {
            let survival = min(ROULETTE_GAIN * max_element(abs(segment.throughput)), 1.0);
            if !plays(u, survival) { return; }
            segment.throughput *= 1.0 / survival;
        }
    }
    (*st).path.pending |= PENDING_NEXT;
    @if(panes) { events |= (*st).path.events & EVENT_LIGHT_LEFT_TO_PATH; }
    (*st).path.events = events;
    path_nexts[(*st).lane] = segment;
}
