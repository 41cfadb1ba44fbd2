//! One vertex of any path: emission, next event, cone direction, continuation. WGSL twin: `shaders/cpu/vertex.wgsl`.

use glam::Vec3;

use super::contribution::*;
use super::panes::{
    distance_from_vertex, draw_at_pane, is_shared, may_leave_no_vertex, pass_straight,
    transmittance,
};
use super::points::{keep_first_vertex, offer_point};
use super::state::*;
use crate::camera::sampler::SampleSet;
use crate::light::backdrop::backdrop_radiance;
use crate::light::blocking::light_may_be_blocked;
use crate::light::cones::{
    Cones, cone_pdf, cone_sample, cone_solid_angle_fraction, cones_at, direction_meets_spheres,
};
use crate::light::environment::share_left_to_eye;
use crate::light::guide::{GUIDE_SHARE, guide_cell, guide_count, guide_pdf, guide_sample};
use crate::light::lights::{LightSample, light_pdf_hit, light_sample, light_select};
use crate::material::{
    BsdfSample, Surface, bsdf_albedo, bsdf_eval, bsdf_is_delta, bsdf_is_diffuse,
    bsdf_is_lambertian, bsdf_is_polished, bsdf_passes_straight, bsdf_sample, bsdf_straight,
};
use crate::math::{dot3, safe_sqrt};
use crate::packed::{
    ESTIMATOR_PAPER, FRAME_BOTH_SHADOWS, FRAME_LIGHTS_SUFFICE, FRAME_NO_CONES,
    FRAME_NO_LAST_VERTEX, FRAME_PANES, LIGHT_ENVIRONMENT, MATERIAL_QUAD_LIGHT,
    MATERIAL_THIN_WALLED, MATERIAL_UNLIT, NONE, PackedScene, SIDE_REAL, SIDE_VIRTUAL,
};
use crate::shared::shared;

shared! {
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
    pub const SHADOW_SHORTEN: f32 = 2e-5;
    pub const SHADOW_SHORTEN_ERRORS: f32 = 4.0;

    /// Lights drawn at the first vertex of a difference where the cones cover this share of what is above it: the noise of contact shadows is theirs,
    /// and shadow rays cost little beside the rest of a sample.
    const CONTACT_LIGHTS: u32 = 4;
    const CONTACT_REACH: f32 = 0.25;
    /// And where the camera first meets a virtual surface of blurred lobes alone: highlights are bright, and which lights were drawn is their noise.
    const GLOSSY_LIGHTS: u32 = 8;

    /// A density below it is none.
    const MIN_POSITIVE: f32 = f32::MIN_POSITIVE;

    /// Surfaces that scatter nothing.
    pub const EMITS_ONLY: u32 = MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT;
}

/// What the techniques of a difference vertex share.
struct Techniques {
    cones: Cones,
    /// With what probability (b) and (c) are played.
    cone_probability: f32,
    bsdf_probability: f32,
    /// How many are drawn.
    lights: u32,
}

fn is_difference(st: &PathState) -> bool {
    st.path.mode == MODE_DIFFERENCE
}

/// Adds the emission at the vertex and plans its shadow ray and continuations. A difference vertex (mode `MODE_DIFFERENCE`) does not emit,
/// for both worlds see it; its throughput multiplies the difference there.
pub fn shade_vertex(scene: &PackedScene, st: &mut PathState, s: &Surface) {
    let difference = is_difference(st);
    let wo = -st.ray.direction;
    let distance = st.vertex_hit.t;
    if st.path.pending < PENDING_LIGHT {
        st.path.throughput *= transmittance(scene, st.path.medium, distance);
        if !difference {
            add_emission(scene, st, s);
        }
    }
    let past_last = st.ray.depth > scene.frame.max_bounces;
    if past_last && scene.frame.flags & FRAME_PANES == 0
        || s.flags & EMITS_ONLY != 0
        || st.path.throughput == Vec3::ZERO
    {
        return;
    }
    stand_at(scene, st, s, distance);
    if past_last {
        // Lights are still seen through panes.
        if may_leave_no_vertex(scene, st, s, wo) {
            let direction = st.ray.direction;
            let throughput = st.path.throughput * bsdf_straight(s, wo);
            pass_straight(st, direction, throughput, medium_along(st, s, direction));
        }
        return;
    }
    offer_point(scene, st, s);

    if difference && is_smooth(&scene.frame, s, st.ray.side, st.ray.depth == 1) {
        st.path.events |= EVENT_AT_POLISHED;
    }
    let techniques = difference.then(|| techniques_at(scene, st, s, wo));
    // The directions of a path are drawn for certain.
    let (cones, bsdf) = techniques
        .as_ref()
        .map_or((0.0, 1.0), |t| (t.cone_probability, t.bsdf_probability));
    keep_first_vertex(scene, st, s, cones, bsdf);
    draw_lights(scene, st, s, wo, techniques.as_ref());
    if st.path.pending >= PENDING_LIGHT || lights_suffice(scene, st, s) {
        return;
    }
    if let Some(techniques) = &techniques {
        plan_cone(scene, st, s, wo, techniques);
    }
    plan_continuation(scene, st, s, wo, techniques.as_ref());
}

