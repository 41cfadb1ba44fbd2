//! One vertex of any path: emission, next event, cone direction, continuation. WGSL twin: `shaders/vertex.wgsl`.

use glam::Vec3;

use super::contribution::*;
use super::state::*;
use crate::light::cones::{
    cone_pdf, cone_sample, cone_solid_angle_fraction, direction_meets_spheres,
};
use crate::light::lights::{LightSample, light_pdf_hit, light_sample};
use crate::material::{
    Surface, bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_is_lambertian, bsdf_sample,
};
use crate::math::exp_;
use crate::packed::{MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT, NONE, PackedScene};

/// Paths shorter than this are never ended by roulette.
const ROULETTE_FROM_DEPTH: u32 = 2;
/// A continuation is followed for certain while its largest channel times this is at least 1.
const ROULETTE_GAIN: f32 = 4.0;
/// The cones and the recursion are followed for certain where their expected contribution times this is at least 1, and never with less
/// than the floor's probability.
const CONE_ROULETTE_GAIN: f32 = 8.0;
const CONE_ROULETTE_FLOOR: f32 = 0.1;
const RECURSION_ROULETTE_GAIN: f32 = 1.0;
const RECURSION_ROULETTE_FLOOR: f32 = 0.1;
/// A light's own surface must not block it: shadow rays end this much short of it, relative to the distance and in position errors.
const SHADOW_SHORTEN: f32 = 2e-5;
const SHADOW_SHORTEN_ERRORS: f32 = 4.0;

/// Lights drawn at the first difference vertex, of which one is traced: most directions meet nothing virtual and cost no ray.
const DIFFERENCE_LIGHTS: u32 = 4;
/// Surfaces that scatter nothing.
const EMITS_ONLY: u32 = MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;

/// With what probability the techniques of a difference vertex are played.
#[derive(Clone, Copy)]
struct Roulette {
    cone: f32,
    bsdf: f32,
}

/// Adds the emission at the vertex and plans its shadow ray and continuations. A difference vertex (mode `MODE_DIFFERENCE`) does not emit,
/// for both worlds see it; its throughput multiplies the difference there.
pub fn shade_vertex(scene: &PackedScene, st: &mut PathState, s: &Surface) {
    let difference = st.mode == MODE_DIFFERENCE;
    let wo = -st.direction;
    let distance = st.vertex_hit.t;
    if !difference {
        if st.medium != NONE {
            let sigma = scene.materials[st.medium as usize].sigma_a;
            st.throughput *= Vec3::new(
                exp_(-sigma[0] * distance),
                exp_(-sigma[1] * distance),
                exp_(-sigma[2] * distance),
            );
        }
        add_emission(scene, st, s, distance);
    }
    if st.depth > scene.frame.max_bounces
        || s.flags & EMITS_ONLY != 0
        || st.throughput == Vec3::ZERO
    {
        return;
    }
    st.position = s.position;
    st.offset = s.ng * s.error;
    st.side = if st.vertex_hit.triangle >= scene.frame.real_triangle_count {
        1
    } else {
        0
    };
    st.real_t_min = scene.materials[s.material as usize].self_shadow_bias;

    let mut roulette = Roulette {
        cone: 1.0,
        bsdf: 1.0,
    };
    if difference {
        let strength = (st.throughput * bsdf_albedo(s, wo)).abs().max_element();
        let reach = cone_solid_angle_fraction(&scene.frame, s.position, s.ns);
        roulette.cone = (CONE_ROULETTE_GAIN * strength * reach).clamp(CONE_ROULETTE_FLOOR, 1.0);
        if bsdf_is_lambertian(s) {
            roulette.bsdf =
                (RECURSION_ROULETTE_GAIN * strength).clamp(RECURSION_ROULETTE_FLOOR, 1.0);
        }
    }
    next_event(scene, st, s, wo, roulette);
    if difference {
        plan_cone(scene, st, s, wo, roulette);
    }
    plan_continuation(scene, st, s, wo, roulette);
}

fn add_emission(scene: &PackedScene, st: &mut PathState, s: &Surface, distance: f32) {
    if s.emission.max_element() <= 0.0 {
        return;
    }
    let mut weight = 1.0;
    if s.light != NONE && st.density != DELTA_DENSITY {
        weight = density_weight(
            st.density,
            light_pdf_hit(
                scene,
                s.light,
                s.position - st.direction * distance,
                st.direction,
                distance,
            ),
        );
    }
    let light = st.throughput * s.emission * weight;
    accumulate(scene, st, light);
}

/// Lights drawn at the present vertex.
fn light_draws(st: &PathState) -> u32 {
    if st.mode == MODE_DIFFERENCE && st.depth == 1 {
        DIFFERENCE_LIGHTS
    } else {
        1
    }
}

/// Draws lights and plans one shadow ray, to the light chosen in proportion to what it would contribute (resampled importance sampling,
/// Talbot 2005). At a difference vertex the technique competes with the cones (at their effective density) and, unless the surface is
/// Lambertian, with the BSDF.
fn next_event(scene: &PackedScene, st: &mut PathState, s: &Surface, wo: Vec3, roulette: Roulette) {
    if scene.frame.light_count == 0 || bsdf_is_delta(s) {
        return;
    }
    let difference = st.mode == MODE_DIFFERENCE;
    let set = if difference {
        SET_DIFFERENCE_LIGHT
    } else {
        SET_PATH_LIGHT
    };
    let count = light_draws(st);
    let mut choice = [0.0; 4];
    if count > 1 {
        choice = draw(scene, st, SET_DIFFERENCE_CHOICE);
    }
    let mut sum = 0.0;
    let mut chosen_size = 1.0;
    let mut contribution = Vec3::ZERO;
    for j in 0..count {
        let l = light_sample(scene, s.position, draw_of(scene, st, set, j, count));
        let candidate = light_contribution(scene, st, s, wo, roulette, &l, count as f32);
        let size = candidate.abs().max_element();
        sum += size;
        if size > 0.0 && choice[j as usize] * sum < size {
            contribution = candidate;
            chosen_size = size;
            plan_shadow(st, s, &l);
        }
    }
    st.shadow_contribution = contribution * (sum / (chosen_size * count as f32));
}

