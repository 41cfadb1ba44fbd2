//! Answers a sample's ray request. WGSL twin: `shaders/cpu/request.wgsl`.

use glam::Vec3;

use super::panes::{blocks, pass, passage, shadow_answer};
use super::state::*;
use crate::accel::{Hit, Ray};
use crate::material::surface_alpha;
use crate::math::{hash_combine, length3, uniform_from_bits};
use crate::packed::{
    FRAME_ALPHA, FRAME_BOTH_SHADOWS, FRAME_PANES, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, NONE,
    PackedScene, SIDE_REAL, SIDE_VIRTUAL,
};
use crate::shared::shared;

shared! {
    /// A ray that meets this many transparent layers ends at the last.
    const MAX_LAYERS: u32 = 64;

    /// The request is answered.
    const QUERY_NONE: u32 = 2;
    /// A length below it is none.
    const MIN_POSITIVE: f32 = f32::MIN_POSITIVE;

    /// One query of a request: a world and how far.
    value struct Query {
        world: u32,
        any_hit: bool,
        t_max: f32,
        /// The answer goes to the real world's hit rather than the virtual one's.
        to_real: bool,
        /// With it the request is answered.
        is_last: bool,
    }
}

/// The answer where only that something was met means anything.
const MET: Hit = Hit {
    t: 0.0,
    triangle: 0,
    ..MISS
};

#[inline]
fn query(world: u32, any_hit: bool, t_max: f32, is_last: bool) -> Query {
    Query {
        world,
        any_hit,
        t_max,
        to_real: world == SIDE_REAL,
        is_last,
    }
}

/// The request as a sequence of at most three queries; `hits`: what the earlier ones met.
#[inline]
fn next_query(scene: &PackedScene, request: u32, step: u32, t_max: f32, hits: &Hits) -> Query {
    let met_real = hits.in_real.triangle != NONE;
    let met_virtual = hits.in_virtual.triangle != NONE;
    match (request, step) {
        (REQUEST_CLOSEST_VIRTUAL, 0) => query(SIDE_VIRTUAL, false, t_max, true),
        (REQUEST_CLOSEST_REAL, 0) => query(SIDE_REAL, false, t_max, true),
        (REQUEST_CLOSEST_MIXED, 0) => query(SIDE_VIRTUAL, false, t_max, false),
        (REQUEST_CLOSEST_MIXED, 1) => query(SIDE_REAL, false, hits.in_virtual.t, true),
        (REQUEST_CLOSEST_EACH, 0) => query(SIDE_VIRTUAL, false, t_max, false),
        (REQUEST_CLOSEST_EACH, 1) => query(SIDE_REAL, false, t_max, true),
        (REQUEST_VIRTUAL_THEN_REAL, 0) => query(SIDE_VIRTUAL, false, t_max, false),
        (REQUEST_VIRTUAL_THEN_REAL, 1) if met_virtual => query(SIDE_REAL, false, t_max, true),
        (REQUEST_REAL_UNLESS_COVERED, 0) => query(SIDE_REAL, false, t_max, false),
        (REQUEST_REAL_UNLESS_COVERED, 1) if met_real => {
            let covering = hits.in_real.t * (1.0 + COINCIDENCE);
            query(SIDE_VIRTUAL, true, covering, true)
        }
        (REQUEST_SHADOW_MIXED, 0) => query(SIDE_VIRTUAL, true, t_max, false),
        (REQUEST_SHADOW_MIXED, 1) if !blocks(hits.in_virtual) => {
            query(SIDE_REAL, true, t_max, true)
        }
        (REQUEST_SHADOW_REAL, 0) => query(SIDE_REAL, true, t_max, true),
        (REQUEST_SHADOW_DIFFERENCE, 0) => query(SIDE_VIRTUAL, true, t_max, false),
        (REQUEST_SHADOW_DIFFERENCE, 1) if met_virtual || asks_both(scene) => {
            query(SIDE_REAL, true, t_max, true)
        }
        (REQUEST_SHADOW_PAIR, 0) => query(SIDE_REAL, true, t_max, false),
        (REQUEST_SHADOW_PAIR, 1) => query(SIDE_VIRTUAL, true, t_max, false),
        (REQUEST_SHADOW_PAIR, 2) if !blocks(hits.in_virtual) => Query {
            to_real: false,
            ..query(SIDE_REAL, true, t_max, true)
        },
        _ => query(QUERY_NONE, false, 0.0, true),
    }
}

fn asks_both(scene: &PackedScene) -> bool {
    scene.frame.flags & FRAME_BOTH_SHADOWS != 0
}

/// Counts the rays of the request, once it is answered, by the paper's kinds.
fn count_rays(scene: &PackedScene, st: &mut PathState) {
    let met_real = st.hits.in_real.triangle != NONE;
    let met_virtual = st.hits.in_virtual.triangle != NONE;
    let rays = &mut st.rays;
    match st.ray.request {
        REQUEST_CLOSEST_VIRTUAL | REQUEST_CLOSEST_MIXED | REQUEST_CLOSEST_EACH => rays.mixed += 1,
        REQUEST_CLOSEST_REAL => rays.real += 1,
        REQUEST_VIRTUAL_THEN_REAL => {
            rays.mixed += 1;
            rays.real += u32::from(met_virtual);
        }
        REQUEST_REAL_UNLESS_COVERED => {
            rays.real += 1;
            rays.mixed += u32::from(met_real);
        }
        REQUEST_SHADOW_MIXED => rays.mixed_shadow += 1,
        REQUEST_SHADOW_REAL => rays.real_shadow += 1,
        REQUEST_SHADOW_DIFFERENCE => {
            rays.mixed_shadow += 1;
            rays.real_shadow += u32::from(met_virtual || asks_both(scene));
        }
        REQUEST_SHADOW_PAIR => {
            rays.real_shadow += 1;
            rays.mixed_shadow += 1;
        }
        _ => {}
    }
}

