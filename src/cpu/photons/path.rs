//! The way of one photon, and what the camera sees of it. WGSL twin: `shaders/cpu/photons/path.wgsl`.
//!
//! A photon follows smooth virtual surfaces until it lands on one that scatters. There, and wherever it goes from there, the lens sees it. What
//! scatters is evaluated as the eye's paths do, from the camera's side, so that both bring the same light.

use glam::Vec3;

use super::emission::emit;
use crate::camera::sampler::{SampleKey, SampleSet, sample_set};
use crate::camera::shutter::{camera_pose, camera_pose_at};
use crate::camera::splat::{exposure_weight, lens_connect};
use crate::cpu::contribution::is_smooth;
use crate::cpu::estimator::virtual_is_nearer;
use crate::cpu::panes::{PANE_SETS, open_share, transmittance};
use crate::cpu::request::answer;
use crate::cpu::state::*;
use crate::cpu::vertex::{EMITS_ONLY, medium_along, stand_at};
use crate::film::Splat;
use crate::material::{
    BsdfSample, Surface, bsdf_eval, bsdf_index_ratio, bsdf_is_polished, bsdf_passes_straight,
    bsdf_sample, bsdf_straight, surface_at,
};
use crate::math::{dot3, hash_combine};
use crate::packed::{
    FRAME_ALPHA, FRAME_SHUTTER, MATERIAL_THIN_WALLED, NONE, PackedScene, SAMPLER_SOBOL, SIDE_REAL,
    SIDE_VIRTUAL,
};
use crate::shared::shared;

shared! {
    /// Sets the photons' numbers apart from the samples', which hash the same seed.
    const PHOTON_SALT: u32 = 0x51ed_270b;
    /// A number is a sequence and a place in it; sequences are this long.
    pub const SEQUENCE_BITS: u32 = 31;

    // Sample sets: direction and point on the light; choices; then two a vertex.
    const SET_EMISSION: u32 = 0;
    const SET_CHOICES: u32 = 1;
    const FIRST_VERTEX_SET: u32 = 2;
    const SETS_PER_VERTEX: u32 = 2;

    /// A photon that has landed is followed for certain while the largest channel of what it has left times this is at least 1.
    const PHOTON_ROULETTE_GAIN: f32 = 1.0;
}

/// A photon in flight.
struct Photon {
    st: PathState,
    key: SampleKey,
    /// Power that it has left; the camera's exposure and the number of photons aside.
    flux: Vec3,
    /// Of its flux at the start.
    throughput: Vec3,
    /// When: a share of the shutter's time.
    time_share: f32,
    /// Its light is infinitely far away.
    distant: bool,
    /// A smooth virtual surface has mirrored or bent it.
    chained: bool,
    /// Past its first landing.
    landed: bool,
}

/// Which photon, and when the shutter's time may see it.
#[derive(Clone, Copy, Debug)]
pub struct PhotonNumber {
    pub sequence: u32,
    pub place: u32,
    /// Beginning and length, as shares of the shutter's time.
    pub window: [f32; 2],
}

/// Follows a photon to its end and hands on what pixels receive; `rays` grows by what was traced.
pub fn trace_photon(
    scene: &PackedScene,
    number: PhotonNumber,
    mut splat: impl FnMut(Splat),
) -> PathState {
    let mut photon = begin(scene, number);
    if photon.flux == Vec3::ZERO {
        return photon.st;
    }
    while let Some((s, wi)) = next_vertex(scene, &mut photon) {
        if photon.chained
            && !bsdf_is_polished(&s)
            && let Some(seen) = see(scene, &mut photon, &s, wi)
        {
            splat(seen);
        }
        if !scatter(scene, &mut photon, &s, wi) {
            break;
        }
    }
    photon.st
}

/// Where a photon lands first on what scatters, and the point that it came from.
#[derive(Clone, Copy, Debug)]
pub struct Landing {
    pub position: Vec3,
    pub from: Vec3,
}

/// Follows a photon to its first landing, if it gets there.
pub fn first_landing(scene: &PackedScene, number: PhotonNumber) -> Option<Landing> {
    let mut photon = begin(scene, number);
    let mut from = photon.st.ray.origin.position;
    while photon.flux != Vec3::ZERO
        && let Some((s, wi)) = next_vertex(scene, &mut photon)
    {
        if photon.chained && !bsdf_is_polished(&s) {
            let position = s.position;
            return Some(Landing { position, from });
        }
        from = s.position;
        if photon.st.ray.depth >= scene.frame.max_bounces || !scatter(scene, &mut photon, &s, wi) {
            return None;
        }
    }
    None
}

