//! Traversal of the CPU's tree and the triangle test. Twin of `shaders/accel/trace.wgsl`: the triangle test there does the same f32 operations.

use super::Ray;
use super::wide::{Eight, TriangleBlock, WideBvh, WideNode};
use crate::shared::shared;

shared! {
    /// Slack of the projected bounds test, relative to the largest projected coordinate: four units of rounding, doubled.
    pub(super) const PROJECTED_SLACK: f32 = 1.0 / (1 << 21) as f32;
    /// Slack of the GPU's box test: 16 units of rounding.
    const BOX_SLACK: f32 = 1.0 / (1 << 20) as f32;
    /// 2^-80: its inverse times any distance is finite. A flat box is wider than what such a component moves a ray.
    const LEAST_COMPONENT: f32 = f32::from_bits((127 - 80) << 23);
    /// Most levels of a tree on the GPU: each leaves at most one group of children waiting.
    const MOST_LEVELS: u32 = super::compressed::MAX_LEVELS as u32;
    /// Levels of a tree that leaves room for twice as many waves: the stack is most of a kernel's workgroup memory.
    pub const SHALLOW_LEVELS: u32 = 10;

    /// Where a ray met a triangle: `(1 - u - v) * v0 + u * v1 + v * v2`.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Hit {
        /// Distance; infinite on a miss.
        pub t: f32,
        pub u: f32,
        pub v: f32,
        /// Global triangle id, [`NONE`](crate::shared::NONE) on a miss.
        pub triangle: u32,
    }
}

/// Factor by which a box may be farther than a hit: 16 units of rounding (see the module's proof).
pub(super) const BOX_MARGIN: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// What the portable traversal needs to know of a ray.
struct RayFrame {
    origin: [f32; 3],
    inv_direction: [f32; 3],
    /// The same, larger by the box margin.
    exit_inv_direction: [f32; 3],
    /// By axis: 0 if the low planes are nearer, 1 if the high ones are.
    near_side: [usize; 3],
    /// Axis permutation: the last one is the direction's largest component.
    axes: [usize; 3],
    /// Shear that takes the direction to the last axis, and the scale along it.
    shear: [f32; 3],
    t_min: f32,
}

impl RayFrame {
    #[inline]
    fn new(ray: &Ray, largest: usize) -> RayFrame {
        // -0 + 0 is +0, so that both zeros take the same inverse.
        let direction = ray.direction.to_array().map(|d| d + 0.0);
        let axes = [(largest + 1) % 3, (largest + 2) % 3, largest];
        let inv_direction = direction.map(|d| 1.0 / d);
        let scale = inv_direction[largest];
        RayFrame {
            origin: ray.origin.to_array(),
            inv_direction,
            exit_inv_direction: inv_direction.map(|inverse| inverse * BOX_MARGIN),
            near_side: direction.map(|d| usize::from(d < 0.0)),
            axes,
            shear: [
                direction[axes[0]] * scale,
                direction[axes[1]] * scale,
                scale,
            ],
            t_min: start(ray),
        }
    }
}

/// Whether the ray can hit anything: finite, with an interval that is not empty.
#[inline(always)]
pub(super) fn is_sound(ray: &Ray, largest: usize) -> bool {
    let zero = |v: f32| v * 0.0;
    let [ox, oy, oz] = ray.origin.to_array();
    let [dx, dy, dz] = ray.direction.to_array();
    // Zero unless one of them is infinite or NaN.
    let sum = (zero(ox) + zero(oy)) + (zero(oz) + zero(dx)) + (zero(dy) + zero(dz));
    let length: &[f32; 3] = ray.direction.as_ref();
    (sum == 0.0) & (ray.t_min < ray.t_max) & (length[largest] != 0.0)
}

/// The axis along which the direction is longest, without branches: rays in random order would have the processor guess.
#[inline(always)]
pub(super) fn largest_axis(ray: &Ray) -> usize {
    let [x, y, z] = ray.direction.to_array().map(|d| d.to_bits() & 0x7fff_ffff);
    let first = usize::from(x <= y);
    if x.max(y) > z { first } else { 2 }
}

/// `t_min` without a sign, so that the bits of distances sort as they do.
#[inline(always)]
pub(super) fn start(ray: &Ray) -> f32 {
    ray.t_min + 0.0
}

