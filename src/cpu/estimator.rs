//! The estimator as a state machine: what a sample does with the hits it asked for. WGSL twin: `shaders/cpu/estimator.wgsl`.
//!
//! `direct` estimates the difference D = Im - Ir where it arises (docs/estimator.md): at a real vertex, (a) lights that virtual geometry blocks
//! or that are virtual, (b) directions inside the cones of the virtual bounding spheres, (c) the recursion along the BSDF. `paper` follows the
//! four ray kinds and four rules of Kan & Kaufmann 2012.

use glam::Vec3;

use super::contribution::*;
use super::panes::{is_pane, open_share, open_share_real};
use super::points::{end_capture, end_cone_capture};
use super::sharing_tile::tile_of;
use super::state::*;
use super::vertex::shade_vertex;
use crate::accel::Hit;
use crate::camera::lens::camera_ray_from;
use crate::camera::sampler::sample_4d;
use crate::camera::shutter::{camera_pose, camera_pose_at, shutter_share};
use crate::light::backdrop::{backdrop_of_pixel, backdrop_radiance};
use crate::light::cones::{cone_pdf, cones_at};
use crate::light::environment::{env_radiance, share_left_to_eye};
use crate::light::lights::env_arriving;
use crate::material::{Surface, bsdf_albedo, surface_at};
use crate::math::{hash_combine, hash_u32};
use crate::packed::{
    ESTIMATOR_PAPER, FRAME_ALPHA, FRAME_AOVS, FRAME_ENV_DRAWN, FRAME_SHUTTER, NONE,
    PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_SHARES, PackedScene,
};
use crate::shared::shared;

shared! {
    /// Sets the turns' offset apart from the sampler's streams, which hash the same numbers.
    const TURN_SALT: u32 = 0x7f4a_7c15;
}

/// The difference is evaluated in turns: at one sample in every `difference_period`, from a random offset of the pixel's own, so that each
/// sample has the same chance; pixels that share take turns together. The number of the turn, or NONE if this sample has none.
pub fn difference_turn(scene: &PackedScene, pixel: u32, index: u32) -> u32 {
    let period = scene.pixels[pixel as usize].difference_period;
    if period <= 1 {
        return index;
    }
    let offset = turn_offset(scene, pixel, period);
    if (index + offset) % period == period - 1 {
        (index + offset) / period
    } else {
        NONE
    }
}

fn turn_offset(scene: &PackedScene, pixel: u32, period: u32) -> u32 {
    let shares = scene.pixels[pixel as usize].flags & PIXEL_SHARES != 0;
    let taking_turns = if shares {
        tile_of(scene.frame.width, pixel)
    } else {
        pixel
    };
    hash_u32(hash_combine(scene.frame.seed ^ TURN_SALT, taking_turns)) % period
}

/// The number of the sample among those that evaluate the difference, or NONE if it does not.
pub fn evaluation(scene: &PackedScene, pixel: u32, index: u32) -> u32 {
    if scene.frame.estimator == ESTIMATOR_PAPER {
        return index;
    }
    difference_turn(scene, pixel, index)
}

/// Evaluations of the difference among a pixel's samples before this one.
pub fn evaluations_before(scene: &PackedScene, pixel: u32, index: u32) -> u32 {
    let period = scene.pixels[pixel as usize].difference_period;
    if period <= 1 || scene.frame.estimator == ESTIMATOR_PAPER {
        return index;
    }
    (index + turn_offset(scene, pixel, period)) / period
}

/// Whether the sample is known to add nothing before its ray is even made.
pub fn is_without_turn(scene: &PackedScene, pixel: u32, index: u32) -> bool {
    let info = &scene.pixels[pixel as usize];
    info.difference_period > 1
        && info.flags & PIXEL_BEAM_MAY_MEET_VIRTUAL == 0
        && scene.frame.estimator != ESTIMATOR_PAPER
        && scene.frame.flags & FRAME_AOVS == 0
        && difference_turn(scene, pixel, index) == NONE
}

