//! Second vertices shared between pixels: every first vertex of a sharing tile uses the points that any of them has found, weighted exactly
//! (Bekaert, Sbert and Halton 2002, "Accelerating path tracing by re-using paths"). WGSL twin: `shaders/cpu/sharing.wgsl`.
//!
//! A tile takes every second pixel of a block of 8 x 8 in either direction: noise that a tile's pixels have in common is spread over the
//! pixels between. Its members are the samples of equal number whose first vertices were kept. The point y that member i has drawn with the
//! radiance B adds to member j
//!
//! ```text
//! t_j f_j(w_j) G_j(y) V_j(y) B / sum over members k of P_k p_k(w_k) |cos(y, w_k)| / d_k^2 V_k(y)
//! ```
//!
//! with the members whose first vertices estimate the same: the balance heuristic over the members' techniques. P_k is the chance that k plays
//! its technique at all, f is albedo / pi.

use glam::Vec3;

use super::contribution::{LINK_SET, sample_key};
use super::in_flight::{InFlight, Member};
use super::panes::blocks;
use super::request::answer;
use super::sharing_tile::{MEMBERS, QUARTER};
use super::state::*;
use super::vertex::{SHADOW_SHORTEN, SHADOW_SHORTEN_ERRORS, plays};
use crate::camera::sampler::sample_set;
use crate::film::is_unusable;
use crate::light::cones::{cone_pdf, cones_at};
use crate::material::scatter::{lambert_cos, terminator};
use crate::math::{INV_PI, dot3, length3, safe_sqrt};
use crate::packed::{Frame, NONE, PackedScene, SIDE_REAL, SIDE_VIRTUAL};
use crate::shared::shared;

shared! {
    /// Links of a sample's points to the members that may use them.
    pub const LINKS: u32 = MEMBERS + 2 * QUARTER;
    /// Points nearer than this, squared metres, count as this far: weights stay finite.
    const LEAST_DISTANCE2: f32 = 1e-20;
    /// A length or density below it is none.
    const MIN_POSITIVE: f32 = f32::MIN_POSITIVE;

    /// A first vertex and a point, as they see each other if nothing is between.
    #[derive(Clone, Copy, Debug, Default)]
    value struct Link {
        /// Share of the point's radiance that arrives for each square metre about it, times 1 / pi.
        transfer: f32,
        /// With which the vertex's technique draws the point, 1 / square metre.
        density: f32,
    }
}

/// Of the points of one sample to the members of its tile, by [`link_of`].
pub type Links = [f32; LINKS as usize];

const NO_LINKS: Links = [0.0; LINKS as usize];

/// `kind`: `POINT_*`.
fn link_to(frame: &Frame, first: &FirstVertex, point: &SharedPoint, kind: u32) -> Link {
    let to_point = point.position - first.origin.position;
    let distance2 = dot3(to_point, to_point).max(LEAST_DISTANCE2);
    let direction = to_point / safe_sqrt(distance2);
    let cosine = lambert_cos(first.ng, first.ns, direction) * INV_PI;
    let solid_angle = (-dot3(point.ng, direction)).max(0.0) / distance2;
    let drawn = if kind == POINT_RECURSION {
        first.bsdf_probability * cosine
    } else {
        let cones = cones_at(frame, first.origin.position, first.ns);
        first.cone_probability * cone_pdf(&cones, direction)
    };
    Link {
        transfer: cosine * terminator(first.ng, first.ns, direction) * solid_angle,
        density: drawn * solid_angle,
    }
}

/// Whether the vertex really sees the point; what is covered, past something virtual. `probe` traces and counts.
fn sees(
    scene: &PackedScene,
    probe: &mut PathState,
    first: &FirstVertex,
    point: &SharedPoint,
    kind: u32,
) -> bool {
    let to_point = point.position + point.ng * point.error - first.origin.position;
    let distance = length3(to_point).max(MIN_POSITIVE);
    let error = length3(first.origin.offset);
    let covered = kind == POINT_COVERED;
    probe.ray = PathRay {
        origin: first.origin,
        direction: to_point / distance,
        t_max: distance - SHADOW_SHORTEN * distance - SHADOW_SHORTEN_ERRORS * error,
        request: if covered {
            REQUEST_SHADOW_DIFFERENCE
        } else {
            REQUEST_SHADOW_MIXED
        },
        side: if first.kept == FIRST_VIRTUAL {
            SIDE_VIRTUAL
        } else {
            SIDE_REAL
        },
        depth: 1,
        opacity_seed: 0,
    };
    answer(scene, probe);
    let Hits {
        in_real,
        in_virtual,
    } = probe.hits;
    if covered {
        let by_no_pane = blocks(in_virtual) && in_virtual.t == 0.0;
        return in_real.triangle == NONE && by_no_pane;
    }
    in_real.triangle == NONE && in_virtual.triangle == NONE
}

