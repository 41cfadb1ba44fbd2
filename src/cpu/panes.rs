//! Light that goes straight through a surface: a thin wall without roughness, or a volume of index 1. It bends no ray, so that what asks
//! whether a light is seen looks through it. WGSL twin: `shaders/cpu/panes.wgsl`.
//!
//! A pane is no vertex: it counts as no bounce, and what a path finds behind it is weighed by how the last vertex before it drew the direction.
//! Only while both worlds share a path a pane of the real world is one: lights with extent are then left to the path that goes through it.

use glam::Vec3;

use super::contribution::sample_key;
use super::state::*;
use crate::accel::Hit;
use crate::camera::sampler::{SampleSet, sample_set};
use crate::material::{Surface, bsdf_straight, surface_at};
use crate::math::{exp_, hash_combine};
use crate::packed::{
    FRAME_PANES, MATERIAL_PANE, MATERIAL_THIN_WALLED, NONE, PackedScene, SIDE_REAL,
};
use crate::shared::shared;

shared! {
    /// Sets the panes' sample sets apart from those of the depths.
    pub const PANE_SETS: u32 = 0x8000_0000;

    /// A shadow ray on its way through panes.
    #[derive(Clone, Copy, Debug)]
    pub value struct Passage {
        /// Share of the light that has passed.
        pub share: Vec3,
        /// Material whose volume the ray is inside, or NONE.
        pub medium: u32,
        /// Where it entered it: distance along the ray, metres.
        pub since: f32,
        pub panes: u32,
    }
}

/// Share of light that goes a distance (metres) through the volume of a material, or through none.
pub fn transmittance(scene: &PackedScene, medium: u32, distance: f32) -> Vec3 {
    if medium == NONE {
        return Vec3::ONE;
    }
    let sigma = scene.materials[medium as usize].sigma_a;
    Vec3::new(
        exp_(-sigma[0] * distance),
        exp_(-sigma[1] * distance),
        exp_(-sigma[2] * distance),
    )
}

/// A ray that has met nothing yet.
pub fn passage() -> Passage {
    Passage {
        share: Vec3::ONE,
        medium: NONE,
        since: 0.0,
        panes: 0,
    }
}

/// The ray after what it has met; no share of it passes what is no pane. A ray that leaves a volume has begun in it.
pub fn pass(scene: &PackedScene, p: Passage, hit: Hit, direction: Vec3) -> Passage {
    let mut passed = p;
    if !may_pass(scene, hit) {
        passed.share = Vec3::ZERO;
        return passed;
    }
    passed.panes += 1;
    let s = surface_at(scene, hit, direction);
    passed.share *= bsdf_straight(&s, -direction);
    if s.flags & MATERIAL_THIN_WALLED != 0 {
        return passed;
    }
    let left = if s.front { p.medium } else { s.material };
    passed.share *= transmittance(scene, left, hit.t - p.since);
    passed.medium = if s.front { s.material } else { NONE };
    passed.since = hit.t;
    passed
}

/// The answer to a shadow ray that ends at `t_max` after it has passed, before `hit` or nothing.
pub fn shadow_answer(scene: &PackedScene, p: Passage, hit: Hit, t_max: f32) -> Hit {
    if p.panes == 0 {
        return hit;
    }
    if hit.triangle != NONE {
        return Hit { t: 1.0, ..hit };
    }
    let mut share = p.share;
    if t_max < f32::INFINITY {
        share *= transmittance(scene, p.medium, t_max - p.since);
    }
    Hit {
        t: share.x,
        u: share.y,
        v: share.z,
        triangle: PANES,
    }
}

/// Whether no light comes past what a shadow ray has met.
pub fn blocks(hit: Hit) -> bool {
    hit.triangle != NONE && hit.triangle != PANES
}

fn may_pass(scene: &PackedScene, hit: Hit) -> bool {
    let material = scene.triangles[hit.triangle as usize].material;
    scene.materials[material as usize].flags & MATERIAL_PANE != 0
}

/// Whether some of what comes along the ray goes straight through what it has met.
pub fn is_pane(scene: &PackedScene, hit: Hit, direction: Vec3) -> bool {
    if scene.frame.flags & FRAME_PANES == 0 || !may_pass(scene, hit) {
        return false;
    }
    let s = surface_at(scene, hit, direction);
    bsdf_straight(&s, -direction) != Vec3::ZERO
}

/// Share of the light that a shadow ray's answer lets through.
pub fn open_share(hit: Hit) -> Vec3 {
    match hit.triangle {
        NONE => Vec3::ONE,
        PANES => Vec3::new(hit.t, hit.u, hit.v),
        _ => Vec3::ZERO,
    }
}

/// That of the real world, for the light that the present vertex has asked for.
pub fn open_share_real(st: &PathState) -> Vec3 {
    if st.path.events & EVENT_LIGHT_LEFT_TO_PATH != 0 && st.hits.in_real.triangle == PANES {
        return Vec3::ZERO;
    }
    open_share(st.hits.in_real)
}

/// Whether both worlds share the path so far.
pub fn is_shared(st: &PathState) -> bool {
    st.path.mode == MODE_DIFFERENCE || st.path.mode == MODE_SHARED
}

/// Whether a path that goes straight on through the vertex leaves none there. One that comes from the camera through a real pane does.
pub fn may_leave_no_vertex(scene: &PackedScene, st: &PathState, s: &Surface, wo: Vec3) -> bool {
    scene.frame.flags & FRAME_PANES != 0
        && !is_shared(st)
        && !(st.ray.side == SIDE_REAL && st.ray.depth == 1)
        && bsdf_straight(s, wo) != Vec3::ZERO
}

/// Random numbers of the choice at a pane: its own, as the next vertex has those of the same depth.
pub fn draw_at_pane(scene: &PackedScene, st: &PathState) -> SampleSet {
    let set_id = hash_combine(st.vertex_hit.triangle, st.ray.depth) | PANE_SETS;
    sample_set(sample_key(scene, st), set_id)
}

/// Goes straight on through the vertex, as if it were none.
pub fn pass_straight(st: &mut PathState, direction: Vec3, throughput: Vec3, medium: u32) {
    let left_to_path = st.ray.side == SIDE_REAL && st.path.events & EVENT_FROM_SHARED != 0;
    let mut density = st.path.density;
    if left_to_path {
        density = DELTA_DENSITY;
    }
    st.passed_m = distance_from_vertex(st);
    st.path.events |= EVENT_PASSED;
    st.ray.depth -= 1;
    st.path.pending |= PENDING_NEXT;
    st.next = Segment {
        direction,
        density,
        throughput,
        medium,
    };
}

/// Between the last vertex and the present hit, metres.
pub fn distance_from_vertex(st: &PathState) -> f32 {
    if st.path.events & EVENT_PASSED != 0 {
        st.passed_m + st.vertex_hit.t
    } else {
        st.vertex_hit.t
    }
}
