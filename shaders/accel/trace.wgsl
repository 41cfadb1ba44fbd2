// Nearest or any hit of a ray in one world. Twin: src/accel/trace.rs does the same arithmetic on triangles over another tree; equal distances
// are decided by triangle id, so that both find the same hits.
//
// The tree is the compressed wide BVH of Ylitie, Karras and Laine (HPG 2017), made in src/accel/compressed.rs.

import package::gpu::buffers::{bvh_leaves, bvh_nodes, frame};
import package::packed::records::SIDE_VIRTUAL;
import package::shared::{NONE, WORKGROUP};

// A hit counts if t > t_min, or t == t_min and its id is larger than skip, and if t < t_max.
struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
    skip: u32,
}

@if(shallow_trees)
const STACK_LEVELS = SHALLOW_LEVELS;
@if(!shallow_trees)
const STACK_LEVELS = MOST_LEVELS;

var<workgroup> trace_stack: array<vec2<u32>, STACK_LEVELS * WORKGROUP>;

fn is_finite3(v: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(v) & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

fn infinity() -> f32 {
    var bits = 0x7f800000u;
    return bitcast<f32>(bits);
}

// Moves axis `last` to the end, keeping the cycle.
fn turn(v: vec3<f32>, last: u32) -> vec3<f32> {
    if last == 0u {
        return v.yzx;
    }
    if last == 1u {
        return v.zxy;
    }
    return v;
}

// cross(p, q) from one canonical order of the two vertices: a neighbour that shares the edge gets exactly the negative, fused or not.
fn edge_function(p: vec2<f32>, q: vec2<f32>) -> f32 {
    let swapped = p.x > q.x || (p.x == q.x && p.y > q.y);
    let first = select(p, q, swapped);
    let second = select(q, p, swapped);
    let value = first.x * second.y - first.y * second.x;
    if all(p == q) {
        return 0.0;
    }
    return select(value, -value, swapped);
}

// For each of four children the bits to set in the hit mask: where, and which.
fn child_bit_index(meta4: u32, octant: u32) -> u32 {
    let is_inner = (meta4 & (meta4 << 1u)) & 0x10101010u;
    let inner_mask = (is_inner >> 4u) * 0xffu;
    return (meta4 ^ (octant & inner_mask)) & 0x1f1f1f1fu;
}

// `world`: SIDE_REAL or SIDE_VIRTUAL. `thread`: local invocation index, which picks a part of the stack.
fn trace(ray: Ray, world: u32, any_hit: bool, thread: u32) -> Hit {
    var hit = Hit(infinity(), 0.0, 0.0, NONE);
    let extent = max(max(abs(ray.direction.x), abs(ray.direction.y)), abs(ray.direction.z));
    if !is_finite3(ray.origin) || !is_finite3(ray.direction) || extent == 0.0 || !(ray.t_min < ray.t_max) {
        return hit;
    }
    let node_base = select(0u, frame.virtual_node_base, world == SIDE_VIRTUAL);
    let leaf_base = select(0u, frame.virtual_leaf_base, world == SIDE_VIRTUAL);
    let node_end = select(frame.virtual_node_base, arrayLength(&bvh_nodes) / 5u, world == SIDE_VIRTUAL);
    if node_base >= node_end {
        return hit;
    }

    // Comparisons instead of signs: -0 counts as +0.
    let backward = ray.direction < vec3<f32>(0.0);
    let size = max(abs(ray.direction), vec3<f32>(LEAST_COMPONENT));
    let inverse = select(vec3<f32>(1.0), vec3<f32>(-1.0), backward) / size;
    let octant = dot(select(vec3<u32>(0x04040404u, 0x02020202u, 0x01010101u), vec3<u32>(0u), backward), vec3<u32>(1u));

    let magnitude = abs(ray.direction);
    var last = 2u;
    if magnitude.x > magnitude.y {
        if magnitude.x > magnitude.z {
            last = 0u;
        }
    } else if magnitude.y > magnitude.z {
        last = 1u;
    }
    let turned_direction = turn(ray.direction, last);
    let scale = 1.0 / turned_direction.z;
    let shear = vec3<f32>(turned_direction.x * scale, turned_direction.y * scale, scale);

    var t_best = ray.t_max;
    // No id is smaller: a hit at exactly t_max is not accepted.
    var id_best = 0u;
    var depth = 0u;
    // First child's index; bits 24 and up: children entered, by priority; bits 0 to 7: slots that hold nodes.
    var group = vec2<u32>(0u, 0x80000000u);
    loop {
        var triangles = vec2<u32>(0u);
        if group.y > 0x00ffffffu {
            let bit = firstLeadingBit(group.y);
            let slot = (bit - 24u) ^ (octant & 7u);
            let before = countOneBits(group.y & ~(0xffffffffu << slot) & 0xffu);
            let node = 5u * (node_base + group.x + before);
            group.y &= ~(1u << bit);
            if group.y > 0x00ffffffu && depth < STACK_LEVELS {
                trace_stack[depth * WORKGROUP + thread] = group;
                depth += 1u;
            }

            let n0 = bvh_nodes[node];
            let n1 = bvh_nodes[node + 1u];
            let n2 = bvh_nodes[node + 2u];
            let n3 = bvh_nodes[node + 3u];
            let n4 = bvh_nodes[node + 4u];
            let cell = bitcast<vec3<f32>>(vec3<u32>((n0.w & 0xffu) << 23u, (n0.w & 0xff00u) << 15u, (n0.w & 0xff0000u) << 7u));
            let step = cell * inverse;
            let start = (bitcast<vec3<f32>>(n0.xyz) - ray.origin) * inverse;
            // Sums of the two below err by at most 8 units of their sizes, and the triangle test by as much.
            let slack = (abs(start) + 256.0 * abs(step)) * BOX_SLACK;
            let start_near = start - slack;
            let start_far = start + slack;
            var entered = 0u;
            for (var half = 0u; half < 2u; half++) {
                let low = vec3<u32>(select(n2.x, n2.y, half == 1u), select(n3.x, n3.y, half == 1u), select(n4.x, n4.y, half == 1u));
                let high = vec3<u32>(select(n2.z, n2.w, half == 1u), select(n3.z, n3.w, half == 1u), select(n4.z, n4.w, half == 1u));
                let near_cells = select(low, high, backward);
                let far_cells = select(high, low, backward);
                let meta4 = select(n1.z, n1.w, half == 1u);
                let bit_index = child_bit_index(meta4, octant);
                let child_bits = (meta4 >> 5u) & 0x07070707u;
                for (var shift = 0u; shift < 32u; shift += 8u) {
                    let near = vec3<f32>((near_cells >> vec3<u32>(shift)) & vec3<u32>(0xffu)) * step + start_near;
                    let far = vec3<f32>((far_cells >> vec3<u32>(shift)) & vec3<u32>(0xffu)) * step + start_far;
                    let t_near = max(max(near.x, near.y), max(near.z, ray.t_min));
                    let t_far = min(min(far.x, far.y), min(far.z, t_best));
                    if t_near <= t_far {
                        entered |= ((child_bits >> shift) & 0xffu) << ((bit_index >> shift) & 0xffu);
                    }
                }
            }
            group = vec2<u32>(n1.x, (entered & 0xff000000u) | (n0.w >> 24u));
            triangles = vec2<u32>(n1.y, entered & 0x00ffffffu);
        }

        while triangles.y != 0u {
            let bit = firstTrailingBit(triangles.y);
            triangles.y &= triangles.y - 1u;
            let leaf = 3u * (leaf_base + triangles.x + bit);
            let v0 = bvh_leaves[leaf];
            let a3 = turn(v0.xyz - ray.origin, last);
            let b3 = turn(bvh_leaves[leaf + 1u].xyz - ray.origin, last);
            let c3 = turn(bvh_leaves[leaf + 2u].xyz - ray.origin, last);
            let a = a3.xy - shear.xy * a3.z;
            let b = b3.xy - shear.xy * b3.z;
            let c = c3.xy - shear.xy * c3.z;
            let u = edge_function(c, b);
            let v = edge_function(a, c);
            let w = edge_function(b, a);
            let det = u + v + w;
            if (min(min(u, v), w) < 0.0 && max(max(u, v), w) > 0.0) || det == 0.0 {
                continue;
            }
            let inv_det = 1.0 / det;
            let weights = vec3<f32>(u * inv_det, v * inv_det, w * inv_det);
            let t = (weights.x * a3.z + weights.y * b3.z + weights.z * c3.z) * shear.z;
            let largest = max(max(abs(a), abs(b)), abs(c));
            let slack = PROJECTED_SLACK * max(largest.x, largest.y);
            if any(min(min(a, b), c) > vec2<f32>(slack)) || any(max(max(a, b), c) < vec2<f32>(-slack)) {
                continue;
            }
            let id = bitcast<u32>(v0.w);
            if (t > ray.t_min || (t == ray.t_min && id > ray.skip)) && (t < t_best || (t == t_best && id < id_best)) {
                t_best = t;
                id_best = id;
                hit = Hit(t, weights.y, weights.z, id);
                if any_hit {
                    return hit;
                }
            }
        }

        if group.y <= 0x00ffffffu {
            if depth == 0u {
                break;
            }
            depth -= 1u;
            group = trace_stack[depth * WORKGROUP + thread];
        }
    }
    return hit;
}