/// Begins a sample in a state that is new or done: sets up the primary ray. `real_pass` renders the real radiance and the mask alone, for pixels that need Ir.
pub fn begin_sample(
    scene: &PackedScene,
    st: &mut PathState,
    pixel: u32,
    index: u32,
    real_pass: bool,
) {
    renew(st, pixel, index);
    let may_meet_virtual = scene.pixels[pixel as usize].flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0;
    let direct = !real_pass && scene.frame.estimator != ESTIMATOR_PAPER;
    if direct && !may_meet_virtual {
        // The samples that have a turn are numbered by it, and so are spread over the pixel and the lens as a set of their own.
        let turn = difference_turn(scene, pixel, index);
        if turn != NONE {
            st.path.index = turn;
        } else if scene.frame.flags & FRAME_AOVS == 0 {
            return;
        }
        primary_missed_virtual(scene, st, turn != NONE);
    }
    // A replayed sample's primary ray was counted when it was first taken.
    st.rays.primary = u32::from(!real_pass);
    let u = sample_4d(sample_key(scene, st), 0);
    let x = (pixel % scene.frame.width) as f32 + u[0];
    let y = (pixel / scene.frame.width) as f32 + u[1];
    let mut pose = camera_pose(&scene.frame);
    if scene.frame.flags & FRAME_SHUTTER != 0 {
        let key = sample_key(scene, st);
        let share = shutter_share(&scene.frame, key, index, pixel / scene.frame.width);
        pose = camera_pose_at(&scene.frame, share);
    }
    let ray = camera_ray_from(&scene.frame, &pose, x, y, u[2], u[3]);
    st.ray.origin.position = ray.origin;
    st.ray.direction = ray.direction;
    if scene.frame.flags & FRAME_ALPHA != 0 {
        st.ray.opacity_seed = hash_combine(hash_combine(scene.frame.seed, pixel), st.path.index);
    }
    if real_pass {
        st.path.stage = STAGE_REAL_PASS;
        st.ray.request = if may_meet_virtual {
            REQUEST_CLOSEST_EACH
        } else {
            REQUEST_CLOSEST_REAL
        };
    } else if scene.frame.estimator == ESTIMATOR_PAPER {
        st.path.mode = MODE_SHARED;
        st.path.stage = STAGE_PATH;
        st.ray.request = REQUEST_CLOSEST_MIXED;
    } else if may_meet_virtual {
        st.path.stage = STAGE_PRIMARY_VIRTUAL;
        st.ray.request = REQUEST_CLOSEST_VIRTUAL;
    }
}

/// Consumes the hits in `st` and either asks for the next ray or finishes the sample.
pub fn advance(scene: &PackedScene, st: &mut PathState) {
    let mut goes_on = true;
    match st.path.stage {
        STAGE_PRIMARY_VIRTUAL => goes_on = primary_virtual(scene, st),
        STAGE_PRIMARY_REAL => primary_real(st),
        STAGE_PATH => goes_on = path_hit(scene, st),
        STAGE_PATH_SHADOW => path_shadow(scene, st),
        STAGE_PAPER_BEHIND => paper_behind(scene, st),
        STAGE_DIFFERENCE_SHADOW => difference_shadow(st),
        STAGE_DIFFERENCE_CONE => difference_cone(scene, st),
        STAGE_DIFFERENCE_BSDF => difference_bsdf(scene, st),
        STAGE_REAL_PASS => real_pass(scene, st),
        _ => {}
    }
    if goes_on {
        resume(scene, st);
    }
}

/// True where the virtual hit covers the real one.
pub fn virtual_is_nearer(hits: &Hits) -> bool {
    let Hits {
        in_real,
        in_virtual,
    } = hits;
    in_virtual.triangle != NONE
        && (in_real.triangle == NONE || in_virtual.t <= in_real.t * (1.0 + COINCIDENCE))
}

/// Nothing virtual was met: the difference is evaluated if the sample has a turn, before the real ray is paid for.
fn primary_missed_virtual(scene: &PackedScene, st: &mut PathState, has_turn: bool) {
    let period = scene.pixels[st.path.pixel as usize].difference_period;
    st.path.weight = if has_turn { period as f32 } else { 0.0 };
    st.path.throughput = Vec3::splat(st.path.weight);
    if has_turn || scene.frame.flags & FRAME_AOVS != 0 {
        st.path.stage = STAGE_PRIMARY_REAL;
        st.ray.request = REQUEST_CLOSEST_REAL;
    } else {
        st.path.stage = STAGE_DONE;
    }
}

