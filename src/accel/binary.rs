//! The BVH2 that both wide trees are made from: obvhs' PLOC with reinsertion, one triangle a leaf, and a balanced tree for input on which
//! PLOC would take quadratic time or build a chain.

use glam::{Vec3, Vec3A};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision, morton::morton_encode_u64_unorm},
};

/// obvhs' conversion recurses to this depth.
pub(super) const MAX_DEPTH: usize = 200;

/// Share of the nodes that reinsertion moves.
const REINSERTION_RATIO: f32 = 0.05;

/// Least enlargement of a box relative to the triangle's largest extent: 16 units of rounding (see the module's proof).
const PAD: f32 = 1.0 / (1 << 20) as f32;

/// Clusters up to this number may merge one at a time: 2^24 steps in all.
const SLOW_MERGE_LIMIT: usize = 4096;

/// Builds over `triangles`; `None` without any.
pub(super) fn build(triangles: &[[Vec3; 3]]) -> Option<Bvh2> {
    if triangles.is_empty() {
        return None;
    }
    let boxes = padded_boxes(triangles);
    if merges_slowly(&boxes) {
        return Some(balanced(&boxes));
    }
    let indices = (0..triangles.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        &boxes,
        indices,
        SortPrecision::U64,
        3,
    );
    if depth(&tree) > MAX_DEPTH {
        return Some(balanced(&boxes));
    }
    ReinsertionOptimizer::default().run(&mut tree, REINSERTION_RATIO, None);
    Some(tree)
}

/// A tree of the least depth, whatever the triangles.
pub(super) fn build_balanced(triangles: &[[Vec3; 3]]) -> Bvh2 {
    balanced(&padded_boxes(triangles))
}

/// Levels below the root.
pub(super) fn depth(tree: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 0usize)];
    while let Some((index, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &tree.nodes[index as usize];
        if !node.is_leaf() {
            open.push((node.first_index, level + 1));
            open.push((node.first_index + 1, level + 1));
        }
    }
    deepest
}

/// Boxes of the triangles, enlarged by one to three times the bound that the triangle test needs. The varying part keeps identical
/// triangles from looking equally near to PLOC, which then would merge one pair at a time into a chain.
fn padded_boxes(triangles: &[[Vec3; 3]]) -> Vec<Aabb> {
    (0..triangles.len())
        .map(|index| padded_box(triangles, index))
        .collect()
}

/// One of [`padded_boxes`].
pub(super) fn padded_box(triangles: &[[Vec3; 3]], index: usize) -> Aabb {
    let [a, b, c] = triangles[index];
    let low = a.min(b).min(c);
    let high = a.max(b).max(c);
    let extent = (high - low).max_element();
    let bits = scramble(index as u64);
    let pad = |slot: u32| {
        let unit = ((bits >> (10 * slot)) & 1023) as f32 / 1024.0;
        extent * PAD * (1.0 + 2.0 * unit)
    };
    let outward = |low: f32, high: f32, axis: u32| {
        (
            (low - pad(2 * axis)).next_down(),
            (high + pad(2 * axis + 1)).next_up(),
        )
    };
    let (x0, x1) = outward(low.x, high.x, 0);
    let (y0, y1) = outward(low.y, high.y, 1);
    let (z0, z1) = outward(low.z, high.z, 2);
    Aabb::new(Vec3A::new(x0, y0, z0), Vec3A::new(x1, y1, z1))
}

/// SplitMix64's finaliser.
fn scramble(index: u64) -> u64 {
    let mut x = index.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Whether locally ordered clustering would merge few pairs a round while many clusters are left, as with nested triangles, where each
/// cluster's best partner is the next smaller one. Rehearses the clustering with two neighbours to each side.
fn merges_slowly(boxes: &[Aabb]) -> bool {
    const NEIGHBOURS: usize = 2;
    if boxes.len() <= SLOW_MERGE_LIMIT {
        return false;
    }
    let mut clusters = in_morton_order(boxes);
    let mut best = vec![0usize; clusters.len()];
    while clusters.len() > SLOW_MERGE_LIMIT {
        let count = clusters.len();
        for i in 0..count {
            let from = i.saturating_sub(NEIGHBOURS);
            let to = (i + NEIGHBOURS).min(count - 1);
            let mut least = f32::INFINITY;
            for j in (from..=to).filter(|&j| j != i) {
                let area = clusters[i].union(&clusters[j]).half_area();
                if area < least {
                    least = area;
                    best[i] = j;
                }
            }
        }
        let mut kept = 0;
        for i in 0..count {
            let partner = best[i];
            let mutual = best[partner] == i;
            if mutual && partner < i {
                continue;
            }
            clusters[kept] = if mutual {
                clusters[i].union(&clusters[partner])
            } else {
                clusters[i]
            };
            kept += 1;
        }
        clusters.truncate(kept);
        if count - kept < count / 32 {
            return true;
        }
    }
    false
}

fn in_morton_order(boxes: &[Aabb]) -> Vec<Aabb> {
    let mut total = Aabb::empty();
    for b in boxes {
        total = total.union(b);
    }
    let origin = total.min.as_dvec3();
    let scale = 1.0 / total.diagonal().as_dvec3();
    let mut keyed: Vec<(u64, u32)> = boxes
        .iter()
        .zip(0..)
        .map(|(b, index)| {
            let unit = (b.center().as_dvec3() - origin) * scale;
            (morton_encode_u64_unorm(unit), index)
        })
        .collect();
    keyed.sort_unstable();
    keyed.iter().map(|&(_, i)| boxes[i as usize]).collect()
}

/// Halves the triangles along the axis on which their centres spread most, down to one.
fn balanced(boxes: &[Aabb]) -> Bvh2 {
    let mut indices: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut tree = Bvh2::zeroed(boxes.len());
    let mut next = 1;
    let mut open = vec![(0usize, 0..boxes.len())];
    while let Some((slot, range)) = open.pop() {
        if range.len() == 1 {
            let index = indices[range.start];
            tree.nodes[slot] = Bvh2Node::new(boxes[index as usize], 1, range.start as u32);
            continue;
        }
        let part = &mut indices[range.clone()];
        let mut spread = Aabb::empty();
        for &index in part.iter() {
            spread.extend(boxes[index as usize].center());
        }
        let axis = spread.largest_axis();
        let middle = part.len() / 2;
        part.select_nth_unstable_by(middle, |&a, &b| {
            let (x, y) = (
                boxes[a as usize].center()[axis],
                boxes[b as usize].center()[axis],
            );
            x.total_cmp(&y).then(a.cmp(&b))
        });
        tree.nodes[slot] = Bvh2Node::new(Aabb::empty(), 0, next as u32);
        let split = range.start + middle;
        open.push((next, range.start..split));
        open.push((next + 1, split..range.end));
        next += 2;
    }
    // Children stand after their parents.
    for slot in (0..tree.nodes.len()).rev() {
        let node = tree.nodes[slot];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            let union = tree.nodes[first].aabb().union(tree.nodes[first + 1].aabb());
            tree.nodes[slot].set_aabb(union);
        }
    }
    tree.primitive_indices = indices;
    tree.children_are_ordered_after_parents = true;
    tree
}
