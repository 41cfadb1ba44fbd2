//! Straight lines through points.

use glam::DVec2;

/// A point of the line and its unit direction.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub point: DVec2,
    pub direction: DVec2,
}

impl Line {
    /// Least squares with weights, across the line.
    fn weighted(points: &[DVec2], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let weighted = points.iter().zip(weights);
        let mean = weighted.clone().map(|(p, w)| *p * *w).sum::<DVec2>() / total;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (p, w) in weighted {
            let d = *p - mean;
            xx += w * d.x * d.x;
            xy += w * d.x * d.y;
            yy += w * d.y * d.y;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        Self {
            point: mean,
            direction: DVec2::from_angle(angle),
        }
    }

    /// Points that lie off the line lose their weight (Huber's first, then by the square of the distance).
    pub fn robust(points: &[DVec2]) -> Self {
        const ROUNDS: usize = 4;
        let mut weights = vec![1.0; points.len()];
        let mut line = Self::weighted(points, &weights);
        let mut distances = Vec::with_capacity(points.len());
        for _ in 0..ROUNDS {
            distances.clear();
            distances.extend(points.iter().map(|p| line.distance(*p)));
            let most = distances.iter().copied().fold(0.0, f64::max);
            let middle = distances.len() / 2;
            let median = match distances.is_empty() {
                true => 0.0,
                false => *distances.select_nth_unstable_by(middle, f64::total_cmp).1,
            };
            // 1.48 medians are a standard deviation.
            let limit = (1.5 * 1.48 * median).max(1e-3 * most).max(1e-12);
            for (w, p) in weights.iter_mut().zip(points) {
                let distance = line.distance(*p);
                *w = if distance <= limit {
                    1.0
                } else {
                    (limit / distance).powi(2)
                };
            }
            line = Self::weighted(points, &weights);
        }
        line
    }

    pub fn distance(&self, point: DVec2) -> f64 {
        (point - self.point).perp_dot(self.direction).abs()
    }

    /// Where two lines cross; `None`: they are parallel to a thousandth.
    pub fn crossing(&self, other: &Self) -> Option<DVec2> {
        let sine = self.direction.perp_dot(other.direction);
        if sine.abs() < 1e-3 {
            return None;
        }
        let along = (other.point - self.point).perp_dot(other.direction) / sine;
        Some(self.point + along * self.direction)
    }
}
