//! What a method is rendered to where that is not a number of rays.

use serde::{Deserialize, Serialize};

use crate::renderer::{CameraNoise, ErrorGoal};

/// When a method stops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Goal {
    pub aim: Aim,
    /// No pixel takes more samples than this.
    pub max_rays_per_pixel: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aim {
    /// Root mean square standard error of each tile, linear.
    TargetError(f64),
    /// Variance over the camera's, mean of each tile, at most 1.
    CameraNoise(#[serde(with = "as_numbers")] CameraNoise),
}

impl Goal {
    /// "to error 0.004", "to camera noise".
    pub fn label(&self) -> String {
        match self.aim {
            Aim::TargetError(error) => format!("to error {error}"),
            Aim::CameraNoise(_) => "to camera noise".to_owned(),
        }
    }
}

impl From<Goal> for ErrorGoal {
    fn from(goal: Goal) -> Self {
        let (standard_error, noise) = match goal.aim {
            Aim::TargetError(error) => (Some(error), None),
            Aim::CameraNoise(noise) => (None, Some(noise)),
        };
        Self {
            standard_error,
            noise,
            max_rays_per_pixel: goal.max_rays_per_pixel,
        }
    }
}

/// a and b of sigma^2 = a y + b, 8-bit codes: red, green, blue.
mod as_numbers {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::renderer::CameraNoise;
    use crate::scene::NoiseFit;

    pub fn serialize<S: Serializer>(noise: &CameraNoise, serializer: S) -> Result<S::Ok, S::Error> {
        noise.fit.map(|fit| [fit.a, fit.b]).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<CameraNoise, D::Error> {
        let numbers = <[[f64; 2]; 3]>::deserialize(deserializer)?;
        Ok(CameraNoise {
            fit: numbers.map(|[a, b]| NoiseFit { a, b }),
        })
    }
}