/// False: the state already asks for its next ray, or is done.
fn primary_virtual(scene: &PackedScene, st: &mut PathState) -> bool {
    if st.hits.in_virtual.triangle == NONE {
        let has_turn = difference_turn(scene, st.path.pixel, st.path.index) != NONE;
        primary_missed_virtual(scene, st, has_turn);
    } else {
        st.path.stage = STAGE_PRIMARY_REAL;
        st.ray.request = REQUEST_CLOSEST_REAL;
        st.ray.t_max = st.hits.in_virtual.t;
    }
    false
}

fn primary_real(st: &mut PathState) {
    st.ray.depth = 1;
    if virtual_is_nearer(&st.hits) {
        st.result.mask = 1;
        st.path.mode = MODE_MIXED;
        st.path.events |= EVENT_FROM_LENS;
        plan_vertex(st, st.hits.in_virtual);
    } else if st.hits.in_real.triangle != NONE {
        // Without throughput the sample has no turn, and the vertex only fills the planes.
        st.path.mode = MODE_DIFFERENCE;
        plan_vertex(st, st.hits.in_real);
    }
}

fn plan_vertex(st: &mut PathState, hit: Hit) {
    st.path.pending |= PENDING_VERTEX;
    st.vertex_hit = hit;
}

fn record_first_hit(scene: &PackedScene, st: &mut PathState, s: &Surface) {
    let back = Vec3::from_slice(&scene.frame.camera_back[..3]);
    let camera = Vec3::from_slice(&scene.frame.camera_position[..3]);
    st.first_hit = FirstHit {
        normal: s.ns,
        depth_m: -(s.position - camera).dot(back),
        albedo: bsdf_albedo(s, -st.ray.direction),
        pad: 0,
    };
}

/// Moves on to whatever is still pending; the sample ends when nothing is.
fn resume(scene: &PackedScene, st: &mut PathState) {
    loop {
        if st.path.pending & PENDING_VERTEX != 0 {
            st.path.pending &= !PENDING_VERTEX;
            let s = surface_at(scene, st.vertex_hit, st.ray.direction);
            if scene.frame.flags & FRAME_AOVS != 0
                && st.ray.depth == 1
                && st.first_hit.depth_m == f32::INFINITY
            {
                record_first_hit(scene, st, &s);
            }
            shade_vertex(scene, st, &s);
            continue;
        }
        if st.path.pending & PENDING_SHADOW != 0 {
            st.path.pending &= !PENDING_SHADOW;
            st.path.stage = if st.path.mode == MODE_DIFFERENCE {
                STAGE_DIFFERENCE_SHADOW
            } else {
                STAGE_PATH_SHADOW
            };
            return;
        }
        if st.path.pending >= PENDING_LIGHT {
            st.ray.direction = st.real.segment.direction;
            plan_vertex(st, st.real.hit);
            continue;
        }
        if st.path.pending & PENDING_NEXT != 0 {
            st.path.pending &= !PENDING_NEXT;
            follow(st, st.next);
            if st.path.mode == MODE_DIFFERENCE {
                let smooth = st.path.events & EVENT_AT_POLISHED != 0;
                st.path.events = events_after(st.path.events, st.ray.depth, st.ray.side, smooth);
                st.path.stage = STAGE_DIFFERENCE_CONE;
                st.ray.request = REQUEST_VIRTUAL_THEN_REAL;
            } else {
                st.path.stage = STAGE_PATH;
                st.ray.request = if st.path.mode == MODE_REAL {
                    REQUEST_CLOSEST_REAL
                } else {
                    REQUEST_CLOSEST_MIXED
                };
            }
            return;
        }
        if st.path.pending & PENDING_REAL != 0 {
            let behind_pane = st.path.pending & PENDING_BEHIND_PANE != 0;
            st.path.pending &= !(PENDING_REAL | PENDING_BEHIND_PANE);
            end_cone_capture(st);
            st.path.mode = MODE_REAL;
            follow(st, st.real.segment);
            st.path.events = st.path.events & !EVENT_PASSED | EVENT_FROM_SHARED;
            if behind_pane {
                st.path.events |= EVENT_PASSED;
                st.passed_m = 0.0;
            }
            st.ray.depth = st.path.real_depth;
            plan_vertex(st, st.real.hit);
            continue;
        }
        if st.path.pending & PENDING_DIFFERENCE != 0 {
            st.path.pending &= !PENDING_DIFFERENCE;
            end_cone_capture(st);
            st.path.mode = MODE_DIFFERENCE;
            follow(st, st.difference.segment);
            st.path.events = st.difference.events | EVENT_SCATTERED;
            st.ray.origin = st.difference.origin;
            st.ray.side = 0;
            st.ray.depth = st.difference.depth;
            st.path.stage = STAGE_DIFFERENCE_BSDF;
            st.ray.request = st.difference.request;
            return;
        }
        end_capture(st);
        st.path.stage = STAGE_DONE;
        return;
    }
}

