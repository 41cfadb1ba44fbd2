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
    /// "to error 0.004", "to camera noise 0.02 y + 0.5" (sigma^2 of 8-bit codes y; of each channel where they differ).
    pub fn label(&self) -> String {
        match self.aim {
            Aim::TargetError(error) => format!("to error {error}"),
            Aim::CameraNoise(noise) => {
                let fits = noise.fit.map(|fit| format!("{} y + {}", fit.a, fit.b));
                let same = fits.iter().all(|fit| *fit == fits[0]);
                let shown = if same { &fits[..1] } else { &fits[..] };
                format!("to camera noise {}", shown.join(" / "))
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::NoiseFit;

    #[test]
    fn other_goals_have_other_labels() {
        let label = |fit| {
            let goal = Goal {
                aim: Aim::CameraNoise(CameraNoise { fit }),
                max_rays_per_pixel: 64,
            };
            goal.label()
        };
        let [fit, other] = [(0.02, 0.5), (0.02, 0.25)].map(|(a, b)| NoiseFit { a, b });
        assert_eq!(label([fit; 3]), "to camera noise 0.02 y + 0.5");
        assert_eq!(
            label([fit, other, fit]),
            "to camera noise 0.02 y + 0.5 / 0.02 y + 0.25 / 0.02 y + 0.5"
        );
        assert_ne!(label([fit, other, other]), label([fit, fit, other]));
    }
}
