//! Puts markers of one size together into a map: how they lie to one another, from the frames that show several.

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3};

use super::board::{Board, BoardKind, square};
use super::frame_pose::{Observation, find_pose};
use super::lens::Lens;
use super::pose::Pose;
use super::quad::Quad;

/// Markers of a frame: ids and corners.
pub type Corners = Vec<(u32, Quad)>;

/// How far two frames may disagree on how one marker lies to another: radians, and sides.
const SAME_ANGLE: f64 = 0.2;
const SAME_SHIFT: f64 = 0.4;

/// How often frames agree, and on what.
struct Link {
    votes: usize,
    from_other: Pose,
}

/// All markers that are linked to the one with the lowest id among those seen most; the world is that marker's, its middle the origin.
pub fn find_layout(frames: &[&Corners], lens: &Lens, side_m: f64) -> Option<Board> {
    let local = square(DVec2::splat(-0.5 * side_m), side_m, 0);
    let mut candidates: BTreeMap<(u32, u32), Vec<Pose>> = BTreeMap::new();
    let mut count: BTreeMap<u32, usize> = BTreeMap::new();
    for frame in frames {
        let posed: Vec<(u32, Vec<Pose>)> = frame
            .iter()
            .map(|(id, corners)| (*id, marker_poses(lens, &local, corners)))
            .collect();
        for (a, of_a) in &posed {
            *count.entry(*a).or_default() += 1;
            for (b, of_b) in posed.iter().filter(|(b, _)| a < b) {
                let relative = of_a.iter().flat_map(|from| {
                    let to_marker = from.inverse();
                    of_b.iter().map(move |other| to_marker.after(other))
                });
                candidates.entry((*a, *b)).or_default().extend(relative);
            }
        }
    }
    let links: BTreeMap<(u32, u32), Link> = candidates
        .into_iter()
        .filter_map(|(pair, poses)| Some((pair, agreed(&poses, side_m)?)))
        .collect();
    let most = *count.values().max()?;
    let root = *count.iter().find(|(_, seen)| **seen * 10 >= most * 9)?.0;
    Some(board_of(&spread(root, &links), &local, side_m))
}

/// Both minima of a single marker.
fn marker_poses(lens: &Lens, local: &[DVec3; 4], corners: &Quad) -> Vec<Pose> {
    let observations: Vec<Observation> = (0..4)
        .map(|point| Observation {
            point,
            pixel: corners[point],
        })
        .collect();
    let Some(minima) = find_pose(lens, local, &observations, &[], 1.0) else {
        return Vec::new();
    };
    let other = minima.other.map(|fit| fit.pose);
    std::iter::once(minima.best.pose).chain(other).collect()
}

/// The relative pose that the most others agree with.
fn agreed(poses: &[Pose], side_m: f64) -> Option<Link> {
    const MOST: usize = 240;
    let step = poses.len().div_ceil(MOST).max(1);
    let picked: Vec<&Pose> = poses.iter().step_by(step).collect();
    let same = |a: &Pose, b: &Pose| {
        let shift = (a.translation - b.translation).length();
        shift < SAME_SHIFT * side_m && a.angle_to(b) < SAME_ANGLE
    };
    let votes = |pose: &Pose| picked.iter().filter(|other| same(pose, other)).count();
    let ranked = picked.iter().map(|pose| (votes(pose), **pose));
    let (votes, first) = ranked.max_by_key(|(votes, _)| *votes)?;
    // Among those that agree, the one in the middle.
    let near: Vec<&&Pose> = picked.iter().filter(|other| same(&first, other)).collect();
    let mean = near.iter().map(|p| p.translation).sum::<DVec3>() / near.len() as f64;
    let central = near.iter().min_by(|a, b| {
        let off = |p: &Pose| (p.translation - mean).length();
        off(a).total_cmp(&off(b))
    })?;
    Some(Link {
        votes: votes * step,
        from_other: ***central,
    })
}

/// From the root along the links with the most votes (Prim's tree).
fn spread(root: u32, links: &BTreeMap<(u32, u32), Link>) -> BTreeMap<u32, Pose> {
    let identity = Pose {
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    };
    let mut placed = BTreeMap::from([(root, identity)]);
    loop {
        let next = links
            .iter()
            .filter(|((a, b), _)| placed.contains_key(a) != placed.contains_key(b))
            .max_by_key(|(_, link)| link.votes);
        let Some(((a, b), link)) = next else {
            return placed;
        };
        let (id, pose) = match placed.get(a) {
            Some(from) => (*b, from.after(&link.from_other)),
            None => (*a, placed[b].after(&link.from_other.inverse())),
        };
        placed.insert(id, pose);
    }
}

fn board_of(placed: &BTreeMap<u32, Pose>, local: &[DVec3; 4], side_m: f64) -> Board {
    let mut board = Board::empty(BoardKind::Found { side_m });
    for (id, pose) in placed {
        board.add(*id, local.map(|corner| pose.of(corner)));
    }
    board
}
