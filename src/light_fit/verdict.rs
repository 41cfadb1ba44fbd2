//! Whether a light explains what it was not fitted to.

use super::comparisons::{BLOCK_COUNT, Costs, FOLDS, fold_of};
use super::fitter::Candidate;

/// Of the cost without any shading: less is no reason to change a scene. A sun that was not there gained 4.5%, where the albedo was not known.
const LEAST_GAIN: f64 = 0.06;
/// Standard errors from 0 that a gain must have, as many candidates were tried.
pub const LEAST_SIGNIFICANCE: f64 = 3.5;
/// The same of a rotation where albedos are known: texture does not pass for light there, and hard shadows, which tell most, lie in few blocks. Rotations
/// that were there gained 2.8 and more. Not of suns: one that stood in for a wrong rotation gained 3.2.
pub const LEAST_SIGNIFICANCE_OF_KNOWN_ROTATION: f64 = 2.5;
/// The same of all light together, which may show at a few places alone.
const LEAST_SIGNIFICANCE_OF_ALL: f64 = 2.0;

/// What one kind of light explains more than another, of parts of the photograph that did not choose among its candidates.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    /// Of the cost without any shading.
    pub share: f64,
    /// Over its standard error, from the scatter over the blocks.
    pub significance: f64,
    /// What that must be for the gain to count.
    pub least_significance: f64,
}

impl Gain {
    /// Cross-validation over the parts of the photograph.
    pub fn of(
        candidates: &[Candidate],
        over: &[Candidate],
        flat: &Costs,
        least_significance: f64,
    ) -> Self {
        let costs = |all: &[Candidate]| held_out(all.iter().map(|c| &c.costs).collect());
        Self {
            least_significance,
            ..Self::between(&costs(candidates), &costs(over), flat)
        }
    }

    /// Over no shading at all.
    pub fn over_flat(candidates: &[Candidate], flat: &Costs) -> Self {
        let costs = held_out(candidates.iter().map(|c| &c.costs).collect());
        Self::between(&costs, flat, flat)
    }

    fn between(with: &Costs, without: &Costs, flat: &Costs) -> Self {
        let gains: Vec<f64> = (without.iter().zip(with)).map(|(a, b)| a - b).collect();
        let n = BLOCK_COUNT as f64;
        let total: f64 = gains.iter().sum();
        let scatter: f64 = gains.iter().map(|gain| (gain - total / n).powi(2)).sum();
        let error = (scatter * n / (n - 1.0)).sqrt();
        let all: f64 = flat.iter().sum();
        Self {
            share: total / all.max(1e-12),
            significance: if error > 0.0 { total / error } else { 0.0 },
            least_significance: LEAST_SIGNIFICANCE_OF_ALL,
        }
    }

    pub fn is_real(&self) -> bool {
        self.share >= LEAST_GAIN && self.significance >= self.least_significance
    }
}

/// Costs of each block by the candidate that the other parts of the photograph choose.
fn held_out(candidates: Vec<&Costs>) -> Costs {
    let mut costs = [0.0; BLOCK_COUNT];
    for fold in 0..FOLDS {
        let of_rest = |costs: &Costs| -> f64 {
            let blocks = costs.iter().enumerate();
            blocks
                .filter(|(block, _)| fold_of(*block) != fold)
                .map(|(_, cost)| cost)
                .sum()
        };
        let chosen = (candidates.iter()).min_by(|a, b| of_rest(a).total_cmp(&of_rest(b)));
        let Some(chosen) = chosen else { continue };
        for block in (0..BLOCK_COUNT).filter(|block| fold_of(*block) == fold) {
            costs[block] = chosen[block];
        }
    }
    costs
}