/// Traces what the state asks for and leaves the answer in its hits.
pub fn answer(scene: &PackedScene, st: &mut PathState) {
    let request = st.ray.request;
    let alpha = scene.frame.flags & FRAME_ALPHA != 0;
    let panes = scene.frame.flags & FRAME_PANES != 0 && is_shadow(request);
    // Rays that nothing lets through keep no account of what they have passed.
    if alpha || panes {
        answer_past::<true>(scene, st, alpha, panes);
    } else {
        answer_past::<false>(scene, st, false, false);
    }
}

/// [`answer`], where the ray may go past what it meets (`PAST`): transparent layers (`alpha`) and panes.
fn answer_past<const PAST: bool>(
    scene: &PackedScene,
    st: &mut PathState,
    alpha: bool,
    panes: bool,
) {
    let request = st.ray.request;
    let (alpha, panes) = (PAST && alpha, PAST && panes);
    // In place: copies of what was just stored in other widths wait for the stores.
    st.hits.in_real = MISS;
    if request != REQUEST_CLOSEST_REAL {
        // It answers beside the virtual hit found before.
        st.hits.in_virtual = MISS;
    }
    let mut step = 0;
    let mut layer = 0;
    let mut t_min = -1.0;
    let mut skip = NONE;
    let mut passed = passage();
    // Transparent layers and panes repeat a query from where it stopped.
    loop {
        let q = next_query(scene, request, step, st.ray.t_max, &st.hits);
        if q.world == QUERY_NONE {
            break;
        }
        let mut ray = ray_into(&st.ray, q.world, q.t_max);
        if layer > 0 {
            ray.t_min = t_min;
            ray.skip = skip;
        }
        let mut hit = trace(scene, &ray, q.world, q.any_hit && !alpha && !panes);
        if (alpha || panes) && hit.triangle != NONE && layer + 1 < MAX_LAYERS {
            let mut goes_on = alpha && !meets(scene, &st.ray, hit);
            if panes && !goes_on {
                let further = pass(scene, passed, hit, ray.direction);
                goes_on = further.share != Vec3::ZERO;
                if goes_on {
                    passed = further;
                }
            }
            if goes_on {
                t_min = hit.t;
                skip = hit.triangle;
                layer += 1;
                continue;
            }
        }
        layer = 0;
        if PAST && q.any_hit && hit.triangle != NONE {
            hit = MET;
        }
        if panes {
            hit = shadow_answer(scene, passed, hit, ray.t_max);
            passed = passage();
        }
        if q.to_real {
            st.hits.in_real = hit;
        } else if q.world == SIDE_VIRTUAL || blocks(hit) {
            st.hits.in_virtual = hit;
        }
        if q.is_last {
            break;
        }
        step += 1;
    }
    count_rays(scene, st);
}

/// One world's nearest hit, or any: then only whether there is one means anything.
#[inline]
fn trace(scene: &PackedScene, ray: &Ray, world: u32, any_hit: bool) -> Hit {
    let bvh = if world == SIDE_REAL {
        &scene.real_bvh
    } else {
        &scene.virtual_bvh
    };
    if !any_hit {
        return bvh.closest(ray);
    }
    if bvh.any(ray) { MET } else { MISS }
}

/// The ray in one world. A ray that leaves a surface starts past it in that surface's own world, so that it does not meet itself. In the other
/// world it starts as if virtual geometry lay in front of real geometry that coincides with it, as seen from where the path came: a ray
/// that goes on through a virtual surface then meets the real one, and one that goes back meets it not. A shadow ray ends at the same point
/// wherever it starts, short of its light: the light must not hide itself.
#[inline]
fn ray_into(ray: &PathRay, world: u32, t_max: f32) -> Ray {
    let offset = ray.origin.offset;
    let shift = if world == ray.side {
        if ray.direction.dot(offset) < 0.0 {
            -offset
        } else {
            offset
        }
    } else if world == SIDE_REAL {
        offset * ray.origin.coincidence_ratio
    } else {
        -offset * ray.origin.coincidence_ratio
    };
    let mut direction = ray.direction;
    let mut distance = t_max;
    if is_shadow(ray.request) && t_max < f32::INFINITY {
        let to_end = ray.direction * t_max - shift;
        distance = length3(to_end);
        direction = to_end / distance.max(MIN_POSITIVE);
    }
    Ray {
        origin: ray.origin.position + shift,
        direction,
        t_min: if world == SIDE_REAL {
            ray.origin.real_t_min
        } else {
            0.0
        },
        t_max: distance,
        skip: NONE,
    }
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

/// Whether the ray meets a surface of partial opacity: with the probability of its opacity.
fn meets(scene: &PackedScene, ray: &PathRay, hit: Hit) -> bool {
    let material = &scene.materials[scene.triangles[hit.triangle as usize].material as usize];
    if material.flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND) == 0 {
        return true;
    }
    let alpha = surface_alpha(scene, hit);
    let bits = hash_combine(hash_combine(ray.opacity_seed, hit.triangle), ray.depth);
    uniform_from_bits(bits) < alpha
}
