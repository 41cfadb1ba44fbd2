//! What a sample leaves for the other samples of its sharing tile: its first vertex, and the second vertices with the light that leaves
//! them. WGSL twin: `shaders/cpu/points.wgsl`.
//!
//! All of the vertices are Lambertian: what leaves them does not depend on where it goes.

use glam::Vec3;

use super::state::*;
use crate::material::{Surface, bsdf_is_lambertian};
use crate::packed::{MATERIAL_NORMAL_MAPPED, PIXEL_SHARES, PackedScene};

fn shares(scene: &PackedScene, st: &PathState) -> bool {
    // Links between vertices do not look through panes, and what lies behind is not shared.
    scene.pixels[st.path.pixel as usize].flags & PIXEL_SHARES != 0
        && st.path.events & EVENT_PASSED == 0
}

/// Keeps the vertex, if it is the first and may use others' points; with the chances that cones and BSDF are played.
pub fn keep_first_vertex(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    cone_probability: f32,
    bsdf_probability: f32,
) {
    // A link does not know what a normal map tilts.
    let is_plain = bsdf_is_lambertian(s) && s.flags & MATERIAL_NORMAL_MAPPED == 0;
    if st.ray.depth != 1 || !shares(scene, st) || !is_plain {
        return;
    }
    let kept = match st.path.mode {
        MODE_DIFFERENCE => FIRST_DIFFERENCE,
        MODE_MIXED => FIRST_VIRTUAL,
        _ => FIRST_NONE,
    };
    st.first = FirstVertex {
        origin: st.ray.origin,
        ng: s.ng,
        cone_probability,
        ns: s.ns,
        bsdf_probability,
        throughput: st.path.throughput * s.base_color,
        kept,
        own: Vec3::ZERO,
        capture: POINT_NONE,
    };
}

/// Which point the vertex to be shaded is, or `POINT_NONE`.
fn point_of(scene: &PackedScene, st: &PathState, s: &Surface) -> u32 {
    if st.ray.depth != 2 || !shares(scene, st) || !bsdf_is_lambertian(s) {
        return POINT_NONE;
    }
    let (point, probability) = match st.path.mode {
        MODE_DIFFERENCE => (POINT_RECURSION, st.first.bsdf_probability),
        MODE_MIXED if st.first.kept == FIRST_VIRTUAL => {
            (POINT_RECURSION, st.first.bsdf_probability)
        }
        MODE_MIXED => (POINT_COVERING, st.first.cone_probability),
        _ => (POINT_COVERED, st.first.cone_probability),
    };
    if probability > 0.0 { point } else { POINT_NONE }
}

/// From here on what the vertex scatters is captured, if others may use it. The throughput keeps its strength, by which roulette goes.
pub fn offer_point(scene: &PackedScene, st: &mut PathState, s: &Surface) {
    let point = point_of(scene, st, s);
    if point == POINT_NONE {
        return;
    }
    let strength = st.path.throughput.abs().max_element();
    st.path.throughput = Vec3::splat(strength);
    st.points[point as usize] = SharedPoint {
        position: s.position,
        error: s.error,
        ng: s.ng,
        strength,
        radiance: Vec3::ZERO,
        pad: 0,
    };
    st.first.own = st.result.radiance;
    st.first.capture = point;
    st.result.radiance = Vec3::ZERO;
}

/// What was found since [`offer_point`] goes to the point.
pub fn end_capture(st: &mut PathState) {
    let point = st.first.capture;
    if point == POINT_NONE {
        return;
    }
    st.points[point as usize].radiance = st.result.radiance;
    st.result.radiance = st.first.own;
    st.first.capture = POINT_NONE;
}

/// A path that comes from the cones ends before another begins; the recursion is the last of all.
pub fn end_cone_capture(st: &mut PathState) {
    if st.first.capture != POINT_RECURSION {
        end_capture(st);
    }
}
