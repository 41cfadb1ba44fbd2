//! How many rays per pixel fit into a frame's time.

/// Share that a new frame has in the running means.
const NEWEST: f64 = 0.2;
/// Of the time of a frame that is planned: frames differ.
const FILLED: f64 = 0.9;
/// The most that the rays grow by from one frame to the next.
const GROWTH: f64 = 1.5;

/// Fits the rays per pixel of the next frame to what those before it took.
#[derive(Clone, Debug)]
pub struct RayBudget {
    frame_secs: f64,
    most: u32,
    rays: u32,
    /// Running means: seconds of a frame beside its rays, and of a ray for every pixel.
    means: Option<(f64, f64)>,
}

impl RayBudget {
    /// Seconds for all that a frame needs; rays per pixel at most.
    pub fn new(frame_secs: f64, most: u32) -> Self {
        Self {
            frame_secs,
            most,
            rays: 1,
            means: None,
        }
    }

    /// Rays per pixel of the next frame, at least one.
    pub fn rays(&self) -> u32 {
        self.rays
    }

    /// A frame took so many seconds to trace its rays, and so many beside.
    pub fn took(&mut self, tracing_secs: f64, other_secs: f64) {
        let each = tracing_secs / f64::from(self.rays);
        let mixed = |mean: f64, new: f64| mean + NEWEST * (new - mean);
        let (other, each) = match self.means {
            Some(means) => (mixed(means.0, other_secs), mixed(means.1, each)),
            None => (other_secs, each),
        };
        self.means = Some((other, each));
        let fitting = (FILLED * self.frame_secs - other) / each.max(1e-9);
        let reachable = (f64::from(self.rays) * GROWTH).ceil();
        self.rays = (fitting.min(reachable) as u32).clamp(1, self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays per pixel and seconds of the last of many frames.
    fn settled(frame_secs: f64, each: f64, other: f64) -> (u32, f64) {
        let mut budget = RayBudget::new(frame_secs, 64);
        for _ in 0..60 {
            budget.took(each * f64::from(budget.rays()), other);
        }
        let rays = budget.rays();
        (rays, each * f64::from(rays) + other)
    }

    #[test]
    fn rays_fill_the_frame_and_no_more() {
        let (rays, secs) = settled(0.066, 0.004, 0.02);
        assert_eq!(rays, 9);
        assert!(secs < 0.066, "{secs}");
        let (double, _) = settled(0.132, 0.004, 0.02);
        assert!(double > 2 * rays, "control: {double}");
    }

    #[test]
    fn one_ray_at_least_and_the_limit_at_most() {
        assert_eq!(settled(0.066, 0.2, 0.1).0, 1);
        assert_eq!(settled(0.066, 1e-6, 0.0).0, 64);
    }
}
