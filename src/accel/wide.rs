//! The CPU's tree: 8-wide nodes of f32 boxes, leaves of one or two blocks of eight triangles, collapsed from a BVH2 by dynamic programming
//! (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3.1).

use std::ops::Range;

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use super::binary::padded_box;
use super::large_pages::on_large_pages;

/// High bit of a child word: the child is a leaf, the rest is first block << 3 | blocks - 1. Without it the word is a node index.
pub(super) const LEAF: u32 = 1 << 31;

/// Deepest tree that the traversal stack serves: each level leaves at most seven children waiting.
pub(super) const MAX_LEVELS: usize = 73;

const WIDTH: usize = 8;

/// Eight numbers where one instruction can load or store them.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct Eight(pub(super) [f32; WIDTH]);

const MAX_LEAF_TRIANGLES: u32 = 16;
/// Cost of a triangle block relative to a node.
const BLOCK_COST: f32 = 0.4;

/// Eight child boxes and what they hold. An empty slot has an inverted infinite box and points at the all-zero block.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct WideNode {
    /// By axis: low planes, high planes.
    pub(super) planes: [[[f32; WIDTH]; 2]; 3],
    pub(super) children: [u32; WIDTH],
}

/// Eight triangles; unused lanes are zero triangles, which nothing hits.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct TriangleBlock {
    /// By vertex and axis.
    pub(super) rows: [[[f32; WIDTH]; 3]; 3],
    pub(super) ids: [u32; WIDTH],
}

pub(super) struct WideBvh {
    pub(super) nodes: Vec<WideNode>,
    /// Block 0 is the all-zero one.
    pub(super) blocks: Vec<TriangleBlock>,
    /// Triangles of each block: its first lanes.
    filled: Vec<u8>,
}

const EMPTY_NODE: WideNode = WideNode {
    planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
    children: [LEAF; WIDTH],
};

const ZERO_BLOCK: TriangleBlock = TriangleBlock {
    rows: [[[0.0; WIDTH]; 3]; 3],
    ids: [0; WIDTH],
};

impl WideNode {
    /// Around its children.
    fn bounds(&self) -> Aabb {
        let children = (0..WIDTH).filter(|&slot| self.children[slot] != LEAF);
        children.fold(Aabb::empty(), |whole, slot| whole.union(&self.child(slot)))
    }

    fn child(&self, slot: usize) -> Aabb {
        let corner = |side: usize| self.planes.map(|axis| axis[side][slot]);
        Aabb::new(corner(0).into(), corner(1).into())
    }

    fn set_slot(&mut self, slot: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.planes[axis][0][slot] = bounds.min[axis];
            self.planes[axis][1][slot] = bounds.max[axis];
        }
    }
}

impl TriangleBlock {
    fn set_lane(&mut self, lane: usize, corners: &[Vec3; 3]) {
        for (vertex, position) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.rows[vertex][axis][lane] = position[axis];
            }
        }
    }
}

/// Cheapest ways to represent the subtree of a BVH2 node.
#[derive(Clone, Copy)]
struct Choice {
    /// `cost[j]`: by at most j + 1 wide children.
    cost: [f32; WIDTH],
    /// `split[j]`: children for the left part << 4 | for the right part; 0 stands for one child.
    split: [u8; WIDTH],
    /// The same for the children of this node, should it become a wide node.
    inner_split: u8,
    /// As one child it is a leaf.
    leaf: bool,
    triangles: u32,
}

impl WideBvh {
    pub(super) fn empty() -> WideBvh {
        WideBvh {
            nodes: vec![EMPTY_NODE],
            blocks: vec![ZERO_BLOCK],
            filled: vec![0],
        }
    }

