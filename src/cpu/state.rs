//! The state of one sample in flight. WGSL twin: `shaders/cpu/state.wgsl`.
//!
//! A sample is a small state machine: it asks for rays ([`Request`] bits), is given hits, and asks again until it is done. Both backends run
//! the same machine, the CPU in a loop, the GPU one step a dispatch.

use glam::Vec3;

use crate::accel::Hit;
use crate::packed::NONE;

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

/// A vertex to be shaded: `vertex_hit`, reached along `direction`.
pub const PENDING_VERTEX: u32 = 16;
pub const PENDING_SHADOW: u32 = 1;
pub const PENDING_NEXT: u32 = 2;
pub const PENDING_REAL: u32 = 4;
pub const PENDING_DIFFERENCE: u32 = 8;

/// Density that stands for a delta distribution: no other technique can find its directions.
pub const DELTA_DENSITY: f32 = -1.0;

/// A virtual hit counts as nearer within this relative distance, so that a base lying in the table's plane covers the table.
pub const COINCIDENCE: f32 = 1e-5;

/// No surface: a ray from the camera.
pub const SIDE_NONE: u32 = 2;

/// Rays traced, by the paper's kinds.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RayCounts {
    pub primary: u32,
    pub mixed: u32,
    pub real: u32,
    pub mixed_shadow: u32,
    pub real_shadow: u32,
}

/// One sample in flight.
#[derive(Clone, Debug)]
pub struct PathState {
    pub pixel: u32,
    pub index: u32,
    pub stage: u32,
    pub mode: u32,
    /// `PENDING_*` bits: what is left to do once the present ray is answered.
    pub pending: u32,
    /// Surface interactions up to and including the vertex being shaded.
    pub depth: u32,
    /// Material whose volume the path is inside, or NONE.
    pub medium: u32,

    // The ray asked for.
    pub request: u32,
    /// Vertex the ray leaves, and its geometric normal times the position's error bound.
    pub position: Vec3,
    pub offset: Vec3,
    /// Times `offset`: how far from the vertex its surface may coincide with one of the other world; negative where a path has come to a
    /// virtual surface from a real one that coincides with it, which then lies behind.
    pub coincidence_ratio: f32,
    /// World of that vertex: 0 real, 1 virtual, SIDE_NONE.
    pub side: u32,
    /// The real world is not met closer than this.
    pub real_t_min: f32,
    pub direction: Vec3,
    pub t_max: f32,

    // The answer.
    pub hit_real: Hit,
    pub hit_virtual: Hit,

    // The path being followed.
    pub vertex_hit: Hit,
    pub throughput: Vec3,
    /// Sum of the densities of the techniques that could have drawn the present direction; DELTA_DENSITY: one technique only.
    pub density: f32,
    /// Samples that this one stands for.
    pub weight: f32,
    /// The path has scattered other than by a mirror or a smooth interface: what it finds is clamped.
    pub indirect: bool,

    // A vertex's shadow ray and its continuation.
    pub shadow_direction: Vec3,
    pub shadow_t_max: f32,
    pub shadow_contribution: Vec3,
    pub shadow_request: u32,
    pub next_direction: Vec3,
    pub next_density: f32,
    pub next_throughput: Vec3,
    pub next_medium: u32,

    // The real path that starts behind a virtual hit.
    pub real_hit: Hit,
    pub real_direction: Vec3,
    pub real_density: f32,
    pub real_throughput: Vec3,
    pub real_medium: u32,
    pub real_depth: u32,

    // The difference chain's next ray.
    pub difference_position: Vec3,
    pub difference_t_min: f32,
    pub difference_offset: Vec3,
    pub difference_coincidence_ratio: f32,
    pub difference_depth: u32,
    pub difference_direction: Vec3,
    pub difference_density: f32,
    pub difference_throughput: Vec3,
    pub difference_medium: u32,
    /// What the cones of that vertex cover is left to them.
    pub difference_left_to_cones: bool,
    /// Shading normal and roulette probability of the cones at that vertex, to weigh a BSDF direction against them.
    pub difference_normal: Vec3,
    pub difference_cone_probability: f32,

    // Results.
    /// 1 where the primary ray met virtual geometry first.
    pub mask: u32,
    /// Direct: radiance of the virtual hit, or the difference. Paper: mixed radiance. Real pass: real radiance.
    pub radiance: Vec3,
    /// Paper: real radiance.
    pub radiance_real: Vec3,
    /// First hit along the view axis in metres (infinity without one), shading normal, albedo.
    pub depth_m: f32,
    pub normal: Vec3,
    pub albedo: Vec3,
    pub rays: RayCounts,
}

impl PathState {
    pub fn new(pixel: u32, index: u32) -> Self {
        Self {
            pixel,
            index,
            stage: STAGE_DONE,
            mode: MODE_MIXED,
            pending: 0,
            depth: 0,
            medium: NONE,
            request: 0,
            position: Vec3::ZERO,
            offset: Vec3::ZERO,
            coincidence_ratio: 1.0,
            side: SIDE_NONE,
            real_t_min: 0.0,
            direction: Vec3::ZERO,
            t_max: f32::INFINITY,
            hit_real: MISS,
            hit_virtual: MISS,
            vertex_hit: MISS,
            throughput: Vec3::ONE,
            density: DELTA_DENSITY,
            weight: 1.0,
            indirect: false,
            shadow_direction: Vec3::ZERO,
            shadow_t_max: 0.0,
            shadow_contribution: Vec3::ZERO,
            shadow_request: 0,
            next_direction: Vec3::ZERO,
            next_density: 0.0,
            next_throughput: Vec3::ZERO,
            next_medium: NONE,
            real_hit: MISS,
            real_direction: Vec3::ZERO,
            real_density: 0.0,
            real_throughput: Vec3::ZERO,
            real_medium: NONE,
            real_depth: 0,
            difference_position: Vec3::ZERO,
            difference_t_min: 0.0,
            difference_offset: Vec3::ZERO,
            difference_coincidence_ratio: 1.0,
            difference_depth: 0,
            difference_direction: Vec3::ZERO,
            difference_density: 0.0,
            difference_throughput: Vec3::ZERO,
            difference_medium: NONE,
            difference_left_to_cones: false,
            difference_normal: Vec3::ZERO,
            difference_cone_probability: 0.0,
            mask: 0,
            radiance: Vec3::ZERO,
            radiance_real: Vec3::ZERO,
            depth_m: f32::INFINITY,
            normal: Vec3::ZERO,
            albedo: Vec3::ZERO,
            rays: RayCounts::default(),
        }
    }
}

/// A ray that met nothing.
pub const MISS: Hit = Hit {
    t: f32::INFINITY,
    u: 0.0,
    v: 0.0,
    triangle: NONE,
};
