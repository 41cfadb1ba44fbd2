//! The state of one sample in flight. WGSL twin: `shaders/cpu/state.wgsl`.
//!
//! A sample is a small state machine: it asks for rays (`REQUEST_*`), is given hits, and asks again until it is done. Both backends run the
//! same machine, the CPU in a loop, the GPU one step a dispatch. The state is cut into parts that are moved as a whole: on the GPU each is an
//! array of its own over the samples in flight, and a kernel reads and writes only those that it needs.

use glam::Vec3;

use crate::accel::Hit;
use crate::packed::NONE;
use crate::shared::shared;
use crate::work::SampleRays;

shared! {
    /// Finished; the results stand in the accumulators.
    pub const STAGE_DONE: u32 = 0;
    /// Waiting for the primary ray's virtual hit.
    pub const STAGE_PRIMARY_VIRTUAL: u32 = 1;
    /// Waiting for the primary ray's real hit.
    pub const STAGE_PRIMARY_REAL: u32 = 2;
    /// Waiting for the next vertex of a mixed, real or shared path.
    pub const STAGE_PATH: u32 = 3;
    /// Waiting for a path vertex's shadow ray.
    pub const STAGE_PATH_SHADOW: u32 = 4;
    /// Paper estimator: waiting for the real ray that continues behind a virtual hit.
    pub const STAGE_PAPER_BEHIND: u32 = 5;
    /// Waiting for a difference vertex's shadow ray.
    pub const STAGE_DIFFERENCE_SHADOW: u32 = 6;
    /// Waiting for both worlds along a direction drawn inside the cones.
    pub const STAGE_DIFFERENCE_CONE: u32 = 7;
    /// Waiting for both worlds along a direction drawn from the BSDF.
    pub const STAGE_DIFFERENCE_BSDF: u32 = 8;
    /// Real pass: waiting for both worlds along the primary ray.
    pub const STAGE_REAL_PASS: u32 = 9;
    pub const STAGE_COUNT: u32 = 10;

    /// Path through real and virtual geometry.
    pub const MODE_MIXED: u32 = 0;
    /// Path through real geometry alone.
    pub const MODE_REAL: u32 = 1;
    /// Paper estimator: the part of a path that both worlds share.
    pub const MODE_SHARED: u32 = 2;
    /// Chain of real vertices at which the difference is estimated.
    pub const MODE_DIFFERENCE: u32 = 3;

    /// Closest virtual hit.
    pub const REQUEST_CLOSEST_VIRTUAL: u32 = 1;
    /// Closest real hit.
    pub const REQUEST_CLOSEST_REAL: u32 = 2;
    /// Closest of both: the real hit is kept only where it is nearer.
    pub const REQUEST_CLOSEST_MIXED: u32 = 3;
    /// Closest in either world, each on its own.
    pub const REQUEST_CLOSEST_EACH: u32 = 4;
    /// Closest virtual hit, and only if there is one the closest real hit on its own.
    pub const REQUEST_VIRTUAL_THEN_REAL: u32 = 5;
    /// Closest real hit, and only if there is one whether something virtual is in front.
    pub const REQUEST_REAL_UNLESS_COVERED: u32 = 6;
    /// Shadow ray in the mixed world.
    pub const REQUEST_SHADOW_MIXED: u32 = 7;
    /// Shadow ray in the real world.
    pub const REQUEST_SHADOW_REAL: u32 = 8;
    /// Shadow ray of the difference: virtual first, real only if something virtual blocks.
    pub const REQUEST_SHADOW_DIFFERENCE: u32 = 9;
    /// The paper's two shadow rays: real, and mixed.
    pub const REQUEST_SHADOW_PAIR: u32 = 10;

    /// The ray asked for is a shadow ray.
    pub const PENDING_SHADOW: u32 = 1;
    /// [`PathState::next`].
    pub const PENDING_NEXT: u32 = 2;
    /// [`PathState::real`].
    pub const PENDING_REAL: u32 = 4;
    /// [`PathState::difference`].
    pub const PENDING_DIFFERENCE: u32 = 8;
    /// With [`PENDING_REAL`]: what covers the real surface is a pane.
    pub const PENDING_BEHIND_PANE: u32 = 32;
    /// A vertex to be shaded: `vertex_hit`, reached along the ray. Never left pending while a ray is traced.
    pub const PENDING_VERTEX: u32 = 16;
    /// From this bit on, how many more lights are to be drawn at the present vertex. It is shaded again for each, and stands in
    /// [`PathState::real`] with the direction that it was reached along.
    pub const PENDING_LIGHT: u32 = 64;

    /// The path has scattered other than by a mirror or a smooth interface: what it finds is clamped.
    pub const EVENT_SCATTERED: u32 = 1;
    /// It did so at its first vertex: photons that land there can be seen by the camera.
    pub const EVENT_SEEN: u32 = 2;
    /// Since it last did so it has met smooth virtual surfaces.
    pub const EVENT_VIRTUAL_CHAIN: u32 = 4;
    /// Since it last did so it has met smooth real surfaces.
    pub const EVENT_REAL_CHAIN: u32 = 8;
    /// The present vertex of a difference is polished.
    pub const EVENT_AT_POLISHED: u32 = 16;
    /// The guide may have drawn the path's last direction that was not a smooth surface's.
    pub const EVENT_GUIDED: u32 = 512;

    /// It has gone straight through panes since its last vertex.
    pub const EVENT_PASSED: u32 = 32;
    /// Both worlds share its last vertex.
    pub const EVENT_FROM_SHARED: u32 = 64;
    /// What the light of the present shadow ray sends through panes of the real world is found by the path that goes through them.
    pub const EVENT_LIGHT_LEFT_TO_PATH: u32 = 128;

    /// All vertices so far are virtual and scatter no light diffusely: the camera looks through them at what lies behind.
    pub const EVENT_FROM_LENS: u32 = 256;

    /// Answer to a shadow ray, in the place of a triangle: it has passed panes alone, and the share of light that comes through stands in
    /// the hit's `t`, `u`, `v`.
    pub const PANES: u32 = 0xffff_fffe;

    /// Density that stands for a delta distribution: no other technique can find its directions.
    pub const DELTA_DENSITY: f32 = -1.0;

    /// The shaders' infinity, for which WGSL has no literal; misses carry it.
    const FAR: f32 = f32::MAX;

    /// What a kept first vertex estimates: there is none; the difference, at a real one; the mixed radiance of a virtual one.
    pub const FIRST_NONE: u32 = 0;
    pub const FIRST_DIFFERENCE: u32 = 1;
    pub const FIRST_VIRTUAL: u32 = 2;

    /// Where the BSDF's direction leads: a difference leaves it, or towards a virtual vertex mixed radiance.
    pub const POINT_RECURSION: u32 = 0;
    /// Virtual geometry that a direction inside the cones has met, and the real surface behind it.
    pub const POINT_COVERING: u32 = 1;
    pub const POINT_COVERED: u32 = 2;
    pub const POINTS: u32 = 3;
    /// Nothing is captured.
    pub const POINT_NONE: u32 = 3;

    /// A virtual hit counts as nearer within this relative distance, so that a base lying in the table's plane covers the table.
    pub const COINCIDENCE: f32 = 1e-5;

    /// No surface: a ray from the camera.
    pub const SIDE_NONE: u32 = 2;

    /// Where a ray starts: a vertex, or the camera.
    #[derive(Clone, Copy, Debug)]
    pub struct RayOrigin {
        pub position: Vec3,
        /// The real world is not met closer than this.
        pub real_t_min: f32,
        /// The vertex's geometric normal times the position's error bound; zero at the camera.
        pub offset: Vec3,
        /// Times `offset`: how far from the vertex its surface may coincide with one of the other world; negative where a path has come to a
        /// virtual surface from a real one that coincides with it, which then lies behind.
        pub coincidence_ratio: f32,
    }

    /// The ray asked for: all that tracing reads.
    #[derive(Clone, Copy, Debug)]
    pub struct PathRay {
        pub origin: RayOrigin,
        /// Unit.
        pub direction: Vec3,
        pub t_max: f32,
        /// `REQUEST_*`.
        pub request: u32,
        /// World of the vertex that it leaves: `SIDE_REAL`, `SIDE_VIRTUAL` or [`SIDE_NONE`].
        pub side: u32,
        /// Surface interactions up to and including the vertex that it leaves.
        pub depth: u32,
        /// Decides, with surface and depth, whether a surface of partial opacity is met; 0 where no material has any.
        pub opacity_seed: u32,
    }

    /// The answer to a request: nearest hits, or for shadow rays whether there is one: `t` is then 0, or 1 if panes come before it.
    #[derive(Clone, Copy, Debug)]
    pub struct Hits {
        pub in_real: Hit,
        pub in_virtual: Hit,
    }

    /// The path being followed, and what is left to do after it.
    #[derive(Clone, Copy, Debug)]
    pub struct Path {
        pub throughput: Vec3,
        /// Sum of the densities of the techniques that could have drawn the present direction; [`DELTA_DENSITY`]: one technique only.
        pub density: f32,
        /// What the vertex's shadow ray adds if it is answered so.
        pub shadow_contribution: Vec3,
        /// Samples that this one stands for.
        pub weight: f32,
        /// Row-major index.
        pub pixel: u32,
        /// Number of the sample among the pixel's that are drawn from one sequence.
        pub index: u32,
        /// `STAGE_*`.
        pub stage: u32,
        /// `MODE_*`.
        pub mode: u32,
        /// `PENDING_*` bits: what is left to do once the present ray is answered.
        pub pending: u32,
        /// Material whose volume the path is inside, or NONE.
        pub medium: u32,
        /// `EVENT_*` bits: how the path has scattered so far.
        pub events: u32,
        /// Surface interactions up to and including the first vertex of the real path that waits.
        pub real_depth: u32,
    }

    /// How a path goes on from a vertex.
    #[derive(Clone, Copy, Debug)]
    pub struct Segment {
        /// Unit.
        pub direction: Vec3,
        /// As [`Path::density`].
        pub density: f32,
        pub throughput: Vec3,
        /// As [`Path::medium`].
        pub medium: u32,
    }

    /// The real path behind a virtual hit: its first vertex, and how it came there.
    #[derive(Clone, Copy, Debug)]
    pub struct RealPath {
        pub segment: Segment,
        pub hit: Hit,
    }

    /// The next ray of the chain of vertices at which the difference is estimated. The vertex that it leaves is real.
    #[derive(Clone, Copy, Debug)]
    pub struct DifferenceRay {
        pub origin: RayOrigin,
        pub segment: Segment,
        /// Shading normal, and roulette probability of the cones there, to weigh a BSDF direction against them.
        pub normal: Vec3,
        pub cone_probability: f32,
        pub depth: u32,
        /// [`REQUEST_REAL_UNLESS_COVERED`] where what the cones cover is left to them, else [`REQUEST_CLOSEST_EACH`].
        pub request: u32,
        /// As [`Path::events`], once the ray is followed.
        pub events: u32,
        pub pad: u32,
    }

    /// What the sample has found.
    #[derive(Clone, Copy, Debug)]
    pub struct PathResult {
        /// Direct: radiance of the virtual hit, or the difference. Paper: mixed radiance. Real pass: real radiance.
        pub radiance: Vec3,
        /// 1 where the primary ray met virtual geometry first.
        pub mask: u32,
    }

    /// The first vertex of a sample that shares: a Lambertian one.
    #[derive(Clone, Copy, Debug)]
    pub struct FirstVertex {
        pub origin: RayOrigin,
        /// Unit geometric normal, on the side that the ray came from.
        pub ng: Vec3,
        /// Roulette probability of the cones; 0: no directions are drawn inside of them.
        pub cone_probability: f32,
        /// Unit shading normal.
        pub ns: Vec3,
        /// Roulette probability of the recursion; 0: there is none.
        pub bsdf_probability: f32,
        /// Albedo times the samples that this one stands for.
        pub throughput: Vec3,
        /// `FIRST_*`.
        pub kept: u32,
        /// What the sample had found before what it finds went to a point.
        pub own: Vec3,
        /// Point that what is found goes to, `POINT_*`.
        pub capture: u32,
    }

    /// A second vertex, whose light other first vertices may use.
    #[derive(Clone, Copy, Debug)]
    pub struct SharedPoint {
        pub position: Vec3,
        /// Bound on the error of `position`, metres.
        pub error: f32,
        /// Unit geometric normal, on the side that the ray came from.
        pub ng: Vec3,
        /// Largest channel of the path's throughput where it was met; 0: there is no such point.
        pub strength: f32,
        /// What leaves the point towards any other: the difference, the mixed radiance, or the real one.
        pub radiance: Vec3,
        pub pad: u32,
    }

    /// The first surface met.
    #[derive(Clone, Copy, Debug)]
    pub struct FirstHit {
        /// Shading normal.
        pub normal: Vec3,
        /// Along the view axis in metres; infinite without a hit.
        pub depth_m: f32,
        pub albedo: Vec3,
        pub pad: u32,
    }
}

