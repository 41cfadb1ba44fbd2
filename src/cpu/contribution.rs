//! What estimator and vertex share: random numbers of a decision, weights, accumulation. WGSL twin: `shaders/cpu/contribution.wgsl`.

use glam::Vec3;

use super::sharing_tile::{MEMBERS, member_of, tile_of};
use super::state::*;
use crate::camera::sampler::{SampleKey, SampleSet, sample_set};
use crate::material::{Surface, bsdf_is_diffuse, bsdf_is_glossy, bsdf_is_polished};
use crate::packed::{
    ESTIMATOR_PAPER, FRAME_BACKDROP, FRAME_NO_PHOTONS, Frame, PIXEL_BEAM_MAY_MEET_VIRTUAL,
    PackedScene, SAMPLER_CMJ, SAMPLER_JITTERED, SIDE_VIRTUAL,
};
use crate::shared::shared;

shared! {
    // Sample sets: 0 is pixel and lens, 1 the roulette on links, then five a depth from 7 on.
    pub const LINK_SET: u32 = 1;
    pub const SET_DIFFERENCE_LIGHT: u32 = 0;
    pub const SET_DIFFERENCE_BSDF: u32 = 1;
    pub const SET_DIFFERENCE_CONE: u32 = 2;
    pub const SET_PATH_LIGHT: u32 = 3;
    pub const SET_PATH_BSDF: u32 = 4;
    const SETS_PER_DEPTH: u32 = 5;
    const FIRST_DEPTH_SET: u32 = 2;

    /// Sets the numbers of a tile apart from those of its pixels.
    const TILE_NUMBERS: u32 = 0x8000_0000;
}

/// Random numbers of one decision at the present vertex, computed when asked for. The samplers spread the first pair of a set best: it is what
/// directions and points on lights are found by.
#[inline]
pub fn draw(scene: &PackedScene, st: &PathState, purpose: u32) -> SampleSet {
    draw_one_of(scene, st, purpose, 0, 1)
}

/// As [`draw`], for the decision's number `number` of `count`: all of a pixel's samples are spread together.
#[inline]
pub fn draw_one_of(
    scene: &PackedScene,
    st: &PathState,
    purpose: u32,
    number: u32,
    count: u32,
) -> SampleSet {
    let set_id = FIRST_DEPTH_SET + st.ray.depth * SETS_PER_DEPTH + purpose;
    let mut key = sample_key(scene, st);
    if is_for_tile(scene, st, purpose) {
        key.index = index_in_tile(scene, st, key);
        key.pixel = tile_of(scene.frame.width, key.pixel) | TILE_NUMBERS;
    }
    key.index = key.index * count + number;
    key.total *= count;
    sample_set(key, set_id)
}

pub fn sample_key(scene: &PackedScene, st: &PathState) -> SampleKey {
    SampleKey {
        pixel: st.path.pixel,
        index: st.path.index,
        total: scene.frame.rays_total * scene.pixels[st.path.pixel as usize].sample_factor,
        seed: scene.frame.seed,
        sampler: scene.frame.sampler,
    }
}

/// Whether what the decision finds may go to the other samples of a sharing tile. The lights of the first vertex stay its own, and the grids of
/// other samplers are laid out for one pixel.
fn is_for_tile(scene: &PackedScene, st: &PathState, purpose: u32) -> bool {
    let is_shared_direction = st.ray.depth == 1
        && st.first.kept != FIRST_NONE
        && purpose != SET_DIFFERENCE_LIGHT
        && purpose != SET_PATH_LIGHT;
    (is_shared_direction || st.first.capture != POINT_NONE)
        && scene.frame.sampler != SAMPLER_JITTERED
        && scene.frame.sampler != SAMPLER_CMJ
}

/// Place of a sample in the sequence of its tile: those of one pixel follow one another in runs, as long as the largest power of two that a pixel's
/// samples fill, so that they are spread by themselves as well as together with those of the other pixels.
fn index_in_tile(scene: &PackedScene, st: &PathState, key: SampleKey) -> u32 {
    let info = &scene.pixels[key.pixel as usize];
    let (mut index, mut count) = (key.index, key.total);
    if st.first.kept == FIRST_DIFFERENCE {
        count /= info.difference_period;
        // Where no beam meets virtual geometry samples are numbered by their turns.
        if info.flags & PIXEL_BEAM_MAY_MEET_VIRTUAL != 0 {
            index /= info.difference_period;
        }
    }
    let run = 1 << count.max(1).ilog2();
    let runs_before = index / run * MEMBERS + member_of(scene.frame.width, key.pixel);
    runs_before * run + index % run
}

/// Adds light to what the present mode accumulates into.
pub fn accumulate(scene: &PackedScene, st: &mut PathState, light: Vec3) {
    let paper = scene.frame.estimator == ESTIMATOR_PAPER;
    let mut light = light;
    if st.path.events & EVENT_SCATTERED != 0 {
        // How many samples this one stands for does not change what it is clamped to.
        let limit = scene.frame.clamp_indirect * st.path.weight;
        let largest = light.abs().max_element();
        if largest > limit {
            light *= limit / largest;
        }
    }
    if !(paper && st.path.mode == MODE_REAL) {
        st.result.radiance += light;
    }
    if paper && (st.path.mode == MODE_REAL || st.path.mode == MODE_SHARED) {
        st.radiance_real += light;
    }
}