    /// Surface of all children's boxes over that of the root: nodes that a ray through the root meets on average (Goldsmith and Salmon,
    /// "Automatic creation of object hierarchies for ray tracing", 1987).
    pub(super) fn surface(&self) -> f32 {
        let (mut sum, mut root) = (0.0f64, 0.0f64);
        for (index, node) in self.nodes.iter().enumerate() {
            for slot in (0..WIDTH).filter(|&slot| node.children[slot] != LEAF) {
                sum += f64::from(node.child(slot).half_area());
            }
            if index == 0 {
                root = f64::from(node.bounds().half_area());
            }
        }
        if root > 0.0 { (sum / root) as f32 } else { 0.0 }
    }

    /// Those of the triangles whose numbers are in `moved` have moved; the tree keeps its shape.
    pub(super) fn refit(&mut self, triangles: &[[Vec3; 3]], first_id: u32, moved: &Range<usize>) {
        // New boxes, where there are any.
        let mut bounds: Vec<Option<Aabb>> = vec![None; self.nodes.len()];
        // Children stand after their parents.
        for index in (0..self.nodes.len()).rev() {
            let mut is_touched = false;
            for slot in 0..WIDTH {
                let child = self.nodes[index].children[slot];
                let of_child = match child & LEAF {
                    _ if child == LEAF => continue,
                    0 => bounds[child as usize],
                    _ => self.refit_leaf(child, triangles, first_id, moved),
                };
                if let Some(of_child) = of_child {
                    self.nodes[index].set_slot(slot, &of_child);
                    is_touched = true;
                }
            }
            bounds[index] = is_touched.then(|| self.nodes[index].bounds());
        }
    }

    /// The leaf's box, if it has a triangle that has moved.
    fn refit_leaf(
        &mut self,
        leaf: u32,
        triangles: &[[Vec3; 3]],
        first_id: u32,
        moved: &Range<usize>,
    ) -> Option<Aabb> {
        let first = ((leaf & !LEAF) >> 3) as usize;
        let end = first + 1 + (leaf & 7) as usize;
        let number = |id: u32| (id - first_id) as usize;
        let blocks = || (first..end).map(|block| (block, self.filled[block] as usize));
        let mut ids = blocks().flat_map(|(block, filled)| &self.blocks[block].ids[..filled]);
        if !ids.any(|&id| moved.contains(&number(id))) {
            return None;
        }
        let mut whole = Aabb::empty();
        for at in first..end {
            let block = &mut self.blocks[at];
            for lane in 0..self.filled[at] as usize {
                let triangle = number(block.ids[lane]);
                block.set_lane(lane, &triangles[triangle]);
                whole = whole.union(&padded_box(triangles, triangle));
            }
        }
        Some(whole)
    }

    /// `None` if the tree is deeper than [`MAX_LEVELS`].
    pub(super) fn collapse(tree: &Bvh2, triangles: &[[Vec3; 3]], first_id: u32) -> Option<WideBvh> {
        let choices = choose(tree);
        let mut wide = WideBvh::empty();
        wide.blocks.reserve(triangles.len() / 5);
        let mut open = vec![(0u32, 0usize, 1usize)];
        while let Some((source, target, level)) = open.pop() {
            if level > MAX_LEVELS {
                return None;
            }
            let mut children = wide_children(tree, &choices, source);
            children.sort_by(|&a, &b| {
                let area = |n: u32| tree.nodes[n as usize].aabb().half_area();
                area(b).total_cmp(&area(a))
            });
            for (slot, child) in children.into_iter().enumerate() {
                let bounds = tree.nodes[child as usize].aabb();
                let word = if choices[child as usize].leaf {
                    wide.push_leaf(tree, triangles, first_id, child)
                } else {
                    let index = wide.nodes.len();
                    wide.nodes.push(EMPTY_NODE);
                    open.push((child, index, level + 1));
                    index as u32
                };
                let node = &mut wide.nodes[target];
                node.set_slot(slot, bounds);
                node.children[slot] = word;
            }
        }
        Some(WideBvh {
            nodes: on_large_pages(&wide.nodes),
            blocks: on_large_pages(&wide.blocks),
            filled: wide.filled,
        })
    }

