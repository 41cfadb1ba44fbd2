//! The traversal with AVX2: eight boxes or triangles at a time, bit for bit the portable results (no fused operation). The same code compiled
//! for AVX-512 has twice the registers.

use std::arch::x86_64::*;

use super::Ray;
use super::trace::{BOX_MARGIN, Found, PROJECTED_SLACK, start, traversal};
use super::wide::{Eight, LEAF, TriangleBlock, WideBvh, WideNode};

/// Nearest or any accepted hit. Call only where [`has_avx2`] says so.
#[inline(always)]
pub(super) fn traverse<const ANY: bool>(tree: &WideBvh, ray: &Ray) -> Found {
    // SAFETY: `Kernel::supported` offers `Avx2` only where the processor has these features.
    unsafe { kernel::<ANY>(tree, ray) }
}

/// The same with AVX-512's registers, of which there are enough to hold the ray. Call only where [`has_avx512`] says so.
#[inline(always)]
pub(super) fn traverse_avx512<const ANY: bool>(tree: &WideBvh, ray: &Ray) -> Found {
    // SAFETY: `Kernel::supported` offers `Avx512` only where the processor has these features.
    unsafe { kernel_avx512::<ANY>(tree, ray) }
}

/// Whether this processor has what [`traverse`] uses.
pub(super) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

/// Whether this processor has what [`traverse_avx512`] uses.
pub(super) fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
}

traversal! {
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
    fn kernel(Lanes::new, boxes, block, prefetch)
}

traversal! {
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt,avx512f,avx512vl,avx512dq")]
    fn kernel_avx512(Lanes::new, boxes, block, prefetch)
}

/// Axis permutations that end with a given axis. Not a constant, which would be copied for every ray.
static AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// A ray in all lanes.
struct Lanes {
    origin: [__m256; 3],
    inv_direction: [__m256; 3],
    /// The same, larger by the box margin.
    exit_inv_direction: [__m256; 3],
    /// By axis: 0 if the low planes are nearer, 1 if the high ones are.
    near_side: [usize; 3],
    /// Axis permutation: the last one is the direction's largest component.
    axes: [usize; 3],
    /// Origin in permuted order.
    sheared_origin: [__m256; 3],
    /// Shear that takes the direction to the last axis, and the scale along it.
    shear: [__m256; 3],
    t_min: __m256,
}

impl Lanes {
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
    fn new(ray: &Ray, largest: usize) -> Lanes {
        let [x, y, z] = ray.direction.to_array();
        // -0 + 0 is +0, so that both zeros take the same inverse.
        let direction = _mm_add_ps(_mm_set_ps(1.0, z, y, x), _mm_setzero_ps());
        let origin: &[f32; 3] = ray.origin.as_ref();
        let inverse = _mm_div_ps(_mm_set1_ps(1.0), direction);
        let axes = AXES[largest];
        let pick = |v: __m128, axis: usize| {
            _mm256_broadcastss_ps(_mm_permutevar_ps(v, _mm_cvtsi32_si128(axis as i32)))
        };
        let scale = _mm_permutevar_ps(inverse, _mm_set1_epi32(largest as i32));
        let shear = _mm_mul_ps(direction, scale);
        let backward = _mm_movemask_ps(_mm_cmplt_ps(direction, _mm_setzero_ps())) as usize;
        let inv_direction = [
            _mm256_broadcastss_ps(inverse),
            _mm256_broadcastss_ps(_mm_movehdup_ps(inverse)),
            _mm256_broadcastss_ps(_mm_movehl_ps(inverse, inverse)),
        ];
        let margin = _mm256_set1_ps(BOX_MARGIN);
        Lanes {
            origin: origin.map(|coordinate| _mm256_set1_ps(coordinate)),
            inv_direction,
            exit_inv_direction: inv_direction.map(|inverse| _mm256_mul_ps(inverse, margin)),
            near_side: [backward & 1, backward >> 1 & 1, backward >> 2 & 1],
            axes,
            sheared_origin: axes.map(|axis| _mm256_set1_ps(origin[axis])),
            shear: [
                pick(shear, axes[0]),
                pick(shear, axes[1]),
                _mm256_broadcastss_ps(scale),
            ],
            t_min: _mm256_set1_ps(start(ray)),
        }
    }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn row(values: &[f32; 8]) -> __m256 {
    bytemuck::cast(*values)
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn boxes(node: &WideNode, lanes: &Lanes, limit: f32) -> (u32, Eight) {
    // Needed as soon as the mask is known, and on a cache line of its own.
    _mm_prefetch::<_MM_HINT_T0>(node.children.as_ptr().cast());
    let entry = |axis: usize| {
        let plane = row(&node.planes[axis][lanes.near_side[axis] & 1]);
        _mm256_mul_ps(
            _mm256_sub_ps(plane, lanes.origin[axis]),
            lanes.inv_direction[axis],
        )
    };
    let exit = |axis: usize| {
        let plane = row(&node.planes[axis][(lanes.near_side[axis] & 1) ^ 1]);
        _mm256_mul_ps(
            _mm256_sub_ps(plane, lanes.origin[axis]),
            lanes.exit_inv_direction[axis],
        )
    };
    let limit = _mm256_set1_ps(limit * BOX_MARGIN);
    let near = _mm256_max_ps(
        _mm256_max_ps(entry(1), entry(2)),
        _mm256_max_ps(entry(0), lanes.t_min),
    );
    let far = _mm256_min_ps(
        _mm256_min_ps(exit(1), exit(2)),
        _mm256_min_ps(exit(0), limit),
    );
    let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far));
    (mask as u32, bytemuck::cast(near))
}

