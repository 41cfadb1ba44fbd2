// Answers a sample's ray request. Rust twin: src/cpu/request.rs.

import package::gpu::buffers::{frame, materials, triangles};
import package::cpu::panes::{blocks, pass_, passage, shadow_answer};
import package::packed::records::{FRAME_BOTH_SHADOWS, FRAME_PANES, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, SIDE_REAL, SIDE_VIRTUAL};
import package::shared::NONE;
import package::math::{dot3, hash_combine, length3, uniform_from_bits};
import package::cpu::state::{
    COINCIDENCE, FAR, Hits, MISS, PathRay, PathState,
    REQUEST_CLOSEST_VIRTUAL, REQUEST_CLOSEST_REAL, REQUEST_CLOSEST_MIXED, REQUEST_CLOSEST_EACH, REQUEST_VIRTUAL_THEN_REAL,
    REQUEST_REAL_UNLESS_COVERED, REQUEST_SHADOW_MIXED, REQUEST_SHADOW_REAL, REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_PAIR,
};
import package::accel::trace::{Hit, Ray, trace};
@if(alpha) import package::material::surface::surface_alpha;

fn query(world: u32, any_hit: bool, t_max: f32, is_last: bool) -> Query {
    return Query(world, any_hit, t_max, world == SIDE_REAL, is_last);
}

// The request as a sequence of at most three queries, so that a kernel has one trace call site; `hits`: what the earlier ones met.
fn next_query(request: u32, step: u32, t_max: f32, hits: Hits) -> Query {
    let met_real = hits.in_real.triangle != NONE;
    let met_virtual = hits.in_virtual.triangle != NONE;
    switch request {
        case REQUEST_CLOSEST_VIRTUAL: {
            if step == 0u { return query(SIDE_VIRTUAL, false, t_max, true); }
        }
        case REQUEST_CLOSEST_REAL: {
            if step == 0u { return query(SIDE_REAL, false, t_max, true); }
        }
        case REQUEST_CLOSEST_MIXED: {
            if step == 0u { return query(SIDE_VIRTUAL, false, t_max, false); }
            if step == 1u { return query(SIDE_REAL, false, hits.in_virtual.t, true); }
        }
        case REQUEST_CLOSEST_EACH: {
            if step == 0u { return query(SIDE_VIRTUAL, false, t_max, false); }
            if step == 1u { return query(SIDE_REAL, false, t_max, true); }
        }
        case REQUEST_VIRTUAL_THEN_REAL: {
            if step == 0u { return query(SIDE_VIRTUAL, false, t_max, false); }
            if step == 1u && met_virtual { return query(SIDE_REAL, false, t_max, true); }
        }
        case REQUEST_REAL_UNLESS_COVERED: {
            if step == 0u { return query(SIDE_REAL, false, t_max, false); }
            let covering = hits.in_real.t * (1.0 + COINCIDENCE);
            if step == 1u && met_real { return query(SIDE_VIRTUAL, true, covering, true); }
        }
        case REQUEST_SHADOW_MIXED: {
            if step == 0u { return query(SIDE_VIRTUAL, true, t_max, false); }
            if step == 1u && !blocks(hits.in_virtual) { return query(SIDE_REAL, true, t_max, true); }
        }
        case REQUEST_SHADOW_REAL: {
            if step == 0u { return query(SIDE_REAL, true, t_max, true); }
        }
        case REQUEST_SHADOW_DIFFERENCE: {
            if step == 0u { return query(SIDE_VIRTUAL, true, t_max, false); }
            if step == 1u && (met_virtual || asks_both()) { return query(SIDE_REAL, true, t_max, true); }
        }
        case REQUEST_SHADOW_PAIR: {
            if step == 0u { return query(SIDE_REAL, true, t_max, false); }
            if step == 1u { return query(SIDE_VIRTUAL, true, t_max, false); }
            if step == 2u && !blocks(hits.in_virtual) { return Query(SIDE_REAL, true, t_max, false, true); }
        }
        default: {}
    }
    return query(QUERY_NONE, false, 0.0, true);
}

fn asks_both() -> bool {
    return (frame.flags & FRAME_BOTH_SHADOWS) != 0u;
}