fn draw(photon: &Photon, set: u32) -> SampleSet {
    sample_set(photon.key, set)
}

fn vertex_set(photon: &Photon, purpose: u32) -> SampleSet {
    draw(
        photon,
        FIRST_VERTEX_SET + photon.st.ray.depth * SETS_PER_VERTEX + purpose,
    )
}

/// As [`crate::cpu::panes::draw_at_pane`].
fn pane_set(photon: &Photon) -> SampleSet {
    let st = &photon.st;
    let set_id = hash_combine(st.vertex_hit.triangle, st.ray.depth) | PANE_SETS;
    draw(photon, set_id)
}

fn begin(scene: &PackedScene, number: PhotonNumber) -> Photon {
    let mut photon = Photon {
        st: path_state(0, 0),
        key: SampleKey {
            pixel: number.sequence,
            index: number.place,
            total: 1,
            seed: hash_combine(scene.frame.seed, PHOTON_SALT),
            sampler: SAMPLER_SOBOL,
        },
        flux: Vec3::ZERO,
        throughput: Vec3::ONE,
        time_share: 0.0,
        distant: false,
        chained: false,
        landed: false,
    };
    let choices = draw(&photon, SET_CHOICES);
    let places = draw(&photon, SET_EMISSION);
    let emission = emit(scene, choices.pair(), places.second_pair(), places.pair());
    photon.flux = emission.flux;
    photon.time_share = number.window[0] + choices.third() * number.window[1];
    let ray = &mut photon.st.ray;
    ray.origin.position = emission.position;
    ray.origin.offset = emission.offset;
    ray.side = emission.side;
    ray.direction = emission.direction;
    photon.distant = emission.distant;
    if scene.frame.flags & FRAME_ALPHA != 0 {
        ray.opacity_seed =
            hash_combine(hash_combine(photon.key.seed, number.sequence), number.place);
    }
    photon
}

/// Where the photon meets the next surface, and the direction that it comes from; nothing where its way ends.
fn next_vertex(scene: &PackedScene, photon: &mut Photon) -> Option<(Surface, Vec3)> {
    let st = &mut photon.st;
    st.ray.request = REQUEST_CLOSEST_MIXED;
    st.ray.t_max = f32::INFINITY;
    answer(scene, st);
    let hit = if virtual_is_nearer(&st.hits) {
        st.hits.in_virtual
    } else {
        st.hits.in_real
    };
    if hit.triangle == NONE {
        return None;
    }
    st.ray.depth += 1;
    st.vertex_hit = hit;
    let s = surface_at(scene, hit, st.ray.direction);
    if s.flags & EMITS_ONLY != 0 {
        return None;
    }
    if st.ray.depth == 1 && leaves_volume(&s) {
        // The light lies inside.
        st.path.medium = s.material;
    }
    photon.flux *= transmittance(scene, st.path.medium, hit.t);
    let wi = -st.ray.direction;
    stand_at(scene, st, &s, hit.t);
    if photon.distant {
        photon.distant = false;
        photon.flux *= open_towards(scene, st, wi, f32::INFINITY);
        if photon.flux == Vec3::ZERO {
            return None;
        }
    }
    Some((s, wi))
}

fn leaves_volume(s: &Surface) -> bool {
    !s.front && s.transmission > 0.0 && s.flags & MATERIAL_THIN_WALLED == 0
}

/// Share of the light that comes to the vertex past what stands in the way.
fn open_towards(scene: &PackedScene, st: &mut PathState, direction: Vec3, distance: f32) -> Vec3 {
    st.ray.direction = direction;
    st.ray.t_max = distance;
    st.ray.request = REQUEST_SHADOW_MIXED;
    answer(scene, st);
    open_share(st.hits.in_virtual) * open_share(st.hits.in_real)
}

