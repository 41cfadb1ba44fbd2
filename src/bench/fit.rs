//! Straight lines through points in log over log.

use serde::{Deserialize, Serialize};

/// A straight line in log over log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The exponent of the power law.
    pub slope: f64,
    /// Of the slope, from the scatter of the points about the line; `None` of two points, which have none.
    pub standard_error: Option<f64>,
}

/// Least squares of log y over log x; points that are not above 0 are left out. `None` with fewer than two different x.
pub fn log_log_fit(points: &[(f64, f64)]) -> Option<Fit> {
    let logs: Vec<(f64, f64)> = points
        .iter()
        .filter(|(x, y)| *x > 0.0 && *y > 0.0)
        .map(|(x, y)| (x.ln(), y.ln()))
        .collect();
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let together: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    if logs.len() < 2 || spread <= 0.0 {
        return None;
    }
    let slope = together / spread;
    let residual = |(x, y): &(f64, f64)| y - mean_y - slope * (x - mean_x);
    let squares: f64 = logs.iter().map(|p| residual(p).powi(2)).sum();
    Some(Fit {
        slope,
        standard_error: (logs.len() > 2).then(|| (squares / (count - 2.0) / spread).sqrt()),
    })
}

/// The slope of [`log_log_fit`].
pub fn log_log_slope(points: &[(f64, f64)]) -> Option<f64> {
    log_log_fit(points).map(|fit| fit.slope)
}

/// What it takes to bring an error down to a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reach {
    /// On the straight line, in log over log, between the two measured points about the target.
    At(f64),
    /// The cheapest measured point, which costs this, is already better.
    Below(f64),
    /// No measured point is as good.
    NotReached,
}

/// The cost at which the error falls to `target`, from (cost, error) points.
pub fn cost_to_reach(points: &[(f64, f64)], target: f64) -> Reach {
    let mut points: Vec<(f64, f64)> = points.iter().copied().filter(|p| p.0 > 0.0).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some(first) = points.iter().position(|p| p.1 <= target) else {
        return Reach::NotReached;
    };
    let (cost, error) = points[first];
    let Some(&(cost_before, error_before)) = first.checked_sub(1).and_then(|i| points.get(i))
    else {
        return Reach::Below(cost);
    };
    if error <= 0.0 {
        return Reach::At(cost);
    }
    let share = (error_before / target).ln() / (error_before / error).ln();
    Reach::At(cost_before * (cost / cost_before).powf(share))
}

#[cfg(test)]
mod tests;
