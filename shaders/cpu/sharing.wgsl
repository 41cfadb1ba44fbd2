// Second vertices shared between pixels, where the weights are derived. Rust twin: src/cpu/sharing.rs.

import package::gpu::buffers::frame;
import package::gpu::lanes::work_of;
import package::shared::NONE;
import package::packed::records::{SIDE_REAL, SIDE_VIRTUAL};
import package::work::list::TILE_PLACES;
import package::film::sums::is_unusable;
import package::light::cones::{cone_pdf, cones_at};
import package::material::scatter::{lambert_cos, terminator};
import package::math::{INV_PI, dot3, length3, safe_sqrt};
import package::cpu::panes::blocks;
import package::cpu::request::answer;
import package::cpu::sharing_tile::{MEMBERS, QUARTER, member_of};
import package::camera::sampler::sample_set;
import package::cpu::contribution::{LINK_SET, sample_key};
import package::cpu::vertex::{SHADOW_SHORTEN, SHADOW_SHORTEN_ERRORS, plays};
import package::cpu::state::{
    FIRST_NONE, FIRST_VIRTUAL, FirstVertex, POINTS, POINT_COVERED, POINT_RECURSION, PathRay, PathState, REQUEST_SHADOW_DIFFERENCE, REQUEST_SHADOW_MIXED,
    SharedPoint, path_firsts, path_links, path_points, paths,
};

fn link_to(first: FirstVertex, point: SharedPoint, kind: u32) -> Link {
    let to_point = point.position - first.origin.position;
    let distance2 = max(dot3(to_point, to_point), LEAST_DISTANCE2);
    let direction = to_point / safe_sqrt(distance2);
    let cosine = lambert_cos(first.ng, first.ns, direction) * INV_PI;
    let solid_angle = max(-dot3(point.ng, direction), 0.0) / distance2;
    var drawn = first.bsdf_probability * cosine;
    if kind != POINT_RECURSION {
        drawn = first.cone_probability * cone_pdf(cones_at(first.origin.position, first.ns), direction);
    }
    return Link(cosine * terminator(first.ng, first.ns, direction) * solid_angle, drawn * solid_angle);
}

fn sees(st: ptr<function, PathState>, first: FirstVertex, point: SharedPoint, kind: u32, thread: u32) -> bool {
    let to_point = point.position + point.ng * point.error - first.origin.position;
    let distance = max(length3(to_point), MIN_POSITIVE);
    let error = length3(first.origin.offset);
    let covered = kind == POINT_COVERED;
    (*st).ray = PathRay(
        first.origin,
        to_point / distance,
        distance - SHADOW_SHORTEN * distance - SHADOW_SHORTEN_ERRORS * error,
        select(REQUEST_SHADOW_MIXED, REQUEST_SHADOW_DIFFERENCE, covered),
        select(SIDE_REAL, SIDE_VIRTUAL, first.kept == FIRST_VIRTUAL),
        1u,
        0u,
    );
    answer(st, thread);
    let in_real = (*st).hits.in_real;
    let in_virtual = (*st).hits.in_virtual;
    if covered {
        let by_no_pane = blocks(in_virtual) && in_virtual.t == 0.0;
        return in_real.triangle == NONE && by_no_pane;
    }
    return in_real.triangle == NONE && in_virtual.triangle == NONE;
}

fn first_link(kind: u32) -> u32 {
    if kind == POINT_RECURSION { return 0u; }
    return MEMBERS + (kind - 1u) * QUARTER;
}

fn link_of(kind: u32, source: u32, receiver: u32) -> u32 {
    if kind == POINT_RECURSION { return receiver; }
    if source / QUARTER != receiver / QUARTER { return LINKS; }
    return first_link(kind) + receiver % QUARTER;
}

// Number of a lane's pixel in its tile.
fn number_of(lane: u32) -> u32 {
    return member_of(frame.width, work_of(lane).pixel);
}

// The first lane of the tile's samples of equal number, and how many there are.
fn tile_lanes(lane: u32) -> vec2<u32> {
    let tile = work_of(lane).tile;
    return vec2<u32>(lane - tile % TILE_PLACES, tile / TILE_PLACES);
}

fn light_of(point: SharedPoint) -> f32 {
    if point.strength == 0.0 || is_unusable(point.radiance) { return 0.0; }
    let size = abs(point.radiance);
    return max(max(size.x, size.y), size.z) / point.strength;
}

fn link_probability(source: u32, kind: u32) -> f32 {
    if kind != POINT_RECURSION { return 1.0; }
    let lanes = tile_lanes(source);
    let kept = path_firsts[source].kept;
    var sum = 0.0;
    var count = 0.0;
    for (var member = lanes.x; member < lanes.x + lanes.y; member++) {
        let light = light_of(path_points[member][kind]);
        if path_firsts[member].kept == kept && light > 0.0 {
            sum += light;
            count += 1.0;
        }
    }
    return min(light_of(path_points[source][kind]) * count / sum, 1.0);
}

fn link_points(st: ptr<function, PathState>, thread: u32) {
    let lane = (*st).lane;
    let lanes = tile_lanes(lane);
    let number = number_of(lane);
    (*st).path = paths[lane];
    let kept = path_firsts[lane].kept;
    for (var place = 0u; place < LINKS; place++) { path_links[lane][place] = 0.0; }
    for (var kind = 0u; kind < POINTS; kind++) {
        let point = path_points[lane][kind];
        if point.strength == 0.0 || all(point.radiance == vec3<f32>(0.0)) { continue; }
        if is_unusable(point.radiance) {
            path_links[lane][link_of(kind, number, number)] = 1.0;
            continue;
        }
        let probability = link_probability(lane, kind);
        if !plays(sample_set(sample_key(st), LINK_SET), probability) { continue; }
        var density = 0.0;
        for (var member = lanes.x; member < lanes.x + lanes.y; member++) {
            let place = link_of(kind, number, number_of(member));
            let first = path_firsts[member];
            if place == LINKS || first.kept != kept { continue; }
            let link = link_to(first, point, kind);
            if link.transfer > 0.0 {
                var visible = member == lane;
                if !visible { visible = sees(st, first, point, kind, thread); }
                if visible {
                    path_links[lane][place] = link.transfer;
                    density += link.density;
                }
            }
        }
        let scale = 1.0 / max(density * point.strength * probability, MIN_POSITIVE);
        for (var place = first_link(kind); place < first_link(kind + 1u); place++) { path_links[lane][place] *= scale; }
    }
}

fn gather(lane: u32) -> vec3<f32> {
    let lanes = tile_lanes(lane);
    let number = number_of(lane);
    var light = vec3<f32>(0.0);
    for (var member = lanes.x; member < lanes.x + lanes.y; member++) {
        if path_firsts[member].kept == FIRST_NONE { continue; }
        let source = number_of(member);
        for (var kind = 0u; kind < POINTS; kind++) {
            let place = link_of(kind, source, number);
            if path_points[member][kind].strength == 0.0 || place == LINKS { continue; }
            let link = path_links[member][place];
            if link == 0.0 { continue; }
            let taken = path_points[member][kind].radiance * link;
            light += select(taken, -taken, kind == POINT_COVERED);
        }
    }
    return light * path_firsts[lane].throughput;
}