/// One sample in flight.
#[derive(Clone, Debug)]
pub struct PathState {
    pub ray: PathRay,
    pub hits: Hits,
    pub path: Path,
    pub next: Segment,
    pub real: RealPath,
    pub difference: DifferenceRay,
    pub result: PathResult,
    /// Paper: real radiance.
    pub radiance_real: Vec3,
    pub first_hit: FirstHit,
    pub first: FirstVertex,
    /// By `POINT_*`.
    pub points: [SharedPoint; POINTS as usize],
    /// The vertex to be shaded next.
    pub vertex_hit: Hit,
    /// From the last vertex to the pane that the ray leaves, metres; meaningful with [`EVENT_PASSED`].
    pub passed_m: f32,
    pub rays: SampleRays,
}

/// A ray that met nothing.
pub const MISS: Hit = Hit::MISS;

const NO_ORIGIN: RayOrigin = RayOrigin {
    position: Vec3::ZERO,
    real_t_min: 0.0,
    offset: Vec3::ZERO,
    coincidence_ratio: 1.0,
};

const NO_SEGMENT: Segment = Segment {
    direction: Vec3::ZERO,
    density: 0.0,
    throughput: Vec3::ZERO,
    medium: NONE,
};

const NO_FIRST_VERTEX: FirstVertex = FirstVertex {
    origin: NO_ORIGIN,
    ng: Vec3::ZERO,
    cone_probability: 0.0,
    ns: Vec3::ZERO,
    bsdf_probability: 0.0,
    throughput: Vec3::ZERO,
    kept: FIRST_NONE,
    own: Vec3::ZERO,
    capture: POINT_NONE,
};

