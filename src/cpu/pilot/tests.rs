//! What the plan promises: least cost for the wanted error, no more samples than asked for, and never a pixel without a chance.

use super::allocation::{Rates, allocate};
use super::blocks::Blocks;
use super::measurement::{BlockMoments, Moments};
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PixelInfo};

/// Blocks of a picture in vertical bands, each of one squared error, wide enough that most blocks have equals for neighbours.
const COLUMNS_PER_BAND: usize = 24;
const ROWS: usize = 24;
/// After so many rays no error shows.
const MANY_RAYS: u32 = 1 << 20;

fn bands(errors: &[f32], costs: &[f32]) -> (Blocks, Vec<BlockMoments>) {
    let columns = COLUMNS_PER_BAND * errors.len();
    let blocks = Blocks::of(4 * columns, 4 * ROWS);
    let moments = (0..blocks.count())
        .map(|block| {
            let band = block % columns / COLUMNS_PER_BAND;
            BlockMoments {
                difference: Moments {
                    pixels: 1.0,
                    error: errors[band],
                    cost: costs[band],
                },
                mixed: Moments::default(),
                near_share: 0.0,
            }
        })
        .collect();
    (blocks, moments)
}

/// Of equal importance everywhere, without highlights.
fn allocate_evenly(blocks: &Blocks, moments: &[BlockMoments], importance: f32) -> Vec<Rates> {
    let everywhere = |value| vec![value; blocks.count()];
    let importance = everywhere(importance);
    allocate(blocks, moments, &importance, &everywhere(0.0), MANY_RAYS).0
}

/// The rate in the middle of each band.
fn middles(rates: &[Rates], bands: usize) -> Vec<f32> {
    let columns = COLUMNS_PER_BAND * bands;
    (0..bands)
        .map(|band| {
            rates[ROWS / 2 * columns + band * COLUMNS_PER_BAND + COLUMNS_PER_BAND / 2].difference
        })
        .collect()
}

#[test]
fn rates_follow_the_root_of_error_over_cost() {
    let (blocks, moments) = bands(&[1.0, 0.04, 0.16], &[4.0, 4.0, 16.0]);
    let rates = allocate_evenly(&blocks, &moments, 0.0);
    let [a, b, c] = middles(&rates, 3)[..] else {
        panic!("three bands")
    };
    assert!((a / b - 5.0).abs() < 0.05, "{a} {b}");
    assert!((a / c - 5.0).abs() < 0.05, "{a} {c}");
    // Control: equal errors at equal costs are equal.
    let (blocks, moments) = bands(&[0.3, 0.3], &[4.0, 4.0]);
    let rates = allocate_evenly(&blocks, &moments, 0.0);
    let [a, b] = middles(&rates, 2)[..] else {
        panic!("two bands")
    };
    assert!((a - b).abs() < 1e-4, "{a} {b}");
}

/// Where the error is even nothing can be saved: as many samples as were asked for, not more.
#[test]
fn no_more_samples_than_asked_for() {
    let (blocks, moments) = bands(&[0.3], &[4.0]);
    let rates = allocate_evenly(&blocks, &moments, 0.0);
    for rate in &rates {
        assert!((rate.difference - 1.0).abs() < 2e-3, "{rate:?}");
    }
    let (blocks, moments) = bands(&[1.0, 1e-3, 1e-3, 1e-3], &[4.0; 4]);
    let rates = allocate_evenly(&blocks, &moments, 0.0);
    let mean = rates.iter().map(|r| r.difference).sum::<f32>() / rates.len() as f32;
    assert!(mean < 0.8, "uneven errors save work: {mean}");
}

