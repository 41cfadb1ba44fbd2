//! What an error-driven render aims at.

use glam::DVec3;

use super::RenderError;
use crate::scene::{NoiseFit, Scene, srgb};

/// Noise of a camera: variance of each channel's 8-bit code value (0..255, sRGB-encoded) as a straight line over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraNoise {
    pub fit: [NoiseFit; 3],
}

impl CameraNoise {
    /// Variance of a channel's linear value (clamped to 0..1 as the encoding does): sigma times the slope of the decoding.
    pub fn linear_variance(&self, channel: usize, linear: f64) -> f64 {
        let encoded = srgb::encode(linear.clamp(0.0, 1.0));
        let codes = self.fit[channel].variance(255.0 * encoded);
        let slope = srgb::decode_slope(encoded) / 255.0;
        codes * slope * slope
    }
}

/// When a tile of the picture is good enough. Where both are given, what either allows is enough; where neither is, no tile is before its rays
/// are spent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorGoal {
    /// Root mean square standard error of the composite, linear, over a tile's pixels and channels.
    pub standard_error: Option<f64>,
    /// The mean over a tile of Monte Carlo variance over noise variance shall not exceed 1.
    pub noise: Option<CameraNoise>,
    /// No pixel takes more samples than this.
    pub max_rays_per_pixel: u32,
}

/// A goal that may wait for its scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    pub goal: ErrorGoal,
    /// The camera's noise is that of the scene's `[noise]`.
    pub noise_of_scene: bool,
}

impl Goal {
    /// The goal for that scene.
    ///
    /// # Errors
    /// [`RenderError::NoCameraNoise`].
    pub fn of(self, scene: &Scene) -> Result<ErrorGoal, RenderError> {
        if !self.noise_of_scene {
            return Ok(self.goal);
        }
        let noise = scene.stages.noise.as_ref();
        let fit = noise.ok_or(RenderError::NoCameraNoise)?.profile.fit;
        Ok(ErrorGoal {
            noise: Some(CameraNoise { fit }),
            ..self.goal
        })
    }
}

impl ErrorGoal {
    /// Rays per pixel after which a pixel is left as it is, unless the caller says otherwise.
    pub const DEFAULT_MAX_RAYS_PER_PIXEL: u32 = 1 << 14;

    /// There is nothing to aim at: all rays are taken.
    pub fn takes_all_rays(&self) -> bool {
        self.standard_error.is_none() && self.noise.is_none()
    }

    /// Variance that is allowed at a pixel of this colour, linear.
    pub(super) fn allowed_variance(&self, linear: [f32; 3]) -> DVec3 {
        if self.takes_all_rays() {
            return DVec3::INFINITY;
        }
        let even = self.standard_error.map_or(0.0, |e| e * e);
        DVec3::from(std::array::from_fn::<f64, 3, _>(|c| {
            let noise = |n: &CameraNoise| n.linear_variance(c, f64::from(linear[c]));
            let noise = self.noise.as_ref().map_or(0.0, noise);
            even.max(noise).max(f64::MIN_POSITIVE)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_in_linear_light_is_that_of_the_codes() {
        let noise = CameraNoise {
            fit: [NoiseFit { a: 0.02, b: 0.5 }; 3],
        };
        for code in [3.0, 40.0, 200.0] {
            let linear = srgb::decode(code / 255.0);
            // A code more or less, by the decoding itself.
            let step = 0.01;
            let by_code = (srgb::decode((code + step) / 255.0)
                - srgb::decode((code - step) / 255.0))
                / (2.0 * step);
            let expected = (0.02 * code + 0.5) * by_code * by_code;
            let found = noise.linear_variance(0, linear);
            assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
            let wrong = noise.linear_variance(0, linear * 1.1);
            assert!(
                (wrong / expected - 1.0).abs() > 1e-2 || code < 10.0,
                "control"
            );
        }
    }

    #[test]
    fn either_goal_is_enough() {
        let noise = CameraNoise {
            fit: [NoiseFit { a: 0.0, b: 1.0 }; 3],
        };
        let goal = |standard_error, noise| ErrorGoal {
            standard_error,
            noise,
            max_rays_per_pixel: 64,
        };
        let at = |goal: ErrorGoal, x: f32| goal.allowed_variance([x; 3]).x;
        let both = goal(Some(1e-3), Some(noise));
        assert_eq!(at(both, 0.9), at(goal(None, Some(noise)), 0.9));
        assert_eq!(at(both, 0.0), 1e-6, "one code at black is 3e-4");
    }
}
