//! Per-pixel sums in double-float arithmetic. Twin of `shaders/film/sums.wgsl`.
//!
//! A double-float is a pair (hi, lo) of f32 whose exact sum is the value: about 46 bits, so that sample ranges rendered apart
//! and merged agree with one run to the last bits of f32, and a million samples sum without drift (T. J. Dekker, "A
//! floating-point technique for extending the available precision", 1971).

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use crate::shared::{Array, shared};

shared! {
    /// Bits of 1e15, the largest magnitude that is accumulated: its square still sums over a million samples without overflow.
    const LARGEST_SAMPLE_BITS: u32 = 0x5863_5fa9;

    /// Three double-floats.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Sum3 {
        pub hi: [f32; 3] as Array<f32, 3>,
        pub lo: [f32; 3] as Array<f32, 3>,
    }

    /// Sums over the samples of one pixel; all zeros before the first.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct PixelSums {
        /// Sum of m * im.
        pub m_im: Sum3,
        /// Sum of (1 - m) * (im - ir), the direct difference.
        pub diff: Sum3,
        /// Sum of m * ir over the real pass.
        pub m_ir: Sum3,
        /// Sum of (1 - m) * ir over the real pass.
        pub r_ir: Sum3,
        /// Sum of squares of the per-sample contribution m * im + (1 - m) * (im - ir).
        pub sq: Sum3,
        /// Samples of the main pass.
        pub n: u32,
        /// Samples of the main pass that met virtual geometry first.
        pub m: u32,
        /// The real pass has covered the first `n_real` samples of this pixel.
        pub n_real: u32,
        /// Samples left out of the radiance sums because they were not finite (or beyond 1e15).
        pub non_finite: u32,
        /// Index of the first of those; means nothing while `non_finite` is 0.
        pub first_non_finite: u32,
        /// Samples that the pixel takes for every ray per pixel asked for; 0 counts as 1.
        pub sample_factor: u32,
    }

    /// Sums over the primary hits of one pixel, for the depth, normal and albedo planes.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct GuideSums {
        /// Metres along the view axis.
        pub depth_hi: f32,
        pub depth_lo: f32,
        pub normal: Sum3,
        pub albedo: Sum3,
        /// Samples that met something.
        pub hits: u32,
        pub pad: u32,
    }
}

/// `s + e == a + b` exactly, `s` being the rounded sum (Knuth).
pub fn two_sum(a: f32, b: f32) -> (f32, f32) {
    let s = a + b;
    let b_part = s - a;
    let a_part = s - b_part;
    let a_error = a - a_part;
    let b_error = b - b_part;
    (s, a_error + b_error)
}

/// Adds `x` to the double-float (hi, lo).
pub fn sum_add(hi: f32, lo: f32, x: f32) -> (f32, f32) {
    let (s, e) = two_sum(hi, x);
    let e = e + lo;
    let h = s + e;
    let h_part = h - s;
    (h, e - h_part)
}

/// The double-float sum of two double-floats.
fn sum_merge(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    let (s, e) = two_sum(a.0, b.0);
    let (t, f) = two_sum(a.1, b.1);
    let (h, l) = two_sum(s, e + t);
    let low = l + f;
    let h2 = h + low;
    (h2, low - (h2 - h))
}

/// NaN, infinite or so large that its square would overflow the sums.
pub fn is_unusable(x: Vec3) -> bool {
    x.to_array()
        .iter()
        .any(|c| c.to_bits() & 0x7fff_ffff > LARGEST_SAMPLE_BITS)
}

impl PixelSums {
    /// No sample has reached it.
    pub fn is_empty(&self) -> bool {
        self.n == 0 && self.n_real == 0 && self.non_finite == 0
    }
}

impl Sum3 {
    pub fn value(&self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|c| f64::from(self.hi[c]) + f64::from(self.lo[c])))
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for c in 0..3 {
            (self.hi[c], self.lo[c]) =
                sum_merge((self.hi[c], self.lo[c]), (other.hi[c], other.lo[c]));
        }
    }
}

impl From<DVec3> for Sum3 {
    fn from(sum: DVec3) -> Self {
        let hi = sum.as_vec3();
        let lo = (sum - hi.as_dvec3()).as_vec3();
        Self {
            hi: hi.to_array(),
            lo: lo.to_array(),
        }
    }
}

