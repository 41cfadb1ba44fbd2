// What a sample leaves for the other samples of its sharing tile. Rust twin: src/cpu/points.rs.

import package::gpu::buffers::pixels;
import package::packed::records::{MATERIAL_NORMAL_MAPPED, PIXEL_SHARES};
import package::material::bsdf::bsdf_is_lambertian;
import package::material::surface::Surface;
import package::cpu::state::{
    EVENT_PASSED, FIRST_DIFFERENCE, FIRST_NONE, FIRST_VIRTUAL, FirstVertex, MODE_DIFFERENCE, MODE_MIXED, POINT_COVERED, POINT_COVERING, POINT_NONE, POINT_RECURSION, PathState,
    SharedPoint, path_firsts, path_points, path_results,
};

fn shares(st: ptr<function, PathState>) -> bool {
    return (pixels[(*st).path.pixel].flags & PIXEL_SHARES) != 0u && ((*st).path.events & EVENT_PASSED) == 0u;
}

fn keep_first_vertex(st: ptr<function, PathState>, s: Surface, cone_probability: f32, bsdf_probability: f32) {
    let is_plain = bsdf_is_lambertian(s) && (s.flags & MATERIAL_NORMAL_MAPPED) == 0u;
    if (*st).ray.depth != 1u || !shares(st) || !is_plain { return; }
    var kept = FIRST_NONE;
    if (*st).path.mode == MODE_DIFFERENCE { kept = FIRST_DIFFERENCE; }
    if (*st).path.mode == MODE_MIXED { kept = FIRST_VIRTUAL; }
    path_firsts[(*st).lane] = FirstVertex(
        (*st).ray.origin,
        s.ng,
        cone_probability,
        s.ns,
        bsdf_probability,
        (*st).path.throughput * s.base_color,
        kept,
        vec3<f32>(0.0),
        POINT_NONE,
    );
}

fn point_of(st: ptr<function, PathState>, s: Surface) -> u32 {
    if (*st).ray.depth != 2u || !shares(st) || !bsdf_is_lambertian(s) { return POINT_NONE; }
    var kind = POINT_COVERED;
    var probability = path_firsts[(*st).lane].cone_probability;
    let of_virtual = path_firsts[(*st).lane].kept == FIRST_VIRTUAL;
    if (*st).path.mode == MODE_DIFFERENCE || ((*st).path.mode == MODE_MIXED && of_virtual) {
        kind = POINT_RECURSION;
        probability = path_firsts[(*st).lane].bsdf_probability;
    } else if (*st).path.mode == MODE_MIXED {
        kind = POINT_COVERING;
    }
    return select(POINT_NONE, kind, probability > 0.0);
}

fn offer_point(st: ptr<function, PathState>, s: Surface) {
    let kind = point_of(st, s);
    if kind == POINT_NONE { return; }
    let lane = (*st).lane;
    let throughput = abs((*st).path.throughput);
    let strength = max(max(throughput.x, throughput.y), throughput.z);
    (*st).path.throughput = vec3<f32>(strength);
    path_points[lane][kind] = SharedPoint(s.position, s.error, s.ng, strength, vec3<f32>(0.0), 0u);
    path_firsts[lane].own = path_results[lane].radiance;
    path_firsts[lane].capture = kind;
    path_results[lane].radiance = vec3<f32>(0.0);
}

fn end_capture(st: ptr<function, PathState>) {
    @if(sharing) {
        let lane = (*st).lane;
        let kind = path_firsts[lane].capture;
        if kind == POINT_NONE { return; }
        path_points[lane][kind].radiance = path_results[lane].radiance;
        path_results[lane].radiance = path_firsts[lane].own;
        path_firsts[lane].capture = POINT_NONE;
    }
}

fn end_cone_capture(st: ptr<function, PathState>) {
    @if(sharing) {
        if path_firsts[(*st).lane].capture != POINT_RECURSION { end_capture(st); }
    }
}