#[test]
fn the_error_aimed_at_is_met_at_less_cost_than_evenly() {
    let errors = [1.0, 0.01];
    let (blocks, moments) = bands(&errors, &[4.0, 4.0]);
    let rates = allocate_evenly(&blocks, &moments, 0.0);
    let predicted: f32 = moments
        .iter()
        .zip(&rates)
        .map(|(m, r)| m.difference.error / r.difference)
        .sum();
    let even: f32 = moments.iter().map(|m| m.difference.error).sum();
    let spent: f32 = rates.iter().map(|r| r.difference).sum::<f32>() / rates.len() as f32;
    // Even rates of that spending would leave more.
    assert!(predicted < 0.7 * even / spent, "{predicted} {even} {spent}");
}

#[test]
fn what_geometry_warns_of_is_sampled_though_nothing_was_measured() {
    let (blocks, moments) = bands(&[1.0, 0.0], &[4.0, 4.0]);
    let warned = middles(&allocate_evenly(&blocks, &moments, 1.0), 2);
    let silent = middles(&allocate_evenly(&blocks, &moments, 0.0), 2);
    assert!(warned[1] >= 0.25, "{warned:?}");
    assert!(silent[1] < 0.2, "control: {silent:?}");
    assert!(
        silent[1] >= 1.0 / 16.0,
        "never without a chance: {silent:?}"
    );
}

/// Turns and factor of a pixel multiply to the rate; only beams that may meet virtual geometry follow its rate.
#[test]
fn a_pixels_plan_is_its_rate() {
    let rates = Rates {
        difference: 0.25,
        mixed: 3.0,
    };
    let expect = |difference_period, sample_factor, flags| PixelInfo {
        difference_period,
        sample_factor,
        flags,
    };
    assert_eq!(rates.pixel(0), expect(4, 1, 0));
    let near = PIXEL_BEAM_MAY_MEET_VIRTUAL;
    assert_eq!(rates.pixel(near), expect(12, 3, near));
    let bright = Rates {
        difference: 4.2,
        mixed: 1.0,
    };
    assert_eq!(bright.pixel(0), expect(1, 4, 0));
}

/// Where a highlight was seen its pixels get more samples; nothing else changes.
#[test]
fn highlights_raise_the_rate_where_they_are() {
    let (blocks, mut moments) = bands(&[1.0, 0.1], &[4.0, 4.0]);
    for m in &mut moments {
        m.mixed = Moments {
            pixels: 1.0,
            error: 0.01,
            cost: 4.0,
        };
    }
    let nowhere = vec![0.0; blocks.count()];
    let mut somewhere = nowhere.clone();
    let lit = ROWS / 2 * 2 * COLUMNS_PER_BAND + COLUMNS_PER_BAND / 2;
    somewhere[lit] = 100.0;
    let without = allocate(&blocks, &moments, &nowhere, &nowhere, MANY_RAYS).0;
    let with = allocate(&blocks, &moments, &nowhere, &somewhere, MANY_RAYS).0;
    for block in 0..blocks.count() {
        if block == lit {
            assert!(with[block].mixed > 4.0 * without[block].mixed);
            assert_eq!(with[block].difference, without[block].difference);
        } else {
            assert_eq!(with[block], without[block]);
        }
    }
}

/// An error that would show after the rays asked for is lowered, with no more samples in all than those rays.
#[test]
fn what_would_show_is_evaluated_more_often() {
    // Standard errors of 0.08 and 0.0008 after 100 rays, one a ray.
    let mut errors = [6.4e-5; 8];
    errors[0] = 0.64;
    let (blocks, moments) = bands(&errors, &[4.0; 8]);
    let nowhere = vec![0.0; blocks.count()];
    let after = |rays| allocate(&blocks, &moments, &nowhere, &nowhere, rays).0;
    let many = middles(&after(MANY_RAYS), 8);
    assert!(many[0] < 2.0, "control: nothing shows: {many:?}");
    let some = middles(&after(400), 8);
    assert!((some[0] - 4.0).abs() < 0.01, "{some:?}");
    assert_eq!(some[4], many[4], "nothing shows there");
    let few = after(100);
    let mean = few.iter().map(|rate| rate.difference).sum::<f32>() / few.len() as f32;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
    assert!(middles(&few, 8)[0] > some[0]);
}