/// The next rays leave the vertex.
pub fn stand_at(scene: &PackedScene, st: &mut PathState, s: &Surface, distance: f32) {
    let side = if st.vertex_hit.triangle < scene.frame.real_triangle_count {
        SIDE_REAL
    } else {
        SIDE_VIRTUAL
    };
    let leaves_coinciding_real =
        side == SIDE_VIRTUAL && st.ray.side == SIDE_REAL && coincides(st, s, distance);
    let reach = 1.0 + COINCIDENCE * distance / s.error;
    st.ray.origin = RayOrigin {
        position: s.position,
        real_t_min: scene.materials[s.material as usize].self_shadow_bias,
        offset: s.ng * s.error,
        coincidence_ratio: if leaves_coinciding_real {
            -reach
        } else {
            reach
        },
    };
    st.ray.side = side;
}

/// Whether the light drawn at the vertex is all the light there is to find: past the last vertex a path finds only emitters. (`paper` traces
/// the rays of its rules all the same.)
fn lights_suffice(scene: &PackedScene, st: &PathState, s: &Surface) -> bool {
    st.ray.depth >= scene.frame.max_bounces
        && scene.frame.flags & (FRAME_LIGHTS_SUFFICE | FRAME_NO_LAST_VERTEX) == FRAME_LIGHTS_SUFFICE
        && scene.frame.estimator != ESTIMATOR_PAPER
        && bsdf_is_lambertian(s)
}

/// What the cones cover is left to them: a Lambertian surface has no direction that the BSDF draws better.
fn left_to_cones(scene: &PackedScene, s: &Surface) -> bool {
    bsdf_is_lambertian(s) && scene.frame.flags & FRAME_NO_CONES == 0
}

fn techniques_at(scene: &PackedScene, st: &PathState, s: &Surface, wo: Vec3) -> Techniques {
    if scene.frame.flags & FRAME_NO_CONES != 0 {
        return Techniques {
            cones: Cones::default(),
            cone_probability: 0.0,
            bsdf_probability: 1.0,
            lights: 1,
        };
    }
    let cones = cones_at(&scene.frame, s.position, s.ns);
    let strength = (st.path.throughput * bsdf_albedo(s, wo))
        .abs()
        .max_element();
    let reach = cone_solid_angle_fraction(&cones);
    let mut cone_probability = 0.0;
    if scene.frame.sphere_count > 0 {
        cone_probability = (CONE_ROULETTE_GAIN * strength * reach).clamp(CONE_ROULETTE_FLOOR, 1.0);
    }
    let mut bsdf_probability = 1.0;
    if bsdf_is_lambertian(s) {
        bsdf_probability =
            (RECURSION_ROULETTE_GAIN * strength).clamp(RECURSION_ROULETTE_FLOOR, 1.0);
    }
    let in_contact = st.ray.depth == 1 && reach >= CONTACT_REACH;
    Techniques {
        cones,
        cone_probability,
        bsdf_probability,
        lights: if in_contact { CONTACT_LIGHTS } else { 1 },
    }
}

/// Whether the surface reached lies in the plane of the one that the ray has left, as far as their errors tell.
fn coincides(st: &PathState, s: &Surface, distance: f32) -> bool {
    let offset = st.ray.origin.offset;
    let error2 = dot3(offset, offset);
    let ratio = st.ray.origin.coincidence_ratio;
    let errors = 2.0 * (error2 * (1.0 + ratio) + safe_sqrt(error2) * s.error);
    dot3(st.ray.direction, offset).abs() * distance <= errors
}

