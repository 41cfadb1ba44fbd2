// The way of one photon, and what the camera sees of it. Rust twin: src/cpu/photons/path.rs, where the method is described.

import package::gpu::buffers::frame;
import package::packed::records::{FRAME_ALPHA, FRAME_SHUTTER, MATERIAL_THIN_WALLED, SAMPLER_SOBOL, SIDE_REAL, SIDE_VIRTUAL};
import package::shared::NONE;
import package::math::{dot3, hash_combine};
import package::camera::sampler::{SampleKey, SampleSet, fourth, pair, sample_set, second_pair, third};
import package::camera::shutter::camera_pose;
@if(shutter) import package::camera::shutter::camera_pose_at;
import package::camera::splat::{exposure_weight, lens_connect};
import package::cpu::contribution::is_smooth;
import package::cpu::estimator::virtual_is_nearer;
import package::cpu::photons::emission::emit;
import package::cpu::panes::{PANE_SETS, open_share, transmittance};
import package::cpu::request::answer;
import package::cpu::state::{FAR, PANES, PathState, REQUEST_CLOSEST_MIXED, REQUEST_SHADOW_MIXED, path_state};
import package::cpu::vertex::{EMITS_ONLY, max_element, medium_along, stand_at};
import package::gpu::photons::add_splat;
import package::material::bsdf::{bsdf_eval, bsdf_index_ratio, bsdf_is_polished, bsdf_passes_straight, bsdf_sample, bsdf_straight};
import package::material::scatter::BsdfSample;
import package::material::surface::{Surface, surface_at};

struct Photon {
    st: PathState,
    key: SampleKey,
    flux: vec3<f32>,
    throughput: vec3<f32>,
    time_share: f32,
    distant: bool,
    chained: bool,
    landed: bool,
    // Local invocation index.
    thread: u32,
}

struct PhotonNumber {
    sequence: u32,
    place: u32,
    window: vec2<f32>,
}

// A vertex, if there is one.
struct Met {
    yes: bool,
    s: Surface,
    wi: vec3<f32>,
}

fn trace_photon(number: PhotonNumber, thread: u32) -> PathState {
    var photon = begin(number, thread);
    if all(photon.flux == vec3<f32>(0.0)) { return photon.st; }
    loop {
        let met = next_vertex(&photon);
        if !met.yes { break; }
        if photon.chained && !bsdf_is_polished(met.s) { see(&photon, met.s, met.wi); }
        if !scatter(&photon, met.s, met.wi) { break; }
    }
    return photon.st;
}

fn draw(photon: ptr<function, Photon>, set_id: u32) -> SampleSet {
    return sample_set((*photon).key, set_id);
}

fn vertex_set(photon: ptr<function, Photon>, purpose: u32) -> SampleSet {
    return draw(photon, FIRST_VERTEX_SET + (*photon).st.ray.depth * SETS_PER_VERTEX + purpose);
}

fn pane_set(photon: ptr<function, Photon>) -> SampleSet {
    let set_id = hash_combine((*photon).st.vertex_hit.triangle, (*photon).st.ray.depth) | PANE_SETS;
    return draw(photon, set_id);
}

fn begin(number: PhotonNumber, thread: u32) -> Photon {
    var photon: Photon;
    photon.st = path_state(0u, 0u, 0u);
    photon.thread = thread;
    photon.key = SampleKey(number.sequence, number.place, 1u, hash_combine(frame.seed, PHOTON_SALT), SAMPLER_SOBOL);
    photon.throughput = vec3<f32>(1.0);
    let choices = draw(&photon, SET_CHOICES);
    let places = draw(&photon, SET_EMISSION);
    let emission = emit(pair(choices), second_pair(places), pair(places));
    photon.flux = emission.flux;
    photon.time_share = number.window.x + third(choices) * number.window.y;
    photon.st.ray.origin.position = emission.position;
    photon.st.ray.origin.offset = emission.offset;
    photon.st.ray.side = emission.side;
    photon.st.ray.direction = emission.direction;
    photon.distant = emission.distant;
    if (frame.flags & FRAME_ALPHA) != 0u {
        photon.st.ray.opacity_seed = hash_combine(hash_combine(photon.key.seed, number.sequence), number.place);
    }
    return photon;
}

fn next_vertex(photon: ptr<function, Photon>) -> Met {
    var met: Met;
    var st = (*photon).st;
    st.ray.request = REQUEST_CLOSEST_MIXED;
    st.ray.t_max = FAR;
    answer(&st, (*photon).thread);
    var hit = st.hits.in_real;
    if virtual_is_nearer(st.hits) { hit = st.hits.in_virtual; }
    if hit.triangle == NONE {
        (*photon).st = st;
        return met;
    }
    st.ray.depth += 1u;
    st.vertex_hit = hit;
    met.s = surface_at(hit, st.ray.direction);
    if (met.s.flags & EMITS_ONLY) != 0u {
        (*photon).st = st;
        return met;
    }
    @if(transmission) {
        if st.ray.depth == 1u && leaves_volume(met.s) { st.path.medium = met.s.material; }
        (*photon).flux *= transmittance(st.path.medium, hit.t);
    }
    met.wi = -st.ray.direction;
    stand_at(&st, met.s, hit.t);
    met.yes = true;
    if (*photon).distant {
        (*photon).distant = false;
        (*photon).flux *= open_towards(&st, met.wi, FAR, (*photon).thread);
        met.yes = any((*photon).flux != vec3<f32>(0.0));
    }
    (*photon).st = st;
    return met;
}

