//! Rows that tell what a saving is worth: `direct` with it and without it, and what is rendered to a goal instead of a number of rays.

use super::{Arguments, Job};
use crate::bench::{Aim, Goal, Method, Truth, rmse_of};
use crate::cli::{Failure, progress, say};
use crate::pack::instants;
use crate::renderer::{CameraNoise, Skip, Watcher};
use crate::scene::{BackendChoice, Choice, Estimator, NoiseFit, Scene};

/// sigma^2 = A y + B of a camera at a low gain, 8-bit codes, where nobody tells of another.
const CAMERA_NOISE: [f64; 2] = [0.02, 0.5];
/// Rays per pixel after which rows with a goal stop, where nobody tells otherwise.
const GOAL_RAYS: u32 = 1024;

impl Arguments {
    /// The savings to measure without.
    pub(super) fn savings(&self) -> Vec<Skip> {
        let wanted = |skip| self.ablate || self.no_skip.contains(&skip);
        let all = Skip::CHOICES.iter().map(|&(_, skip)| skip);
        all.filter(|&skip| wanted(skip)).collect()
    }

    /// Rows that only `direct` has want it among the estimators.
    pub(super) fn check_direct(&self) -> Result<(), Failure> {
        if self.runs.estimators.is_empty() || self.runs.estimators.contains(&Estimator::Direct) {
            return Ok(());
        }
        for (flag, given) in [
            ("ablate", self.ablate),
            ("--no-skip", !self.no_skip.is_empty()),
            ("--target-error", self.target_error.is_some()),
            ("--camera-noise", self.camera_noise.is_some()),
            ("--filter", self.filter),
        ] {
            if given {
                return Err(Failure(format!(
                    "{flag} is of `direct`, which --estimators leaves out; expected it among them; add direct"
                )));
            }
        }
        Ok(())
    }

    /// A limit wants a goal.
    pub(super) fn check_goals(&self) -> Result<(), Failure> {
        let to_goal = self.target_error.is_some()
            || self.camera_noise.is_some()
            || self.savings().into_iter().any(wants_goal);
        if self.goal_rpp.is_some() && !to_goal {
            let message = "--goal-rpp limits rows with a goal, and there are none; expected a goal; add --target-error or --camera-noise, or measure with ablate";
            return Err(Failure(message.to_owned()));
        }
        Ok(())
    }
}

/// It acts where rays are bought by error, and does nothing where their number is given.
fn wants_goal(skip: Skip) -> bool {
    matches!(skip, Skip::Adaptive | Skip::CameraNoise)
}

/// The method once for each of the savings that it has, with that one switched off.
pub(super) fn without_each(method: Method, savings: &[Skip]) -> impl Iterator<Item = Method> {
    let on_gpu = method.backend == BackendChoice::Gpu;
    let has = move |skip: &&Skip| !wants_goal(**skip) && (on_gpu || **skip != Skip::Specialisation);
    savings.iter().filter(has).map(move |&skip| Method {
        without: Some(skip),
        ..method
    })
}

impl Job {
    /// The goals' savings, and whether rows with that goal are wanted.
    fn goals(&self) -> [(Skip, bool); 2] {
        let savings = self.arguments.savings();
        let wanted = |skip, given| (skip, given || savings.contains(&skip));
        [
            wanted(Skip::Adaptive, self.arguments.target_error.is_some()),
            wanted(Skip::CameraNoise, self.camera_noise.is_some()),
        ]
    }

    /// `direct` as it is.
    fn plain(&self) -> impl Iterator<Item = &Method> {
        self.methods.iter().filter(|method| {
            method.estimator == Estimator::Direct && method.without.is_none() && !method.filter
        })
    }

