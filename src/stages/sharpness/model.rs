//! What a point spread makes of an ideal edge, and the point spread that makes a given profile.

use super::edges::{BINS, distance_px};
use super::taps;

/// Distances that a fit looks at, pixels.
const NEAR_PX: f64 = 5.0;
const REACH: u32 = 21;
/// Strongest sharpening that is told from noise, and weakest.
const STRONGEST: f64 = 4.0;
const WEAKEST: f64 = 0.03;

/// An upright edge that pixels average over their area, filtered with variance `sigma2` (pixels squared) along its normal.
fn edge(sigma2: f64) -> [f64; BINS] {
    let taps = taps(sigma2 as f32, 0.0, REACH);
    std::array::from_fn(|bin| {
        let at = distance_px(bin);
        let taps = taps.iter().take(2 * REACH as usize + 1).enumerate();
        taps.map(|(i, weight)| {
            let ramp = at - (i as f64 - f64::from(REACH)) + 0.5;
            f64::from(*weight) * ramp.clamp(0.0, 1.0)
        })
        .sum()
    })
}

/// A sharpened normal distribution: the numbers of [`PointSpread`](super::PointSpread), of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sharpened {
    pub sigma_px: f64,
    pub sharpening: f64,
    pub radius_px: f64,
}

impl Sharpened {
    pub fn profile(&self) -> [f64; BINS] {
        let core = edge(self.sigma_px.powi(2));
        let halo = edge(self.sigma_px.powi(2) + self.radius_px.powi(2));
        std::array::from_fn(|bin| core[bin] + self.sharpening * (core[bin] - halo[bin]))
    }

    /// The one whose edge is nearest to `profile`, by least squares.
    pub fn fit(profile: &[f64; BINS]) -> Self {
        let mut best = (f64::INFINITY, Self::plain(0.0));
        // From coarse to fine; the sharpening follows from the two others.
        for (step, around) in [(0.2, 10.0), (0.05, 0.25), (0.01, 0.06)] {
            let centre = best.1;
            let sigmas = candidates(centre.sigma_px, around, step, 0.0);
            let radii = candidates(centre.radius_px, around, 2.0 * step, 0.8);
            for sigma_px in sigmas {
                let core = edge(sigma_px.powi(2));
                for radius_px in radii.clone() {
                    let halo = edge(sigma_px.powi(2) + radius_px.powi(2));
                    let found = best_sharpening(profile, &core, &halo);
                    if found.0 < best.0 {
                        let sharpening = found.1;
                        best = (
                            found.0,
                            Self {
                                sigma_px,
                                sharpening,
                                radius_px,
                            },
                        );
                    }
                }
            }
        }
        if best.1.sharpening < WEAKEST {
            return Self::plain(0.0).refit(profile);
        }
        best.1
    }

    /// The same sharpening with the deviation that `profile` asks for.
    pub fn refit(self, profile: &[f64; BINS]) -> Self {
        let mut best = (f64::INFINITY, self);
        for (step, around) in [(0.2, 10.0), (0.02, 0.2)] {
            for sigma_px in candidates(best.1.sigma_px, around, step, 0.0) {
                let candidate = Self { sigma_px, ..self };
                let error = distance(profile, &candidate.profile());
                if error < best.0 {
                    best = (error, candidate);
                }
            }
        }
        best.1
    }

    fn plain(sigma_px: f64) -> Self {
        Self {
            sigma_px,
            sharpening: 0.0,
            radius_px: 1.0,
        }
    }
}

/// Values about `centre`, at least `least` and at most what a scene may give.
fn candidates(
    centre: f64,
    around: f64,
    step: f64,
    least: f64,
) -> impl Iterator<Item = f64> + Clone {
    let first = ((centre - around).max(least) / step).ceil() as i32;
    let last = ((centre + around).min(4.0) / step).floor() as i32;
    (first..=last).map(move |i| f64::from(i) * step)
}

fn is_near(bin: usize) -> bool {
    distance_px(bin).abs() < NEAR_PX
}

fn distance(a: &[f64; BINS], b: &[f64; BINS]) -> f64 {
    let near = (0..BINS).filter(|bin| is_near(*bin));
    near.map(|bin| (a[bin] - b[bin]).powi(2)).sum()
}

/// Smallest squared distance and the sharpening that has it.
fn best_sharpening(profile: &[f64; BINS], core: &[f64; BINS], halo: &[f64; BINS]) -> (f64, f64) {
    let (mut product, mut square) = (0.0, 0.0);
    for bin in (0..BINS).filter(|bin| is_near(*bin)) {
        let change = core[bin] - halo[bin];
        product += change * (profile[bin] - core[bin]);
        square += change * change;
    }
    let sharpening = (product / square.max(1e-12)).clamp(0.0, STRONGEST);
    let sharpened = std::array::from_fn(|bin| core[bin] + sharpening * (core[bin] - halo[bin]));
    (distance(profile, &sharpened), sharpening)
}
