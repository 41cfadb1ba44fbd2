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

impl Sum3 {
    pub fn value(&self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|c| f64::from(self.hi[c]) + f64::from(self.lo[c])))
    }

    fn merge(&mut self, other: &Self) {
        for c in 0..3 {
            (self.hi[c], self.lo[c]) =
                sum_merge((self.hi[c], self.lo[c]), (other.hi[c], other.lo[c]));
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

    /// Adds `count` samples of the main pass that met nothing virtual and bring no difference.
    pub fn add_nothing(&mut self, count: u32) {
        self.n += count;
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
mod tests {
    use super::*;

    fn noise(i: u32) -> f32 {
        let mut x = i.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
        x ^= x >> 16;
        x = x.wrapping_mul(0x7feb_352d);
        x ^= x >> 15;
        (x >> 8) as f32 / 16_777_216.0
    }

    /// 1e6 samples against an f64 sum; a plain f32 sum is the negative control.
    #[test]
    fn a_million_samples_sum_without_drift() {
        let (mut hi, mut lo, mut plain, mut truth) = (0.0f32, 0.0f32, 0.0f32, 0.0f64);
        for i in 0..1_000_000 {
            let x = noise(i) + 0.1;
            (hi, lo) = sum_add(hi, lo, x);
            plain += x;
            truth += f64::from(x);
        }
        let error = ((f64::from(hi) + f64::from(lo)) / truth - 1.0).abs();
        assert!(error < 1e-11, "{error}");
        let plain_error = (f64::from(plain) / truth - 1.0).abs();
        assert!(
            plain_error > 1e-7,
            "control: a plain sum drifts, {plain_error}"
        );
    }

    #[test]
    fn unusable_samples_are_counted_and_left_out() {
        let mut sums = PixelSums::default();
        let add = |sums: &mut PixelSums, index, x: f32| {
            sums.add(
                index,
                &Sample {
                    is_virtual: false,
                    contribution: Vec3::new(0.5, x, 0.5),
                    real: Some(Vec3::ONE),
                },
            );
        };
        for (index, x) in [1.0, f32::NAN, f32::INFINITY, -2e15, 9e14]
            .into_iter()
            .enumerate()
        {
            add(&mut sums, index as u32, x);
        }
        assert_eq!(
            (sums.n, sums.n_real, sums.non_finite, sums.first_non_finite),
            (5, 5, 3, 1)
        );
        assert!(sums.sq.value().is_finite());
        assert_eq!(sums.diff.value().x, 1.0);
    }

    #[test]
    fn real_radiance_is_taken_only_without_a_gap() {
        let sample = |real| Sample {
            is_virtual: true,
            contribution: Vec3::ONE,
            real,
        };
        let mut sums = PixelSums::default();
        sums.add(0, &sample(Some(Vec3::ONE)));
        sums.add(1, &sample(None));
        sums.add(2, &sample(Some(Vec3::ONE)));
        assert_eq!((sums.n, sums.n_real), (3, 1));
        pixel_add_real(&mut sums, 1, true, Vec3::ONE);
        assert_eq!(sums.m_ir.value(), DVec3::splat(2.0));
    }

    /// The shader sums bit for bit as this file does, whatever the compiler makes of it. Controls: a plain sum in the same
    /// shader, and the last bit of one input.
    #[test]
    fn the_shader_sums_the_same_bits() {
        use crate::gpu::{Features, harness::Probe, harness::test_device};
        let Some(gpu) = test_device() else { return };
        const STEPS: u32 = 300;
        let probe = Probe {
            features: Features::default(),
            prelude: "import package::film::sums::{PixelSums, pixel_add, pixel_add_real};
                fn noise(i: u32) -> f32 {
                    var x = (i * 0x9e3779b9u) ^ 0x85ebca6bu;
                    x = x ^ (x >> 16u);
                    x = x * 0x7feb352du;
                    x = x ^ (x >> 15u);
                    return f32(x >> 8u) / 16777216.0;
                }",
            // The second word of a record is the zero that no compiler may know.
            body: "var sums = PixelSums();
                var plain = 0.0;
                for (var i = 0u; i < 300u; i = i + 1u) {
                    let x = noise(input(0u) * 300u + i);
                    let v = vec3<f32>(x, 1000.0 * x, x - 0.5);
                    let is_virtual = x < 0.4;
                    sums = pixel_add(sums, i, is_virtual, v, input(1u));
                    sums = pixel_add_real(sums, i, is_virtual, v, input(1u));
                    plain = plain + x;
                }
                for (var c = 0u; c < 3u; c = c + 1u) {
                    output_f32(c, sums.m_im.hi[c]);
                    output_f32(3u + c, sums.m_im.lo[c]);
                    output_f32(6u + c, sums.diff.hi[c]);
                    output_f32(9u + c, sums.diff.lo[c]);
                    output_f32(12u + c, sums.sq.hi[c]);
                    output_f32(15u + c, sums.sq.lo[c]);
                    output_f32(18u + c, sums.r_ir.lo[c]);
                }
                output(21u, sums.n);
                output(22u, sums.m);
                output(23u, sums.n_real);
                output_f32(24u, plain);",
            input_words: 2,
            output_words: 25,
            scene: None,
        };
        let inputs: Vec<u32> = (0..64).flat_map(|record| [record, 0]).collect();
        let outputs = probe.run(gpu, &inputs).expect("the probe runs");
        let host = |record: u32, nudge: u32| -> Vec<u32> {
            let mut sums = PixelSums::default();
            for i in 0..STEPS {
                let x =
                    f32::from_bits(noise(record * STEPS + i).to_bits() + nudge * u32::from(i == 7));
                let v = Vec3::new(x, 1000.0 * x, x - 0.5);
                pixel_add(&mut sums, i, x < 0.4, v);
                pixel_add_real(&mut sums, i, x < 0.4, v);
            }
            let floats = [
                sums.m_im.hi,
                sums.m_im.lo,
                sums.diff.hi,
                sums.diff.lo,
                sums.sq.hi,
                sums.sq.lo,
                sums.r_ir.lo,
            ];
            let words = floats.as_flattened().iter().map(|x| x.to_bits());
            words.chain([sums.n, sums.m, sums.n_real]).collect()
        };
        for (record, got) in outputs.as_chunks::<25>().0.iter().enumerate() {
            let record = record as u32;
            assert_eq!(got[..24], host(record, 0), "record {record}");
            assert_ne!(got[..24], host(record, 1), "control");
        }
        let differ = outputs.as_chunks::<25>().0.iter().filter(|got| {
            let sum = f64::from(f32::from_bits(got[0])) + f64::from(f32::from_bits(got[6]));
            f64::from(f32::from_bits(got[24])) != f64::from(sum as f32)
        });
        assert!(differ.count() > 16, "control: a plain sum drifts");
    }
}