/// Where the links of a point begin, and the members that may use it: all of the tile, or those of the same quarter.
fn first_link(kind: u32) -> u32 {
    if kind == POINT_RECURSION {
        0
    } else {
        MEMBERS + (kind - 1) * QUARTER
    }
}

/// Place of a member's link among those of a point; `LINKS`: it may not use the point.
fn link_of(kind: u32, from: u32, to: u32) -> u32 {
    if kind == POINT_RECURSION {
        return to;
    }
    if from / QUARTER != to / QUARTER {
        return LINKS;
    }
    first_link(kind) + to % QUARTER
}

/// Largest channel of what leaves a point; 0 where there is nothing to share.
fn light_of(point: &SharedPoint) -> f32 {
    if point.strength == 0.0 || is_unusable(point.radiance) {
        return 0.0;
    }
    point.radiance.abs().max_element() / point.strength
}

/// With what probability one member's point is linked at all: in proportion to what leaves it, for certain from the tile's mean on. Points of
/// the cones send out nearly equal light and have few links.
fn link_probability(samples: &[InFlight], members: &[Member], from: Member, kind: u32) -> f32 {
    if kind != POINT_RECURSION {
        return 1.0;
    }
    let light = |member: Member| light_of(&samples[member.slot].state.points[kind as usize]);
    let kept = samples[from.slot].state.first.kept;
    let (mut sum, mut count) = (0.0, 0.0);
    for &member in members {
        let of_member = light(member);
        if samples[member.slot].state.first.kept == kept && of_member > 0.0 {
            sum += of_member;
            count += 1.0;
        }
    }
    (light(from) * count / sum).min(1.0)
}

/// Weighs the points of one member's sample against all members that could have drawn them: how much of a point's radiance each of them
/// takes, albedo and throughput apart; none where nothing leaves them. `probe` traces and counts.
pub fn link_points(
    scene: &PackedScene,
    samples: &[InFlight],
    members: &[Member],
    from: Member,
    probe: &mut PathState,
) -> Option<Links> {
    let mut links = None;
    let state = &samples[from.slot].state;
    let kept = state.first.kept;
    for kind in 0..POINTS {
        let point = state.points[kind as usize];
        if point.strength == 0.0 || point.radiance == Vec3::ZERO {
            continue;
        }
        if is_unusable(point.radiance) {
            // One sample's fault stays its own.
            let place = link_of(kind, from.number, from.number);
            links.get_or_insert(NO_LINKS)[place as usize] = 1.0;
            continue;
        }
        let probability = link_probability(samples, members, from, kind);
        if !plays(&sample_set(sample_key(scene, state), LINK_SET), probability) {
            continue;
        }
        let links = links.get_or_insert(NO_LINKS);
        let mut density = 0.0;
        for member in members {
            let place = link_of(kind, from.number, member.number);
            let first = &samples[member.slot].state.first;
            if place == LINKS || first.kept != kept {
                continue;
            }
            let link = link_to(&scene.frame, first, &point, kind);
            if link.transfer > 0.0
                && (member.slot == from.slot || sees(scene, probe, first, &point, kind))
            {
                links[place as usize] = link.transfer;
                density += link.density;
            }
        }
        let scale = 1.0 / (density * point.strength * probability).max(MIN_POSITIVE);
        for place in first_link(kind)..first_link(kind + 1) {
            links[place as usize] *= scale;
        }
    }
    links
}