fn add_emission(scene: &PackedScene, st: &mut PathState, s: &Surface) {
    if s.emission.max_element() <= 0.0 {
        return;
    }
    if s.light != NONE
        && scene.lights[s.light as usize].photon_pdf > 0.0
        && left_to_photons(scene, st)
    {
        return;
    }
    let mut weight = 1.0;
    if s.light != NONE && st.path.density != DELTA_DENSITY {
        let direction = st.ray.direction;
        let distance = distance_from_vertex(st);
        let from_position = s.position - direction * distance;
        let pdf = light_pdf_hit(scene, s.light, from_position, direction, distance);
        weight = density_weight(st.path.density, pdf);
    }
    let light = st.path.throughput * s.emission * weight;
    accumulate(scene, st, light);
}

/// Lights drawn at a path's vertex.
fn path_lights(scene: &PackedScene, st: &PathState, s: &Surface) -> u32 {
    let seen_first = st.path.mode == MODE_MIXED && st.ray.depth == 1;
    let blurred = !bsdf_is_diffuse(s) && !bsdf_is_polished(s);
    if scene.frame.estimator != ESTIMATOR_PAPER && seen_first && blurred {
        GLOSSY_LIGHTS
    } else {
        1
    }
}

/// Draws the vertex's lights up to the next that asks for a shadow ray. Those that are left stay pending: the vertex is shaded again after it.
fn draw_lights(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    wo: Vec3,
    techniques: Option<&Techniques>,
) {
    let count = techniques.map_or_else(|| path_lights(scene, st, s), |t| t.lights);
    let mut left = st.path.pending / PENDING_LIGHT;
    st.path.pending %= PENDING_LIGHT;
    if left == 0 {
        left = count;
    }
    while left > 0 && st.path.pending & PENDING_SHADOW == 0 {
        next_event(scene, st, s, wo, techniques, count - left, count);
        left -= 1;
    }
    if left > 0 {
        st.path.pending |= left * PENDING_LIGHT;
        st.real.segment.direction = -wo;
        st.real.hit = st.vertex_hit;
    }
}

/// Draws the light with this number of `count` and plans its shadow ray. At a difference vertex the technique competes with the cones (at their effective density) and, unless
/// the surface is Lambertian, with the BSDF.
fn next_event(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    wo: Vec3,
    techniques: Option<&Techniques>,
    number: u32,
    count: u32,
) {
    if scene.frame.light_count == 0 || bsdf_is_delta(s) {
        return;
    }
    let difference = is_difference(st);
    let set = if difference {
        SET_DIFFERENCE_LIGHT
    } else {
        SET_PATH_LIGHT
    };
    let u = draw_one_of(scene, st, set, number, count);
    let mut index = 0;
    if scene.frame.light_count > 1 {
        let [choice, coin] = u.second_pair();
        index = light_select(scene, choice, coin);
    }
    if difference
        && scene.frame.flags & FRAME_BOTH_SHADOWS == 0
        && !light_may_be_blocked(&scene.frame, &scene.lights[index as usize], s.position)
    {
        return;
    }
    let mut l = light_sample(scene, index, s.position, u.pair());
    if scene.lights[index as usize].kind == LIGHT_ENVIRONMENT
        && sees_backdrop(scene, st)
        && from_lens_after(
            st,
            s,
            false,
            is_smooth(&scene.frame, s, st.ray.side, st.ray.depth == 1),
        ) != 0
    {
        l.radiance = backdrop_radiance(scene, s.position, l.direction);
    }
    let mut contribution =
        light_contribution(scene, st, s, wo, techniques, &l) * (1.0 / count as f32);
    if vertex_left_to_photons(scene, st, s) {
        contribution *= light_left_to_eye(scene, index, l.direction);
    }
    if contribution != Vec3::ZERO {
        plan_shadow(st, s, &l, contribution);
    }
}

/// Share of a light from `direction` that the eye's paths bring by way of smooth and polished virtual surfaces.
fn light_left_to_eye(scene: &PackedScene, index: u32, direction: Vec3) -> f32 {
    let light = &scene.lights[index as usize];
    if light.kind == LIGHT_ENVIRONMENT {
        return share_left_to_eye(scene, direction);
    }
    if light.photon_pdf > 0.0 { 0.0 } else { 1.0 }
}