const NO_POINT: SharedPoint = SharedPoint {
    position: Vec3::ZERO,
    error: 0.0,
    ng: Vec3::ZERO,
    strength: 0.0,
    radiance: Vec3::ZERO,
    pad: 0,
};

const NO_RAY: PathRay = PathRay {
    origin: NO_ORIGIN,
    direction: Vec3::ZERO,
    t_max: f32::INFINITY,
    request: 0,
    side: SIDE_NONE,
    depth: 0,
    opacity_seed: 0,
};

const NO_HITS: Hits = Hits {
    in_real: MISS,
    in_virtual: MISS,
};

const NO_PATH: Path = Path {
    throughput: Vec3::ONE,
    density: DELTA_DENSITY,
    shadow_contribution: Vec3::ZERO,
    weight: 1.0,
    pixel: 0,
    index: 0,
    stage: STAGE_DONE,
    mode: MODE_MIXED,
    pending: 0,
    medium: NONE,
    events: 0,
    real_depth: 0,
};

const NO_RESULT: PathResult = PathResult {
    radiance: Vec3::ZERO,
    mask: 0,
};

const NO_FIRST_HIT: FirstHit = FirstHit {
    normal: Vec3::ZERO,
    depth_m: f32::INFINITY,
    albedo: Vec3::ZERO,
    pad: 0,
};

