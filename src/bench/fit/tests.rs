use super::*;

#[test]
fn the_slope_of_a_power_law_is_its_exponent() {
    let law = |exponent: f64| -> Vec<(f64, f64)> {
        [1.0, 4.0, 9.0, 49.0, 100.0]
            .map(|x: f64| (x, 0.3 * x.powf(exponent)))
            .to_vec()
    };
    for exponent in [-0.5, -0.75, -1.0, 2.0] {
        let slope = log_log_slope(&law(exponent)).unwrap();
        assert!((slope - exponent).abs() < 1e-12, "{slope}");
    }
    let mut scattered = law(-0.5);
    scattered[0].1 *= 1.1;
    let slope = log_log_slope(&scattered).unwrap();
    assert!((slope + 0.5).abs() > 1e-3, "control: a point off the line");
    scattered.push((200.0, 0.0));
    assert_eq!(
        log_log_slope(&scattered),
        Some(slope),
        "an error of 0 is left out"
    );
    assert_eq!(log_log_slope(&[(1.0, 1.0)]), None);
    assert_eq!(log_log_slope(&[(1.0, 1.0), (1.0, 2.0)]), None);
}

#[test]
fn the_standard_error_is_the_spread_of_slopes() {
    // Slopes of laws with scatter added anew must spread as each one's own standard error says.
    let mut random = crate::bench::stress::meshes::Random(5);
    let (mut slopes, mut stated) = (Vec::new(), 0.0);
    for _ in 0..4000 {
        // Sum of 12 uniform numbers: nearly normal, variance 1.
        let mut normal = || (0..12).map(|_| f64::from(random.unit())).sum::<f64>() - 6.0;
        let points = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]
            .map(|x: f64| (x, x.powf(0.3) * (0.05 * normal()).exp()));
        let fit = log_log_fit(&points).unwrap();
        slopes.push(fit.slope);
        stated += fit.standard_error.unwrap().powi(2) / 4000.0;
    }
    let mean = slopes.iter().sum::<f64>() / 4000.0;
    let spread = slopes.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 3999.0;
    assert!((mean - 0.3).abs() < 1e-3, "{mean}");
    assert!((stated / spread - 1.0).abs() < 0.1, "{}", stated / spread);

    let exact = [(1.0, 2.0), (2.0, 4.0), (4.0, 8.0)];
    assert!(log_log_fit(&exact).unwrap().standard_error.unwrap() < 1e-12);
    assert_eq!(log_log_fit(&exact[..2]).unwrap().standard_error, None);
}

#[test]
fn costs_lie_on_the_line_between_two_points() {
    // error = cost^-1/2
    let points = [(16.0, 0.25), (1.0, 1.0), (4.0, 0.5)];
    let Reach::At(cost) = cost_to_reach(&points, 1.0 / 3.0) else {
        panic!("lies between two points");
    };
    assert!((cost - 9.0).abs() < 1e-12, "{cost}");
    assert_eq!(cost_to_reach(&points, 0.25), Reach::At(16.0));
    assert_eq!(cost_to_reach(&points, 2.0), Reach::Below(1.0));
    assert_eq!(cost_to_reach(&points, 0.2), Reach::NotReached);
    assert_eq!(cost_to_reach(&[], 0.2), Reach::NotReached);
}