/// What a drawn light adds if nothing hides it (or, for the difference, if only something virtual does); zero if that cannot be.
fn light_contribution(
    scene: &PackedScene,
    st: &PathState,
    s: &Surface,
    wo: Vec3,
    techniques: Option<&Techniques>,
    l: &LightSample,
) -> Vec3 {
    let difference = is_difference(st);
    let real_light = l.side == SIDE_REAL;
    if l.pdf <= 0.0 || (st.path.mode == MODE_REAL && !real_light) {
        return Vec3::ZERO;
    }
    if difference
        && real_light
        && scene.frame.flags & FRAME_BOTH_SHADOWS == 0
        && !direction_meets_spheres(&scene.frame, s.position, l.direction)
    {
        return Vec3::ZERO;
    }
    let f = bsdf_eval(s, wo, l.direction);
    if f.f_cos.max_element() <= 0.0 {
        return Vec3::ZERO;
    }
    let mut weight = 1.0;
    if !l.delta && !lights_suffice(scene, st, s) {
        let mut other = path_pdf(scene, st, s, l.direction, f.pdf);
        if let Some(t) = techniques {
            other = t.cone_probability * cone_pdf(&t.cones, l.direction);
            if !left_to_cones(scene, s) {
                other += f.pdf;
            }
        }
        weight = density_weight(l.pdf, other);
    }
    let sign = if difference && real_light { -1.0 } else { 1.0 };
    st.path.throughput * f.f_cos * l.radiance * (sign * weight / l.pdf)
}

/// The next ray asked for is the shadow ray: what else the vertex plans comes after it.
fn plan_shadow(st: &mut PathState, s: &Surface, l: &LightSample, contribution: Vec3) {
    st.path.shadow_contribution = contribution;
    st.ray.direction = l.direction;
    st.ray.t_max = if l.distance < f32::INFINITY {
        l.distance - SHADOW_SHORTEN * l.distance - SHADOW_SHORTEN_ERRORS * s.error
    } else {
        f32::INFINITY
    };
    let real_light = l.side == SIDE_REAL;
    st.ray.request = match st.path.mode {
        MODE_DIFFERENCE if real_light => REQUEST_SHADOW_DIFFERENCE,
        MODE_REAL => REQUEST_SHADOW_REAL,
        MODE_SHARED if real_light => REQUEST_SHADOW_PAIR,
        _ => REQUEST_SHADOW_MIXED,
    };
    st.path.events &= !EVENT_LIGHT_LEFT_TO_PATH;
    if is_shared(st) && !l.delta {
        st.path.events |= EVENT_LIGHT_LEFT_TO_PATH;
    }
    st.path.pending |= PENDING_SHADOW;
}

/// Roulette by the last number of a set.
pub fn plays(u: &SampleSet, probability: f32) -> bool {
    probability >= 1.0 || u.fourth() < probability
}

/// (b): a direction inside the cones of the virtual bounding spheres. Those about the shading normal leave nothing out: Lambert's mirrored
/// cosine is 0 under its horizon.
fn plan_cone(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    wo: Vec3,
    techniques: &Techniques,
) {
    let u = draw(scene, st, SET_DIFFERENCE_CONE);
    if !plays(&u, techniques.cone_probability) {
        return;
    }
    let c = cone_sample(&techniques.cones, u.third(), u.pair());
    if c.pdf <= 0.0 {
        return;
    }
    let f = bsdf_eval(s, wo, c.direction);
    if f.f_cos.max_element() <= 0.0 {
        return;
    }
    let mut density = techniques.cone_probability * c.pdf;
    if !bsdf_is_lambertian(s) {
        density += f.pdf;
    }
    st.path.pending |= PENDING_NEXT;
    st.next = Segment {
        direction: c.direction,
        density,
        throughput: st.path.throughput * f.f_cos * (1.0 / density),
        medium: medium_along(st, s, c.direction),
    };
}

/// Material whose volume a direction from the vertex leads through, or NONE.
pub fn medium_along(st: &PathState, s: &Surface, direction: Vec3) -> u32 {
    if s.flags & MATERIAL_THIN_WALLED != 0 || s.ng.dot(direction) >= 0.0 {
        return st.path.medium;
    }
    if s.front { s.material } else { NONE }
}

/// Share of the directions of a path that the guide draws: at the first vertex that scatters, where the camera sees it by way of smooth surfaces.
fn guided_share(scene: &PackedScene, st: &PathState, s: &Surface) -> f32 {
    if scene.frame.guide_cell_count == 0
        || st.path.mode != MODE_MIXED
        || st.ray.depth == 1
        || st.path.events & EVENT_SCATTERED != 0
        || bsdf_is_polished(s)
        || guide_count(scene, guide_cell(scene, s.position)) == 0
    {
        return 0.0;
    }
    GUIDE_SHARE
}

/// Density with which a path's direction is drawn, `bsdf_pdf` being the BSDF's.
fn path_pdf(
    scene: &PackedScene,
    st: &PathState,
    s: &Surface,
    direction: Vec3,
    bsdf_pdf: f32,
) -> f32 {
    let share = guided_share(scene, st, s);
    if share == 0.0 {
        return bsdf_pdf;
    }
    let cell = guide_cell(scene, s.position);
    (1.0 - share) * bsdf_pdf + share * guide_pdf(scene, cell, s.position, direction)
}

