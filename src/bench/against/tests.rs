use super::*;
use crate::bench::record::test_support::report;

/// Multiplies the seconds of every run of a row.
fn slow(report: &Report, row: usize, factor: f64) -> Report {
    let mut slower = report.clone();
    let row = &mut slower.rows[row];
    row.cpu_secs *= factor;
    row.efficiency = row.efficiency.map(|e| e / factor);
    for run in &mut row.runs {
        run.cpu_secs *= factor;
    }
    slower
}

#[test]
fn a_report_is_no_regression_against_itself() {
    let report = report();
    let verdict = against(&report, &report, 0.05);
    assert_eq!(verdict.changes.len(), report.rows.len());
    assert!(verdict.not_compared.is_empty() && !verdict.spread_assumed);
    for change in &verdict.changes {
        assert_eq!(
            (change.efficiency, change.secs, change.rmse),
            (1.0, 1.0, 1.0)
        );
        assert!(!change.is_regression());
    }
}

#[test]
fn only_what_the_spread_does_not_explain_is_a_regression() {
    let report = report();
    let spread = against(&report, &report, 0.0).spread;
    // Two runs in each report.
    let explained = (3.0 * spread * f64::sqrt(0.5 + 0.5)).exp();
    let verdict = |factor| against(&slow(&report, 1, factor), &report, 0.0);
    assert!(!verdict(explained * 0.99).changes[1].is_regression());
    let caught = verdict(explained * 1.01);
    assert!(caught.changes[1].is_regression());
    assert!(
        !caught.changes[0].is_regression(),
        "the other row is as it was"
    );
    let tolerant = against(&slow(&report, 1, explained * 1.01), &report, 0.05);
    assert!(!tolerant.changes[1].is_regression());
}

#[test]
fn the_spread_is_the_standard_deviation_within_rows() {
    let mut report = report();
    report.rows.truncate(1);
    let row = &mut report.rows[0];
    let (a, b) = (0.10f64, 0.12);
    row.runs.truncate(2);
    for (run, secs) in row.runs.iter_mut().zip([a, b]) {
        (run.cpu_secs, run.mse) = (secs, 1e-4);
    }
    let expected = (b / a).ln() / 2.0f64.sqrt();
    let spread = pooled_spread(report.rows.iter()).unwrap();
    assert!((spread - expected).abs() < 1e-12);
    report.rows[0].runs.truncate(1);
    assert_eq!(pooled_spread(report.rows.iter()), None);
    assert!(against(&report, &report, 0.05).spread_assumed);
}

#[test]
fn rows_of_one_report_only_are_named() {
    let report = report();
    let mut shorter = report.clone();
    let gone = shorter.rows.remove(0);
    assert_eq!(against(&shorter, &report, 0.05).not_compared, [gone.key()]);
    assert_eq!(against(&report, &shorter, 0.05).not_compared, [gone.key()]);
    shorter.rows[0].efficiency = None;
    assert_eq!(against(&shorter, &report, 0.05).not_compared.len(), 2);
}
