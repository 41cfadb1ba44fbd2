//! How old frames are when they go out.

use serde::Serialize;

/// Seconds from arrival to output, of some frames.
#[derive(Clone, Debug, Default)]
pub struct Ages(Vec<f64>);

/// Milliseconds; of no frame 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AgeSpread {
    pub median_ms: f64,
    pub p95_ms: f64,
    pub most_ms: f64,
}

impl Ages {
    pub fn add(&mut self, secs: f64) {
        self.0.push(secs);
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn extend(&mut self, others: &Self) {
        self.0.extend(&others.0);
    }

    /// Ranks are rounded up: p95 of 20 frames is the 19th.
    pub fn spread(&self) -> AgeSpread {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            1e3 * sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        AgeSpread {
            median_ms: at(0.5),
            p95_ms: at(0.95),
            most_ms: at(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_of_a_known_row() {
        let mut ages = Ages::default();
        assert_eq!(ages.spread(), AgeSpread::default());
        for ms in (1..=20).rev() {
            ages.add(f64::from(ms) / 1e3);
        }
        let AgeSpread {
            median_ms,
            p95_ms,
            most_ms,
        } = ages.spread();
        for (found, expected) in [(median_ms, 10.0), (p95_ms, 19.0), (most_ms, 20.0)] {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }
}