/// A path's next direction, by the BSDF or, with the probability `share`, by the guide.
fn path_sample(
    scene: &PackedScene,
    st: &PathState,
    s: &Surface,
    wo: Vec3,
    u: [f32; 3],
    share: f32,
) -> BsdfSample {
    let mut b = bsdf_sample(s, wo, u);
    if share == 0.0 {
        return b;
    }
    let guide = draw(scene, st, SET_DIFFERENCE_CONE);
    if guide.third() < share {
        let cell = guide_cell(scene, s.position);
        b.wi = guide_sample(scene, cell, s.position, guide.fourth(), guide.pair());
        b.delta = false;
    } else if !b.valid {
        return b;
    }
    if b.delta {
        b.weight *= 1.0 / (1.0 - share);
        return b;
    }
    let f = bsdf_eval(s, wo, b.wi);
    b.pdf = path_pdf(scene, st, s, b.wi, f.pdf);
    b.valid = b.pdf > 0.0 && f.f_cos.max_element() > 0.0;
    b.weight = f.f_cos * (1.0 / b.pdf.max(MIN_POSITIVE));
    b
}

/// The BSDF's own direction: the path's next ray, or (c) the recursion of the difference.
fn plan_continuation(
    scene: &PackedScene,
    st: &mut PathState,
    s: &Surface,
    wo: Vec3,
    techniques: Option<&Techniques>,
) {
    let difference = is_difference(st);
    let left_to_cones = left_to_cones(scene, s);
    if difference && left_to_cones && st.ray.depth >= scene.frame.max_bounces {
        return;
    }
    let set = if difference {
        SET_DIFFERENCE_BSDF
    } else {
        SET_PATH_BSDF
    };
    let at_pane = may_leave_no_vertex(scene, st, s, wo);
    let u = if at_pane {
        draw_at_pane(scene, st)
    } else {
        draw(scene, st, set)
    };
    if techniques.is_some_and(|t| !plays(&u, t.bsdf_probability)) {
        return;
    }
    let lobe = if bsdf_is_lambertian(s) {
        0.0
    } else {
        u.third()
    };
    let [x, y] = u.pair();
    let share = guided_share(scene, st, s);
    let b = path_sample(scene, st, s, wo, [lobe, x, y], share);
    if !b.valid {
        return;
    }
    let straight = b.delta && b.transmitted && bsdf_passes_straight(s);
    let throughput = st.path.throughput * b.weight;
    let medium = medium_along(st, s, b.wi);
    if at_pane && straight {
        pass_straight(st, b.wi, throughput, medium);
        return;
    }
    let smooth = b.delta || is_smooth(&scene.frame, s, st.ray.side, st.ray.depth == 1);
    let mut events = st.path.events;
    if !straight {
        events = events_after(events, st.ray.depth, st.ray.side, smooth);
    }
    if share > 0.0 {
        events |= EVENT_GUIDED;
    }
    let from_lens = from_lens_after(st, s, b.delta, smooth);
    events = events & !(EVENT_PASSED | EVENT_FROM_SHARED | EVENT_FROM_LENS) | from_lens;
    let mut segment = Segment {
        direction: b.wi,
        density: if b.delta { DELTA_DENSITY } else { b.pdf },
        throughput,
        medium,
    };
    if let Some(t) = techniques {
        segment.throughput *= 1.0 / t.bsdf_probability;
        st.path.pending |= PENDING_DIFFERENCE;
        st.difference = DifferenceRay {
            origin: st.ray.origin,
            segment,
            normal: s.ns,
            cone_probability: t.cone_probability,
            depth: st.ray.depth,
            request: if left_to_cones {
                REQUEST_REAL_UNLESS_COVERED
            } else {
                REQUEST_CLOSEST_EACH
            },
            events,
            pad: 0,
        };
        return;
    }
    // A guided direction's throughput is small because much light is expected from there.
    if st.ray.depth >= ROULETTE_FROM_DEPTH && events & EVENT_GUIDED == 0 {
        let survival = (ROULETTE_GAIN * segment.throughput.abs().max_element()).min(1.0);
        if !plays(&u, survival) {
            return;
        }
        segment.throughput *= 1.0 / survival;
    }
    st.path.pending |= PENDING_NEXT;
    st.path.events = events | st.path.events & EVENT_LIGHT_LEFT_TO_PATH;
    st.next = segment;
}
