// Per-pixel sums of the film in double-float arithmetic. Twin of src/film/sums.rs.
//
// A double-float is a pair (hi, lo) whose exact sum is the value. Compilers may reassociate WGSL arithmetic, which turns the
// error terms below into 0; every intermediate is therefore passed through `opaque`, an XOR with a word `zero` that the caller
// reads from a uniform whose value is 0.

fn opaque(x: f32, zero: u32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ zero);
}

// s + e == a + b exactly, s the rounded sum (Knuth).
fn two_sum(a: f32, b: f32, zero: u32) -> vec2<f32> {
    let s = opaque(a + b, zero);
    let b_part = opaque(s - a, zero);
    let a_part = opaque(s - b_part, zero);
    let a_error = opaque(a - a_part, zero);
    let b_error = opaque(b - b_part, zero);
    return vec2<f32>(s, a_error + b_error);
}

// Adds x to the double-float (hi, lo).
fn sum_add(hi: f32, lo: f32, x: f32, zero: u32) -> vec2<f32> {
    let s = two_sum(hi, x, zero);
    let e = opaque(s.y + lo, zero);
    let h = opaque(s.x + e, zero);
    let h_part = opaque(h - s.x, zero);
    return vec2<f32>(h, e - h_part);
}

// NaN, infinite or so large that its square would overflow the sums.
fn is_unusable(x: vec3<f32>) -> bool {
    let bits = bitcast<vec3<u32>>(x) & vec3<u32>(0x7fffffffu);
    return bits.x > LARGEST_SAMPLE_BITS || bits.y > LARGEST_SAMPLE_BITS || bits.z > LARGEST_SAMPLE_BITS;
}

fn sum3_add(sum: Sum3, x: vec3<f32>, zero: u32) -> Sum3 {
    let r = sum_add(sum.hi[0], sum.lo[0], x.x, zero);
    let g = sum_add(sum.hi[1], sum.lo[1], x.y, zero);
    let b = sum_add(sum.hi[2], sum.lo[2], x.z, zero);
    return Sum3(array<f32, 3>(r.x, g.x, b.x), array<f32, 3>(r.y, g.y, b.y));
}

// One sample of the main pass: `contribution` is im where the primary ray met virtual geometry, else im - ir.
fn pixel_add(sums: PixelSums, index: u32, is_virtual: bool, contribution: vec3<f32>, zero: u32) -> PixelSums {
    var out = sums;
    out.n = out.n + 1u;
    if is_virtual {
        out.m = out.m + 1u;
    }
    if is_unusable(contribution) {
        return count_unusable(out, index);
    }
    if is_virtual {
        out.m_im = sum3_add(out.m_im, contribution, zero);
    } else {
        out.diff = sum3_add(out.diff, contribution, zero);
    }
    out.sq = sum3_add(out.sq, contribution * contribution, zero);
    return out;
}

// One sample of the real pass: the next of the pixel's samples 0 .. n_real.
fn pixel_add_real(sums: PixelSums, index: u32, is_virtual: bool, real: vec3<f32>, zero: u32) -> PixelSums {
    var out = sums;
    out.n_real = out.n_real + 1u;
    if is_unusable(real) {
        return count_unusable(out, index);
    }
    if is_virtual {
        out.m_ir = sum3_add(out.m_ir, real, zero);
    } else {
        out.r_ir = sum3_add(out.r_ir, real, zero);
    }
    return out;
}

fn count_unusable(sums: PixelSums, index: u32) -> PixelSums {
    var out = sums;
    if out.non_finite == 0u {
        out.first_non_finite = index;
    }
    out.non_finite = out.non_finite + 1u;
    return out;
}

// What the primary mixed ray met; call it only for a hit.
fn guide_add(sums: GuideSums, depth: f32, normal: vec3<f32>, albedo: vec3<f32>, zero: u32) -> GuideSums {
    var out = sums;
    if is_unusable(vec3<f32>(depth)) || is_unusable(normal) || is_unusable(albedo) {
        return out;
    }
    out.hits = out.hits + 1u;
    let d = sum_add(out.depth_hi, out.depth_lo, depth, zero);
    out.depth_hi = d.x;
    out.depth_lo = d.y;
    out.normal = sum3_add(out.normal, normal, zero);
    out.albedo = sum3_add(out.albedo, albedo, zero);
    return out;
}