/// Larger and smaller of three.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn range(a: __m256, b: __m256, c: __m256) -> (__m256, __m256) {
    (
        _mm256_min_ps(_mm256_min_ps(a, b), c),
        _mm256_max_ps(_mm256_max_ps(a, b), c),
    )
}

/// `a * b - c * d`, unfused.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn edge(a: __m256, b: __m256, c: __m256, d: __m256) -> __m256 {
    _mm256_sub_ps(_mm256_mul_ps(a, b), _mm256_mul_ps(c, d))
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn vertex(block: &TriangleBlock, lanes: &Lanes, index: usize) -> [__m256; 3] {
    // The bound is known, but not to the compiler, which otherwise checks each row.
    let [kx, ky, kz] = lanes.axes.map(|axis| axis.min(2));
    let offset = |axis: usize| row(&block.rows[index][axis]);
    let x = _mm256_sub_ps(offset(kx), lanes.sheared_origin[0]);
    let y = _mm256_sub_ps(offset(ky), lanes.sheared_origin[1]);
    let z = _mm256_sub_ps(offset(kz), lanes.sheared_origin[2]);
    [
        _mm256_sub_ps(x, _mm256_mul_ps(lanes.shear[0], z)),
        _mm256_sub_ps(y, _mm256_mul_ps(lanes.shear[1], z)),
        z,
    ]
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn block(block: &TriangleBlock, lanes: &Lanes, limit: f32) -> (u32, [Eight; 3]) {
    let [ax, ay, az] = vertex(block, lanes, 0);
    let [bx, by, bz] = vertex(block, lanes, 1);
    let [cx, cy, cz] = vertex(block, lanes, 2);
    let u = edge(cx, by, cy, bx);
    let v = edge(ax, cy, ay, cx);
    let w = edge(bx, ay, by, ax);
    let zero = _mm256_setzero_ps();
    let det = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let (least, most) = range(u, v, w);
    let inside = _mm256_or_ps(
        _mm256_cmp_ps::<_CMP_GE_OQ>(least, zero),
        _mm256_cmp_ps::<_CMP_LE_OQ>(most, zero),
    );
    let inside = _mm256_and_ps(inside, _mm256_cmp_ps::<_CMP_NEQ_UQ>(det, zero));
    if _mm256_movemask_ps(inside) == 0 {
        return (0, [Eight([0.0; 8]); 3]);
    }
    let inv_det = _mm256_div_ps(_mm256_set1_ps(1.0), det);
    let second = _mm256_mul_ps(v, inv_det);
    let third = _mm256_mul_ps(w, inv_det);
    let a_part = _mm256_mul_ps(_mm256_mul_ps(u, inv_det), az);
    let b_part = _mm256_mul_ps(second, bz);
    let c_part = _mm256_mul_ps(third, cz);
    let t = _mm256_mul_ps(
        _mm256_add_ps(_mm256_add_ps(a_part, b_part), c_part),
        lanes.shear[2],
    );
    let within = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GE_OQ>(t, lanes.t_min),
        _mm256_cmp_ps::<_CMP_LE_OQ>(t, _mm256_set1_ps(limit)),
    );
    let hit = _mm256_and_ps(inside, within);
    if _mm256_movemask_ps(hit) == 0 {
        return (0, [Eight([0.0; 8]); 3]);
    }
    let sign = _mm256_set1_ps(-0.0);
    let size = |value: __m256| _mm256_andnot_ps(sign, value);
    let (low_x, high_x) = range(ax, bx, cx);
    let (low_y, high_y) = range(ay, by, cy);
    let largest = _mm256_max_ps(
        _mm256_max_ps(_mm256_max_ps(size(ax), size(bx)), size(cx)),
        _mm256_max_ps(_mm256_max_ps(size(ay), size(by)), size(cy)),
    );
    let slack = _mm256_mul_ps(_mm256_set1_ps(PROJECTED_SLACK), largest);
    let minus = _mm256_xor_ps(slack, sign);
    let bounded = _mm256_and_ps(
        _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_LE_OQ>(low_x, slack),
            _mm256_cmp_ps::<_CMP_GE_OQ>(high_x, minus),
        ),
        _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_LE_OQ>(low_y, slack),
            _mm256_cmp_ps::<_CMP_GE_OQ>(high_y, minus),
        ),
    );
    let mask = _mm256_movemask_ps(_mm256_and_ps(hit, bounded));
    (mask as u32, [t, second, third].map(bytemuck::cast))
}

/// Asks for the first two cache lines of a node or of a leaf's first block; asking for all of them takes longer than it saves.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn prefetch(tree: &WideBvh, child: u32) {
    let start = if child & LEAF == 0 {
        let node = tree.nodes.as_ptr().wrapping_add(child as usize);
        node.cast::<i8>()
    } else {
        let first = ((child & !LEAF) >> 3) as usize;
        tree.blocks.as_ptr().wrapping_add(first).cast::<i8>()
    };
    _mm_prefetch::<_MM_HINT_T0>(start);
    _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64));
}