    /// Renders that a scene takes.
    pub(super) fn runs_of(&self, scene: &Scene) -> u64 {
        let savings = self.arguments.savings();
        let rests = instants(scene).is_empty();
        let goals = (self.goals().into_iter()).filter(|(_, wanted)| rests && *wanted);
        let rows = goals.map(|(skip, _)| 1 + u64::from(savings.contains(&skip)));
        let rows = rows.sum::<u64>() * self.plain().count() as u64;
        let plan = self.plan(self.arguments.rays.ascending(), self.methods.clone());
        plan.runs() + rows * (1 + u64::from(plan.repeats))
    }

    /// The rows with a goal, with their savings and without. `truth_of` is the scene's reference for a method.
    pub(super) fn goal_methods<'a>(
        &self,
        scene: &Scene,
        truth_of: &dyn Fn(&Method) -> Option<&'a Truth>,
        watcher: &Watcher<'_>,
        steps: &progress::Steps,
    ) -> Result<Vec<Method>, Failure> {
        if self.goals().iter().all(|(_, wanted)| !wanted) {
            return Ok(Vec::new());
        }
        if !instants(scene).is_empty() {
            let name = &scene.name;
            say(
                "note",
                &format!(
                    "{name}: objects move while the shutter is open, so there are no rows with a goal"
                ),
            );
            return Ok(Vec::new());
        }
        let savings = self.arguments.savings();
        let mut methods = Vec::new();
        for (skip, _) in self.goals().into_iter().filter(|(_, wanted)| *wanted) {
            let aim = match skip {
                Skip::CameraNoise => Some(Aim::CameraNoise(self.noise_of(scene))),
                _ => match self.arguments.target_error {
                    Some(error) => Some(Aim::TargetError(error)),
                    None => self.usual_error(scene, truth_of, watcher, steps)?,
                },
            };
            let Some(aim) = aim else { continue };
            let goal = Some(Goal {
                aim,
                max_rays_per_pixel: self.arguments.goal_rpp.unwrap_or(GOAL_RAYS),
            });
            for &method in self.plain() {
                let method = Method { goal, ..method };
                methods.push(method);
                if savings.contains(&skip) {
                    let without = Some(skip);
                    methods.push(Method { without, ..method });
                }
            }
        }
        Ok(methods)
    }

    /// What `direct` leaves at the middle number of rays, to one digit; `None` where it leaves nothing.
    fn usual_error<'a>(
        &self,
        scene: &Scene,
        truth_of: &dyn Fn(&Method) -> Option<&'a Truth>,
        watcher: &Watcher<'_>,
        steps: &progress::Steps,
    ) -> Result<Option<Aim>, Failure> {
        let Some(method) = self.plain().next() else {
            return Ok(None);
        };
        let Some(truth) = truth_of(method) else {
            return Ok(None);
        };
        let rays = self.arguments.rays.ascending();
        let rays = rays[rays.len() / 2];
        steps.say(&format!("{}: {}, for a goal", scene.name, method.label()));
        let rmse = rmse_of(
            scene,
            *method,
            rays,
            self.arguments.runs.seed,
            truth,
            watcher,
        )?;
        Ok(one_digit(rmse).map(Aim::TargetError))
    }

    fn noise_of(&self, scene: &Scene) -> CameraNoise {
        let of_scene = || scene.stages.noise.as_ref().map(|noise| noise.profile.fit);
        let [a, b] = CAMERA_NOISE;
        self.camera_noise.unwrap_or_else(|| CameraNoise {
            fit: of_scene().unwrap_or([NoiseFit { a, b }; 3]),
        })
    }
}

/// 0.0083 as 0.008; none of 0.
fn one_digit(x: f64) -> Option<f64> {
    // Printed and read, so that it is the nearest to what a user would type.
    format!("{x:.0e}").parse().ok().filter(|&x: &f64| x > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_are_round() {
        assert_eq!(one_digit(0.008_31), Some(0.008));
        assert_eq!(one_digit(0.0955), Some(0.1));
        assert_eq!(one_digit(3.0), Some(3.0));
        assert_eq!(one_digit(0.0), None);
    }
}