/// A sample that has not begun.
pub fn path_state(pixel: u32, index: u32) -> PathState {
    PathState {
        ray: NO_RAY,
        hits: NO_HITS,
        path: Path {
            pixel,
            index,
            ..NO_PATH
        },
        next: NO_SEGMENT,
        real: RealPath {
            segment: NO_SEGMENT,
            hit: MISS,
        },
        difference: DifferenceRay {
            origin: NO_ORIGIN,
            segment: NO_SEGMENT,
            normal: Vec3::ZERO,
            cone_probability: 0.0,
            depth: 0,
            request: 0,
            events: 0,
            pad: 0,
        },
        result: NO_RESULT,
        radiance_real: Vec3::ZERO,
        first_hit: NO_FIRST_HIT,
        first: NO_FIRST_VERTEX,
        points: [NO_POINT; POINTS as usize],
        vertex_hit: MISS,
        passed_m: 0.0,
        rays: SampleRays::default(),
    }
}

/// Makes the state of a sample that is done that of one that has not begun, but for what is only read once it is written.
pub fn renew(st: &mut PathState, pixel: u32, index: u32) {
    st.ray = NO_RAY;
    st.hits = NO_HITS;
    st.path = Path {
        pixel,
        index,
        ..NO_PATH
    };
    st.result = NO_RESULT;
    st.radiance_real = Vec3::ZERO;
    st.first_hit = NO_FIRST_HIT;
    st.first.kept = FIRST_NONE;
    st.first.cone_probability = 0.0;
    st.first.bsdf_probability = 0.0;
    st.first.capture = POINT_NONE;
    for point in &mut st.points {
        point.strength = 0.0;
    }
    st.rays = SampleRays::default();
}