/// What the lens sees of the photon at a vertex, if anything.
fn see(scene: &PackedScene, photon: &mut Photon, s: &Surface, wi: Vec3) -> Option<Splat> {
    let frame = &scene.frame;
    let pose = if frame.flags & FRAME_SHUTTER != 0 {
        camera_pose_at(frame, photon.time_share)
    } else {
        camera_pose(frame)
    };
    let [lens_u, lens_v] = vertex_set(photon, 1).pair();
    let lens = lens_connect(frame, &pose, s.position, lens_u, lens_v);
    if lens.pixel == NONE {
        return None;
    }
    let exposed = exposure_weight(frame, photon.time_share, lens.pixel / frame.width);
    if exposed <= 0.0 {
        return None;
    }
    let (scattered, cos) = scattered_to(scene, &photon.st, lens.direction, wi);
    if scattered.max_element() <= 0.0 {
        return None;
    }
    let open = open_towards(scene, &mut photon.st, lens.direction, lens.distance);
    let Hits {
        in_real,
        in_virtual,
    } = photon.st.hits;
    // What the camera sees through a real pane is the eye's.
    if open == Vec3::ZERO || in_real.triangle == PANES {
        return None;
    }
    let pixels = (frame.width * frame.height) as f32;
    let geometry = cos / (lens.distance * lens.distance) * lens.importance;
    let scale = geometry * (exposed * frame.exposure_scale / pixels);
    Some(Splat {
        pixel: lens.pixel,
        is_virtual: photon.st.ray.side == SIDE_VIRTUAL || in_virtual.triangle == PANES,
        value: photon.flux * scattered * open * scale,
    })
}

/// Radiance that leaves the vertex towards `wo` for each unit of power per area that arrives from `wi`, as the eye's paths evaluate it; and the
/// cosine of `wo`.
fn scattered_to(scene: &PackedScene, st: &PathState, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
    let s = surface_at(scene, st.vertex_hit, -wo);
    let arriving = dot3(s.ng, wi).abs();
    if arriving <= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let f = bsdf_eval(&s, wo, wi);
    (f.f_cos * (1.0 / arriving), dot3(s.ng, wo).abs())
}

/// The next direction; false where the photon ends.
fn scatter(scene: &PackedScene, photon: &mut Photon, s: &Surface, wi: Vec3) -> bool {
    let at_pane = bsdf_straight(s, wi) != Vec3::ZERO;
    let is_last = photon.st.ray.depth >= scene.frame.max_bounces;
    if is_last && !at_pane {
        return false;
    }
    let u = if at_pane {
        pane_set(photon)
    } else {
        vertex_set(photon, 0)
    };
    let [x, y] = u.pair();
    let b = bsdf_sample(s, wi, [u.third(), x, y]);
    if !b.valid {
        return false;
    }
    let straight = b.delta && b.transmitted && bsdf_passes_straight(s);
    if is_last && !straight {
        return false;
    }
    if !photon.landed && !straight {
        if b.delta || is_smooth(&scene.frame, s, photon.st.ray.side, false) {
            // A smooth real surface on the way: the eye's paths bring that.
            if photon.st.ray.side == SIDE_REAL {
                return false;
            }
            photon.chained = true;
        } else {
            if !photon.chained {
                return false;
            }
            photon.landed = true;
        }
    }
    let weight = adjoint_weight(scene, photon, s, wi, &b);
    photon.flux *= weight;
    photon.throughput *= weight;
    if photon.landed {
        let survival = (PHOTON_ROULETTE_GAIN * photon.throughput.max_element()).min(1.0);
        if survival <= 0.0 || (survival < 1.0 && u.fourth() >= survival) {
            return false;
        }
        photon.flux *= 1.0 / survival;
        photon.throughput *= 1.0 / survival;
    }
    photon.st.path.medium = medium_along(&photon.st, s, b.wi);
    photon.st.ray.direction = b.wi;
    if straight {
        // As if there were no vertex.
        photon.st.ray.depth -= 1;
    }
    photon.flux != Vec3::ZERO
}

/// What a direction drawn as the eye's paths draw theirs, from `wi`, weighs for light: evaluated the other way round, per area of the surface
/// itself and not of the shading normal's (Veach 1997, section 5.3).
fn adjoint_weight(
    scene: &PackedScene,
    photon: &Photon,
    s: &Surface,
    wi: Vec3,
    b: &BsdfSample,
) -> Vec3 {
    if b.delta {
        let (arriving, leaving) = (dot3(s.ng, wi).abs(), dot3(s.ng, b.wi).abs());
        let (shaded_in, shaded_out) = (dot3(s.ns, wi).abs(), dot3(s.ns, b.wi).abs());
        let below = arriving * shaded_out;
        if below <= 0.0 {
            return Vec3::ZERO;
        }
        let mut scale = shaded_in * leaving / below;
        if b.transmitted {
            // The eye's paths carry radiance over index squared, whatever volume they are in.
            let ratio = bsdf_index_ratio(s);
            scale *= 1.0 / (ratio * ratio);
        }
        return b.weight * scale;
    }
    let (scattered, cos) = scattered_to(scene, &photon.st, b.wi, wi);
    scattered * (cos / b.pdf)
}