/// Goes on along a segment, as far as it leads.
fn follow(st: &mut PathState, segment: Segment) {
    st.ray.direction = segment.direction;
    st.ray.t_max = f32::INFINITY;
    st.path.density = segment.density;
    st.path.throughput = segment.throughput;
    st.path.medium = segment.medium;
    if segment.density != DELTA_DENSITY {
        st.path.events |= EVENT_SCATTERED;
    }
}

/// The segment being followed.
fn followed(st: &PathState) -> Segment {
    Segment {
        direction: st.ray.direction,
        density: st.path.density,
        throughput: st.path.throughput,
        medium: st.path.medium,
    }
}

/// The next vertex of a path, or its escape. False: the state already asks for its next ray.
fn path_hit(scene: &PackedScene, st: &mut PathState) -> bool {
    let virtual_first = st.path.mode != MODE_REAL && virtual_is_nearer(&st.hits);
    let hit = if virtual_first {
        st.hits.in_virtual
    } else {
        st.hits.in_real
    };
    st.ray.depth += 1;
    if hit.triangle == NONE {
        path_escape(scene, st);
        return true;
    }
    if st.path.mode == MODE_SHARED && virtual_first {
        // Rule 3 of the paper: a real ray continues in the same direction behind the virtual hit.
        if st.ray.depth == 1 {
            st.result.mask = 1;
        }
        st.path.stage = STAGE_PAPER_BEHIND;
        st.ray.request = REQUEST_CLOSEST_REAL;
        return false;
    }
    plan_vertex(st, hit);
    true
}

fn paper_behind(scene: &PackedScene, st: &mut PathState) {
    if st.hits.in_real.triangle != NONE {
        st.path.pending |= PENDING_REAL;
        st.real = RealPath {
            segment: followed(st),
            hit: st.hits.in_real,
        };
        st.path.real_depth = st.ray.depth;
    } else {
        st.path.mode = MODE_REAL;
        path_escape(scene, st);
    }
    st.path.mode = MODE_MIXED;
    st.path.events |= EVENT_FROM_SHARED;
    if st.ray.depth == 1 {
        st.path.events |= EVENT_FROM_LENS;
    }
    plan_vertex(st, st.hits.in_virtual);
}

/// A path left the scene: the environment, weighted against the technique that samples it as a light.
fn path_escape(scene: &PackedScene, st: &mut PathState) {
    let seen_past_panes = st.path.events & EVENT_PASSED != 0;
    if st.ray.depth == 1 && scene.frame.flags & FRAME_ENV_DRAWN == 0 && !seen_past_panes {
        return;
    }
    let mut light = escaping_light(scene, st);
    if left_to_photons(scene, st) {
        light *= share_left_to_eye(scene, st.ray.direction);
    }
    accumulate(scene, st, light);
}

fn escaping_light(scene: &PackedScene, st: &PathState) -> Vec3 {
    let backdrop = sees_backdrop(scene, st).then(|| backdrop_behind(scene, st));
    if st.path.density == DELTA_DENSITY {
        let radiance = backdrop.unwrap_or_else(|| env_radiance(scene, st.ray.direction));
        return st.path.throughput * radiance;
    }
    let (environment, pdf) = env_arriving(scene, st.ray.direction);
    let radiance = backdrop.unwrap_or(environment);
    st.path.throughput * radiance * density_weight(st.path.density, pdf)
}

