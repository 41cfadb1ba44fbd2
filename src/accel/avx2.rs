//! The traversal with AVX2: eight boxes or triangles at a time, bit for bit the portable results (no fused operation).

use std::arch::x86_64::*;

use super::trace::{BOX_MARGIN, Found, PROJECTED_SLACK, RayFrame, Stack, traversal};
use super::wide::{Eight, LEAF, TriangleBlock, WideBvh, WideNode};

/// Nearest or any accepted hit. Call only where [`super::trace::Kernel::best`] found the instructions.
pub(super) fn traverse<const ANY: bool>(
    tree: &WideBvh,
    frame: &RayFrame,
    found: Found,
    stack: &mut Stack,
) -> Found {
    // SAFETY: `Kernel::Avx2` exists only where the processor has these features.
    unsafe { kernel::<ANY>(tree, frame, found, stack) }
}

traversal! {
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
    fn kernel(Lanes::new, boxes, block, prefetch)
}

/// A ray in all lanes.
struct Lanes {
    origin: [__m256; 3],
    inv_direction: [__m256; 3],
    near_side: [usize; 3],
    axes: [usize; 3],
    /// Origin in permuted order.
    sheared_origin: [__m256; 3],
    shear: [__m256; 3],
    t_min: __m256,
}

impl Lanes {
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
    fn new(frame: &RayFrame) -> Lanes {
        let along = |axis: usize| _mm256_set1_ps(frame.origin[axis.min(2)]);
        let [kx, ky, kz] = frame.axes;
        let origin = [
            _mm256_set1_ps(frame.origin[0]),
            _mm256_set1_ps(frame.origin[1]),
            _mm256_set1_ps(frame.origin[2]),
        ];
        Lanes {
            origin,
            inv_direction: [
                _mm256_set1_ps(frame.inv_direction[0]),
                _mm256_set1_ps(frame.inv_direction[1]),
                _mm256_set1_ps(frame.inv_direction[2]),
            ],
            near_side: frame.near_side.map(|side| side & 1),
            axes: frame.axes,
            sheared_origin: [along(kx), along(ky), along(kz)],
            shear: [
                _mm256_set1_ps(frame.shear[0]),
                _mm256_set1_ps(frame.shear[1]),
                _mm256_set1_ps(frame.shear[2]),
            ],
            t_min: _mm256_set1_ps(frame.t_min),
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
    let mut near = lanes.t_min;
    let mut far = _mm256_set1_ps(limit);
    for axis in 0..3 {
        let near_side = lanes.near_side[axis] & 1;
        let plane = row(&node.planes[axis][near_side]);
        let entry = _mm256_mul_ps(
            _mm256_sub_ps(plane, lanes.origin[axis]),
            lanes.inv_direction[axis],
        );
        near = _mm256_max_ps(entry, near);
        let plane = row(&node.planes[axis][near_side ^ 1]);
        let exit = _mm256_mul_ps(
            _mm256_sub_ps(plane, lanes.origin[axis]),
            lanes.inv_direction[axis],
        );
        far = _mm256_min_ps(exit, far);
    }
    far = _mm256_mul_ps(far, _mm256_set1_ps(BOX_MARGIN));
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

/// Asks for the cache lines of a node or of a leaf's first block.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,lzcnt,popcnt")]
fn prefetch(tree: &WideBvh, child: u32) {
    let (start, lines) = if child & LEAF == 0 {
        (
            std::ptr::from_ref(&tree.nodes[child as usize]).cast::<i8>(),
            4,
        )
    } else {
        let first = ((child & !LEAF) >> 3) as usize;
        (std::ptr::from_ref(&tree.blocks[first]).cast::<i8>(), 5)
    };
    for line in 0..lines {
        _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line));
    }
}
