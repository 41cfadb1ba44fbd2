//! The GPU's tree: obvhs' compressed wide BVH (Ylitie et al., HPG 2017) with the child boxes compressed anew.
//!
//! obvhs rounds the offset from the node's corner before it takes the floor, computes the cell size through a rounded logarithm and clamps
//! what then does not fit; with an outlier a million times larger than the rest its boxes lose triangles. Here cells are found in f64 and
//! widened by its rounding, so that a decompressed box contains its triangles exactly. What the shader's own arithmetic adds is bounded there.

use std::ops::Range;
use std::sync::LazyLock;

use glam::{DVec3, Vec3};
use obvhs::{
    aabb::Aabb,
    bvh2::Bvh2,
    cwbvh::{bvh2_to_cwbvh::bvh2_to_cwbvh, node::CwBvhNode},
};

use super::binary::padded_box;

/// Levels that the shader's stack serves.
pub(super) const MAX_LEVELS: usize = 24;

const MAX_LEAF_TRIANGLES: u32 = 3;

/// Smallest biased exponent of a cell, 2^-100: keeps cell sizes and their products with inverse directions normal numbers.
const LEAST_EXPONENT: i32 = 27;

/// As the shader reads it.
pub type Node = [[u32; 4]; 5];

pub(super) struct CompressedBvh {
    /// The root first.
    pub(super) nodes: Vec<Node>,
    /// Three a triangle.
    pub(super) leaves: Vec<[f32; 4]>,
    /// Nodes on the longest path.
    pub(super) levels: u32,
    /// Around the triangles of each node, enlarged; none without any.
    boxes: Vec<Aabb>,
    place: Place,
    /// By the last refit; `None` before one.
    pub(super) refitted: Option<Refitted>,
}

/// Records that a refit changed, in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refitted {
    /// Of the nodes below the root.
    pub nodes: Vec<Range<usize>>,
    /// Three records a triangle.
    pub leaves: Vec<Range<usize>>,
}

/// Adds records after those that are there; short gaps are filled, so that few ranges are left.
fn add_range(ranges: &mut Vec<Range<usize>>, more: Range<usize>) {
    const LONGEST_GAP: usize = 16;
    match ranges.last_mut() {
        Some(last) if more.start <= last.end + LONGEST_GAP => last.end = more.end,
        _ => ranges.push(more),
    }
}

/// Where in a world's arrays the nodes below a tree's root and its triangles stand.
#[derive(Clone, Copy)]
pub(super) struct Place {
    node: u32,
    triangle: u32,
}

/// A root over two trees, and theirs.
const ROOTS: u32 = 3;

impl Place {
    /// Of the first of two trees, after the roots.
    pub(super) const FIRST: Place = Place {
        node: ROOTS,
        triangle: 0,
    };

    /// Of the second, after the first.
    pub(super) fn after(first: &CompressedBvh) -> Place {
        Place {
            node: ROOTS + first.nodes.len() as u32 - 1,
            triangle: first.leaves.len() as u32 / 3,
        }
    }
}

/// A root over two trees at their places, and their roots. Where one has no triangles the other's root is the root, and the rest unused.
pub(super) fn join(first: &CompressedBvh, second: &CompressedBvh) -> [Node; ROOTS as usize] {
    let (a, b) = match (first.boxes.first(), second.boxes.first()) {
        (Some(&a), Some(&b)) => (a, b),
        (None, Some(_)) => return [second.nodes[0]; ROOTS as usize],
        (_, None) => return [first.nodes[0]; ROOTS as usize],
    };
    let mut root = CwBvhNode {
        child_base_idx: 1,
        imask: 0b11,
        ..Default::default()
    };
    // As obvhs marks a node: 24 and its slot.
    root.child_meta[..2].copy_from_slice(&[1 << 5 | 24, 1 << 5 | 25]);
    let mut boxes = [None; 8];
    boxes[..2].copy_from_slice(&[Some(a), Some(b)]);
    compress(&mut root, &boxes);
    [bytemuck::cast(root), first.nodes[0], second.nodes[0]]
}

impl CompressedBvh {
    /// One node without children.
    pub(super) fn empty() -> CompressedBvh {
        CompressedBvh {
            nodes: vec![[[0; 4]; 5]],
            leaves: Vec::new(),
            levels: 1,
            boxes: Vec::new(),
            place: Place::FIRST,
            refitted: None,
        }
    }

