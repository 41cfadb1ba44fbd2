//! How a camera's codes become light: the power with which corners fit best. A wrong one moves every edge towards its dark or its light side.

use rayon::prelude::*;

use super::detector::{Detector, FrameSeen};
use super::learning::learn_from;
use super::light::{Luma, Tone};
use super::options::TrackOptions;

/// Frames that are looked at.
const FRAMES: usize = 20;
const POWERS: [f64; 5] = [1.0, 1.4, 1.8, 2.2, 2.6];

/// `None`: the frames show too little to tell.
pub fn estimate_tone(detector: &Detector, options: &TrackOptions, frames: &[Luma]) -> Option<Tone> {
    let mut seen: Vec<(usize, usize)> = frames
        .par_iter()
        .enumerate()
        .step_by(frames.len().div_ceil(3 * FRAMES).max(1))
        .map(|(index, luma)| match detector.look(luma) {
            FrameSeen::Markers(seen) => (seen.markers.len(), index),
            _ => (0, index),
        })
        .collect();
    seen.sort_unstable_by(|a, b| b.cmp(a));
    let chosen: Vec<&Luma> = seen
        .iter()
        .take(FRAMES)
        .filter(|(count, _)| *count > 0)
        .map(|(_, index)| &frames[*index])
        .collect();
    let first = chosen.first()?;
    let size = (first.width, first.height);
    let costs: Vec<Option<f64>> = POWERS
        .par_iter()
        .map(|power| {
            let own = Detector {
                tone: Tone::Power(*power),
                ..detector.clone()
            };
            let looked: Vec<FrameSeen> = chosen.iter().map(|luma| own.look(luma)).collect();
            let (_, solution, _) = learn_from(options, &looked, size).ok()?;
            Some(solution.noise_px)
        })
        .collect();
    let known: Vec<(f64, f64)> = POWERS
        .into_iter()
        .zip(costs)
        .filter_map(|(p, c)| Some((p, c?)))
        .collect();
    least(&known).map(Tone::Power)
}

/// Of a parabola through the least value and its neighbours.
fn least(values: &[(f64, f64)]) -> Option<f64> {
    let (index, (at, lowest)) = values
        .iter()
        .copied()
        .enumerate()
        .min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let around = index
        .checked_sub(1)
        .and_then(|before| Some((values.get(before)?, values.get(index + 1)?)));
    let Some(((before, left), (_, right))) = around else {
        return Some(at);
    };
    let curvature = left + right - 2.0 * lowest;
    let step = at - before;
    Some(at + 0.5 * step * (left - right) / curvature.max(1e-12))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_a_parabola_is_between_its_samples() {
        let curve = |at: f64| (at, 0.1 + (at - 1.55).powi(2));
        let found = least(&[1.0, 1.4, 1.8, 2.2].map(curve)).unwrap();
        assert!((found - 1.55).abs() < 1e-9, "{found}");
        assert_eq!(least(&[(1.0, 0.1), (1.4, 0.2)]), Some(1.0));
        assert_eq!(least(&[]), None);
    }
}
