//! Numbers of a composition by their names, for scripts.

use super::composition::{Composition, EnvironmentForm, Opening};
use crate::scene::{Aperture, Choice, Exposure, NoiseSettings, PointSpread};

/// As the scene file has it, unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    FNumber,
    FocusDistance,
    /// Of the aperture; 0: it has none.
    Blades,
    BladeRotation,
    EnvironmentScale,
    EnvironmentRotation,
    Exposure,
    RaysPerPixel,
    MaxBounces,
    Seed,
    NoiseScale,
    /// Of the green channel in the middle.
    SharpnessSigma,
    Sharpening,
    /// How much antialiasing blends.
    AntialiasBeta,
    CartoonIterations,
    CartoonSigmaP,
    /// Of the shutter.
    ExposureTime,
    Time,
}

impl Choice for Quantity {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("f_number", Self::FNumber),
        ("focus_distance_m", Self::FocusDistance),
        ("blades", Self::Blades),
        ("blade_rotation_deg", Self::BladeRotation),
        ("environment_scale", Self::EnvironmentScale),
        ("environment_rotation_deg", Self::EnvironmentRotation),
        ("exposure_ev", Self::Exposure),
        ("rays_per_pixel", Self::RaysPerPixel),
        ("max_bounces", Self::MaxBounces),
        ("seed", Self::Seed),
        ("noise_scale", Self::NoiseScale),
        ("sharpness_sigma_px", Self::SharpnessSigma),
        ("sharpening", Self::Sharpening),
        ("antialias_beta", Self::AntialiasBeta),
        ("cartoon_iterations", Self::CartoonIterations),
        ("cartoon_sigma_p", Self::CartoonSigmaP),
        ("exposure_secs", Self::ExposureTime),
        ("time_secs", Self::Time),
    ];
}

impl Quantity {
    /// `None`: the scene has no such thing.
    pub fn of(self, composition: &Composition) -> Option<f64> {
        let stages = &composition.stages;
        let spread = || stages.sharpness.as_ref()?.given;
        match self {
            Self::FNumber => match composition.lens.opening {
                Opening::FNumber { f_number, .. } => Some(f_number),
                Opening::RadiusM(_) => None,
            },
            Self::FocusDistance => Some(composition.focus_distance_m()),
            Self::Blades => match composition.lens.aperture {
                Aperture::Blades(blades) => Some(f64::from(blades)),
                Aperture::Disc | Aperture::Square => Some(0.0),
            },
            Self::BladeRotation => Some(composition.lens.blade_rotation_deg),
            Self::EnvironmentScale => composition.environment.map(|form| form.scale),
            Self::EnvironmentRotation => composition.environment.map(|form| form.rotation_deg),
            Self::Exposure => match composition.exposure {
                Exposure::Ev(ev) => Some(ev),
                Exposure::Auto => None,
            },
            Self::RaysPerPixel => Some(f64::from(composition.rays_per_pixel)),
            Self::MaxBounces => Some(f64::from(composition.max_bounces)),
            Self::Seed => Some(f64::from(composition.seed)),
            Self::NoiseScale => stages.noise.as_ref().map(|noise| decimal(noise.scale)),
            Self::SharpnessSigma => spread().map(|spread| decimal(spread.sigma_px[1])),
            Self::Sharpening => spread().map(|spread| decimal(spread.sharpening)),
            Self::AntialiasBeta => stages.antialias.map(|antialias| decimal(antialias.beta)),
            Self::CartoonIterations => (stages.cartoon).map(|c| f64::from(c.iterations)),
            Self::CartoonSigmaP => stages.cartoon.map(|cartoon| decimal(cartoon.sigma_p)),
            Self::ExposureTime => composition.shutter.map(|shutter| shutter.exposure_secs),
            Self::Time => {
                let has_time = composition.shutter.is_some() || composition.has_keys();
                has_time.then(|| composition.time_secs())
            }
        }
    }

