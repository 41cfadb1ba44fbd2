//! Answers a sample's ray request. WGSL twin: `shaders/cpu/request.wgsl`.

use super::state::*;
use crate::accel::{Hit, Ray};
use crate::material::surface_alpha;
use crate::math::{hash_combine, length3, uniform_from_bits};
use crate::packed::{
    FRAME_ALPHA, FRAME_BOTH_SHADOWS, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, NONE, PackedScene,
};

/// A ray that meets this many transparent layers ends at the last.
const MAX_ALPHA_LAYERS: u32 = 64;

pub const WORLD_REAL: u32 = 0;
pub const WORLD_VIRTUAL: u32 = 1;

/// Traces what `st.request` asks for and leaves the answer in `st.hit_real` and `st.hit_virtual`.
pub fn answer(scene: &PackedScene, st: &mut PathState) {
    let mut hit_real = MISS;
    let mut hit_virtual = MISS;
    let t_max = st.t_max;
    match st.request {
        REQUEST_CLOSEST_VIRTUAL => {
            st.rays.mixed += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, false);
        }
        REQUEST_CLOSEST_REAL => {
            st.rays.real += 1;
            hit_real = trace_world(scene, st, WORLD_REAL, t_max, false);
            // The primary real ray answers beside the virtual hit found before.
            hit_virtual = st.hit_virtual;
        }
        REQUEST_CLOSEST_MIXED => {
            st.rays.mixed += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, false);
            hit_real = trace_world(scene, st, WORLD_REAL, hit_virtual.t, false);
        }
        REQUEST_CLOSEST_EACH => {
            st.rays.mixed += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, false);
            hit_real = trace_world(scene, st, WORLD_REAL, t_max, false);
        }
        REQUEST_VIRTUAL_THEN_REAL => {
            st.rays.mixed += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, false);
            if hit_virtual.triangle != NONE {
                st.rays.real += 1;
                hit_real = trace_world(scene, st, WORLD_REAL, t_max, false);
            }
        }
        REQUEST_REAL_UNLESS_COVERED => {
            st.rays.real += 1;
            hit_real = trace_world(scene, st, WORLD_REAL, t_max, false);
            if hit_real.triangle != NONE {
                st.rays.mixed += 1;
                let covering = hit_real.t * (1.0 + COINCIDENCE);
                hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, covering, true);
            }
        }
        REQUEST_SHADOW_MIXED => {
            st.rays.mixed_shadow += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, true);
            if hit_virtual.triangle == NONE {
                hit_real = trace_world(scene, st, WORLD_REAL, t_max, true);
            }
        }
        REQUEST_SHADOW_REAL => {
            st.rays.real_shadow += 1;
            hit_real = trace_world(scene, st, WORLD_REAL, t_max, true);
        }
        REQUEST_SHADOW_DIFFERENCE => {
            st.rays.mixed_shadow += 1;
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, true);
            if hit_virtual.triangle != NONE || scene.frame.flags & FRAME_BOTH_SHADOWS != 0 {
                st.rays.real_shadow += 1;
                hit_real = trace_world(scene, st, WORLD_REAL, t_max, true);
            }
        }
        REQUEST_SHADOW_PAIR => {
            st.rays.real_shadow += 1;
            st.rays.mixed_shadow += 1;
            hit_real = trace_world(scene, st, WORLD_REAL, t_max, true);
            hit_virtual = trace_world(scene, st, WORLD_VIRTUAL, t_max, true);
            if hit_virtual.triangle == NONE {
                hit_virtual = trace_world(scene, st, WORLD_REAL, t_max, true);
            }
        }
        _ => {}
    }
    st.hit_real = hit_real;
    st.hit_virtual = hit_virtual;
}

fn is_shadow(request: u32) -> bool {
    matches!(
        request,
        REQUEST_SHADOW_MIXED
            | REQUEST_SHADOW_REAL
            | REQUEST_SHADOW_DIFFERENCE
            | REQUEST_SHADOW_PAIR
    )
}

/// What an any-hit query that met something answers: only `triangle != NONE` means anything.
const BLOCKED: Hit = Hit {
    t: 0.0,
    u: 0.0,
    v: 0.0,
    triangle: 0,
};

/// One world's answer. A ray that leaves a surface starts past it in that surface's own world, so that it does not meet itself. In the other
/// world it starts as if virtual geometry lay in front of real geometry that coincides with it, as seen from where the path came: a ray
/// that goes on through a virtual surface then meets the real one, and one that goes back meets it not. A shadow ray ends at the same point
/// wherever it starts, short of its light: the light must not hide itself.
fn trace_world(scene: &PackedScene, st: &PathState, world: u32, t_max: f32, any_hit: bool) -> Hit {
    let shift = if world == st.side {
        if st.direction.dot(st.offset) < 0.0 {
            -st.offset
        } else {
            st.offset
        }
    } else if world == WORLD_REAL {
        st.offset * st.coincidence_ratio
    } else {
        -st.offset * st.coincidence_ratio
    };
    let mut direction = st.direction;
    let mut t_max = t_max;
    if is_shadow(st.request) && t_max < f32::INFINITY {
        let to_end = st.direction * t_max - shift;
        t_max = length3(to_end);
        direction = to_end / t_max.max(f32::MIN_POSITIVE);
    }
    let mut ray = Ray {
        origin: st.position + shift,
        direction,
        t_min: if world == WORLD_REAL {
            st.real_t_min
        } else {
            0.0
        },
        t_max,
        skip: NONE,
    };
    let bvh = if world == WORLD_REAL {
        &scene.real_bvh
    } else {
        &scene.virtual_bvh
    };
    if scene.frame.flags & FRAME_ALPHA == 0 {
        if any_hit {
            return if bvh.any(&ray) { BLOCKED } else { MISS };
        }
        return bvh.closest(&ray);
    }
    let mut hit = MISS;
    for _ in 0..MAX_ALPHA_LAYERS {
        hit = bvh.closest(&ray);
        if hit.triangle == NONE || meets(scene, st, hit) {
            return hit;
        }
        ray.t_min = hit.t;
        ray.skip = hit.triangle;
    }
    hit
}

/// Whether the ray meets a surface of partial opacity: with the probability of its opacity.
fn meets(scene: &PackedScene, st: &PathState, hit: Hit) -> bool {
    let material = &scene.materials[scene.triangles[hit.triangle as usize].material as usize];
    if material.flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND) == 0 {
        return true;
    }
    let alpha = surface_alpha(scene, hit);
    let bits = hash_combine(
        hash_combine(
            hash_combine(hash_combine(scene.frame.seed, st.pixel), st.index),
            hit.triangle,
        ),
        st.depth,
    );
    uniform_from_bits(bits) < alpha
}