/// Adds `x` to each of the three.
pub fn sum3_add(sum: &mut Sum3, x: Vec3) {
    for (c, x) in x.to_array().into_iter().enumerate() {
        (sum.hi[c], sum.lo[c]) = sum_add(sum.hi[c], sum.lo[c], x);
    }
}

/// What one camera sample brought back. Radiance is linear Rec.709 with the exposure already applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The primary mixed ray met virtual geometry first (the mask m of this sample).
    pub is_virtual: bool,
    /// The mixed radiance im where `is_virtual`, else the difference im - ir.
    pub contribution: Vec3,
    /// The real radiance ir of the same sample, if it was traced.
    pub real: Option<Vec3>,
}

impl PixelSums {
    /// Adds a sample of the main pass, whose index in the pixel is `index`. Its real radiance is taken only while the real pass
    /// has kept up with the main pass: what is missing is replayed later by [`pixel_add_real`].
    pub fn add(&mut self, index: u32, sample: &Sample) {
        let real_is_next = self.n_real == self.n;
        pixel_add(self, index, sample.is_virtual, sample.contribution);
        if let Some(real) = sample.real
            && real_is_next
        {
            pixel_add_real(self, index, sample.is_virtual, real);
        }
    }

    /// Adds a sample of the main pass that met nothing virtual and brings no difference.
    pub fn add_nothing(&mut self) {
        self.n += 1;
    }

    /// Adds the sums of later samples of the same pixel.
    pub(super) fn merge(&mut self, later: &Self) {
        let real_kept_up = self.n_real == self.n;
        self.m_im.merge(&later.m_im);
        self.diff.merge(&later.diff);
        self.sq.merge(&later.sq);
        self.n += later.n;
        self.m += later.m;
        if real_kept_up {
            // Otherwise the later part's real samples would leave a gap in 0..n_real; they are replayed.
            self.m_ir.merge(&later.m_ir);
            self.r_ir.merge(&later.r_ir);
            self.n_real += later.n_real;
        }
        if self.non_finite == 0 {
            self.first_non_finite = later.first_non_finite;
        }
        self.non_finite += later.non_finite;
    }
}

/// One sample of the main pass: `contribution` is im where the primary ray met virtual geometry, else im - ir.
pub fn pixel_add(sums: &mut PixelSums, index: u32, is_virtual: bool, contribution: Vec3) {
    sums.n += 1;
    if is_virtual {
        sums.m += 1;
    }
    if is_unusable(contribution) {
        count_unusable(sums, index);
        return;
    }
    if is_virtual {
        sum3_add(&mut sums.m_im, contribution);
    } else {
        sum3_add(&mut sums.diff, contribution);
    }
    sum3_add(&mut sums.sq, contribution * contribution);
}

/// One sample of the real pass: the next of the pixel's samples 0 .. n_real.
pub fn pixel_add_real(sums: &mut PixelSums, index: u32, is_virtual: bool, real: Vec3) {
    sums.n_real += 1;
    if is_unusable(real) {
        count_unusable(sums, index);
        return;
    }
    if is_virtual {
        sum3_add(&mut sums.m_ir, real);
    } else {
        sum3_add(&mut sums.r_ir, real);
    }
}

pub(super) fn count_unusable(sums: &mut PixelSums, index: u32) {
    if sums.non_finite == 0 {
        sums.first_non_finite = index;
    }
    sums.non_finite += 1;
}

impl GuideSums {
    pub fn depth(&self) -> f64 {
        f64::from(self.depth_hi) + f64::from(self.depth_lo)
    }

    pub(super) fn merge(&mut self, other: &Self) {
        (self.depth_hi, self.depth_lo) = sum_merge(
            (self.depth_hi, self.depth_lo),
            (other.depth_hi, other.depth_lo),
        );
        self.normal.merge(&other.normal);
        self.albedo.merge(&other.albedo);
        self.hits += other.hits;
    }
}

/// What the primary mixed ray met; call it only for a hit.
pub fn guide_add(sums: &mut GuideSums, depth_m: f32, normal: Vec3, albedo: Vec3) {
    if is_unusable(Vec3::splat(depth_m)) || is_unusable(normal) || is_unusable(albedo) {
        return;
    }
    sums.hits += 1;
    (sums.depth_hi, sums.depth_lo) = sum_add(sums.depth_hi, sums.depth_lo, depth_m);
    sum3_add(&mut sums.normal, normal);
    sum3_add(&mut sums.albedo, albedo);
}

#[cfg(test)]
mod tests;