    /// Kept within what a scene file may say; nothing happens where the scene has no such thing.
    pub fn set(self, composition: &mut Composition, value: f64) {
        let count = value.clamp(1.0, f64::from(u32::MAX)) as u32;
        let stages = &mut composition.stages;
        let spread = (stages.sharpness.as_mut()).and_then(|sharpness| sharpness.given.as_mut());
        match self {
            Self::FNumber => {
                if let Opening::FNumber { f_number, .. } = &mut composition.lens.opening {
                    *f_number = value;
                }
            }
            Self::FocusDistance => composition.focus(value),
            Self::Blades => {
                composition.lens.aperture = match value < 3.0 {
                    true => Aperture::Disc,
                    false => Aperture::Blades(count.min(64)),
                }
            }
            Self::BladeRotation => composition.lens.blade_rotation_deg = value,
            Self::EnvironmentScale => {
                composition.environment = composition.environment.map(|form| EnvironmentForm {
                    scale: value,
                    ..form
                });
            }
            Self::EnvironmentRotation => {
                composition.environment = composition.environment.map(|form| EnvironmentForm {
                    rotation_deg: value,
                    ..form
                });
            }
            Self::Exposure => composition.exposure = Exposure::Ev(value),
            Self::RaysPerPixel => composition.rays_per_pixel = count,
            Self::MaxBounces => composition.max_bounces = count,
            Self::Seed => composition.seed = value.max(0.0) as u32,
            Self::NoiseScale => {
                if let Some(noise) = &mut stages.noise {
                    noise.scale = value.clamp(0.0, f64::from(NoiseSettings::MAX_SCALE)) as f32;
                }
            }
            Self::SharpnessSigma => {
                if let Some(spread) = spread {
                    set_sigma(spread, value as f32);
                }
            }
            Self::Sharpening => {
                if let Some(spread) = spread {
                    spread.sharpening = value.clamp(0.0, 10.0) as f32;
                }
            }
            Self::AntialiasBeta => {
                if let Some(antialias) = &mut stages.antialias {
                    antialias.beta = value.clamp(0.0, 1.0) as f32;
                }
            }
            Self::CartoonIterations => {
                if let Some(cartoon) = &mut stages.cartoon {
                    cartoon.iterations = value.clamp(0.0, 1000.0) as u32;
                }
            }
            Self::CartoonSigmaP => {
                if let Some(cartoon) = &mut stages.cartoon {
                    cartoon.sigma_p = value.clamp(1e-4, 1e3) as f32;
                }
            }
            Self::ExposureTime => {
                if let Some(shutter) = &mut composition.shutter {
                    shutter.exposure_secs = value.clamp(0.0, 1e6);
                }
            }
            Self::Time => {
                if self.of(composition).is_some() {
                    composition.set_time(value);
                }
            }
        }
    }
}

/// The deviation of the green channel in the middle; the other channels and the corners keep their ratio to it.
fn set_sigma(spread: &mut PointSpread, sigma_px: f32) {
    let before = spread.sigma_px[1];
    for sigma in (spread.sigma_px.iter_mut()).chain(&mut spread.corner_sigma_px) {
        let other = match before > 0.0 && *sigma != before {
            true => (*sigma * (sigma_px / before) * 1e4).round() / 1e4,
            false => sigma_px,
        };
        *sigma = other.clamp(0.0, PointSpread::MAX_PX);
    }
}

/// The shortest decimal number that is read as this one.
pub fn decimal(value: f32) -> f64 {
    // Every f32 is written as a number.
    value.to_string().parse().unwrap_or(f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_takes_the_others_along() {
        let mut spread = PointSpread {
            sigma_px: [0.6, 0.5, 0.5],
            corner_sigma_px: [1.0, 0.5, 9.0],
            ..PointSpread::gaussian(0.5)
        };
        set_sigma(&mut spread, 1.0);
        assert_eq!(spread.sigma_px, [1.2, 1.0, 1.0]);
        assert_eq!(spread.corner_sigma_px, [2.0, 1.0, PointSpread::MAX_PX]);
    }

    #[test]
    fn a_short_number_stays_short() {
        assert_eq!(decimal(0.8), 0.8);
        assert_ne!(f64::from(0.8_f32), 0.8, "control");
    }
}
