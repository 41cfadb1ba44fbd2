//! Keeps submissions short on any device, by what the last ones took.

use std::time::Duration;

/// What a submission should take at most: short enough for a desktop to stay responsive and for no driver to lose patience.
const TARGET_SECS: f64 = 0.1;
/// Lanes of the first batch, and of the least.
const LEAST_LANES: usize = 4096;
/// Above this more lanes bring no speed, but cost memory.
const MOST_LANES: usize = 1 << 19;
/// Batches grow by no more than this at a time.
const GROWTH: usize = 8;
/// Steps of a submission at most: what runs after the last lane is done is wasted.
const MOST_STEPS: usize = 16;

#[derive(Debug)]
pub struct Pacer {
    /// Seconds that one step of one lane takes; None until something was measured.
    secs_per_step: Option<f64>,
    lanes: usize,
    most_lanes: usize,
}

impl Pacer {
    /// `most_lanes` is what the device's limits allow.
    pub fn new(most_lanes: usize) -> Self {
        let most_lanes = most_lanes.clamp(1, MOST_LANES);
        Self {
            secs_per_step: None,
            lanes: LEAST_LANES.min(most_lanes),
            most_lanes,
        }
    }

    /// Lanes that the next batch may have: one step of all of them takes half of a submission's time.
    pub fn lanes(&mut self) -> usize {
        if let Some(secs) = self.secs_per_step {
            let affordable = (0.5 * TARGET_SECS / secs) as usize;
            let least = LEAST_LANES.min(self.most_lanes);
            let most = (self.lanes * GROWTH).min(self.most_lanes);
            self.lanes = affordable.clamp(least, most);
        }
        self.lanes
    }

    /// Lanes to make room for where so many are wanted: powers of two, so that buffers are seldom made anew while the pace is found.
    pub fn room(&self, wanted: usize) -> usize {
        wanted.next_power_of_two().min(self.most_lanes).max(wanted)
    }

    /// Steps that the next submission may take with so many lanes alive.
    pub fn steps(&self, alive: usize) -> usize {
        match self.secs_per_step {
            Some(secs) => {
                ((TARGET_SECS / (secs * alive.max(1) as f64)) as usize).clamp(1, MOST_STEPS)
            }
            None => 1,
        }
    }

    /// A submission of `lane_steps` steps took so long. A slow one counts at once, fast ones by and by. Those that end a batch, when few
    /// lanes are alive, say more about the cost of a dispatch than of a step; they count only where they take too long.
    pub fn record(&mut self, took: Duration, lane_steps: u64, begins_batch: bool) {
        if !begins_batch && took.as_secs_f64() < TARGET_SECS {
            return;
        }
        let measured = took.as_secs_f64() / lane_steps.max(1) as f64;
        self.secs_per_step = Some(match self.secs_per_step {
            Some(known) if measured < known => 0.5 * (known + measured),
            _ => measured,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The longest submission of a device with a fixed cost a submission and a cost a lane step.
    fn longest_after_warm_up(secs_per_step: f64) -> (f64, usize) {
        let mut pacer = Pacer::new(usize::MAX);
        let mut longest = 0.0f64;
        for batch in 0..50 {
            let lanes = pacer.lanes();
            let steps = pacer.steps(lanes);
            let secs = 1e-4 + secs_per_step * (lanes * steps) as f64;
            pacer.record(Duration::from_secs_f64(secs), (lanes * steps) as u64, true);
            if batch >= 2 {
                longest = longest.max(secs);
            }
        }
        (longest, pacer.lanes())
    }

    #[test]
    fn room_is_made_a_few_times_only() {
        let pacer = Pacer::new(100_000);
        let mut rooms: Vec<usize> = (1..=100_000).map(|wanted| pacer.room(wanted)).collect();
        rooms.dedup();
        assert!(rooms.is_sorted() && rooms.len() <= 18, "{rooms:?}");
        assert_eq!(
            rooms.last(),
            Some(&100_000),
            "no more than the device allows"
        );
    }

    #[test]
    fn submissions_stay_short_on_slow_and_fast_devices() {
        for secs_per_step in [1e-5, 1e-6, 1e-8, 1e-10] {
            let (longest, lanes) = longest_after_warm_up(secs_per_step);
            assert!(longest < 0.2, "{secs_per_step}: {longest} s");
            assert!(lanes >= LEAST_LANES);
        }
        assert_eq!(
            longest_after_warm_up(1e-9).1,
            MOST_LANES,
            "fast devices get large batches"
        );
    }
}
