//! What `render` and `sequence` both take: how good pictures shall be.

use clap::Args;

use super::Failure;
use super::values::{above_zero, camera_noise, choice};
use crate::renderer::{ErrorGoal, Filter, Goal, SCRAMBLES};

#[derive(Debug, Args)]
pub(super) struct GoalFlags {
    /// Render until the standard error of the composite is down to this, root mean square over each tile of 16 x 16 pixels, linear;
    /// --rpp then limits the rays of a pixel [default: 16384]
    #[arg(long, value_name = "E", value_parser = above_zero)]
    target_error: Option<f64>,
    /// camera-noise: render until the variance of the composite is no more than that of the camera's noise
    #[arg(long, value_name = "WHEN", value_parser = ["camera-noise"])]
    stop_at: Option<String>,
    /// The camera's noise: a file of `mixray noise calibrate`, or sigma^2 = A y + B in 8-bit code values y of the encoded picture
    /// [default: the profile of the scene's [noise]]
    #[arg(long, value_name = "NOISE.toml|A,B", requires = "stop_at")]
    pub camera_noise: Option<String>,
    /// Smooth what virtual objects change on real surfaces, biased: preview (if no name is given) for a few rays per pixel, final for
    /// pictures and videos that are to be kept
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true, default_missing_value = "preview", value_parser = choice::<Filter>())]
    pub filter: Option<Filter>,
}

impl GoalFlags {
    /// `rays_per_pixel`: as given.
    pub(super) fn goal(&self, rays_per_pixel: Option<u32>) -> Result<Option<Goal>, Failure> {
        if self.target_error.is_none() && self.stop_at.is_none() {
            return Ok(None);
        }
        if rays_per_pixel.is_some_and(|rpp| rpp < SCRAMBLES) {
            return Err(Failure(format!(
                "--rpp limits the rays of a pixel here: the error is taken from {SCRAMBLES} renders, each of one ray or more"
            )));
        }
        let noise = self.camera_noise.as_deref();
        Ok(Some(Goal {
            noise_of_scene: self.stop_at.is_some() && noise.is_none(),
            goal: ErrorGoal {
                standard_error: self.target_error,
                noise: noise.map(camera_noise).transpose()?,
                max_rays_per_pixel: rays_per_pixel.unwrap_or(ErrorGoal::DEFAULT_MAX_RAYS_PER_PIXEL),
            },
        }))
    }
}
