//! Keeps submissions short on any device, by what the last ones took.

use std::time::Duration;

/// What a submission should take at most: short enough for a desktop to stay responsive and for no driver to lose patience.
const LONGEST_SECS: f64 = 0.1;
/// The same while a window is drawn on the device.
const LONGEST_BESIDE_WINDOW_SECS: f64 = 0.03;
/// Steps of lanes that a submission has at least if the first measurement is to be trusted.
const TELLING_STEPS: f64 = 1000.0;
/// Share of that time that is planned for: the lanes that live on are known by those before.
const FILLED: f64 = 0.6;
/// Lanes of the first batch, and of the least.
const LEAST_LANES: usize = 4096;
/// Above this more lanes bring no speed, but cost memory; up to it, each batch that is saved saves the host its steps.
const MOST_LANES: usize = 1 << 21;
/// Batches grow by no more than this at a time.
const GROWTH: usize = 8;
/// Batches that could be larger by this factor are planned anew.
const FAR_MORE: usize = 4;
/// Seconds that any dispatch takes, however few its lanes, before one was measured.
const DISPATCH_SECS: f64 = 1e-5;

/// What a submission has to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Steps of lanes, by what is known of the lanes that live on.
    pub lane_steps: f64,
    pub dispatches: usize,
}

impl std::ops::Add for Load {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            lane_steps: self.lane_steps + other.lane_steps,
            dispatches: self.dispatches + other.dispatches,
        }
    }
}

#[derive(Debug)]
pub struct Pacer {
    /// Seconds that one step of one lane takes; None until something was measured.
    secs_per_step: Option<f64>,
    /// Seconds that a dispatch takes however few its lanes.
    secs_per_dispatch: f64,
    longest_secs: f64,
    lanes: usize,
    most_lanes: usize,
    is_trying: bool,
}

impl Pacer {
    /// `most_lanes` is what the device's limits allow.
    pub fn new(most_lanes: usize, beside_window: bool) -> Self {
        let most_lanes = most_lanes.clamp(1, MOST_LANES);
        Self {
            secs_per_step: None,
            secs_per_dispatch: DISPATCH_SECS,
            longest_secs: match beside_window {
                true => LONGEST_BESIDE_WINDOW_SECS,
                false => LONGEST_SECS,
            },
            lanes: LEAST_LANES.min(most_lanes),
            most_lanes,
            is_trying: true,
        }
    }

    /// Lanes that the next batch of so many samples may have: one step of all of them fills a submission.
    pub fn lanes_for(&mut self, samples: u64) -> usize {
        let of_all = usize::try_from(samples).unwrap_or(usize::MAX);
        self.lanes().min(of_all.max(LEAST_LANES))
    }

    /// The same of as many as there are.
    fn lanes(&mut self) -> usize {
        if let Some(affordable) = self.affordable_lanes() {
            let least = LEAST_LANES.min(self.most_lanes);
            let most = (self.lanes * GROWTH).min(self.most_lanes);
            self.lanes = affordable.clamp(least, most);
            self.is_trying = self.lanes < affordable;
        }
        self.lanes
    }

    /// One step of so many fills a submission.
    fn affordable_lanes(&self) -> Option<usize> {
        let secs = self.secs_per_step?;
        Some(((FILLED * self.longest_secs / secs) as usize).min(self.most_lanes))
    }

    /// Batches of so many lanes were planned while the device seemed slow: so many samples are worth another plan.
    pub fn affords_far_more(&self, lanes: usize, samples: u64) -> bool {
        let more = lanes.saturating_mul(FAR_MORE);
        samples >= more as u64 && self.affordable_lanes().is_some_and(|lanes| lanes >= more)
    }

    /// Lanes to make room for where so many are wanted: powers of two, so that buffers are seldom made anew while the pace is found.
    pub fn room(&self, wanted: usize) -> usize {
        wanted.next_power_of_two().min(self.most_lanes).max(wanted)
    }

    /// How long a step takes is not known.
    pub fn is_cold(&self) -> bool {
        self.secs_per_step.is_none()
    }

    /// The next batch is a trial: more lanes may fit into a submission's time.
    pub fn is_trying(&self) -> bool {
        self.is_trying
    }

    /// A submission with `load` has no time for `more`. While nothing is known, it has none for anything more.
    pub fn is_full(&self, load: Load, more: Load) -> bool {
        load != Load::default()
            && self.secs_per_step.is_none_or(|secs| {
                let [of_lanes, of_dispatches] = self.parts(secs, load + more);
                of_lanes + of_dispatches > FILLED * self.longest_secs
            })
    }

    /// What lanes and dispatches take of a load's time.
    fn parts(&self, secs_per_step: f64, load: Load) -> [f64; 2] {
        [
            secs_per_step * load.lane_steps,
            self.secs_per_dispatch * load.dispatches as f64,
        ]
    }

