use super::*;
use crate::film::test_support::noise;

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
            let x = f32::from_bits(noise(record * STEPS + i).to_bits() + nudge * u32::from(i == 7));
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