/// What the path sees of the photograph. Past panes alone it is what its own pixel shows.
fn backdrop_behind(scene: &PackedScene, st: &PathState) -> Vec3 {
    if st.ray.depth == 1 {
        return backdrop_of_pixel(scene, st.path.pixel);
    }
    backdrop_radiance(scene, st.ray.origin.position, st.ray.direction)
}

fn path_shadow(scene: &PackedScene, st: &mut PathState) {
    let open_real = open_share_real(st);
    let open_mixed = open_share(st.hits.in_virtual) * open_real;
    let light = st.path.shadow_contribution;
    if st.path.mode == MODE_SHARED {
        if open_mixed != Vec3::ZERO {
            st.result.radiance += light * open_mixed;
        }
        if st.ray.request == REQUEST_SHADOW_PAIR && open_real != Vec3::ZERO {
            st.radiance_real += light * open_real;
        }
        return;
    }
    if open_mixed != Vec3::ZERO {
        accumulate(scene, st, light * open_mixed);
    }
}

/// A difference shadow ray contributes as far as only something virtual blocks a real light, or as nothing blocks a virtual one.
fn difference_shadow(st: &mut PathState) {
    let open_virtual = open_share(st.hits.in_virtual);
    let mut share = open_share_real(st);
    if st.ray.request == REQUEST_SHADOW_DIFFERENCE {
        share *= Vec3::ONE - open_virtual;
    } else {
        share *= open_virtual;
    }
    if share != Vec3::ZERO {
        st.result.radiance += st.path.shadow_contribution * share;
    }
}

/// A direction inside the cones counts only where virtual geometry is nearer.
fn difference_cone(scene: &PackedScene, st: &mut PathState) {
    if virtual_is_nearer(&st.hits) {
        split_difference(scene, st);
    }
}

/// A direction drawn from the BSDF: the recursion where real geometry is nearer, the other half of (b) where virtual geometry is.
fn difference_bsdf(scene: &PackedScene, st: &mut PathState) {
    if virtual_is_nearer(&st.hits) {
        let left_to_cones = st.ray.request == REQUEST_REAL_UNLESS_COVERED;
        if !left_to_cones {
            if st.path.density != DELTA_DENSITY {
                // The cones could have drawn it too: the balance heuristic divides by the sum.
                let total = st.path.density + vertex_cone_density(scene, st);
                st.path.throughput *= st.path.density / total;
                st.path.density = total;
            }
            split_difference(scene, st);
        }
    } else if st.hits.in_real.triangle != NONE && st.ray.depth < scene.frame.max_bounces {
        st.ray.depth += 1;
        plan_vertex(st, st.hits.in_real);
    }
}

/// Effective density of the cone technique at the vertex that the present ray leaves.
fn vertex_cone_density(scene: &PackedScene, st: &PathState) -> f32 {
    let probability = st.difference.cone_probability;
    if probability == 0.0 {
        return 0.0;
    }
    probability
        * cone_pdf(
            &cones_at(&scene.frame, st.ray.origin.position, st.difference.normal),
            st.ray.direction,
        )
}

/// Virtual geometry is nearer: its radiance counts, and what the real world shows behind it is taken away.
fn split_difference(scene: &PackedScene, st: &mut PathState) {
    if st.hits.in_real.triangle == NONE {
        st.result.radiance -= escaping_light(scene, st);
    } else {
        st.path.pending |= PENDING_REAL;
        if is_pane(scene, st.hits.in_virtual, st.ray.direction) {
            st.path.pending |= PENDING_BEHIND_PANE;
        }
        let mut segment = followed(st);
        segment.throughput = -segment.throughput;
        st.real = RealPath {
            segment,
            hit: st.hits.in_real,
        };
        st.path.real_depth = st.ray.depth + 1;
    }
    st.path.mode = MODE_MIXED;
    st.path.events |= EVENT_FROM_SHARED;
    st.ray.depth += 1;
    plan_vertex(st, st.hits.in_virtual);
}

/// Real pass: the real radiance along the primary ray, and whether something virtual covers it.
fn real_pass(scene: &PackedScene, st: &mut PathState) {
    if virtual_is_nearer(&st.hits) {
        st.result.mask = 1;
    }
    st.path.mode = MODE_REAL;
    st.ray.depth = 1;
    if st.hits.in_real.triangle == NONE {
        path_escape(scene, st);
    } else {
        plan_vertex(st, st.hits.in_real);
    }
}
