//! Parts of trees that are refitted.

use std::ops::Range;

use glam::Vec3;

use crate::accel::WorldBvh;
use crate::bench::stress::meshes::*;

/// Bytes of the second nodes and first leaves, as a device has them.
fn records(world: &WorldBvh) -> (Vec<[[u32; 4]; 5]>, Vec<[u32; 4]>) {
    let leaves = world.gpu_leaves()[0].iter();
    (
        world.gpu_nodes()[1].to_vec(),
        leaves.map(|row| row.map(f32::to_bits)).collect(),
    )
}

/// The records of `after` within `ranges`, those of `before` elsewhere.
fn patched<T: Copy>(before: &[T], after: &[T], ranges: &[Range<usize>]) -> Vec<T> {
    let mut all = before.to_vec();
    for range in ranges {
        all[range.clone()].copy_from_slice(&after[range.clone()]);
    }
    all
}

/// Against all triangles refitted, bit for bit. Control: the tree before, and one range left out.
#[test]
fn a_part_is_refitted_as_with_all_others() {
    let triangles = soup(3000, 0.2, 5);
    let part = 700..900;
    let moved: Vec<[Vec3; 3]> = (triangles[part.clone()].iter())
        .map(|triangle| triangle.map(|v| v + Vec3::new(0.03, -0.02, 0.01)))
        .collect();
    let mut after = triangles.clone();
    after[part.clone()].copy_from_slice(&moved);
    let world = || {
        let world = WorldBvh::build(&triangles, 7).expect("builds");
        world.gpu_nodes();
        world
    };
    let before = records(&world());
    let mut in_part = world();
    assert_eq!(in_part.gpu_refitted(), None);
    in_part.refit_part(part.start, &moved).expect("finite");
    let mut whole = world();
    assert!(whole.refit(&after).expect("finite"));
    let refitted = records(&in_part);
    assert_eq!(refitted, records(&whole));
    assert_eq!(in_part.gpu_nodes()[0], whole.gpu_nodes()[0], "the roots");
    assert_eq!(in_part.bounds(), whole.bounds());
    assert_eq!(in_part.is_worn(), whole.is_worn());
    assert_ne!(refitted, before, "control");

    let ranges = in_part.gpu_refitted().expect("refitted");
    let sent = |nodes: &[Range<usize>], leaves: &[Range<usize>]| {
        (
            patched(&before.0, &refitted.0, nodes),
            patched(&before.1, &refitted.1, leaves),
        )
    };
    assert_eq!(sent(&ranges.nodes, &ranges.leaves), refitted);
    assert_ne!(
        sent(&ranges.nodes[1..], &ranges.leaves),
        refitted,
        "control"
    );
    assert_ne!(
        sent(&ranges.nodes, &ranges.leaves[1..]),
        refitted,
        "control"
    );
    let count = |ranges: &[Range<usize>]| ranges.iter().map(Range::len).sum::<usize>();
    assert!(count(&ranges.leaves) < before.1.len() / 2, "{ranges:?}");
}
