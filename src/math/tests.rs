//! Each function against f64 over its useful range. The measured maxima are printed; the limits are those of the documentation.

use glam::{DVec3, Vec3};

use super::*;

/// `count + 1` evenly spaced values.
fn sweep(from: f64, to: f64, count: u32) -> impl Iterator<Item = f32> {
    (0..=count).map(move |i| (from + (to - from) * f64::from(i) / f64::from(count)) as f32)
}

fn max_error(
    values: impl Iterator<Item = f32>,
    found: impl Fn(f32) -> f32,
    truth: impl Fn(f64) -> f64,
    relative: bool,
) -> f64 {
    values.fold(0.0, |worst, x| {
        let want = truth(f64::from(x));
        let error = (f64::from(found(x)) - want).abs();
        worst.max(if relative && want != 0.0 {
            error / want.abs()
        } else {
            error
        })
    })
}

fn assert_within(name: &str, error: f64, limit: f64) {
    eprintln!("{name}: max error {error:.2e}, limit {limit:.2e}");
    assert!(error <= limit, "{name}: {error:e} exceeds {limit:e}");
}

#[test]
fn the_floor_is_the_library_s() {
    let whole = (-5..=5).map(|i| i as f32);
    let around = whole.flat_map(|x| [x.next_down(), x, x.next_up()]);
    let far = [
        -2_147_483_500.0,
        -16_777_217.0,
        8_388_607.5,
        2_147_483_500.0,
    ];
    let values: Vec<f32> = around
        .chain(sweep(-40.0, 40.0, 10_007))
        .chain(far)
        .collect();
    for x in &values {
        assert_eq!(floor_(*x), x.floor(), "{x}");
    }
    assert!(values.iter().any(|x| x.trunc() != x.floor()), "control");
}

#[test]
fn sincos_matches_f64() {
    // The range reduction is exact, so the truth may reduce in f64 too.
    let turns = |x: f64| (x - x.floor()) * std::f64::consts::TAU;
    for (from, to) in [(-1.0, 1.0), (-100.0, 100.0), (1.0e6, 1.04e6)] {
        let values = || sweep(from, to, 200_000);
        assert_within(
            "sin",
            max_error(values(), |x| sincos_2pi(x).0, |x| turns(x).sin(), false),
            1.2e-7,
        );
        assert_within(
            "cos",
            max_error(values(), |x| sincos_2pi(x).1, |x| turns(x).cos(), false),
            1.2e-7,
        );
    }
    assert_within(
        "sin near 0, relative",
        max_error(
            sweep(1e-9, 0.125, 100_000),
            |x| sincos_2pi(x).0,
            |x| (x * std::f64::consts::TAU).sin(),
            true,
        ),
        1.5e-7,
    );
    for (x, want) in [
        (0.0, (0.0, 1.0)),
        (0.25, (1.0, 0.0)),
        (0.5, (0.0, -1.0)),
        (-0.25, (-1.0, 0.0)),
        (7.75, (-1.0, 0.0)),
    ] {
        assert_eq!(sincos_2pi(x), want, "at {x} turns");
    }
}

#[test]
fn acos_matches_f64() {
    let error = max_error(sweep(-1.0, 1.0, 400_000), acos_, f64::acos, true);
    assert_within("acos", error, 2.4e-7);
    let near_one = (0..1000u32).map(|i| f32::from_bits(1.0_f32.to_bits() - i));
    assert_within(
        "acos near 1",
        max_error(near_one, acos_, f64::acos, true),
        2.4e-7,
    );
    assert_eq!(acos_(1.5), 0.0);
    assert_eq!(acos_(-1.5), PI);
}

#[test]
fn atan2_matches_f64_in_all_quadrants() {
    let mut worst: f64 = 0.0;
    for angle in sweep(-3.13, 3.13, 200_000) {
        for radius in [1e-20_f64, 1.0, 3e7] {
            let (s, c) = f64::from(angle).sin_cos();
            let (y, x) = ((s * radius) as f32, (c * radius) as f32);
            let want = f64::from(y).atan2(f64::from(x));
            if want != 0.0 {
                worst = worst.max(((f64::from(atan2_(y, x)) - want) / want).abs());
            }
        }
    }
    assert_within("atan2", worst, 3e-7);
    assert_eq!(atan2_(0.0, 0.0), 0.0);
    assert_eq!(atan2_(0.0, -2.0), PI);
    assert_eq!(atan2_(2.0, 0.0), FRAC_PI_2);
    assert_eq!(atan2_(-2.0, 0.0), -FRAC_PI_2);
}

