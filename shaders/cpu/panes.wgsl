// Light that goes straight through a surface. Rust twin: src/cpu/panes.rs, where the rules are described.

import package::gpu::buffers::{frame, materials, triangles};
import package::packed::records::{FRAME_PANES, MATERIAL_PANE, MATERIAL_THIN_WALLED, SIDE_REAL};
import package::shared::NONE;
import package::accel::trace::Hit;
import package::camera::sampler::{SampleSet, sample_set};
import package::cpu::contribution::sample_key;
import package::cpu::state::{
    DELTA_DENSITY, EVENT_FROM_SHARED, EVENT_LIGHT_LEFT_TO_PATH, EVENT_PASSED, FAR, MODE_DIFFERENCE, MODE_SHARED, PANES, PENDING_NEXT, PathState,
    Segment, path_nexts, path_passed_m,
};
import package::material::bsdf::bsdf_straight;
import package::material::surface::{Surface, surface_at};
import package::math::{exp_, hash_combine};

fn transmittance(medium: u32, distance: f32) -> vec3<f32> {
    if medium == NONE { return vec3<f32>(1.0); }
    let sigma = materials[medium].sigma_a;
    return vec3<f32>(exp_(-sigma.x * distance), exp_(-sigma.y * distance), exp_(-sigma.z * distance));
}

fn passage() -> Passage {
    return Passage(vec3<f32>(1.0), NONE, 0.0, 0u);
}

fn pass_(p: Passage, hit: Hit, direction: vec3<f32>) -> Passage {
    var passed = p;
    if !may_pass(hit) {
        passed.share = vec3<f32>(0.0);
        return passed;
    }
    passed.panes += 1u;
    let s = surface_at(hit, direction);
    passed.share *= bsdf_straight(s, -direction);
    if (s.flags & MATERIAL_THIN_WALLED) != 0u { return passed; }
    let left = select(s.material, p.medium, s.front);
    passed.share *= transmittance(left, hit.t - p.since);
    passed.medium = select(NONE, s.material, s.front);
    passed.since = hit.t;
    return passed;
}

fn shadow_answer(p: Passage, hit: Hit, t_max: f32) -> Hit {
    if p.panes == 0u { return hit; }
    if hit.triangle != NONE { return Hit(1.0, hit.u, hit.v, hit.triangle); }
    var share = p.share;
    if t_max < FAR { share *= transmittance(p.medium, t_max - p.since); }
    return Hit(share.x, share.y, share.z, PANES);
}

fn blocks(hit: Hit) -> bool {
    return hit.triangle != NONE && hit.triangle != PANES;
}

fn may_pass(hit: Hit) -> bool {
    return (materials[triangles[hit.triangle].material].flags & MATERIAL_PANE) != 0u;
}

fn is_pane(hit: Hit, direction: vec3<f32>) -> bool {
    if (frame.flags & FRAME_PANES) == 0u || !may_pass(hit) { return false; }
    let s = surface_at(hit, direction);
    return any(bsdf_straight(s, -direction) != vec3<f32>(0.0));
}

fn open_share(hit: Hit) -> vec3<f32> {
    @if(panes) {
        if hit.triangle == PANES { return vec3<f32>(hit.t, hit.u, hit.v); }
    }
    return vec3<f32>(select(0.0, 1.0, hit.triangle == NONE));
}

fn open_share_real(st: ptr<function, PathState>) -> vec3<f32> {
    @if(panes) {
        let left_to_path = ((*st).path.events & EVENT_LIGHT_LEFT_TO_PATH) != 0u;
        if left_to_path && (*st).hits.in_real.triangle == PANES { return vec3<f32>(0.0); }
    }
    return open_share((*st).hits.in_real);
}

fn is_shared(st: ptr<function, PathState>) -> bool {
    return (*st).path.mode == MODE_DIFFERENCE || (*st).path.mode == MODE_SHARED;
}

fn may_leave_no_vertex(st: ptr<function, PathState>, s: Surface, wo: vec3<f32>) -> bool {
    @if(panes) {
        return (frame.flags & FRAME_PANES) != 0u
            && !is_shared(st)
            && !((*st).ray.side == SIDE_REAL && (*st).ray.depth == 1u)
            && any(bsdf_straight(s, wo) != vec3<f32>(0.0));
    }
    @else {
        return false;
    }
}

fn draw_at_pane(st: ptr<function, PathState>) -> SampleSet {
    let set_id = hash_combine((*st).vertex_hit.triangle, (*st).ray.depth) | PANE_SETS;
    return sample_set(sample_key(st), set_id);
}

fn pass_straight(st: ptr<function, PathState>, direction: vec3<f32>, throughput: vec3<f32>, medium: u32) {
    let left_to_path = (*st).ray.side == SIDE_REAL && ((*st).path.events & EVENT_FROM_SHARED) != 0u;
    var density = (*st).path.density;
    if left_to_path { density = DELTA_DENSITY; }
    path_passed_m[(*st).lane] = distance_from_vertex(st);
    (*st).path.events |= EVENT_PASSED;
    (*st).ray.depth -= 1u;
    (*st).path.pending |= PENDING_NEXT;
    path_nexts[(*st).lane] = Segment(direction, density, throughput, medium);
}

fn distance_from_vertex(st: ptr<function, PathState>) -> f32 {
    @if(panes) {
        if ((*st).path.events & EVENT_PASSED) != 0u { return path_passed_m[(*st).lane] + (*st).vertex_hit.t; }
    }
    return (*st).vertex_hit.t;
}
