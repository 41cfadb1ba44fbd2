//! Arithmetic that both backends do in the same order: polynomials instead of library transcendentals, and integer hashes.
//!
//! The WGSL twin is `shaders/math.wgsl`. Every function is plain f32 (no fused multiply-add), so that a result on the GPU differs
//! from the CPU's by the rounding of its division and square root at most. Polynomials are minimax fits (Remez) to the remainder
//! named beside them; the stated errors are maxima over the stated range, asserted by the tests.

use glam::Vec3;

use crate::shared::shared;

shared! {
    pub const PI: f32 = std::f32::consts::PI;
    pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;
    pub const INV_TAU: f32 = 0.159_154_94;
    const FRAC_PI_2: f32 = std::f32::consts::FRAC_PI_2;
    const FRAC_PI_4: f32 = std::f32::consts::FRAC_PI_4;
    pub const TAU: f32 = std::f32::consts::TAU;
    const TAN_PI_8: f32 = 0.414_213_57;
    const SQRT_2: f32 = std::f32::consts::SQRT_2;
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    const LN_2: f32 = std::f32::consts::LN_2;
    /// ln 2 in two parts: the first has 15 bits, so that its product with an exponent is exact.
    const LN_2_HI: f32 = 0.693_145_75;
    const LN_2_LO: f32 = 1.428_606_8e-6;
    const MIN_NORMAL: f32 = f32::MIN_POSITIVE;
}

/// Sine and cosine of `2 pi x`, for |x| <= 2^20 turns. Absolute error at most 1.2e-7; exact at multiples of a quarter turn.
pub fn sincos_2pi(x: f32) -> (f32, f32) {
    let quarter = (x * 4.0 + 0.5).floor();
    let r = x - quarter * 0.25;
    let z = r * r;
    // sin(2 pi r) / r; summed before the product, as a shader compiler would rearrange a sum of products
    let p = ((-75.393_56 * z + 81.592_354) * z - 41.341_663) * z + TAU;
    let s = r * p;
    // (cos(2 pi r) - 1) / r^2
    let c = 1.0 + z * (((59.250_042 * z - 85.443_87) * z + 64.939_33) * z - 19.739_208);
    let quadrant = quarter as i32 & 3;
    let swap = (quadrant & 1) != 0;
    let sine = if swap { c } else { s };
    let cosine = if swap { s } else { c };
    (
        if quadrant >= 2 { -sine } else { sine },
        if quadrant == 1 || quadrant == 2 {
            -cosine
        } else {
            cosine
        },
    )
}

/// Arc cosine in radians; the argument is clamped to [-1, 1]. Relative error at most 2.4e-7.
pub fn acos_(x: f32) -> f32 {
    let a = x.abs().min(1.0);
    let outer = a > 0.5;
    let z = if outer { (1.0 - a) * 0.5 } else { a * a };
    let y = if outer { z.sqrt() } else { a };
    // (asin(y) / y - 1) / y^2
    let p = ((((0.037_513_852 * z + 0.014_440_975) * z + 0.031_806_9) * z + 0.044_517_085) * z
        + 0.075_005_03)
        * z
        + 0.166_666_6;
    let asin = y + y * z * p;
    if outer {
        let acos = asin * 2.0;
        if x < 0.0 { PI - acos } else { acos }
    } else if x < 0.0 {
        FRAC_PI_2 + asin
    } else {
        FRAC_PI_2 - asin
    }
}

