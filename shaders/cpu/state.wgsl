// The state of one sample in flight. Rust twin: src/cpu/state.rs.

import package::packed::bindings::NONE;
import package::accel::trace::Hit;

const STAGE_DONE: u32 = 0u;
const STAGE_PRIMARY_VIRTUAL: u32 = 1u;
const STAGE_PRIMARY_REAL: u32 = 2u;
const STAGE_PATH: u32 = 3u;
const STAGE_PATH_SHADOW: u32 = 4u;
const STAGE_PAPER_BEHIND: u32 = 5u;
const STAGE_DIFFERENCE_SHADOW: u32 = 6u;
const STAGE_DIFFERENCE_CONE: u32 = 7u;
const STAGE_DIFFERENCE_BSDF: u32 = 8u;
const STAGE_REAL_PASS: u32 = 9u;

const MODE_MIXED: u32 = 0u;
const MODE_REAL: u32 = 1u;
const MODE_SHARED: u32 = 2u;
const MODE_DIFFERENCE: u32 = 3u;

const REQUEST_CLOSEST_VIRTUAL: u32 = 1u;
const REQUEST_CLOSEST_REAL: u32 = 2u;
const REQUEST_CLOSEST_MIXED: u32 = 3u;
const REQUEST_CLOSEST_EACH: u32 = 4u;
const REQUEST_VIRTUAL_THEN_REAL: u32 = 5u;
const REQUEST_REAL_UNLESS_COVERED: u32 = 6u;
const REQUEST_SHADOW_MIXED: u32 = 7u;
const REQUEST_SHADOW_REAL: u32 = 8u;
const REQUEST_SHADOW_DIFFERENCE: u32 = 9u;
const REQUEST_SHADOW_PAIR: u32 = 10u;

const PENDING_SHADOW: u32 = 1u;
const PENDING_NEXT: u32 = 2u;
const PENDING_REAL: u32 = 4u;
const PENDING_DIFFERENCE: u32 = 8u;
const PENDING_VERTEX: u32 = 16u;

const DELTA_DENSITY: f32 = -1.0;
const COINCIDENCE: f32 = 1e-5;
const SIDE_NONE: u32 = 2u;
// WGSL has no literal for infinity: the largest float stands for it, and misses carry it.
const FAR: f32 = 3.40282346638528859812e38;

struct RayCounts {
    primary: u32,
    mixed: u32,
    real: u32,
    mixed_shadow: u32,
    real_shadow: u32,
}

// vec3 and the scalar after it share 16 bytes.
struct PathState {
    position: vec3<f32>,
    t_max: f32,
    offset: vec3<f32>,
    real_t_min: f32,
    direction: vec3<f32>,
    density: f32,
    throughput: vec3<f32>,
    shadow_t_max: f32,
    shadow_direction: vec3<f32>,
    next_density: f32,
    shadow_contribution: vec3<f32>,
    real_density: f32,
    next_direction: vec3<f32>,
    difference_t_min: f32,
    next_throughput: vec3<f32>,
    difference_density: f32,
    real_direction: vec3<f32>,
    difference_cone_probability: f32,
    real_throughput: vec3<f32>,
    depth_m: f32,
    difference_position: vec3<f32>,
    pixel: u32,
    difference_offset: vec3<f32>,
    index: u32,
    difference_direction: vec3<f32>,
    stage: u32,
    difference_throughput: vec3<f32>,
    mode: u32,
    difference_normal: vec3<f32>,
    pending: u32,
    radiance: vec3<f32>,
    depth: u32,
    radiance_real: vec3<f32>,
    medium: u32,
    normal: vec3<f32>,
    request: u32,
    albedo: vec3<f32>,
    side: u32,
    hit_real: Hit,
    hit_virtual: Hit,
    vertex_hit: Hit,
    real_hit: Hit,
    shadow_request: u32,
    real_depth: u32,
    difference_depth: u32,
    difference_left_to_cones: u32,
    next_medium: u32,
    real_medium: u32,
    difference_medium: u32,
    coincidence_ratio: f32,
    difference_coincidence_ratio: f32,
    mask: u32,
    indirect: u32,
    weight: f32,
    rays: RayCounts,
}

fn miss() -> Hit {
    return Hit(FAR, 0.0, 0.0, NONE);
}

fn path_state(pixel: u32, index: u32) -> PathState {
    // A var without initialiser is all zeros.
    var st: PathState;
    st.pixel = pixel;
    st.index = index;
    st.stage = STAGE_DONE;
    st.mode = MODE_MIXED;
    st.medium = NONE;
    st.next_medium = NONE;
    st.real_medium = NONE;
    st.difference_medium = NONE;
    st.side = SIDE_NONE;
    st.t_max = FAR;
    st.hit_real = miss();
    st.hit_virtual = miss();
    st.vertex_hit = miss();
    st.real_hit = miss();
    st.throughput = vec3<f32>(1.0);
    st.weight = 1.0;
    st.density = DELTA_DENSITY;
    st.depth_m = FAR;
    return st;
}