fn count_rays(st: ptr<function, PathState>) {
    let met_real = (*st).hits.in_real.triangle != NONE;
    let met_virtual = (*st).hits.in_virtual.triangle != NONE;
    switch (*st).ray.request {
        case REQUEST_CLOSEST_VIRTUAL, REQUEST_CLOSEST_MIXED, REQUEST_CLOSEST_EACH: { (*st).rays.mixed += 1u; }
        case REQUEST_CLOSEST_REAL: { (*st).rays.real += 1u; }
        case REQUEST_VIRTUAL_THEN_REAL: {
            (*st).rays.mixed += 1u;
            (*st).rays.real += u32(met_virtual);
        }
        case REQUEST_REAL_UNLESS_COVERED: {
            (*st).rays.real += 1u;
            (*st).rays.mixed += u32(met_real);
        }
        case REQUEST_SHADOW_MIXED: { (*st).rays.mixed_shadow += 1u; }
        case REQUEST_SHADOW_REAL: { (*st).rays.real_shadow += 1u; }
        case REQUEST_SHADOW_DIFFERENCE: {
            (*st).rays.mixed_shadow += 1u;
            (*st).rays.real_shadow += u32(met_virtual || asks_both());
        }
        case REQUEST_SHADOW_PAIR: {
            (*st).rays.real_shadow += 1u;
            (*st).rays.mixed_shadow += 1u;
        }
        default: {}
    }
}

// Traces what the state asks for and leaves the answer in its hits. `thread`: local invocation index.
fn answer(st: ptr<function, PathState>, thread: u32) {
    let request = (*st).ray.request;
    var hits = Hits(MISS, MISS);
    var step = 0u;
    var layer = 0u;
    var t_min = -1.0;
    var skip = NONE;
    @if(panes) let panes = (frame.flags & FRAME_PANES) != 0u && is_shadow(request);
    @if(panes) var passed = passage();
    // Transparent layers and panes repeat a query from where it stopped.
    loop {
        let q = next_query(request, step, (*st).ray.t_max, hits);
        if q.world == QUERY_NONE { break; }
        var ray = ray_into((*st).ray, q.world, q.t_max);
        var any_hit = q.any_hit;
        @if(alpha) { any_hit = false; }
        @if(panes) { any_hit = any_hit && !panes; }
        @if(alpha || panes) {
            if layer > 0u {
                ray.t_min = t_min;
                ray.skip = skip;
            }
        }
        var hit = trace(ray, q.world, any_hit, thread);
        @if(alpha || panes) {
            if hit.triangle != NONE && layer + 1u < MAX_LAYERS {
                var goes_on = false;
                @if(alpha) { goes_on = !meets((*st).ray, hit); }
                @if(panes) {
                    if panes && !goes_on {
                        let further = pass_(passed, hit, ray.direction);
                        goes_on = any(further.share != vec3<f32>(0.0));
                        if goes_on { passed = further; }
                    }
                }
                if goes_on {
                    t_min = hit.t;
                    skip = hit.triangle;
                    layer += 1u;
                    continue;
                }
            }
            layer = 0u;
        }
        if q.any_hit && hit.triangle != NONE {
            // Only that something was met means anything.
            hit.t = 0.0;
        }
        @if(panes) {
            if panes {
                hit = shadow_answer(passed, hit, ray.t_max);
                passed = passage();
            }
        }
        if q.to_real { hits.in_real = hit; } else if q.world == SIDE_VIRTUAL || blocks(hit) { hits.in_virtual = hit; }
        if q.is_last { break; }
        step += 1u;
    }
    if request == REQUEST_CLOSEST_REAL {
        // It answers beside the virtual hit found before.
        hits.in_virtual = (*st).hits.in_virtual;
    }
    (*st).hits = hits;
    count_rays(st);
}

// Where a ray starts in its own world and in the other one: see src/cpu/request.rs.
fn ray_into(ray: PathRay, world: u32, t_max: f32) -> Ray {
    let offset = ray.origin.offset;
    var shift = -offset * ray.origin.coincidence_ratio;
    if world == ray.side {
        shift = select(offset, -offset, dot3(ray.direction, offset) < 0.0);
    } else if world == SIDE_REAL {
        shift = offset * ray.origin.coincidence_ratio;
    }
    var direction = ray.direction;
    var distance = t_max;
    if is_shadow(ray.request) && t_max < FAR {
        let to_end = direction * t_max - shift;
        distance = length3(to_end);
        direction = to_end / max(distance, MIN_POSITIVE);
    }
    let t_min = select(0.0, ray.origin.real_t_min, world == SIDE_REAL);
    return Ray(ray.origin.position + shift, t_min, direction, distance, NONE);
}

fn is_shadow(request: u32) -> bool {
    return request == REQUEST_SHADOW_MIXED || request == REQUEST_SHADOW_REAL || request == REQUEST_SHADOW_DIFFERENCE
        || request == REQUEST_SHADOW_PAIR;
}

@if(alpha)
fn meets(ray: PathRay, hit: Hit) -> bool {
    let flags = materials[triangles[hit.triangle].material].flags;
    if (flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND)) == 0u { return true; }
    let alpha = surface_alpha(hit);
    let bits = hash_combine(hash_combine(ray.opacity_seed, hit.triangle), ray.depth);
    return uniform_from_bits(bits) < alpha;
}