/// The nearest accepted triangle so far.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) t: f32,
    /// Weights of the second and third vertex.
    pub(super) weights: [f32; 2],
    pub(super) id: u32,
    pub(super) any: bool,
}

impl Found {
    #[inline(always)]
    pub(super) fn none(ray: &Ray) -> Found {
        Found {
            t: ray.t_max,
            // No id is smaller: a hit at exactly t_max is not accepted.
            id: 0,
            weights: [0.0; 2],
            any: false,
        }
    }

    #[inline(always)]
    pub(super) fn accepts(&self, ray: &Ray, t: f32, id: u32) -> bool {
        (t > ray.t_min || (t == ray.t_min && id > ray.skip))
            && (t < self.t || (t == self.t && id < self.id))
    }
}

/// Defines a traversal `fn NAME<const ANY: bool>(&WideBvh, &Ray) -> Found`.
///
/// `$lanes` makes the vector form of a ray, none for a ray that cannot hit; `$boxes(node, lanes, limit)` returns the mask of children
/// entered before `limit` and their distances; `$block(block, lanes, limit)` the mask of triangles hit in [t_min, limit], their distances
/// and the weights of their second and third vertices; `$prefetch(tree, child)` may fetch a child that waits.
macro_rules! traversal {
    ($(#[$attribute:meta])* fn $name:ident($lanes:path, $boxes:path, $block:path, $prefetch:path)) => {
        $(#[$attribute])*
        fn $name<const ANY: bool>(
            tree: &$crate::accel::wide::WideBvh,
            ray: &$crate::accel::Ray,
        ) -> $crate::accel::trace::Found {
            use $crate::accel::{stack::{Stack, UNUSED}, trace::{BOX_MARGIN, Found, is_sound, largest_axis}, wide::LEAF};
            let mut found = Found::none(ray);
            let largest = largest_axis(ray);
            if !is_sound(ray, largest) {
                return found;
            }
            let lanes = $lanes(ray, largest);
            let mut storage = UNUSED;
            let mut stack = Stack::new(&mut storage);
            let mut child = 0u32;
            loop {
                if child & LEAF == 0 {
                    let node = &tree.nodes[child as usize];
                    let (mut mask, near) = $boxes(node, &lanes, found.t);
                    if mask != 0 {
                        let mut lane = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        if mask == 0 {
                            child = node.children[lane];
                            continue;
                        }
                        // Near the root boxes lie one behind the other, and the nearest should come first. Deeper they lie side by
                        // side, and whether anything is hit depends so little on the order that comparing them does not pay.
                        if ANY && !stack.is_empty() {
                            child = node.children[lane];
                            while mask != 0 {
                                lane = mask.trailing_zeros() as usize & 7;
                                mask &= mask - 1;
                                let other = node.children[lane];
                                $prefetch(tree, other);
                                stack.push(u64::from(other));
                            }
                            continue;
                        }
                        let entry = |lane: usize| {
                            u64::from(near.0[lane].to_bits()) << 32 | u64::from(node.children[lane])
                        };
                        let mut nearest = entry(lane);
                        while mask != 0 {
                            lane = mask.trailing_zeros() as usize & 7;
                            mask &= mask - 1;
                            let other = entry(lane);
                            let farther = nearest.max(other);
                            nearest = nearest.min(other);
                            $prefetch(tree, farther as u32);
                            stack.push(farther);
                        }
                        child = nearest as u32;
                        continue;
                    }
                } else {
                    let first = (child & !LEAF) >> 3;
                    for block_index in first..first + (child & 7) + 1 {
                        let block = &tree.blocks[block_index as usize];
                        let (mut mask, [distances, second, third]) = $block(block, &lanes, found.t);
                        while mask != 0 {
                            let lane = mask.trailing_zeros() as usize & 7;
                            mask &= mask - 1;
                            let (t, id) = (distances.0[lane], block.ids[lane]);
                            if found.accepts(ray, t, id) {
                                found.t = t;
                                found.id = id;
                                found.weights = [second.0[lane], third.0[lane]];
                                found.any = true;
                                if ANY {
                                    return found;
                                }
                            }
                        }
                    }
                }
                let limit = found.t * BOX_MARGIN;
                loop {
                    let Some(entry) = stack.pop() else {
                        return found;
                    };
                    if f32::from_bits((entry >> 32) as u32) <= limit {
                        child = entry as u32;
                        break;
                    }
                }
            }
        }
    };
}
pub(super) use traversal;

/// Nearest or any accepted hit, without special instructions.
#[inline(always)]
pub(super) fn traverse<const ANY: bool>(tree: &WideBvh, ray: &Ray) -> Found {
    portable::<ANY>(tree, ray)
}

/// One triangle seen along the ray.
struct Projected {
    /// Barycentric weights of the three vertices.
    weights: [f32; 3],
    t: f32,
    hit: bool,
}

/// The watertight test (Woop et al. 2013) of one lane.
///
/// Without fused operations the edge function of (p, q) is exactly minus that of (q, p), and its sign is never the wrong one, but rounding
/// can make it zero. Zero counts as inside; the bounds test undoes that for triangles much smaller than their distance from the ray.
#[inline(always)]
fn project(block: &TriangleBlock, frame: &RayFrame, lane: usize) -> Projected {
    let [kx, ky, kz] = frame.axes;
    let [shear_x, shear_y, scale] = frame.shear;
    let vertex = |i: usize| {
        let x = block.rows[i][kx][lane] - frame.origin[kx];
        let y = block.rows[i][ky][lane] - frame.origin[ky];
        let z = block.rows[i][kz][lane] - frame.origin[kz];
        [x - shear_x * z, y - shear_y * z, z]
    };
    let [ax, ay, az] = vertex(0);
    let [bx, by, bz] = vertex(1);
    let [cx, cy, cz] = vertex(2);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let det = u + v + w;
    let least = min(min(u, v), w);
    let most = max(max(u, v), w);
    let slack = PROJECTED_SLACK
        * max(
            max(max(ax.abs(), bx.abs()), cx.abs()),
            max(max(ay.abs(), by.abs()), cy.abs()),
        );
    let bounded = min(min(ax, bx), cx) <= slack
        && max(max(ax, bx), cx) >= -slack
        && min(min(ay, by), cy) <= slack
        && max(max(ay, by), cy) >= -slack;
    let inv_det = 1.0 / det;
    let weights = [u * inv_det, v * inv_det, w * inv_det];
    Projected {
        weights,
        t: (weights[0] * az + weights[1] * bz + weights[2] * cz) * scale,
        hit: (least >= 0.0 || most <= 0.0) && det != 0.0 && bounded,
    }
}

/// As the processor's instruction: the second operand if either is NaN.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// See [`min`].
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

traversal! { fn portable(RayFrame::new, portable_boxes, portable_block, nothing) }

fn nothing(_: &WideBvh, _: u32) {}

/// A plane through an origin that moves along it gives 0 * inf = NaN, which `min` and `max` pass over: no constraint.
#[inline(always)]
fn portable_boxes(node: &WideNode, frame: &RayFrame, limit: f32) -> (u32, Eight) {
    let mut near = [frame.t_min; 8];
    let mut far = [limit * BOX_MARGIN; 8];
    for axis in 0..3 {
        let near_side = frame.near_side[axis] & 1;
        let near_row = &node.planes[axis][near_side];
        let far_row = &node.planes[axis][near_side ^ 1];
        let origin = frame.origin[axis];
        let (entry, exit) = (frame.inv_direction[axis], frame.exit_inv_direction[axis]);
        for lane in 0..8 {
            near[lane] = max((near_row[lane] - origin) * entry, near[lane]);
            far[lane] = min((far_row[lane] - origin) * exit, far[lane]);
        }
    }
    let mut mask = 0;
    for lane in 0..8 {
        mask |= u32::from(near[lane] <= far[lane]) << lane;
    }
    (mask, Eight(near))
}

#[inline(always)]
fn portable_block(block: &TriangleBlock, frame: &RayFrame, limit: f32) -> (u32, [Eight; 3]) {
    let mut mask = 0;
    let mut results = [Eight([0.0; 8]); 3];
    for lane in 0..8 {
        let projected = project(block, frame, lane);
        let within = projected.t >= frame.t_min && projected.t <= limit;
        mask |= u32::from(projected.hit && within) << lane;
        results[0].0[lane] = projected.t;
        results[1].0[lane] = projected.weights[1];
        results[2].0[lane] = projected.weights[2];
    }
    (mask, results)
}