    /// A submission took so long. That tells the cost of what took most of its time by what was known: a step of a lane, or, where few lanes are
    /// alive, a dispatch. What is slower than known counts at once, what is faster by and by.
    pub fn record(&mut self, took: Duration, load: Load) {
        let blend = |known: f64, measured: f64| match measured < known {
            true => 0.5 * (known + measured),
            false => measured,
        };
        let took = took.as_secs_f64();
        let Some(known) = self.secs_per_step else {
            if load.lane_steps >= TELLING_STEPS {
                self.secs_per_step = Some(took / load.lane_steps);
            }
            return;
        };
        let [of_lanes, of_dispatches] = self.parts(known, load);
        if of_lanes > of_dispatches {
            let measured = (took - of_dispatches).max(0.0) / load.lane_steps;
            self.secs_per_step = Some(blend(known, measured));
        } else if load.dispatches > 0 {
            let measured = (took - of_lanes).max(0.0) / load.dispatches as f64;
            self.secs_per_dispatch = blend(self.secs_per_dispatch, measured);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The longest submission of a device with a fixed cost a dispatch and a cost a lane step, and the lanes of its batches.
    fn longest_after_warm_up(secs_per_step: f64, beside_window: bool) -> (f64, usize) {
        let mut pacer = Pacer::new(usize::MAX, beside_window);
        let mut longest = 0.0f64;
        for batch in 0..50 {
            let step = Load {
                lane_steps: pacer.lanes() as f64,
                dispatches: 3,
            };
            let mut load = step;
            while load.dispatches < 60 && !pacer.is_full(load, step) {
                load = load + step;
            }
            let secs = 1e-4 * load.dispatches as f64 + secs_per_step * load.lane_steps;
            pacer.record(Duration::from_secs_f64(secs), load);
            if batch >= 2 {
                longest = longest.max(secs);
            }
        }
        (longest, pacer.lanes())
    }

    #[test]
    fn room_is_made_a_few_times_only() {
        let pacer = Pacer::new(100_000, false);
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
        for (beside_window, most_secs) in [(false, 0.1), (true, 0.03)] {
            for secs_per_step in [5e-6, 1e-6, 1e-8, 1e-10] {
                let (longest, lanes) = longest_after_warm_up(secs_per_step, beside_window);
                assert!(longest < most_secs, "{secs_per_step}: {longest} s");
                assert!(lanes >= LEAST_LANES);
            }
        }
        let (alone, _) = longest_after_warm_up(1e-6, false);
        assert!(alone > 0.03, "control: {alone} s");
        assert_eq!(
            longest_after_warm_up(1e-9, false).1,
            MOST_LANES,
            "fast devices get large batches"
        );
        let mut fast = Pacer::new(usize::MAX, false);
        let load = Load {
            lane_steps: 1e9,
            dispatches: 3,
        };
        fast.record(Duration::from_millis(1), load);
        let lanes: Vec<usize> = (0..5).map(|_| fast.lanes_for(100_000)).collect();
        assert_eq!(lanes, [32_768, 100_000, 100_000, 100_000, 100_000]);
        assert_eq!(fast.lanes_for(10), LEAST_LANES);
        assert!(fast.affords_far_more(LEAST_LANES, 100_000));
        assert!(!fast.affords_far_more(LEAST_LANES, 10_000), "few samples");
        assert!(!Pacer::new(LEAST_LANES, false).affords_far_more(LEAST_LANES, 100_000));
    }

    #[test]
    fn a_tail_of_few_lanes_tells_the_cost_of_a_dispatch() {
        let mut pacer = Pacer::new(usize::MAX, false);
        let load = |lane_steps, dispatches| Load {
            lane_steps,
            dispatches,
        };
        assert!(pacer.is_full(load(1.0, 3), load(1.0, 3)));
        assert!(pacer.is_cold() && pacer.is_trying());
        assert!(!pacer.is_full(Load::default(), load(1e9, 3)), "never empty");
        pacer.record(Duration::from_millis(50), load(10.0, 3));
        assert!(pacer.is_cold(), "nothing was learnt");
        pacer.record(Duration::from_millis(50), load(50_000.0, 3));
        assert!(!pacer.is_full(load(1.0, 3), load(1.0, 3)));
        assert!(pacer.is_full(load(50_000.0, 3), load(50_000.0, 3)));
        let lanes = pacer.lanes();
        pacer.record(Duration::from_millis(40), load(10.0, 3));
        assert!(pacer.is_full(load(1.0, 3), load(1.0, 3)), "slow dispatches");
        assert!(pacer.lanes() >= lanes, "steps are as fast as before");
        for _ in 0..20 {
            pacer.record(Duration::from_micros(30), load(10.0, 3));
        }
        assert!(!pacer.is_full(load(1.0, 3), load(1.0, 3)), "fast again");
    }
}