/// Angle of (x, y) from +X in radians, in [-pi, pi]; 0 at the origin. A zero of either sign counts as positive.
/// Arguments are finite and their sum does not overflow. Relative error at most 3e-7.
pub fn atan2_(y: f32, x: f32) -> f32 {
    let ax = x.abs();
    let ay = y.abs();
    let large = ax.max(ay);
    let small = ax.min(ay);
    if large == 0.0 {
        return 0.0;
    }
    let t = small / large;
    let upper = t > TAN_PI_8;
    let u = if upper {
        (small - large) / (small + large)
    } else {
        t
    };
    let z = u * u;
    // (atan(u) / u - 1) / u^2
    let p = (((-0.060_842_36 * z + 0.105_963_65) * z - 0.142_439_08) * z + 0.199_984_94) * z
        - 0.333_333_16;
    let mut angle = u + u * z * p;
    if upper {
        angle += FRAC_PI_4;
    }
    if ay > ax {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

/// e^x, with x clamped to at most 88; exactly 0 below -87. Relative error at most 1.5e-7.
pub fn exp_(x: f32) -> f32 {
    if x < -87.0 {
        return 0.0;
    }
    let bounded = x.min(88.0);
    let scaled = bounded * LOG2_E + 0.5;
    // Its floor: a call of the library where processors need not have the instruction.
    let whole = scaled as i32 as f32;
    let n = if whole > scaled { whole - 1.0 } else { whole };
    // max never acts: a shader compiler that may reassociate would otherwise merge the two parts of ln 2
    let r = (bounded - n * LN_2_HI).max(-1.0) - n * LN_2_LO;
    // (e^r - 1 - r) / r^2
    let p = (((0.001_381_459_7 * r + 0.008_368_729) * r + 0.041_668_39) * r + 0.166_665_21) * r
        + 0.499_999_94;
    let e = (p * r + 1.0) * r + 1.0;
    e * f32::from_bits(((n as i32 + 127) as u32) << 23)
}

/// Natural logarithm; arguments below the smallest normal number (zero and negative ones too) count as that number, and the
/// result is at least -87.34. Relative error at most 3e-7 away from 1, absolute at most 4e-8 near 1.
pub fn log_(x: f32) -> f32 {
    let bits = x.max(MIN_NORMAL).to_bits();
    let exponent = ((bits >> 23) as i32 - 127) as f32;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    let upper = mantissa > SQRT_2;
    let m = if upper { mantissa * 0.5 } else { mantissa };
    let e = if upper { exponent + 1.0 } else { exponent };
    let f = m - 1.0;
    // (ln(1 + f) - f + f^2 / 2) / f^3
    let p = (((((((0.067_410_48 * f - 0.115_828_82) * f + 0.118_373_26) * f - 0.124_191_13) * f
        + 0.142_293_32)
        * f
        - 0.166_674_85)
        * f
        + 0.200_015_26)
        * f
        - 0.250_000_12)
        * f
        + 0.333_333_22;
    let z = f * f;
    let log1p = f + z * (f * p - 0.5);
    e * LN_2 + log1p
}

/// NaN or infinite, by its bits: a shader compiler may assume that neither exists and fold a comparison.
pub fn is_non_finite(x: f32) -> bool {
    (x.to_bits() & 0x7fff_ffff) >= 0x7f80_0000
}

/// A bijection of u32 that flips each output bit with probability near 1/2 for every input bit (constants of "lowbias32",
/// Wellons 2018).
pub fn hash_u32(x: u32) -> u32 {
    let mut h = x;
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// Hash of an ordered pair; a bijection in either argument while the other is held.
pub fn hash_combine(a: u32, b: u32) -> u32 {
    hash_u32(hash_u32(a.wrapping_add(0x9e37_79b9)) ^ b)
}

/// The top 24 bits as a number in [0, 1).
pub fn uniform_from_bits(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Two unit vectors that with the unit vector `n` form a right-handed orthonormal frame (t x b = n); Duff et al. 2017.
pub fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
    )
}

/// Rec.709 luminance of a linear colour.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.x * 0.2126 + rgb.y * 0.7152 + rgb.z * 0.0722
}

/// Square root with negative arguments taken as 0.
pub fn safe_sqrt(x: f32) -> f32 {
    x.max(0.0).sqrt()
}

/// Dot product, summed from x to z.
pub fn dot3(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Cross product.
pub fn cross3(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(
        a.y * b.z - a.z * b.y,
        a.z * b.x - a.x * b.z,
        a.x * b.y - a.y * b.x,
    )
}

/// Euclidean length.
pub fn length3(v: Vec3) -> f32 {
    dot3(v, v).sqrt()
}

/// `v` divided by its length, which must be neither 0 nor overflow when squared.
pub fn normalize3(v: Vec3) -> Vec3 {
    v / length3(v)
}

#[cfg(test)]
mod tests;