    /// [`CompressedBvh::empty`], for those who have none of their own.
    pub(super) fn none() -> &'static CompressedBvh {
        static NONE: LazyLock<CompressedBvh> = LazyLock::new(CompressedBvh::empty);
        &NONE
    }

    /// `None` if the tree is too deep for the shader's stack. The BVH2's depth must be bounded: obvhs recurses.
    pub(super) fn convert(
        tree: &Bvh2,
        triangles: &[[Vec3; 3]],
        first_id: u32,
        place: Place,
    ) -> Option<CompressedBvh> {
        let mut converted = bvh2_to_cwbvh(tree, MAX_LEAF_TRIANGLES, true, false);
        let nodes = &mut converted.nodes;
        let levels = levels(nodes);
        // One more joins two trees.
        if levels >= MAX_LEVELS {
            return None;
        }
        // Box of each triangle in leaf order, enlarged as in the BVH2.
        let mut enlarged = vec![Aabb::empty(); triangles.len()];
        for node in tree.nodes.iter().filter(|node| node.is_leaf()) {
            let triangle = tree.primitive_indices[node.first_index as usize];
            enlarged[triangle as usize] = *node.aabb();
        }
        let mut node_boxes = vec![Aabb::empty(); nodes.len()];
        // Children stand after their parents.
        for index in (0..nodes.len()).rev() {
            let node = nodes[index];
            let mut boxes = [None; 8];
            for (slot, child_box) in boxes.iter_mut().enumerate() {
                *child_box = match child(&node, slot) {
                    Child::None => None,
                    Child::Node(child) => Some(node_boxes[child]),
                    Child::Leaf(range) => {
                        let ids = &converted.primitive_indices[range];
                        ids.iter()
                            .map(|&id| enlarged[id as usize])
                            .reduce(|a, b| a.union(&b))
                    }
                };
            }
            node_boxes[index] = compress(&mut nodes[index], &boxes);
        }
        let mut leaves = Vec::with_capacity(3 * triangles.len());
        for &index in &converted.primitive_indices {
            let [a, b, c] = triangles[index as usize];
            leaves.push([a.x, a.y, a.z, f32::from_bits(first_id + index)]);
            leaves.push([b.x, b.y, b.z, 0.0]);
            leaves.push([c.x, c.y, c.z, 0.0]);
        }
        for node in nodes.iter_mut() {
            node.child_base_idx += place.node - 1;
            node.primitive_base_idx += place.triangle;
        }
        Some(CompressedBvh {
            nodes: bytemuck::cast_slice(nodes).to_vec(),
            leaves,
            levels: levels as u32,
            boxes: node_boxes,
            place,
            refitted: None,
        })
    }

    /// Those of the triangles whose numbers are in `moved` have moved; the tree keeps its shape.
    pub(super) fn refit(&mut self, triangles: &[[Vec3; 3]], first_id: u32, moved: &Range<usize>) {
        let mut refitted = Refitted::default();
        let number = |leaf: &[[f32; 4]]| (leaf[0][3].to_bits() - first_id) as usize;
        for (index, leaf) in self.leaves.chunks_exact_mut(3).enumerate() {
            let triangle = number(leaf);
            if moved.contains(&triangle) {
                for (row, corner) in leaf.iter_mut().zip(triangles[triangle]) {
                    row[..3].copy_from_slice(&corner.to_array());
                }
                add_range(&mut refitted.leaves, 3 * index..3 * index + 3);
            }
        }
        let nodes: &mut [CwBvhNode] = bytemuck::cast_slice_mut(&mut self.nodes);
        let leaves = &self.leaves;
        let mut touched = vec![false; self.boxes.len()];
        // Children stand after their parents.
        for index in (0..self.boxes.len()).rev() {
            let node = CwBvhNode {
                child_base_idx: nodes[index].child_base_idx - (self.place.node - 1),
                primitive_base_idx: nodes[index].primitive_base_idx - self.place.triangle,
                ..nodes[index]
            };
            let held = |leaf: Range<usize>| {
                leaves[3 * leaf.start..3 * leaf.end]
                    .chunks_exact(3)
                    .map(number)
            };
            touched[index] = (0..8).any(|slot| match child(&node, slot) {
                Child::None => false,
                Child::Node(child) => touched[child],
                Child::Leaf(range) => held(range).any(|triangle| moved.contains(&triangle)),
            });
            if !touched[index] {
                continue;
            }
            let boxes = std::array::from_fn(|slot| match child(&node, slot) {
                Child::None => None,
                Child::Node(child) => Some(self.boxes[child]),
                Child::Leaf(range) => held(range)
                    .map(|triangle| padded_box(triangles, triangle))
                    .reduce(|a, b| a.union(&b)),
            });
            self.boxes[index] = compress(&mut nodes[index], &boxes);
        }
        // The root is sent by itself.
        for (index, _) in touched
            .iter()
            .skip(1)
            .enumerate()
            .filter(|(_, touched)| **touched)
        {
            add_range(&mut refitted.nodes, index..index + 1);
        }
        self.refitted = Some(refitted);
    }
}