fn leaves_volume(s: Surface) -> bool {
    return !s.front && s.transmission > 0.0 && (s.flags & MATERIAL_THIN_WALLED) == 0u;
}

fn open_towards(st: ptr<function, PathState>, direction: vec3<f32>, distance: f32, thread: u32) -> vec3<f32> {
    (*st).ray.direction = direction;
    (*st).ray.t_max = distance;
    (*st).ray.request = REQUEST_SHADOW_MIXED;
    answer(st, thread);
    return open_share((*st).hits.in_virtual) * open_share((*st).hits.in_real);
}

fn see(photon: ptr<function, Photon>, s: Surface, wi: vec3<f32>) {
    var pose = camera_pose();
    @if(shutter) {
        if (frame.flags & FRAME_SHUTTER) != 0u { pose = camera_pose_at((*photon).time_share); }
    }
    let on_lens = pair(vertex_set(photon, 1u));
    let lens = lens_connect(pose, s.position, on_lens.x, on_lens.y);
    if lens.pixel == NONE { return; }
    let exposed = exposure_weight((*photon).time_share, lens.pixel / frame.width);
    if exposed <= 0.0 { return; }
    var st = (*photon).st;
    let scattered = scattered_to(&st, lens.direction, wi);
    if max_element(scattered.xyz) <= 0.0 { return; }
    let open = open_towards(&st, lens.direction, lens.distance, (*photon).thread);
    (*photon).st = st;
    // What the camera sees through a real pane is the eye's.
    if all(open == vec3<f32>(0.0)) || st.hits.in_real.triangle == PANES { return; }
    let pixels = f32(frame.width * frame.height);
    let geometry = scattered.w / (lens.distance * lens.distance) * lens.importance;
    let scale = geometry * (exposed * frame.exposure_scale / pixels);
    let is_virtual = st.ray.side == SIDE_VIRTUAL || st.hits.in_virtual.triangle == PANES;
    add_splat(lens.pixel, is_virtual, (*photon).flux * scattered.xyz * open * scale);
}

// xyz: radiance, w: the cosine.
fn scattered_to(st: ptr<function, PathState>, wo: vec3<f32>, wi: vec3<f32>) -> vec4<f32> {
    let s = surface_at((*st).vertex_hit, -wo);
    let arriving = abs(dot3(s.ng, wi));
    if arriving <= 0.0 { return vec4<f32>(0.0); }
    let f = bsdf_eval(s, wo, wi);
    return vec4<f32>(f.f_cos * (1.0 / arriving), abs(dot3(s.ng, wo)));
}

fn scatter(photon: ptr<function, Photon>, s: Surface, wi: vec3<f32>) -> bool {
    let at_pane = any(bsdf_straight(s, wi) != vec3<f32>(0.0));
    let is_last = (*photon).st.ray.depth >= frame.max_bounces;
    if is_last && !at_pane { return false; }
    var u = vertex_set(photon, 0u);
    if at_pane { u = pane_set(photon); }
    let b = bsdf_sample(s, wi, vec3<f32>(third(u), pair(u)));
    if !b.valid { return false; }
    let straight = b.delta && b.transmitted && bsdf_passes_straight(s);
    if is_last && !straight { return false; }
    if !(*photon).landed && !straight {
        if b.delta || is_smooth(s, (*photon).st.ray.side, false) {
            if (*photon).st.ray.side == SIDE_REAL { return false; }
            (*photon).chained = true;
        } else {
            if !(*photon).chained { return false; }
            (*photon).landed = true;
        }
    }
    let weight = adjoint_weight(photon, s, wi, b);
    (*photon).flux *= weight;
    (*photon).throughput *= weight;
    if (*photon).landed {
        let survival = min(PHOTON_ROULETTE_GAIN * max_element((*photon).throughput), 1.0);
        if survival <= 0.0 || (survival < 1.0 && fourth(u) >= survival) { return false; }
        (*photon).flux *= 1.0 / survival;
        (*photon).throughput *= 1.0 / survival;
    }
    var st = (*photon).st;
    (*photon).st.path.medium = medium_along(&st, s, b.wi);
    (*photon).st.ray.direction = b.wi;
    if straight { (*photon).st.ray.depth -= 1u; }
    return any((*photon).flux != vec3<f32>(0.0));
}

fn adjoint_weight(photon: ptr<function, Photon>, s: Surface, wi: vec3<f32>, b: BsdfSample) -> vec3<f32> {
    if b.delta {
        let below = abs(dot3(s.ng, wi)) * abs(dot3(s.ns, b.wi));
        if below <= 0.0 { return vec3<f32>(0.0); }
        var scale = abs(dot3(s.ns, wi)) * abs(dot3(s.ng, b.wi)) / below;
        if b.transmitted {
            let ratio = bsdf_index_ratio(s);
            scale *= 1.0 / (ratio * ratio);
        }
        return b.weight * scale;
    }
    var st = (*photon).st;
    let scattered = scattered_to(&st, b.wi, wi);
    return scattered.xyz * (scattered.w / b.pdf);
}
