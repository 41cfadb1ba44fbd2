//! The light of a scene, fitted to the shading and shadows that its photograph shows on the proxy: `mixray light fit`.
//!
//! A photograph shows albedo times light. Albedo is mostly the same from a point to one nearby of like colour, so that what differs between them is
//! light; where it is not, a robust cost leaves the pair out. The light is the environment about its vertical and a sun, few parameters; what the proxy hides of
//! it is traced, and what the proxy itself sends is read in the photograph. Nothing is taken from the fit that does not hold in parts of the photograph
//! that it has not seen.

mod comparisons;
mod directions;
mod fitter;
mod points;
mod rays;
mod residual;
mod scene_edit;
mod search;
mod uncertainty;
mod verdict;

pub use residual::picture as residual_picture;
pub use scene_edit::edited;
pub use search::fit;
pub use verdict::Gain;

use std::sync::Arc;

use glam::DVec3;

use points::Grid;

/// What is fitted.
#[derive(Clone, Copy, Debug, Default)]
pub struct FitOptions {
    /// A sky that is white all over in place of the scene's environment.
    pub white_sky: bool,
    /// The environment stays as it is turned: it was taken there, or is the photograph itself.
    pub keep_rotation: bool,
}

/// The light that explains most of the photograph.
pub struct LightFit {
    /// Points of the proxy that were compared, and cells of it that were left out: clipped, dark, or at its edges.
    pub points: usize,
    pub left_out: usize,
    /// Of the scale of the environment; what the scene has now.
    pub scale: Fitted,
    /// What the scale follows from.
    pub scale_basis: ScaleBasis,
    /// Degrees; `None`: the environment looks the same from all sides.
    pub rotation_deg: Option<Fitted>,
    pub sun: Option<FittedSun>,
    /// What a sun would explain more, whether or not it is taken.
    pub gain_of_sun: Gain,
    pub gain_of_rotation: Option<Gain>,
    /// Of the variation without any shading, what the light explains: as the scene has it, of a sky that is white all over, and fitted.
    pub explained: Explained,
    /// Gain of the fit over no shading, in parts that it has not seen.
    pub gain: Gain,
    /// What a sky that is white all over would explain more than the fit.
    pub gain_of_white_sky: Gain,
    /// The surroundings are a white sky in place of the scene's environment.
    pub is_white_sky: bool,
    /// How dark the proxy's shadows are.
    pub shadows: Shadows,
    /// Spread of ln of luminance between neighbours, in the median: texture and noise.
    pub texture: f64,
    /// Mean reflectance of the proxy under the fitted light.
    pub mean_albedo: f64,
    pub grid: Arc<Grid>,
    /// ln of the irradiance of each point, in the photograph's units.
    pub log_light: Vec<f32>,
}

/// A value, what it was, and how sure it is.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    pub was: f64,
    pub is: f64,
    /// In the value's unit; `None`: it was kept, or the photograph does not tell.
    pub sigma: Option<f64>,
    pub is_kept: bool,
}

impl Fitted {
    fn kept(was: f64) -> Self {
        Self {
            was,
            is: was,
            sigma: None,
            is_kept: true,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleBasis {
    /// The scene tells albedos.
    Albedo,
    /// The proxy reflects as much as it did in the scene as given, which can be.
    SameReflectance,
    /// It is made to reflect 40%, for what it would reflect cannot be.
    GuessedReflectance,
    /// The exposure is "auto": only what differs in light matters.
    Exposure,
}

#[derive(Clone, Copy, Debug)]
pub struct FittedSun {
    /// Of travel, world space, unit.
    pub direction: DVec3,
    /// Across its light, each channel, in the scene's units.
    pub irradiance: f64,
    pub direction_sigma_deg: Option<f64>,
    /// Relative.
    pub irradiance_sigma: Option<f64>,
}

/// Shares of the robust variation.
#[derive(Clone, Copy, Debug)]
pub struct Explained {
    pub as_given: f64,
    pub by_white_sky: f64,
    pub fitted: f64,
}

/// In the twentieth of the points that the proxy hides most from a white sky, compared with what is around them: luminance over that around, in the
/// median.
#[derive(Clone, Copy, Debug)]
pub struct Shadows {
    pub in_photograph: f64,
    pub as_given: f64,
    pub by_white_sky: f64,
    pub fitted: f64,
}

impl LightFit {
    /// The photograph's shading is not that of the proxy under any such light.
    pub fn is_poor(&self) -> bool {
        !self.gain.is_real() || self.is_worse()
    }

    /// The scene's own light explains more.
    pub fn is_worse(&self) -> bool {
        self.explained.fitted < self.explained.as_given - 0.01
    }
}

impl FittedSun {
    /// Degrees above the horizon.
    pub fn elevation_deg(&self) -> f64 {
        (-self.direction.y).clamp(-1.0, 1.0).asin().to_degrees()
    }

    /// Degrees; 0 is -Z, 90 is +X.
    pub fn azimuth_deg(&self) -> f64 {
        (-self.direction.x).atan2(self.direction.z).to_degrees()
    }

    /// As comments and summaries have it.
    pub fn sureness(&self) -> String {
        let direction = match self.direction_sigma_deg {
            Some(sigma) => format!("direction +- {sigma:.1} degrees"),
            None => "direction not told".to_owned(),
        };
        match self.irradiance_sigma {
            Some(sigma) => format!("{direction}, irradiance +- {:.0}%", 100.0 * sigma),
            None => direction,
        }
    }
}
