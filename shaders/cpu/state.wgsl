// The state of one sample in flight. Rust twin: src/cpu/state.rs, which declares its parts and constants for both.

import package::shared::NONE;
import package::accel::trace::Hit;
import package::cpu::sharing::LINKS;
import package::work::rays::SampleRays;

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

@group(2) @binding(9) var<storage, read_write> path_firsts: array<FirstVertex>;
@group(2) @binding(10) var<storage, read_write> path_points: array<array<SharedPoint, POINTS>>;
@group(2) @binding(11) var<storage, read_write> path_links: array<array<f32, LINKS>>;
@group(2) @binding(12) var<storage, read_write> path_passed_m: array<f32>;

// What a step works on. It reads and writes the parts that are not here where they lie, at `lane`.
struct PathState {
    lane: u32,
    ray: PathRay,
    hits: Hits,
    path: Path,
    vertex_hit: Hit,
    rays: SampleRays,
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