/// What a drawn light adds if nothing hides it (or, for the difference, if only something virtual does); zero if that cannot be.
fn light_contribution(
    scene: &PackedScene,
    st: &PathState,
    s: &Surface,
    wo: Vec3,
    roulette: Roulette,
    l: &LightSample,
    count: f32,
) -> Vec3 {
    let difference = st.mode == MODE_DIFFERENCE;
    let real_light = l.side == 0;
    if l.pdf <= 0.0 || (st.mode == MODE_REAL && !real_light) {
        return Vec3::ZERO;
    }
    if difference && real_light && !direction_meets_spheres(&scene.frame, s.position, l.direction) {
        return Vec3::ZERO;
    }
    let f = bsdf_eval(s, wo, l.direction);
    if f.f_cos.max_element() <= 0.0 {
        return Vec3::ZERO;
    }
    let mut weight = 1.0;
    if !l.delta {
        let mut other = f.pdf;
        if difference {
            other = roulette.cone * cone_pdf(&scene.frame, s.position, s.ns, l.direction);
            if !bsdf_is_lambertian(s) {
                other += f.pdf;
            }
        }
        weight = density_weight(count * l.pdf, other);
    }
    let sign = if difference && real_light { -1.0 } else { 1.0 };
    st.throughput * f.f_cos * l.radiance * (sign * weight / l.pdf)
}

fn plan_shadow(st: &mut PathState, s: &Surface, l: &LightSample) {
    st.shadow_direction = l.direction;
    st.shadow_t_max = if l.distance < f32::INFINITY {
        l.distance - SHADOW_SHORTEN * l.distance - SHADOW_SHORTEN_ERRORS * s.error
    } else {
        f32::INFINITY
    };
    let real_light = l.side == 0;
    st.shadow_request = match st.mode {
        MODE_DIFFERENCE if real_light => REQUEST_SHADOW_DIFFERENCE,
        MODE_REAL => REQUEST_SHADOW_REAL,
        MODE_SHARED if real_light => REQUEST_SHADOW_PAIR,
        _ => REQUEST_SHADOW_MIXED,
    };
    st.pending |= PENDING_SHADOW;
}

/// (b): a direction inside the cones of the virtual bounding spheres.
fn plan_cone(scene: &PackedScene, st: &mut PathState, s: &Surface, wo: Vec3, roulette: Roulette) {
    let u = draw(scene, st, SET_DIFFERENCE_CONE);
    if scene.frame.sphere_count == 0 || u[3] >= roulette.cone {
        return;
    }
    let c = cone_sample(&scene.frame, s.position, s.ns, [u[0], u[1], u[2]]);
    if c.pdf <= 0.0 {
        return;
    }
    let f = bsdf_eval(s, wo, c.direction);
    if f.f_cos.max_element() <= 0.0 {
        return;
    }
    let mut density = roulette.cone * c.pdf;
    if !bsdf_is_lambertian(s) {
        density += f.pdf;
    }
    st.pending |= PENDING_NEXT;
    st.next_direction = c.direction;
    st.next_throughput = st.throughput * f.f_cos * (1.0 / density);
    st.next_density = density / light_draws(st) as f32;
}

/// The BSDF's own direction: the path's next ray, or (c) the recursion of the difference.
fn plan_continuation(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    wo: Vec3,
    roulette: Roulette,
) {
    let difference = st.mode == MODE_DIFFERENCE;
    if difference && bsdf_is_lambertian(s) && st.depth >= scene.frame.max_bounces {
        return;
    }
    let u = draw(
        scene,
        st,
        if difference {
            SET_DIFFERENCE_BSDF
        } else {
            SET_PATH_BSDF
        },
    );
    if u[3] >= roulette.bsdf {
        return;
    }
    let b = bsdf_sample(s, wo, [u[0], u[1], u[2]]);
    if !b.valid {
        return;
    }
    let density = if b.delta { DELTA_DENSITY } else { b.pdf };
    let mut throughput = st.throughput * b.weight;
    if difference {
        st.pending |= PENDING_DIFFERENCE;
        st.difference_position = st.position;
        st.difference_offset = st.offset;
        st.difference_t_min = st.real_t_min;
        st.difference_depth = st.depth;
        st.difference_direction = b.wi;
        st.difference_lambertian = bsdf_is_lambertian(s);
        st.difference_normal = s.ns;
        st.difference_cone_probability = roulette.cone / light_draws(st) as f32;
        st.difference_density = if b.delta {
            DELTA_DENSITY
        } else {
            b.pdf / light_draws(st) as f32
        };
        st.difference_throughput = throughput * (1.0 / roulette.bsdf);
        return;
    }
    if st.depth >= ROULETTE_FROM_DEPTH {
        let survival = (ROULETTE_GAIN * throughput.abs().max_element()).min(1.0);
        if u[3] >= survival {
            return;
        }
        throughput *= 1.0 / survival;
    }
    if b.transmitted && s.flags & MATERIAL_THIN_WALLED == 0 {
        st.medium = if s.front { s.material } else { NONE };
    }
    st.pending |= PENDING_NEXT;
    st.next_direction = b.wi;
    st.next_throughput = throughput;
    st.next_density = density;
}
