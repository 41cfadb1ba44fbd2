use super::test_support::curve;
use super::*;

#[test]
fn a_law_is_broken_by_a_larger_exponent_only() {
    for (law, kept, broken) in [
        (Law::Build, 1.1, 1.5),
        (Law::RaysPerPixel, 1.0, 1.2),
        (Law::Objects, 0.1, 0.5),
        (Law::Lights, -0.3, 0.2),
    ] {
        assert!(!curve(law, kept).is_worse_than_expected(), "{law:?}");
        assert!(curve(law, broken).is_worse_than_expected(), "{law:?}");
    }
    let fit = curve(Law::Objects, 0.5).exponent.unwrap();
    let error = fit.standard_error.unwrap();
    assert!(
        (fit.slope - 0.5).abs() < 3.0 * error && error < 0.02,
        "{fit:?}"
    );
    assert!((curve(Law::Objects, 0.5).rays_exponent.unwrap().slope - 1.0).abs() < 1e-12);
}

/// The same sizes with other seconds.
fn timed(law: Law, secs: [f64; 5], spread: f64) -> Curve {
    let mut points = curve(law, 0.0).points;
    for (point, secs) in points.iter_mut().zip(secs) {
        point.secs = secs;
        point.runs = vec![secs, secs * (1.0 + spread), secs * (1.0 + 0.5 * spread)];
    }
    Curve::new(law, String::new(), String::new(), "cpu", points)
}

#[test]
fn a_step_is_a_growth_and_noise_is_none() {
    let step = [1.0, 1.0, 1.0, 2.0, 2.0];
    assert!(timed(Law::Lights, step, 0.02).is_worse_than_expected());
    assert!(timed(Law::Lights, [1.0, 1.0, 1.0, 1.0, 20.0], 0.02).is_worse_than_expected());
    // Runs that differ by as much as the step explain it.
    assert!(!timed(Law::Lights, step, 1.0).is_worse_than_expected());
    assert!(!timed(Law::Lights, [1.0; 5], 0.02).is_worse_than_expected());
}

#[test]
fn the_noise_of_an_exponent_is_that_of_its_points() {
    // Deviations from the mean of ln 4^k are -2..2 times ln 4, their squares sum to 10; the runs' ln have the standard deviation s.
    let curve = timed(Law::Build, [1.0; 5], 0.1);
    let runs = [1.0f64, 1.1, 1.05].map(f64::ln);
    let mean = runs.iter().sum::<f64>() / 3.0;
    let s = (runs.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 2.0).sqrt();
    let want = s / (10f64.sqrt() * 4f64.ln());
    assert!((curve.exponent_noise.unwrap() / want - 1.0).abs() < 1e-9);
}

#[test]
fn single_runs_prove_nothing() {
    let mut points = curve(Law::Objects, 0.9).points;
    for point in &mut points {
        point.runs.truncate(1);
    }
    let once = Curve::new(Law::Objects, String::new(), String::new(), "cpu", points);
    assert!(once.exponent.is_some() && !once.is_worse_than_expected());
}