/// What a member's sample takes of the points of its tile, by their links from the members that have found them.
pub fn gather(samples: &[InFlight], linked: &[(Member, Links)], to: Member) -> Vec3 {
    let mut light = Vec3::ZERO;
    for (from, links) in linked {
        for kind in 0..POINTS {
            let point = &samples[from.slot].state.points[kind as usize];
            let place = link_of(kind, from.number, to.number);
            if point.strength == 0.0 || place == LINKS || links[place as usize] == 0.0 {
                continue;
            }
            let taken = point.radiance * links[place as usize];
            light += if kind == POINT_COVERED { -taken } else { taken };
        }
    }
    light * samples[to.slot].state.first.throughput
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::cpu::sharing_tile::{member_of, tile_of};
    use crate::cpu::state::path_state;
    use crate::pack::test_scene;
    use crate::packed::PackedScene;

    #[test]
    fn a_block_holds_four_tiles_of_sixteen_members_and_each_link_has_a_place() {
        let width = 43;
        let in_block = (8..16).flat_map(|y| (16..24).map(move |x| y * width + x));
        let places: BTreeSet<_> = (in_block.clone())
            .map(|pixel| (tile_of(width, pixel), member_of(width, pixel)))
            .collect();
        assert_eq!(places.len(), 64);
        let tiles: BTreeSet<_> = places.iter().map(|(tile, _)| tile).collect();
        assert_eq!(
            (tiles.len(), tiles.last().copied()),
            (4, Some(&(4 * (6 + 2) + 3)))
        );
        let members: BTreeSet<_> = in_block.map(|pixel| member_of(width, pixel)).collect();
        assert!(members.into_iter().eq(0..MEMBERS));
        let neighbours = [
            tile_of(width, 8 * width + 16),
            tile_of(width, 8 * width + 17),
        ];
        assert_ne!(neighbours[0], neighbours[1]);
        for from in 0..MEMBERS {
            let all = (0..POINTS).flat_map(|kind| (0..MEMBERS).map(move |to| (kind, to)));
            let mut links: Vec<u32> = all.map(|(kind, to)| link_of(kind, from, to)).collect();
            links.retain(|&place| place != LINKS);
            links.sort_unstable();
            assert!(links.iter().copied().eq(0..LINKS), "{links:?}");
        }
    }

    #[test]
    fn points_are_linked_in_proportion_to_what_leaves_them() {
        let light = [8.0, 1.0, 3.0, 0.0, f32::NAN];
        let samples: Vec<_> = (light.iter())
            .map(|&light| {
                let mut state = path_state(0, 0);
                state.first.kept = FIRST_DIFFERENCE;
                for point in &mut state.points {
                    // Strength is in the radiance, too.
                    point.strength = 0.5;
                    point.radiance = Vec3::new(0.1, -0.5, 0.2) * light;
                }
                InFlight { index: 0, state }
            })
            .collect();
        let members: Vec<_> = (0..light.len())
            .map(|slot| Member {
                slot,
                number: slot as u32,
            })
            .collect();
        let probabilities = |kind: u32| {
            let of = |from: &Member| link_probability(&samples, &members, *from, kind);
            members[..3].iter().map(of).collect::<Vec<_>>()
        };
        // Of those that send out anything the mean is 4.
        assert_eq!(probabilities(POINT_RECURSION), [1.0, 0.25, 0.75]);
        assert_eq!(probabilities(POINT_COVERING), [1.0; 3], "control");
    }

    /// A disc of radius R that faces a point of a plane at distance h sends it R^2 / (R^2 + h^2) of what an infinite one does.
    #[test]
    fn links_sum_to_the_form_factor_of_a_disc() {
        let frame = PackedScene::build(&test_scene(), &crate::work::Watcher::none())
            .expect("packs")
            .frame;
        let mut first = path_state(0, 0).first;
        (first.ng, first.ns, first.bsdf_probability) = (Vec3::Z, Vec3::Z, 0.25);
        let (height, radius) = (0.7_f64, 1.3_f64);
        let cells = 400;
        let cell = 2.0 * radius / f64::from(cells);
        let at = |i: i32| (f64::from(i) + 0.5) * cell - radius;
        let (mut transfer, mut density) = (0.0, 0.0);
        for (x, y) in (0..cells).flat_map(|x| (0..cells).map(move |y| (at(x), at(y)))) {
            if x.hypot(y) < radius {
                let mut point = path_state(0, 0).points[0];
                point.position = Vec3::new(x as f32, y as f32, height as f32);
                point.ng = -Vec3::Z;
                let link = link_to(&frame, &first, &point, POINT_RECURSION);
                transfer += f64::from(link.transfer) * cell * cell;
                density += f64::from(link.density) * cell * cell;
            }
        }
        let form_factor = radius.powi(2) / (radius.powi(2) + height.powi(2));
        assert!(
            (transfer / form_factor - 1.0).abs() < 1e-3,
            "{transfer} {form_factor}"
        );
        assert!((density / (0.25 * form_factor) - 1.0).abs() < 1e-3);
        assert!(
            (transfer / (1.01 * form_factor) - 1.0).abs() > 1e-3,
            "control"
        );
    }
}