#[test]
fn exp_matches_f64() {
    let error = max_error(sweep(-87.0, 88.0, 400_000), exp_, f64::exp, true);
    assert_within("exp", error, 1.5e-7);
    assert_eq!(exp_(0.0), 1.0);
    assert_eq!(exp_(-1e30), 0.0);
    assert_eq!(exp_(f32::NEG_INFINITY), 0.0);
    assert!(!is_non_finite(exp_(f32::INFINITY)));
}

#[test]
fn log_matches_f64() {
    let wide =
        (-87..=88).flat_map(|k| sweep(0.5, 1.0, 2000).map(move |m| m * f64::from(k).exp() as f32));
    let far = wide.filter(|x| (x - 1.0).abs() > 0.3 && *x >= f32::MIN_POSITIVE);
    assert_within("log away from 1", max_error(far, log_, f64::ln, true), 3e-7);
    assert_within(
        "log near 1, relative",
        max_error(sweep(0.7, 1.4, 300_000), log_, f64::ln, true),
        3e-7,
    );
    assert_eq!(log_(1.0), 0.0);
    assert_eq!(log_(0.0), log_(f32::MIN_POSITIVE));
    assert!(!is_non_finite(log_(-1.0)));
}

#[test]
fn error_measure_sees_one_wrong_bit() {
    let spoiled = |x: f32| f32::from_bits(exp_(x).to_bits() ^ 8);
    assert!(max_error(sweep(-87.0, 88.0, 1000), spoiled, f64::exp, true) > 1.5e-7);
}

#[test]
fn non_finite_is_seen_by_bits() {
    for x in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(is_non_finite(x));
    }
    for x in [0.0, -0.0, 1.0, f32::MAX, f32::MIN, 1e-40] {
        assert!(!is_non_finite(x));
    }
}

#[test]
fn hashes_avalanche() {
    // Every input bit flips every output bit in half of the cases; the identity would show 0 or 1.
    for (name, hash) in [
        ("hash_u32", &hash_u32 as &dyn Fn(u32) -> u32),
        ("hash_combine, first", &|x| hash_combine(x, 17)),
        ("hash_combine, second", &|x| hash_combine(17, x)),
    ] {
        for bit in 0..32 {
            let mut flips = [0u32; 32];
            for x in 0..4096u32 {
                let difference = hash(x) ^ hash(x ^ (1 << bit));
                for (k, count) in flips.iter_mut().enumerate() {
                    *count += (difference >> k) & 1;
                }
            }
            for count in flips {
                let rate = f64::from(count) / 4096.0;
                assert!(
                    (rate - 0.5).abs() < 0.08,
                    "{name}: bit {bit} flips at {rate}"
                );
            }
        }
    }
}

#[test]
fn uniforms_stay_below_one() {
    assert_eq!(uniform_from_bits(0), 0.0);
    assert!(uniform_from_bits(u32::MAX) < 1.0);
    assert_eq!(uniform_from_bits(1 << 31), 0.5);
}

#[test]
fn basis_is_orthonormal_and_right_handed() {
    let mut state = 1;
    let mut next = || {
        state = hash_u32(state + 1);
        f64::from(state) / f64::from(u32::MAX) * 2.0 - 1.0
    };
    for i in 0..10_000 {
        let v = DVec3::new(next(), next(), if i % 3 == 0 { -1e3 } else { next() });
        let n = v.normalize().as_vec3();
        let (t, b) = orthonormal_basis(n);
        let (n, t, b) = (n.as_dvec3(), t.as_dvec3(), b.as_dvec3());
        assert!((t.length() - 1.0).abs() < 1e-6 && (b.length() - 1.0).abs() < 1e-6);
        assert!((t.cross(b) - n).length() < 1e-6);
    }
    for n in [Vec3::Z, -Vec3::Z, Vec3::new(0.0, 0.0, -1.0)] {
        let (t, b) = orthonormal_basis(n);
        assert_eq!(t.cross(b), n);
    }
}
