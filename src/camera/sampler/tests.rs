//! Uniformity, stratification and rate of convergence of the samplers.

use super::super::chi_squared::{assert_uniform, critical, statistic};
use super::*;
use crate::packed::SAMPLER_SOBOL;

const SAMPLERS: [(&str, u32); 3] = [
    ("jittered", SAMPLER_JITTERED),
    ("cmj", SAMPLER_CMJ),
    ("sobol", SAMPLER_SOBOL),
];
const TOTALS: [u32; 8] = [1, 4, 7, 9, 16, 25, 49, 50];

fn key(sampler: u32, pixel: u32, index: u32, total: u32) -> SampleKey {
    SampleKey {
        pixel,
        index,
        total,
        seed: 3,
        sampler,
    }
}

/// What the stratified samplers are measured against.
fn independent_4d(pixel: u32, index: u32) -> [f32; 4] {
    let base = hash_combine(hash_combine(99, pixel), index);
    [0, 1, 2, 3].map(|d| uniform_from_bits(hash_combine(base, d)))
}

#[test]
fn every_value_lies_in_the_unit_interval() {
    for (name, sampler) in SAMPLERS {
        for total in [1, 2, 3, 49, 50, 1000, 65_537, MAX_TOTAL] {
            for i in 0..2000 {
                let k = key(sampler, i / 7, hash_u32(i) % total, total);
                for set in [0, 1, 9] {
                    for v in sample_4d(k, set) {
                        assert!((0.0..1.0).contains(&v), "{name}: {v} of {k:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn degenerate_totals_do_not_panic() {
    for (_, sampler) in SAMPLERS {
        for total in [0, 1, u32::MAX] {
            for index in [0, 5, u32::MAX] {
                let _ = sample_4d(key(sampler, 0, index, total), 0);
            }
        }
    }
}

/// Uniform for every single index means unbiased, whatever the total. Each pair of dimensions is looked at on an 8 x 8 grid.
#[test]
fn each_sample_alone_is_uniform_over_pixels() {
    const PAIRS: [(usize, usize); 6] = [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)];
    for (name, sampler) in SAMPLERS {
        for total in TOTALS {
            for index in [0, total / 2, total - 1] {
                for set in [0, 2] {
                    let mut counts = [[0u32; 64]; 6];
                    for pixel in 0..6400 {
                        let v = sample_4d(key(sampler, pixel, index, total), set);
                        for (cells, (a, b)) in counts.iter_mut().zip(PAIRS) {
                            cells[(v[a] * 8.0) as usize * 8 + (v[b] * 8.0) as usize] += 1;
                        }
                    }
                    for (cells, pair) in counts.iter().zip(PAIRS) {
                        assert_uniform(
                            &format!("{name}, sample {index} of {total}, set {set}, {pair:?}"),
                            cells,
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn uniformity_test_sees_a_bias() {
    let mut counts = [0u32; 64];
    for pixel in 0..6400 {
        let v = sample_4d(key(SAMPLER_JITTERED, pixel, 0, 7), 0);
        counts[(v[0].powf(1.2) * 8.0) as usize * 8 + (v[1] * 8.0) as usize] += 1;
    }
    assert!(statistic(&counts) > critical(64));
}

/// Two samples of a pixel, and one sample in two sets, are as unrelated as strata allow: across pixels their joint cells are even.
#[test]
fn sets_are_independent_of_each_other() {
    for (name, sampler) in SAMPLERS {
        for (first, second) in [(0, 1), (1, 2), (3, 8)] {
            for dimensions in [(0, 0), (1, 2), (3, 3)] {
                let mut counts = [0u32; 64];
                for pixel in 0..400 {
                    for index in 0..16 {
                        let k = key(sampler, pixel, index, 16);
                        let a = sample_4d(k, first)[dimensions.0];
                        let b = sample_4d(k, second)[dimensions.1];
                        counts[(a * 8.0) as usize * 8 + (b * 8.0) as usize] += 1;
                    }
                }
                assert_uniform(&format!("{name}, sets {first} {second}"), &counts);
            }
        }
    }
}

#[test]
fn square_totals_fill_every_stratum_once() {
    for (name, sampler) in [SAMPLERS[0], SAMPLERS[1]] {
        for side in [1u32, 2, 3, 5, 7, 16] {
            let total = side * side;
            for pixel in 0..20 {
                for pair in [0, 2] {
                    let mut hits = vec![0; total as usize];
                    let mut columns = vec![0; total as usize];
                    let mut rows = vec![0; total as usize];
                    for index in 0..total {
                        let v = sample_4d(key(sampler, pixel, index, total), 0);
                        let (x, y) = (f64::from(v[pair]), f64::from(v[pair + 1]));
                        let n = f64::from(side);
                        hits[(x * n) as usize * side as usize + (y * n) as usize] += 1;
                        columns[(x * n * n) as usize] += 1;
                        rows[(y * n * n) as usize] += 1;
                    }
                    assert!(hits.iter().all(|&h| h == 1), "{name} {total}: {hits:?}");
                    if sampler == SAMPLER_CMJ {
                        assert!(columns.iter().chain(&rows).all(|&h| h == 1));
                    }
                }
            }
        }
    }
}

#[test]
fn uneven_totals_use_distinct_strata() {
    for total in [2u32, 3, 5, 7, 50, 97] {
        let columns = strata_columns(total);
        let rows = total.div_ceil(columns);
        assert!(columns * rows >= total && columns * rows < total + columns);
        for pixel in 0..50 {
            let mut hits = vec![0; (columns * rows) as usize];
            for index in 0..total {
                let v = sample_4d(key(SAMPLER_JITTERED, pixel, index, total), 1);
                let x = (f64::from(v[0]) * f64::from(columns)) as u32;
                let y = (f64::from(v[1]) * f64::from(rows)) as u32;
                hits[(y * columns + x) as usize] += 1;
            }
            assert!(hits.iter().all(|&h| h <= 1), "{total}: {hits:?}");
        }
    }
}

#[test]
fn columns_are_the_rounded_up_square_root() {
    for n in 1..=32_768u32 {
        for total in [n * n - 1, n * n, n * n + 1] {
            if (1..=MAX_TOTAL).contains(&total) {
                let c = strata_columns(total);
                assert!(c * c >= total && (c - 1) * (c - 1) < total, "{total}: {c}");
            }
        }
    }
}

#[test]
fn strata_divide_exactly() {
    let mut state = 7;
    for _ in 0..100_000 {
        state = hash_u32(state + 1);
        let count = 1 + state % 32_769;
        let fraction = hash_u32(state ^ 1);
        let stratum = hash_u32(state ^ 2) % count;
        let want = ((u64::from(stratum) << 32) + u64::from(fraction)) / u64::from(count);
        assert_eq!(u64::from(in_stratum(stratum, count, fraction)), want);
    }
}

#[test]
fn permutations_are_bijections_and_unbiased_in_pairs() {
    for count in (1..=70).chain([1000, 4097]) {
        let mut seen = vec![false; count as usize];
        for i in 0..count {
            let to = permute(i, count, 12_345) as usize;
            assert!(!seen[to], "{count}: {to} twice");
            seen[to] = true;
        }
    }
    for count in [2u32, 3, 4, 5, 7, 8, 9, 12] {
        for (i, j) in [(0, 1), (0, count - 1), (count / 2, count - 1)] {
            if i == j {
                continue;
            }
            let mut cells = vec![0u32; (count * count) as usize];
            for seed in 0..count * (count - 1) * 200 {
                let key = hash_u32(seed);
                cells[(permute(i, count, key) * count + permute(j, count, key)) as usize] += 1;
            }
            let off_diagonal: Vec<u32> = (0..count * count)
                .filter(|c| c / count != c % count)
                .map(|c| cells[c as usize])
                .collect();
            assert_eq!(off_diagonal.iter().sum::<u32>(), count * (count - 1) * 200);
            assert_uniform(&format!("places of {i} and {j} of {count}"), &off_diagonal);
        }
    }
}

/// Joe and Kuo's recurrence, written from the paper, most significant bit first.
fn directions(degree: usize, coefficients: u32, initial: &[u32]) -> Vec<u32> {
    let mut m = initial.to_vec();
    for k in degree..32 {
        let mut next = m[k - degree] ^ (m[k - degree] << degree);
        for j in 1..degree {
            if (coefficients >> (degree - 1 - j)) & 1 == 1 {
                next ^= m[k - j] << j;
            }
        }
        m.push(next);
    }
    (0..32).map(|k| m[k] << (31 - k)).collect()
}

#[test]
fn sobol_points_follow_the_recurrence() {
    let columns = [
        (0..32).map(|k| 1u32 << (31 - k)).collect(),
        directions(1, 0, &[1]),
        directions(2, 1, &[1, 3]),
        directions(3, 1, &[1, 3, 1]),
    ];
    for i in 0..3000 {
        let point = if i < 1500 { i } else { hash_u32(i) };
        let want = columns.each_ref().map(|c| {
            (0..32)
                .filter(|k| (point >> k) & 1 == 1)
                .fold(0, |v, k| v ^ c[k])
        });
        let found = [0, 1, 2, 3].map(|d| sobol_reversed(point, d).reverse_bits());
        assert_eq!(found, want);
    }
}

#[test]
fn scrambled_sobol_keeps_its_nets() {
    // Every dimension alone, and Sobol's first two (the third and first number of set 0, the first two of the others) in every
    // elementary rectangle, hold exactly one of 2^m points.
    for m in [2u32, 4, 6] {
        let n = 1u32 << m;
        for (pixel, set) in [(0, 0), (1, 0), (2, 1), (3, 5)] {
            // Another set shuffles within aligned blocks of every power of two, so that its prefixes are nets too.
            let points: Vec<[f32; 4]> = (0..n)
                .map(|i| sample_4d(key(SAMPLER_SOBOL, pixel, i, n), set))
                .collect();
            for d in 0..4 {
                let mut cells = vec![0; n as usize];
                points
                    .iter()
                    .for_each(|p| cells[(p[d] * n as f32) as usize] += 1);
                assert!(cells.iter().all(|&c| c == 1), "dimension {d}: {cells:?}");
            }
            let (a, b) = if set == 0 { (2, 0) } else { (0, 1) };
            for split in 0..=m {
                let (nx, ny) = (1u32 << split, 1u32 << (m - split));
                let mut cells = vec![0; n as usize];
                for p in &points {
                    let cell = (p[a] * nx as f32) as u32 * ny + (p[b] * ny as f32) as u32;
                    cells[cell as usize] += 1;
                }
                assert!(cells.iter().all(|&c| c == 1), "{nx} x {ny}: {cells:?}");
            }
        }
    }
}

#[test]
fn scramble_is_nested_and_fair() {
    let reference = |x: u32, seed: u32| owen_scramble(x, hash_u32(seed));
    for bit in 0..31 {
        // A higher bit never changes a lower one.
        for i in 0..500 {
            let x = hash_u32(i);
            let changed = reference(x, 5) ^ reference(x ^ (1 << bit), 5);
            assert_eq!(changed & ((2u32 << bit) - 1), 1 << bit);
        }
    }
    for bit in 0..12u32 {
        // Whether a bit flips is decided anew for every prefix: half of the seeds, half of the prefixes.
        for prefix in 0..(1u32 << bit.min(4)) {
            let flips: u32 = (0..4000)
                .map(|seed| (reference(prefix, seed) ^ prefix) >> bit & 1)
                .sum();
            let rate = f64::from(flips) / 4000.0;
            assert!(
                (rate - 0.5).abs() < 0.05,
                "bit {bit}, prefix {prefix}: {rate}"
            );
        }
    }
}

/// A defocused edge over a texture, seen through a disc lens: radiance 0..1, discontinuous in all four dimensions.
fn defocused_edge(scene: u32, v: [f32; 4]) -> f64 {
    let random = |d| f64::from(uniform_from_bits(hash_combine(scene, d)));
    let (a, b) = (2.0 * f64::from(v[2]) - 1.0, 2.0 * f64::from(v[3]) - 1.0);
    let (r, angle) = if a.abs() > b.abs() {
        (a, b / a * std::f64::consts::FRAC_PI_4)
    } else if b != 0.0 {
        (
            b,
            std::f64::consts::FRAC_PI_2 - a / b * std::f64::consts::FRAC_PI_4,
        )
    } else {
        (0.0, 0.0)
    };
    let lens = [r * angle.cos(), r * angle.sin()];
    let pixel = [f64::from(v[0]) - 0.5, f64::from(v[1]) - 0.5];
    let (s, c) = (random(0) * std::f64::consts::TAU).sin_cos();
    let blurred = [0, 1].map(|k| pixel[k] + 2.5 * lens[k]);
    let edge = blurred[0] * c + blurred[1] * s + (random(1) - 0.5) * 4.0;
    if edge > 0.0 {
        return 0.9;
    }
    let behind = [0, 1].map(|k| pixel[k] - 0.6 * lens[k]);
    let phase = random(2) * 6.0;
    0.4 + 0.4 * (behind[0] * (1.0 + 2.0 * random(3)) + behind[1] * 2.0 * random(4) + phase).sin()
}

fn edge_estimate(sampler: Option<u32>, scene: u32, repeat: u32, total: u32) -> f64 {
    let pixel = scene * 1000 + repeat;
    let sum: f64 = (0..total)
        .map(|index| {
            let v = match sampler {
                Some(s) => sample_4d(key(s, pixel, index, total), 0),
                None => independent_4d(pixel, index),
            };
            defocused_edge(scene, v)
        })
        .sum();
    sum / f64::from(total)
}

const SCENES: u32 = 64;
const REPEATS: u32 = 32;

fn references() -> Vec<f64> {
    (0..SCENES)
        .map(|scene| edge_estimate(Some(SAMPLER_SOBOL), scene, 999, 65_536))
        .collect()
}

/// Root mean square error over all scenes and repeats, and the bias: the squared mean errors of the scenes over the squares expected of
/// an unbiased estimator. About 1 without a bias.
fn errors(references: &[f64], estimate: impl Fn(u32, u32) -> f64) -> (f64, f64) {
    let repeats = f64::from(REPEATS);
    let (mut squares, mut found, mut expected) = (0.0, 0.0, 0.0);
    for (scene, reference) in (0..).zip(references) {
        let (mut sum, mut square) = (0.0, 0.0);
        for repeat in 0..REPEATS {
            let error = estimate(scene, repeat) - reference;
            sum += error;
            square += error * error;
        }
        found += (sum / repeats).powi(2);
        expected += (square - sum * sum / repeats) / (repeats - 1.0) / repeats;
        squares += square;
    }
    let n = f64::from(SCENES) * repeats;
    ((squares / n).sqrt(), found / expected)
}

/// More than five standard deviations above the expectation (weighted chi-squared, 64 scenes).
const BIAS_LIMIT: f64 = 2.3;

fn edge_error(sampler: Option<u32>, total: u32, references: &[f64]) -> (f64, f64) {
    errors(references, |scene, repeat| {
        edge_estimate(sampler, scene, repeat, total)
    })
}

#[test]
fn error_falls_as_each_sampler_promises() {
    let references = references();
    let totals = [1, 4, 9, 16, 25, 49, 64, 256];
    let mut table = Vec::new();
    eprintln!("rays per pixel {totals:?}");
    for (name, sampler) in [
        ("independent", None),
        ("jittered", Some(SAMPLER_JITTERED)),
        ("cmj", Some(SAMPLER_CMJ)),
        ("sobol", Some(SAMPLER_SOBOL)),
    ] {
        let row = totals.map(|total| {
            let (rmse, bias) = edge_error(sampler, total, &references);
            assert!(bias < BIAS_LIMIT, "{name} at {total}: bias {bias:.1}");
            rmse
        });
        eprintln!("{name:12} {}", row.map(|e| format!("{e:.4}")).join(" "));
        table.push(row);
    }
    let slope = |row: &[f64; 8]| (row[7] / row[1]).ln() / (256.0_f64 / 4.0).ln();
    let slopes: Vec<f64> = table.iter().map(slope).collect();
    eprintln!("slopes from 4 to 256: {slopes:.3?}");
    assert!((slopes[0] + 0.5).abs() < 0.04);
    assert!(slopes[1] < -0.54 && slopes[2] < -0.54);
    assert!(slopes[3] < -0.65 && slopes[3] < slopes[1] && slopes[3] < slopes[2]);
    for (jittered, independent) in table[1].iter().zip(&table[0]).skip(1) {
        assert!(*jittered < 0.9 * independent);
    }
    assert!(table[2][5] < table[1][5] && table[3][7] < 0.8 * table[2][7]);
}

#[test]
fn uneven_totals_are_unbiased_and_no_worse_than_independent() {
    let references = references();
    for total in TOTALS {
        let (independent, _) = edge_error(None, total, &references);
        for (name, sampler) in SAMPLERS {
            let (rmse, bias) = edge_error(Some(sampler), total, &references);
            assert!(bias < BIAS_LIMIT, "{name} at {total}: bias {bias:.1}");
            assert!(
                rmse < 1.06 * independent,
                "{name} at {total}: {rmse} {independent}"
            );
        }
    }
}

#[test]
fn bias_measure_sees_a_half_filled_grid() {
    // The first 7 of 9 unpermuted strata: what a grid without a permutation would give.
    let (_, bias) = errors(&references(), |scene, repeat| {
        let sum: f64 = (0..7)
            .map(|i| {
                let jitter = independent_4d(scene * 1000 + repeat, i);
                let cell = |stratum: u32, d: usize| (stratum as f32 + jitter[d]) / 3.0;
                let v = [
                    cell(i % 3, 0),
                    cell(i / 3, 1),
                    cell(i % 3, 2),
                    cell(i / 3, 3),
                ];
                defocused_edge(scene, v)
            })
            .sum();
        sum / 7.0
    });
    eprintln!("bias of the control: {bias:.1}");
    assert!(bias > BIAS_LIMIT);
}
