//! The chi-squared test that the camera's tests share.

/// Pearson's statistic of equally likely cells.
pub fn statistic(counts: &[u32]) -> f64 {
    let total: f64 = counts.iter().map(|&c| f64::from(c)).sum();
    let expected = total / counts.len() as f64;
    counts
        .iter()
        .map(|&c| (f64::from(c) - expected).powi(2) / expected)
        .sum()
}

/// Value exceeded with a probability of about 1e-6 (Wilson and Hilferty's approximation), `cells - 1` degrees of freedom.
pub fn critical(cells: usize) -> f64 {
    let k = (cells - 1) as f64;
    let spread = 2.0 / (9.0 * k);
    k * (1.0 - spread + 4.75 * spread.sqrt()).powi(3)
}

/// Panics where the counts are too uneven for chance.
pub fn assert_uniform(name: &str, counts: &[u32]) {
    let (found, limit) = (statistic(counts), critical(counts.len()));
    assert!(
        found < limit,
        "{name}: chi-squared {found:.1}, limit {limit:.1}"
    );
}
