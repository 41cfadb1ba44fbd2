// The state of one sample in flight. Rust twin: src/cpu/state.rs.

import package::shared::NONE;
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

struct RayOrigin {
    position: vec3<f32>,
    real_t_min: f32,
    offset: vec3<f32>,
    coincidence_ratio: f32,
}

struct PathRay {
    origin: RayOrigin,
    direction: vec3<f32>,
    t_max: f32,
    request: u32,
    side: u32,
    depth: u32,
    opacity_seed: u32,
}

struct Hits {
    in_real: Hit,
    in_virtual: Hit,
}

struct Path {
    throughput: vec3<f32>,
    density: f32,
    shadow_contribution: vec3<f32>,
    weight: f32,
    pixel: u32,
    index: u32,
    stage: u32,
    mode: u32,
    pending: u32,
    medium: u32,
    indirect: u32,
}

struct Segment {
    direction: vec3<f32>,
    density: f32,
    throughput: vec3<f32>,
    medium: u32,
}

struct RealPath {
    segment: Segment,
    hit: Hit,
    depth: u32,
}

struct DifferenceRay {
    origin: RayOrigin,
    segment: Segment,
    normal: vec3<f32>,
    cone_probability: f32,
    depth: u32,
    request: u32,
}

struct PathResult {
    radiance: vec3<f32>,
    mask: u32,
}

struct FirstHit {
    normal: vec3<f32>,
    depth_m: f32,
    albedo: vec3<f32>,
}

// The parts of the samples in flight, by lane.
@group(2) @binding(0) var<storage, read_write> path_rays: array<PathRay>;
@group(2) @binding(1) var<storage, read_write> path_hits: array<Hits>;
@group(2) @binding(2) var<storage, read_write> paths: array<Path>;
@group(2) @binding(3) var<storage, read_write> path_nexts: array<Segment>;
@group(2) @binding(4) var<storage, read_write> path_reals: array<RealPath>;
@group(2) @binding(5) var<storage, read_write> path_differences: array<DifferenceRay>;
@group(2) @binding(6) var<storage, read_write> path_results: array<PathResult>;
@group(2) @binding(7) var<storage, read_write> path_radiances_real: array<vec3<f32>>;
@group(2) @binding(8) var<storage, read_write> path_first_hits: array<FirstHit>;

// What a step works on. It reads and writes the parts that are not here where they lie, at `lane`.
struct PathState {
    lane: u32,
    ray: PathRay,
    hits: Hits,
    path: Path,
    vertex_hit: Hit,
    rays: RayCounts,
}

const MISS: Hit = Hit(FAR, 0.0, 0.0, NONE);

fn path_state(lane: u32, pixel: u32, index: u32) -> PathState {
    // A var without initialiser is all zeros.
    var st: PathState;
    st.lane = lane;
    st.ray.origin.coincidence_ratio = 1.0;
    st.ray.t_max = FAR;
    st.ray.side = SIDE_NONE;
    st.hits = Hits(MISS, MISS);
    st.path.throughput = vec3<f32>(1.0);
    st.path.density = DELTA_DENSITY;
    st.path.weight = 1.0;
    st.path.pixel = pixel;
    st.path.index = index;
    st.path.stage = STAGE_DONE;
    st.path.mode = MODE_MIXED;
    st.path.medium = NONE;
    return st;
}