enum Child {
    None,
    Node(usize),
    Leaf(std::ops::Range<usize>),
}

fn child(node: &CwBvhNode, slot: usize) -> Child {
    let meta = node.child_meta[slot];
    if meta == 0 {
        Child::None
    } else if node.imask >> slot & 1 == 1 {
        let before = (node.imask & ((1 << slot) - 1)).count_ones();
        Child::Node((node.child_base_idx + before) as usize)
    } else {
        let first = (node.primitive_base_idx + u32::from(meta & 31)) as usize;
        Child::Leaf(first..first + (meta >> 5).count_ones() as usize)
    }
}

/// Nodes on the longest path.
fn levels(nodes: &[CwBvhNode]) -> usize {
    let mut level = vec![1usize; nodes.len()];
    let mut deepest = 0;
    for (index, node) in nodes.iter().enumerate() {
        deepest = deepest.max(level[index]);
        for slot in 0..8 {
            if let Child::Node(child) = child(node, slot) {
                level[child] = level[index] + 1;
            }
        }
    }
    deepest
}

/// Writes the corner, the cell sizes and the children's cells; returns the box of all.
fn compress(node: &mut CwBvhNode, boxes: &[Option<Aabb>; 8]) -> Aabb {
    let total = boxes
        .iter()
        .flatten()
        .copied()
        .reduce(|a, b| a.union(&b))
        .unwrap_or(Aabb::new(Default::default(), Default::default()));
    let corner = total.min;
    node.p = corner.into();
    let offset_of = |point: glam::Vec3A| -> DVec3 { point.as_dvec3() - corner.as_dvec3() };
    let size = offset_of(total.max);
    let mut low = [[0u8; 8]; 3];
    let mut high = [[0u8; 8]; 3];
    for axis in 0..3 {
        let exponent = cell_exponent(size[axis]);
        node.e[axis] = exponent as u8;
        let cell = cell_size(exponent);
        for (slot, child_box) in boxes.iter().enumerate() {
            let Some(child_box) = child_box else { continue };
            low[axis][slot] = cell_below(offset_of(child_box.min)[axis], cell);
            high[axis][slot] = cell_above(offset_of(child_box.max)[axis], cell) as u8;
        }
    }
    [node.child_min_x, node.child_min_y, node.child_min_z] = low;
    [node.child_max_x, node.child_max_y, node.child_max_z] = high;
    total
}

/// Two roundings of an f64: those of the subtraction and of the widening itself.
const WIDEN: f64 = 2.0 * f64::EPSILON;

fn cell_below(offset: f64, cell: f64) -> u8 {
    (offset * (1.0 - WIDEN) / cell).floor() as u8
}

fn cell_above(offset: f64, cell: f64) -> f64 {
    (offset * (1.0 + WIDEN) / cell).ceil()
}

/// Biased exponent of the smallest power of two of which 255 cover `size`.
fn cell_exponent(size: f64) -> i32 {
    // 255 cells of 2^(n - 8) cover less than 2^n.
    let power = (size.to_bits() >> 52) as i32 - 1023;
    let mut exponent = LEAST_EXPONENT.max(power - 7 + 127);
    while cell_above(size, cell_size(exponent)) > 255.0 {
        exponent += 1;
    }
    exponent
}

fn cell_size(exponent: i32) -> f64 {
    f64::from_bits(((exponent - 127 + 1023) as u64) << 52)
}