    fn push_leaf(&mut self, tree: &Bvh2, triangles: &[[Vec3; 3]], first_id: u32, root: u32) -> u32 {
        let first = self.blocks.len();
        let mut count = 0;
        let mut open = vec![root];
        while let Some(index) = open.pop() {
            let node = &tree.nodes[index as usize];
            if !node.is_leaf() {
                open.push(node.first_index + 1);
                open.push(node.first_index);
                continue;
            }
            let triangle = tree.primitive_indices[node.first_index as usize];
            if count % WIDTH == 0 {
                self.blocks.push(ZERO_BLOCK);
                self.filled.push(0);
            }
            let at = first + count / WIDTH;
            let lane = count % WIDTH;
            self.blocks[at].set_lane(lane, &triangles[triangle as usize]);
            self.blocks[at].ids[lane] = first_id + triangle;
            self.filled[at] += 1;
            count += 1;
        }
        LEAF | (first as u32) << 3 | (count.div_ceil(WIDTH) - 1) as u32
    }
}

/// BVH2 nodes that become the children of the wide node made from `source`.
fn wide_children(tree: &Bvh2, choices: &[Choice], source: u32) -> Vec<u32> {
    let node = &tree.nodes[source as usize];
    if node.is_leaf() {
        return vec![source];
    }
    let mut children = Vec::with_capacity(WIDTH);
    let halves = |first: u32, split: u8| [(first, split >> 4), (first + 1, split & 15)];
    let mut open = Vec::from(halves(
        node.first_index,
        choices[source as usize].inner_split,
    ));
    while let Some((index, budget)) = open.pop() {
        let split = choices[index as usize].split[budget as usize - 1];
        if split == 0 {
            children.push(index);
        } else {
            open.extend(halves(tree.nodes[index as usize].first_index, split));
        }
    }
    children
}

/// Cheapest split of `budget` children between two subtrees.
fn distribute(left: &Choice, right: &Choice, budget: usize) -> (f32, u8) {
    let mut best = (f32::INFINITY, 0);
    for k in 1..budget {
        let cost = left.cost[k - 1] + right.cost[budget - k - 1];
        if cost < best.0 {
            best = (cost, (k << 4 | (budget - k)) as u8);
        }
    }
    best
}

fn choose(tree: &Bvh2) -> Vec<Choice> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut open = vec![0u32];
    while let Some(index) = open.pop() {
        order.push(index);
        let node = &tree.nodes[index as usize];
        if !node.is_leaf() {
            open.push(node.first_index);
            open.push(node.first_index + 1);
        }
    }
    let unset = Choice {
        cost: [0.0; WIDTH],
        split: [0; WIDTH],
        inner_split: 0,
        leaf: true,
        triangles: 1,
    };
    let mut choices = vec![unset; tree.nodes.len()];
    for &index in order.iter().rev() {
        let node = &tree.nodes[index as usize];
        let area = node.aabb().half_area();
        if node.is_leaf() {
            choices[index as usize].cost = [BLOCK_COST * area; WIDTH];
            continue;
        }
        let left = &choices[node.first_index as usize];
        let right = &choices[node.first_index as usize + 1];
        let triangles = left.triangles + right.triangles;
        let (inner_cost, inner_split) = distribute(left, right, WIDTH);
        let as_node = area + inner_cost;
        let as_leaf = if triangles <= MAX_LEAF_TRIANGLES {
            BLOCK_COST * area * triangles.div_ceil(WIDTH as u32) as f32
        } else {
            f32::INFINITY
        };
        let mut choice = Choice {
            inner_split,
            leaf: as_leaf <= as_node && triangles <= MAX_LEAF_TRIANGLES,
            triangles,
            ..unset
        };
        choice.cost[0] = as_leaf.min(as_node);
        for budget in 2..=WIDTH {
            let (cost, split) = distribute(left, right, budget);
            let fewer = budget - 2;
            (choice.cost[budget - 1], choice.split[budget - 1]) = if cost < choice.cost[fewer] {
                (cost, split)
            } else {
                (choice.cost[fewer], choice.split[fewer])
            };
        }
        choices[index as usize] = choice;
    }
    choices
}