/// `events` after one more vertex of `depth` in a world (`side`): `smooth` if a mirror or a smooth interface scattered there, or it is polished. That it scattered
/// otherwise is noted once the ray is followed.
pub fn events_after(events: u32, depth: u32, side: u32, smooth: bool) -> u32 {
    if !smooth {
        let seen = if depth == 1 { EVENT_SEEN } else { 0 };
        return (events & (EVENT_SEEN | EVENT_SCATTERED)) | seen;
    }
    let chain = if side == SIDE_VIRTUAL {
        EVENT_VIRTUAL_CHAIN
    } else {
        EVENT_REAL_CHAIN
    };
    // The difference's chain comes back to its first vertex after the cone's ray has left it.
    let before = if depth == 1 {
        events & EVENT_SCATTERED
    } else {
        events & !EVENT_AT_POLISHED
    };
    before | chain
}

/// Whether light that comes by way of the vertex is the photons'. Where the camera first meets a surface, and on real ones, less blur makes it their
/// landing place; so does a photograph that shows through glass, which photons do not bring.
pub fn is_smooth(frame: &Frame, s: &Surface, side: u32, is_first: bool) -> bool {
    if is_first || side != SIDE_VIRTUAL || frame.flags & FRAME_BACKDROP != 0 {
        return bsdf_is_polished(s);
    }
    bsdf_is_glossy(s)
}

/// Whether photons bring what a mixed path now finds: from a vertex that scatters, smooth virtual surfaces alone lead to the light.
pub fn left_to_photons(scene: &PackedScene, st: &PathState) -> bool {
    let chain = EVENT_SEEN | EVENT_VIRTUAL_CHAIN | EVENT_REAL_CHAIN;
    photons_traced(&scene.frame)
        && st.path.mode == MODE_MIXED
        && st.path.events & chain == EVENT_SEEN | EVENT_VIRTUAL_CHAIN
}

/// Whether photons bring what lights send by way of the vertex of a mixed path: it is virtual and glossy, and comes after one that scatters.
pub fn vertex_left_to_photons(scene: &PackedScene, st: &PathState, s: &Surface) -> bool {
    photons_traced(&scene.frame)
        && st.path.mode == MODE_MIXED
        && st.ray.side == SIDE_VIRTUAL
        && st.path.events & (EVENT_SEEN | EVENT_REAL_CHAIN) == EVENT_SEEN
        && is_smooth(&scene.frame, s, st.ray.side, false)
}

/// Whether what the path sees of the world that is not modelled is what the photograph shows.
pub fn sees_backdrop(scene: &PackedScene, st: &PathState) -> bool {
    scene.frame.flags & FRAME_BACKDROP != 0
        && st.path.mode == MODE_MIXED
        && st.path.events & EVENT_FROM_LENS != 0
}

/// [`EVENT_FROM_LENS`] past a vertex, if the path had it: `smooth` as in [`events_after`]. A chain of smooth vertices after one that scatters is the
/// photons', and they bring the environment.
pub fn from_lens_after(st: &PathState, s: &Surface, delta: bool, smooth: bool) -> u32 {
    let looks_through = st.ray.side == SIDE_VIRTUAL && (delta || !bsdf_is_diffuse(s));
    let left_to_photons = smooth && st.path.events & EVENT_SEEN != 0;
    if looks_through && !left_to_photons {
        st.path.events & EVENT_FROM_LENS
    } else {
        0
    }
}

pub fn photons_traced(frame: &Frame) -> bool {
    frame.photon_sphere_count > 0
        && frame.flags & FRAME_NO_PHOTONS == 0
        && frame.estimator != ESTIMATOR_PAPER
}

/// Power heuristic (Veach 1997, section 9.2.3) of a direction drawn with `density` that another technique draws with density `pdf`.
pub fn density_weight(density: f32, pdf: f32) -> f32 {
    if density == DELTA_DENSITY {
        1.0
    } else {
        let ratio = pdf / density;
        1.0 / (1.0 + ratio * ratio)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::cpu::render::test_scene;
    use crate::cpu::sharing_tile::{BLOCK_SIDE, TILE_STRIDE};

    #[test]
    fn the_samples_of_a_tile_have_places_of_their_own_and_those_of_a_pixel_whole_runs() {
        let mut scene = test_scene();
        let (pixels_of_a_side, width) = (BLOCK_SIDE / TILE_STRIDE, scene.frame.width);
        let near = PIXEL_BEAM_MAY_MEET_VIRTUAL;
        // Rays, flags, period, first vertex, the first two samples, and the places that one pixel's fill.
        let cases = [
            (32, near, 1, FIRST_VIRTUAL, [0, 1], 32),
            (49, near, 3, FIRST_DIFFERENCE, [2, 5], 16),
            (49, 0, 3, FIRST_DIFFERENCE, [0, 1], 16),
        ];
        for (rays, flags, difference_period, kept, [first, second], run) in cases {
            scene.frame.rays_total = rays;
            let mut places = BTreeSet::new();
            for at in 0..MEMBERS {
                let (column, row) = (at % pixels_of_a_side, at / pixels_of_a_side);
                let pixel = row * TILE_STRIDE * width + column * TILE_STRIDE;
                let member = member_of(width, pixel);
                scene.pixels[pixel as usize].flags = flags;
                scene.pixels[pixel as usize].difference_period = difference_period;
                let place = |number: u32| {
                    let mut st = path_state(pixel, first + number * (second - first));
                    st.first.kept = kept;
                    index_in_tile(&scene, &st, sample_key(&scene, &st))
                };
                let of_pixel: BTreeSet<_> = (0..run).map(place).collect();
                assert!(of_pixel.iter().all(|place| place / run == member));
                assert!(place(run) / run >= MEMBERS, "the next run");
                places.extend(of_pixel);
            }
            assert!(places.iter().copied().eq(0..MEMBERS * run));
        }
    }
}
